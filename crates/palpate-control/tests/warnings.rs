//! Warnings fire where a simulated loop diverges, and not where it settles.
#![expect(clippy::unwrap_used, reason = "what cannot go on fails")]

mod support;

use palpate_control::{
    ControlConfig, ControlInput, DerivativeRule, ForceController, ForceLoop, GainSpec, Gains, Law,
    ParallelController, ParallelGains, PolicyModel, Tie, Warning,
};
use palpate_spatial::{
    Pose, Twist, UnitQuaternion, Vector3, Vector6, Wrench, integrate, pose_error_vector_part,
};
use support::*;

fn with_rule(rule: DerivativeRule) -> ControlConfig {
    let mut config = control();
    config.parallel.derivative_rule = rule;
    config.admittance.derivative_rule = rule;
    config
}

fn fixed(value: f64) -> GainSpec {
    GainSpec { tie: Tie::Fixed, base: [value; 6], range: [0.0; 6] }
}

/// P-9 with constant K_p and S.
fn at(kp: f64, selection: f64) -> PolicyModel {
    let mut model = model("p-9");
    model.gains.position = fixed(kp);
    model.gains.selection = Some(fixed(selection));
    model
}

/// Axes warned of, by the kind of warning.
fn derivative_axes(warnings: &[Warning]) -> Vec<usize> {
    warnings
        .iter()
        .filter_map(|w| match w {
            Warning::Derivative { axis, .. } => Some(*axis),
            _ => None,
        })
        .collect()
}

/// Whether position control of a pose that follows at once settles, from an error of 1 mm and 1 mrad.
fn settles(rule: DerivativeRule, kp: f64, selection: f64, axis: usize) -> bool {
    let mut law = ParallelController::new(&with_rule(rule).parallel);
    let repeat = Vector6::repeat;
    law.set_gains(&Gains::Parallel(ParallelGains {
        kp_x: repeat(kp),
        kp_f: repeat(0.0),
        selection: repeat(selection),
    }))
    .unwrap();
    let goal = Pose::identity();
    let start = Vector6::from_fn(|j, _| if j == axis { 1e-3 } else { 0.0 });
    let mut tool = Pose::from_parts(
        start.fixed_rows::<3>(0).into_owned().into(),
        UnitQuaternion::from_scaled_axis(Vector3::from(start.fixed_rows::<3>(3).into_owned())),
    );
    for _ in 0..20_000 {
        let pose_error = pose_error_vector_part(&goal, &tool);
        let input = ControlInput { pose_error, wrench: Wrench::zero(), action: Twist::zero() };
        let u = law.update(&input, DT);
        if u.vector().amax().is_nan() || u.vector().amax() > 1e3 {
            return false;
        }
        tool = integrate(&tool, &u, DT);
    }
    pose_error_vector_part(&goal, &tool).amax() < 1e-5
}

#[test]
fn the_printed_rule_at_k_p_5_warns_above_s_0_22_and_diverges_there() {
    let rule = DerivativeRule::Critical;
    let warned = |s: f64| derivative_axes(&at(5.0, s).warnings(&with_rule(rule), DT));
    // 1 / (2√5 + 5·0.001) = 0.2234
    assert_eq!(warned(0.22), []);
    assert!(settles(rule, 5.0, 0.22, 0));
    assert_eq!(warned(0.225)[..3], [0, 1, 2]);
    assert!(!settles(rule, 5.0, 0.225, 0));
}

#[test]
fn warnings_and_loops_agree_on_both_sides_of_the_limit() {
    for rule in [DerivativeRule::Critical, DerivativeRule::Tenth, DerivativeRule::RootTimesBase] {
        for axis in [0, 5] {
            for kp in [5.0, 25.0, 54.0, 100.0] {
                // x_e is sin(θ/2): a rotation moves it half as far.
                let per_unit = if axis < 3 { 1.0 } else { 0.5 };
                let limit = 1.0 / (per_unit * (rule.derivative_gain(kp, axis) + 0.5 * kp * DT));
                for (part, stable) in [(0.97, true), (1.03, false)] {
                    let s = part * limit;
                    if s > 1.0 {
                        continue;
                    }
                    let warned = derivative_axes(&at(kp, s).warnings(&with_rule(rule), DT));
                    assert_eq!(settles(rule, kp, s, axis), stable, "{rule:?} {axis} {kp} {s}");
                    assert_eq!(
                        !warned.contains(&axis),
                        stable,
                        "{rule:?} {axis} {kp} {s}: {warned:?}"
                    );
                }
            }
        }
    }
}

