//! Eqs. 2–4, F = m_d ẍ + b_d ẋ + k_d x with b_d = 2ζ√(k_d m_d), against the analytic solution.
#![expect(clippy::unwrap_used, reason = "what cannot go on fails")]

mod support;

use approx::assert_relative_eq;
use palpate_control::{AdmittanceController, AdmittanceOutput, DerivativeRule, ForceController};
use proptest::prelude::*;
use support::*;

fn law(
    inertia: f64,
    damping_ratio: f64,
    stiffness: f64,
    output: AdmittanceOutput,
) -> AdmittanceController {
    let mut law = AdmittanceController::new(&admittance(inertia, damping_ratio, output));
    law.set_gains(&admittance_gains(0.0, stiffness)).unwrap();
    law
}

/// x(t)·k_d/F of a step of force at t = 0, from rest.
fn step_response(damping_ratio: f64, natural: f64, t: f64) -> f64 {
    let (z, w) = (damping_ratio, natural);
    if t <= 0.0 {
        return 0.0;
    }
    if z < 1.0 {
        let root = (1.0 - z * z).sqrt();
        let (sin, cos) = (w * root * t).sin_cos();
        1.0 - (-z * w * t).exp() * (cos + z / root * sin)
    } else if z == 1.0 {
        1.0 - (-w * t).exp() * (1.0 + w * t)
    } else {
        let root = (z * z - 1.0).sqrt();
        let (slow, fast) = (-w / (z + root), -w * (z + root));
        1.0 - (fast * (slow * t).exp() - slow * (fast * t).exp()) / (fast - slow)
    }
}

/// m_d, ζ, k_d: the paper's inertia under, at and over critical damping, the authors' benches (b = 1386,
/// and all but undamped), their later file with ω_n·dt = 14, and both sides of critical.
const MODELS: [(f64, f64, f64); 10] = [
    (0.1, 0.1, 300.0),
    (0.1, 0.7, 300.0),
    (0.1, 1.0, 300.0),
    (0.1, 1.0, 100.0),
    (0.1, 3.0, 500.0),
    (1.0, 40.0, 300.0),
    (0.01, 1e-4, 300.0),
    (1e-3, 1e-3, 5e4),
    (0.1, 1.0 + 1e-7, 300.0),
    (0.1, 1.0 - 1e-7, 300.0),
];

#[test]
fn a_step_of_force_gives_the_analytic_displacement_for_minutes() {
    for (m, z, k) in MODELS {
        let natural = (k / m).sqrt();
        let mut law = law(m, z, k, AdmittanceOutput::Velocity);
        // The analytic formulas cancel near ζ = 1 and lose digits of phase over many turns.
        let tolerance = if (z - 1.0).abs() == 0.0 || (z - 1.0).abs() > 0.1 { 1e-9 } else { 1e-6 };
        for tick in 1..=60_000 {
            let x = law.update(&input(0.0, 6.0, 0.0), DT).linear.y;
            let expected = 6.0 / k * step_response(z, natural, f64::from(tick) * DT);
            assert!(
                (x - expected).abs() < tolerance * 6.0 / k,
                "m {m}, ζ {z}, k {k}, tick {tick}: {x} for {expected}"
            );
        }
    }
}

#[test]
fn integrating_the_displacement_output_carries_exactly_x() {
    for (m, z, k) in MODELS {
        let mut velocity = law(m, z, k, AdmittanceOutput::Velocity);
        let mut displacement = law(m, z, k, AdmittanceOutput::Displacement);
        let mut pose = 0.0;
        for tick in 0..5000 {
            let force = input(0.0, if tick % 700 < 350 { 8.0 } else { -3.0 }, 0.0);
            let x = velocity.update(&force, DT).angular.x;
            pose += displacement.update(&force, DT).angular.x * DT;
            assert_relative_eq!(pose, x, epsilon = 1e-12);
        }
        // At rest a spring, not a damper.
        for _ in 0..200_000 {
            pose += displacement.update(&input(0.0, 8.0, 0.0), DT).angular.x * DT;
        }
        if z > 0.05 {
            assert_relative_eq!(pose, 8.0 / k, max_relative = 1e-6);
        }
    }
}

