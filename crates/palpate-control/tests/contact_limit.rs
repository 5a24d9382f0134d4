//! The contact limits in closed form against a simulated loop: a bilateral spring, an arm that follows
//! at once, the real filter and the real law.
//!
//! At 20 µs a tick is short enough for the loop to be the continuous one of the formulas: just below the
//! limit an oscillation dies, just above it grows.
#![expect(clippy::unwrap_used, reason = "what cannot go on fails")]

mod support;

use palpate_control::{
    AdmittanceController, AdmittanceOutput, ControlInput, ForceController, LowPass, ParallelConfig,
    ParallelController,
};
use palpate_spatial::{Twist, Vector6, Wrench};
use support::*;

/// Energy (sum of squares) of an oscillation in a contact of `k` N/m in the last third of the time, by
/// that in the middle third.
fn growth(law: &mut impl ForceController, k: f64, cutoff: f64, dt: f64, seconds: f64) -> f64 {
    let mut filter = LowPass::new(cutoff, 1.0 / dt);
    let along_x = |x: f64| Vector6::new(x, 0.0, 0.0, 0.0, 0.0, 0.0);
    let third = (seconds / dt / 3.0) as usize;
    let mut depth = 1e-3; // a push to swing from
    let mut energy = [0.0; 3];
    for part in &mut energy {
        for _ in 0..third {
            let wrench = filter.update(&Wrench::from(along_x(-k * depth)));
            let input = ControlInput { pose_error: along_x(-depth), wrench, action: Twist::zero() };
            depth += law.update(&input, dt).linear.x * dt;
            *part += depth * depth;
        }
    }
    energy[2] / energy[1]
}

/// K_p^x, K_p^f, S, cut-off in Hz.
const PARALLEL: [(f64, f64, f64, f64); 5] = [
    (5.0, 5e-3, 0.5, 2.5),
    (1.0, 9e-3, 0.1, 50.0),
    (1.8, 1e-3, 0.9, 10.0),
    (9.0, 5e-3, 0.9, 2.5),
    (0.0, 5e-3, 0.0, 25.0),
];

/// ζ, k_d, cut-off in Hz.
const ADMITTANCE: [(f64, f64, f64); 5] = [
    (1.0, 100.0, 50.0),
    (1.0, 300.0, 50.0),
    (1.0, 500.0, 2.5),
    (0.3, 300.0, 10.0),
    (3.0, 200.0, 25.0),
];

fn parallel(kp: f64, kf: f64, s: f64) -> ParallelController {
    let mut law = ParallelController::new(&proportional());
    law.set_gains(&parallel_gains(kp, kf, s)).unwrap();
    law
}

fn model(damping_ratio: f64, stiffness: f64, output: AdmittanceOutput) -> AdmittanceController {
    let mut law = AdmittanceController::new(&admittance(0.1, damping_ratio, output));
    law.set_gains(&admittance_gains(0.0, stiffness)).unwrap();
    law
}

#[test]
fn the_parallel_law_turns_unstable_at_the_limit() {
    for (kp, kf, s, cutoff) in PARALLEL {
        let limit = proportional().contact_limit(kp, kf, s, cutoff);
        let grows =
            |part: f64| growth(&mut parallel(kp, kf, s), part * limit, cutoff, 2e-5, 60.0 / cutoff);
        let (below, above) = (grows(0.99), grows(1.01));
        assert!(below < 0.97 && above > 1.03, "{cutoff} Hz, S {s}: {below} and {above} at ±1 %");
    }
}

#[test]
fn the_admittance_law_turns_unstable_at_the_limit_of_either_output() {
    for output in [AdmittanceOutput::Velocity, AdmittanceOutput::Displacement] {
        for (z, kd, cutoff) in ADMITTANCE {
            let limit = admittance(0.1, z, output).contact_limit(kd, cutoff);
            let seconds = 60.0 / cutoff.min((kd / 0.1f64).sqrt() / std::f64::consts::TAU);
            let grows =
                |part: f64| growth(&mut model(z, kd, output), part * limit, cutoff, 2e-5, seconds);
            let (below, above) = (grows(0.99), grows(1.01));
            assert!(
                below < 0.97 && above > 1.03,
                "{output:?}, ζ {z}, k_d {kd}, {cutoff} Hz: {below} and {above} at ±1 %"
            );
        }
    }
}

#[test]
fn limits_by_hand() {
    let config = ParallelConfig { integral_ratio: 0.01, ..proportional() };
    // (1−S)·K_p^f·k < √2·2π·2.5 = 22.2 /s where S·K_p is small beside it.
    let k = config.contact_limit(0.0, 5e-3, 0.5, 2.5);
    assert!((0.5 * 5e-3 * k - 22.21).abs() < 0.01, "{k}");
    // The base gains: 27.8 /s and 1.1e4 N/m.
    let k = config.contact_limit(5.0, 5e-3, 0.5, 2.5);
    assert!((0.5 * 5e-3 * k - 27.8).abs() < 0.05, "{k}");
    // All position: no force loop, no limit.
    assert_eq!(config.contact_limit(1.0, 5e-3, 1.0, 50.0), f64::INFINITY);
    // Behind a filter that is far faster than the model: 2ζω_n·k_d, and no limit for the displacement.
    let limit = |output| admittance(0.1, 1.0, output).contact_limit(100.0, 1e7);
    let bare = 2.0 * (100.0f64 / 0.1).sqrt() * 100.0;
    assert!((limit(AdmittanceOutput::Velocity) / bare - 1.0).abs() < 1e-4);
    assert!(limit(AdmittanceOutput::Displacement) > 1e3 * bare);
}
