//! Where a press against a spring comes to rest, in closed form. One axis, an arm that follows at once.

mod support;

use approx::assert_relative_eq;
use palpate_control::{
    ActionPlacement, AdmittanceController, AdmittanceOutput, ForceController, ParallelConfig,
    ParallelController,
};
use support::*;

/// The goal lies this far behind the surface, m.
const DEPTH: f64 = 0.010;

/// Depth behind the surface of a bilateral spring `k` (N/m) after `seconds`, starting at `depth`.
fn press(law: &mut impl ForceController, k: f64, action: f64, depth: f64, seconds: f64) -> f64 {
    let mut depth = depth;
    for _ in 0..(seconds / DT) as usize {
        depth += law.update(&input(DEPTH - depth, -k * depth, action), DT).linear.z * DT;
    }
    depth
}

#[test]
fn the_parallel_law_shares_the_press_between_position_and_force() {
    for k in [1e3, 1e4, 1e5] {
        for (kp, kf, s) in [(5.0, 5e-3, 0.5), (1.0, 9e-3, 0.1), (1.8, 1e-3, 0.9)] {
            for action in [0.0, 0.02] {
                for placement in
                    [ActionPlacement::OutsideSelection, ActionPlacement::InsideSelection]
                {
                    let config = ParallelConfig { action_placement: placement, ..proportional() };
                    let mut law = ParallelController::new(&config);
                    law.set_gains(&parallel_gains(kp, kf, s)).unwrap();
                    let inside = placement == ActionPlacement::InsideSelection;
                    let a = if inside { s * action } else { action };
                    // 0 = S·K_p·(D − d) + a − (1−S)·K_p^f·k·d
                    let depth = (s * kp * DEPTH + a) / (s * kp + (1.0 - s) * kf * k);
                    let got = press(&mut law, k, action, 0.0, 60.0);
                    assert_relative_eq!(got, depth, max_relative = 1e-9);
                }
            }
        }
    }
}

#[test]
fn forces_of_the_base_gains_are_the_published_ones() {
    // K_p 5, K_p^f 5e-3, S 0.5, goal 10 mm behind the surface, no filter: N, over 7.5 s.
    for (k, force) in [(1e3, 5.0), (3e3, 7.5), (1e4, 9.1), (3e4, 9.7), (1e5, 9.9)] {
        let mut law = ParallelController::new(&proportional());
        law.set_gains(&parallel_gains(5.0, 5e-3, 0.5)).unwrap();
        assert_relative_eq!(press(&mut law, k, 0.0, 0.0, 7.5) * k, force, epsilon = 0.05);
    }
}

#[test]
fn the_force_integral_relieves_the_press_down_to_its_bound() {
    let (k, kp, kf, s, limit) = (1e4, 1.0, 9e-3, 0.5, 1e-3);
    let config = ParallelConfig { integral_ratio: 0.01, integral_limit: limit, ..proportional() };
    let mut law = ParallelController::new(&config);
    law.set_gains(&parallel_gains(kp, kf, s)).unwrap();
    let depth = (s * kp * DEPTH - (1.0 - s) * limit) / (s * kp + (1.0 - s) * kf * k);
    let got = press(&mut law, k, 0.0, 0.0, 120.0);
    assert_relative_eq!(got, depth, max_relative = 1e-9);
}

#[test]
fn an_unbounded_force_integral_ends_at_no_force() {
    let config = ParallelConfig { integral_ratio: 0.5, ..proportional() };
    let mut law = ParallelController::new(&config);
    law.set_gains(&parallel_gains(1.0, 5e-3, 0.5)).unwrap();
    assert!(press(&mut law, 1e4, 0.0, 0.0, 120.0).abs() * 1e4 < 1e-6);
}

#[test]
fn the_velocity_output_presses_with_k_d_times_the_nominal_speed() {
    for (k, kd, kp, action) in
        [(1e3, 300.0, 1.0, 0.0), (1e4, 500.0, 0.2, 0.02), (3e3, 100.0, 1.8, -0.01)]
    {
        let mut law = AdmittanceController::new(&admittance(0.1, 1.0, AdmittanceOutput::Velocity));
        law.set_gains(&admittance_gains(kp, kd)).unwrap();
        // 0 = K_p·(D − d) + a − k·d/k_d
        let depth = (kp * DEPTH + action) / (kp + k / kd);
        assert_relative_eq!(press(&mut law, k, action, 0.0, 60.0), depth, max_relative = 1e-9);
    }
}

#[test]
fn the_displacement_output_yields_like_a_spring_in_series() {
    // No nominal motion, pressed 2 mm deep at first: k·d = k_d·x and d + x = 2 mm.
    let (k, kd) = (700.0, 300.0);
    let mut law = AdmittanceController::new(&admittance(0.1, 1.0, AdmittanceOutput::Displacement));
    law.set_gains(&admittance_gains(0.0, kd)).unwrap();
    let depth = press(&mut law, k, 0.0, 0.002, 20.0);
    assert_relative_eq!(depth, 0.002 * kd / (k + kd), max_relative = 1e-9);
    // With a nominal trajectory it goes on to the goal, whatever the force.
    let mut law = AdmittanceController::new(&admittance(0.1, 1.0, AdmittanceOutput::Displacement));
    law.set_gains(&admittance_gains(1.0, kd)).unwrap();
    assert_relative_eq!(press(&mut law, k, 0.0, 0.0, 120.0), DEPTH, max_relative = 1e-9);
}
