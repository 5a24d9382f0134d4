//! Eq. 1, u = S(K_p x_e + K_d ẋ_e) + a_x + (I−S)(K_p^f F + K_i^f ∫F dt), term by term.
#![expect(clippy::unwrap_used, reason = "what cannot go on fails")]

mod support;

use approx::assert_relative_eq;
use palpate_control::{
    ActionPlacement, ControlInput, DerivativeRule, ForceController, Gains, ParallelConfig,
    ParallelController, ParallelGains,
};
use palpate_spatial::Vector6;
use proptest::prelude::*;
use support::*;

fn law(config: &ParallelConfig, gains: &Gains) -> ParallelController {
    let mut law = ParallelController::new(config);
    law.set_gains(gains).unwrap();
    law
}

/// Eq. 1 in scalars for constant gains: the whole history is summed anew at every tick.
fn transcribed(
    config: &ParallelConfig,
    gains: &ParallelGains,
    history: &[ControlInput],
    dt: f64,
) -> [f64; 6] {
    let now = history.last().unwrap();
    std::array::from_fn(|j| {
        let (kp, kf, s) = (gains.kp_x[j], gains.kp_f[j], gains.selection[j]);
        let kd = match config.derivative_rule {
            DerivativeRule::None => 0.0,
            DerivativeRule::Critical => 2.0 * kp.sqrt(),
            DerivativeRule::Tenth => kp / 10.0,
            DerivativeRule::RootTimesBase => (kp * [0.01, 0.06][j / 3]).sqrt(),
        };
        let ki = config.integral_ratio * kf;
        let error = now.pose_error[j];
        let error_rate = match history {
            [.., before, _] => (error - before.pose_error[j]) / dt,
            _ => 0.0,
        };
        let force = now.wrench.vector()[j];
        let impulse: f64 = history.iter().map(|i| i.wrench.vector()[j] * dt).sum();
        let pd = kp * error + kd * error_rate;
        let pi = kf * force + ki * impulse;
        let a = now.action.vector()[j];
        match config.action_placement {
            ActionPlacement::OutsideSelection => s * pd + a + (1.0 - s) * pi,
            ActionPlacement::InsideSelection => s * (pd + a) + (1.0 - s) * pi,
        }
    })
}

proptest! {
    #[test]
    fn every_tick_is_the_printed_sum(
        gains in any_parallel_gains(),
        inputs in prop::collection::vec(any_input(), 1..30),
        action_placement in any_placement(),
        derivative_rule in any_rule(),
        integral_ratio in 0.0..0.5,
        dt in 5e-4..1e-2,
    ) {
        let config =
            ParallelConfig { action_placement, derivative_rule, integral_ratio, integral_limit: 1e9 };
        let mut law = law(&config, &Gains::Parallel(gains));
        for tick in 0..inputs.len() {
            let u = law.update(&inputs[tick], dt).vector();
            let expected = Vector6::from(transcribed(&config, &gains, &inputs[..=tick], dt));
            prop_assert!((u - expected).amax() <= 1e-11 * (1.0 + expected.amax()), "tick {tick}: {u} for {expected}");
        }
    }
}

#[test]
fn each_term_alone_by_hand() {
    let config = proportional();
    // S = 1: position only. 5 /s · 10 mm.
    let u = law(&config, &parallel_gains(5.0, 5e-3, 1.0)).update(&input(0.01, 40.0, 0.0), DT);
    assert_relative_eq!(u.linear.z, 0.05, epsilon = 1e-15);
    // S = 0: force only, along the measured force. 5e-3 (m/s)/N · 4 N.
    let u = law(&config, &parallel_gains(5.0, 5e-3, 0.0)).update(&input(0.01, 4.0, 0.0), DT);
    assert_relative_eq!(u.linear.z, 0.02, epsilon = 1e-15);
    // a_x outside S moves the tool whatever S is, inside S only its share.
    for (placement, at_quarter) in
        [(ActionPlacement::OutsideSelection, 0.02), (ActionPlacement::InsideSelection, 0.005)]
    {
        let config = ParallelConfig { action_placement: placement, ..proportional() };
        let u = law(&config, &parallel_gains(5.0, 5e-3, 0.25)).update(&input(0.0, 0.0, 0.02), DT);
        assert_relative_eq!(u.linear.z, at_quarter, epsilon = 1e-15);
    }
}

#[test]
fn derivative_gains_are_those_of_the_paper_and_of_its_authors() {
    let kd = |rule: DerivativeRule, kp: f64, axis| rule.derivative_gain(kp, axis);
    assert_relative_eq!(kd(DerivativeRule::Critical, 5.0, 0), 4.472_135_954_999_579);
    assert_relative_eq!(kd(DerivativeRule::Critical, 30.0, 5), 10.954_451_150_103_322);
    assert_relative_eq!(kd(DerivativeRule::Tenth, 25.0, 3), 2.5);
    // K_p = p·e and K_d = √p·e with p = 500, e = 1e-2 and 6e-2.
    assert_relative_eq!(
        kd(DerivativeRule::RootTimesBase, 5.0, 2),
        500f64.sqrt() * 1e-2,
        epsilon = 1e-14
    );
    assert_relative_eq!(
        kd(DerivativeRule::RootTimesBase, 30.0, 3),
        500f64.sqrt() * 6e-2,
        epsilon = 1e-14
    );
    assert_eq!(kd(DerivativeRule::None, 30.0, 3), 0.0);
}

#[test]
fn the_integral_gain_is_one_percent() {
    // 4 N for 10 s at K_p^f = 5e-3: 0.01·5e-3·4·10 = 2 mm/s beside 20 mm/s.
    let config = control().parallel;
    let mut law = law(&config, &parallel_gains(1.0, 5e-3, 0.0));
    let u = (0..5000).map(|_| law.update(&input(0.0, 4.0, 0.0), DT).linear.z).last().unwrap();
    assert_relative_eq!(u, 0.022, epsilon = 1e-12);
}

#[test]
fn the_integral_stops_at_its_bound_and_leaves_it_at_once() {
    let config = ParallelConfig { integral_limit: 0.003, integral_ratio: 1.0, ..proportional() };
    let mut law = law(&config, &parallel_gains(0.0, 1e-2, 0.0));
    let mut press = |force: f64| law.update(&input(0.0, force, 0.0), DT).linear.z - 1e-2 * force;
    for _ in 0..1000 {
        press(10.0);
    }
    assert_relative_eq!(press(10.0), 0.003, epsilon = 1e-15);
    // 1 /s · 1e-2 · 10 N · 2 ms less after the first tick of the other sign.
    assert_relative_eq!(press(-10.0), 0.0028, epsilon = 1e-15);
}

#[test]
fn axes_do_not_mix() {
    let config = control().parallel;
    for axis in 0..6 {
        let only = |value: f64| Vector6::from_fn(|j, _| if j == axis { value } else { 0.0 });
        let mut law = law(&config, &parallel_gains(5.0, 5e-3, 0.5));
        let input = ControlInput {
            pose_error: only(0.01),
            wrench: only(3.0).into(),
            action: only(0.02).into(),
        };
        let u = law.update(&input, DT).vector();
        assert!(u[axis] != 0.0 && (u - only(u[axis])).amax() == 0.0, "axis {axis}: {u}");
    }
}