#[test]
fn without_a_derivative_no_model_of_ours_is_warned_of() {
    for (name, _) in MODELS {
        assert_eq!(model(name).warnings(&control(), DT), [], "{name}");
    }
}

#[test]
fn the_printed_rule_warns_of_every_model() {
    for (name, _) in MODELS {
        let warnings = model(name).warnings(&with_rule(DerivativeRule::Critical), DT);
        assert_eq!(derivative_axes(&warnings), [0, 1, 2, 3, 4, 5], "{name}");
    }
    let model = at(5.0, 0.9);
    let warnings = model.warnings(&with_rule(DerivativeRule::Critical), DT);
    assert_eq!(
        warnings[0].to_string(),
        "axis x: S·(K_d + K_p·dt/2) reaches 4.03 (S 0.90, K_p 5.00, K_d 4.47), and from 1 on the position loop \
         diverges where the arm follows at once: lower S or K_p, or choose another derivative_rule"
    );
}

#[test]
fn a_model_that_settles_within_a_tick_is_warned_of() {
    // The authors' file: M 1e-3, K 5e4.
    let mut config = control();
    config.admittance.inertia = 1e-3;
    let mut model = model("a-8");
    model.gains.stiffness = Some(fixed(5e4));
    let warnings = model.warnings(&config, DT);
    let text = warnings[0].to_string();
    assert_eq!(warnings.len(), 6);
    assert!(
        text.starts_with("axis x: the admittance model has ω_n·dt = 14.14 at k_d 50000.0"),
        "{text}"
    );
    // ω_n·dt = 1 at m = k·dt².
    for (inertia, count) in [(5e4 * DT * DT * 0.99, 6), (5e4 * DT * DT * 1.01, 0)] {
        config.admittance.inertia = inertia;
        assert_eq!(model.warnings(&config, DT).len(), count);
    }
}

#[test]
fn a_contact_beyond_the_limit_of_the_strongest_gains_is_warned_of() {
    let force_loop = ForceLoop { cutoff: 50.0, servo_lag: 0.010, rebased: false, period: DT };
    for (name, _) in MODELS {
        let model = model(name);
        // The strongest force gain, the least S or k_d, and the K_p that damps least.
        let strongest = match model.law {
            Law::Parallel => [0.2, 1.8].map(|kp| parallel_gains(kp, 9e-3, 0.1)),
            Law::Admittance => [0.2, 1.8].map(|kp| admittance_gains(kp, 100.0)),
        };
        let limit = strongest
            .map(|gains| force_loop.contact_limit(&control(), &gains, 2))
            .into_iter()
            .fold(f64::INFINITY, f64::min);
        assert!(limit > 1e3 && limit < 1e5, "{limit}");
        let warned = |contact, force_loop| model.contact_warnings(&control(), contact, &force_loop);
        assert_eq!(warned(0.999 * limit, force_loop), [], "{name}");
        let warnings = warned(1.001 * limit, force_loop);
        assert_eq!(warnings.len(), 3, "{name}");
        let Warning::Contact { axis, limit: stated, .. } = warnings[2] else {
            panic!("{warnings:?}")
        };
        assert_eq!(axis, 2);
        assert!((stated / limit - 1.0).abs() < 1e-9, "{stated} for {limit}");
        assert!(warnings[2].to_string().contains("behind a 50 Hz filter and a servo lag of 10 ms"));
        // A number that is none is no all-clear.
        assert_eq!(warned(f64::NAN, force_loop).len(), 3);
        for cutoff in [0.0, 250.0, f64::NAN] {
            assert_eq!(warned(1.0, ForceLoop { cutoff, ..force_loop }).len(), 3);
        }
        assert_eq!(warned(1.0, ForceLoop { servo_lag: f64::NAN, ..force_loop }).len(), 3);
    }
}