#[test]
fn between_samples_the_model_obeys_the_differential_equation() {
    // Central differences at 10 µs, blind to how the sampling was derived.
    for (m, z, k) in [(0.1, 0.3, 300.0), (0.1, 1.0, 500.0), (1.0, 4.0, 100.0)] {
        let (h, force) = (1e-5, 5.0);
        let b = 2.0 * z * f64::sqrt(k * m);
        let mut law = law(m, z, k, AdmittanceOutput::Velocity);
        let x: Vec<f64> =
            (0..30_000).map(|_| law.update(&input(0.0, force, 0.0), h).linear.x).collect();
        for at in (1..x.len() - 1).step_by(97) {
            let rate = (x[at + 1] - x[at - 1]) / (2.0 * h);
            let acceleration = (x[at + 1] - 2.0 * x[at] + x[at - 1]) / (h * h);
            let sum = m * acceleration + b * rate + k * x[at];
            assert!((sum - force).abs() < 1e-4 * force, "sample {at}: {sum} N for {force} N");
        }
    }
}

proptest! {
    /// Any force is a sum of steps, and the model is linear.
    #[test]
    fn forces_superpose(
        forces in prop::collection::vec(-50.0..50.0, 1..40),
        damping_ratio in prop_oneof![0.05..0.95, Just(1.0), 1.1..20.0],
        stiffness in 5.0..2000.0,
        inertia in 0.05..2.0,
    ) {
        let natural = f64::sqrt(stiffness / inertia);
        let mut law = law(inertia, damping_ratio, stiffness, AdmittanceOutput::Velocity);
        for tick in 0..forces.len() {
            let x = law.update(&input(0.0, forces[tick], 0.0), DT).linear.z;
            let expected: f64 = (0..=tick)
                .map(|at| {
                    let jump = forces[at] - if at > 0 { forces[at - 1] } else { 0.0 };
                    let t = (tick - at + 1) as f64 * DT;
                    jump / stiffness * step_response(damping_ratio, natural, t)
                })
                .sum();
            prop_assert!((x - expected).abs() < 1e-9 * 50.0 / stiffness, "{x} for {expected}");
        }
    }

    /// Bounded force, bounded displacement: |x| ≤ |F|/k_d · ∫|h|, and ∫|h| ≤ coth(πζ/2√(1−ζ²)) or 1.
    #[test]
    fn no_sampling_is_unstable(
        forces in prop::collection::vec(-50.0..50.0, 500),
        damping_ratio in 0.3..50.0,
        stiffness in 1.0..1e6,
        inertia in 1e-4..10.0,
        dt in 1e-4..0.1,
    ) {
        let mut law = law(inertia, damping_ratio, stiffness, AdmittanceOutput::Velocity);
        let bound = if damping_ratio < 1.0 {
            let decrement = std::f64::consts::FRAC_PI_2 * damping_ratio / (1.0 - damping_ratio * damping_ratio).sqrt();
            1.0 / decrement.tanh()
        } else {
            1.0
        };
        for force in forces {
            let x = law.update(&input(0.0, force, 0.0), dt).linear.z;
            prop_assert!(x.abs() <= 50.0 / stiffness * bound * (1.0 + 1e-9), "{x}");
        }
    }
}

#[test]
fn the_nominal_trajectory_is_a_pd_and_the_action() {
    for rule in RULES {
        for output in [AdmittanceOutput::Velocity, AdmittanceOutput::Displacement] {
            let mut config = admittance(0.1, 1.0, output);
            config.derivative_rule = rule;
            let mut law = AdmittanceController::new(&config);
            law.set_gains(&admittance_gains(4.0, 300.0)).unwrap();
            let first = law.update(&input(0.010, 0.0, 0.03), DT).linear.x;
            assert_relative_eq!(first, 4.0 * 0.010 + 0.03, epsilon = 1e-15);
            let second = law.update(&input(0.009, 0.0, 0.03), DT).linear.x;
            let kd = match rule {
                DerivativeRule::None => 0.0,
                DerivativeRule::Critical => 4.0,
                DerivativeRule::Tenth => 0.4,
                DerivativeRule::RootTimesBase => 0.2,
            };
            assert_relative_eq!(second, 4.0 * 0.009 - kd * 0.5 + 0.03, epsilon = 1e-12);
        }
    }
}
