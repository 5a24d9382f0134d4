//! The four points of [`ForceController`]'s contract, for both laws in every form.
#![expect(clippy::unwrap_used, reason = "what cannot go on fails")]

mod support;

use palpate_control::{
    ControlConfig, ControlInput, Controller, DerivativeRule, ForceController, Gains, Law,
};
use palpate_spatial::{Twist, Vector6};
use proptest::prelude::*;
use support::*;

/// Either law in any form but its derivative rule.
fn any_form() -> impl Strategy<Value = (ControlConfig, Law)> {
    (
        any_placement(),
        any_output(),
        0.0..0.5,
        0.2..5.0,
        prop_oneof![Just(Law::Parallel), Just(Law::Admittance)],
    )
        .prop_map(|(placement, output, ratio, damping_ratio, law)| {
            let mut config = control();
            // Bounds that never act, so that a difference cannot hide behind one.
            (config.max_linear_speed, config.max_angular_speed) = (1e6, 1e6);
            config.parallel.action_placement = placement;
            config.parallel.integral_ratio = ratio;
            config.parallel.integral_limit = 1e6;
            config.admittance.output = output;
            config.admittance.damping_ratio = damping_ratio;
            (config, law)
        })
}

/// A form and two sets of gains for it.
fn any_case() -> impl Strategy<Value = (ControlConfig, Law, Gains, Gains)> {
    any_form().prop_flat_map(|(config, law)| {
        (any_gains(law), any_gains(law)).prop_map(move |(a, b)| (config.clone(), law, a, b))
    })
}

fn any_inputs(count: std::ops::Range<usize>) -> impl Strategy<Value = Vec<ControlInput>> {
    prop::collection::vec(any_input(), count)
}

fn build(config: &ControlConfig, law: Law, rule: DerivativeRule, gains: &Gains) -> Controller {
    let mut config = config.clone();
    config.parallel.derivative_rule = rule;
    config.admittance.derivative_rule = rule;
    let mut controller = Controller::new(&config, law).unwrap();
    controller.set_gains(gains).unwrap();
    controller
}

fn run(law: &mut Controller, inputs: &[ControlInput]) -> Vec<Twist> {
    inputs.iter().map(|input| law.update(input, DT)).collect()
}

/// What multiplies ẋ_e in u.
fn derivative_gains(rule: DerivativeRule, gains: &Gains) -> Vector6 {
    let (kp, s) = match gains {
        Gains::Parallel(g) => (g.kp_x, g.selection),
        Gains::Admittance(g) => (g.kp_x, Vector6::repeat(1.0)),
    };
    Vector6::from_fn(|axis, _| s[axis] * rule.derivative_gain(kp[axis], axis))
}

proptest! {
    #[test]
    fn point_1_the_first_tick_after_a_reset_has_no_derivative(
        (config, law, gains, _) in any_case(),
        rule in any_rule(),
        before in any_inputs(0..5),
        first in any_input(),
        second in any_input(),
    ) {
        let mut with = build(&config, law, rule, &gains);
        let mut without = build(&config, law, DerivativeRule::None, &gains);
        for law in [&mut with, &mut without] {
            run(law, &before);
            law.reset();
        }
        prop_assert_eq!(with.update(&first, DT), without.update(&first, DT));
        // The second has one: the first would have had it without this point.
        let kick = with.update(&second, DT).vector() - without.update(&second, DT).vector();
        let rate = (second.pose_error - first.pose_error) / DT;
        let expected = derivative_gains(rule, &gains).component_mul(&rate);
        prop_assert!((kick - expected).amax() <= 1e-9 * (1.0 + expected.amax()));
    }

    #[test]
    fn a_reset_forgets_everything_but_the_gains(
        (config, law, gains, _) in any_case(),
        rule in any_rule(),
        before in any_inputs(1..5),
        after in any_inputs(1..5),
        refused in any::<bool>(),
    ) {
        let mut used = build(&config, law, rule, &gains);
        run(&mut used, &before);
        used.reset();
        if refused {
            used.command_refused(); // nothing is left to take back
        }
        prop_assert_eq!(run(&mut used, &after), run(&mut build(&config, law, rule, &gains), &after));
    }

    #[test]
    fn point_2_gains_that_were_never_used_leave_no_trace(
        (config, law, gains, others) in any_case(),
        rule in any_rule(),
        before in any_inputs(0..5),
        after in any_inputs(1..5),
    ) {
        let mut changed = build(&config, law, rule, &gains);
        let mut same = changed.clone();
        for law in [&mut changed, &mut same] {
            run(law, &before);
        }
        changed.set_gains(&others).unwrap();
        changed.set_gains(&gains).unwrap();
        prop_assert_eq!(run(&mut changed, &after), run(&mut same, &after));
    }

    #[test]
    fn point_2_the_force_integral_does_not_jump_with_its_gain(
        (config, _, _, _) in any_case(),
        (old, new) in (any_parallel_gains(), any_parallel_gains()),
        before in any_inputs(1..20),
    ) {
        // With no input what remains of u is (I−S)·integral, whatever the gains were and are.
        let mut law = build(&config, Law::Parallel, DerivativeRule::None, &Gains::Parallel(old));
        run(&mut law, &before);
        let integral: Vector6 = before
            .iter()
            .map(|i| old.kp_f.component_mul(&i.wrench.vector()) * (config.parallel.integral_ratio * DT))
            .sum();
        law.set_gains(&Gains::Parallel(new)).unwrap();
        let expected = new.selection.map(|s| 1.0 - s).component_mul(&integral);
        let u = law.update(&nothing(), DT).vector();
        prop_assert!((u - expected).amax() <= 1e-12 * (1.0 + expected.amax()), "{u} for {expected}");
    }

    #[test]
    fn point_2_the_admittance_model_goes_on_from_where_it_is(
        (config, _, _, _) in any_case(),
        (old, new) in (50.0..500.0, 50.0..500.0),
        force in -20.0..20.0,
        ticks in 1..100,
    ) {
        // Just after a change x and ẋ are what they were: x by the velocity output, ẋ by the displacement's.
        let mut law = build(&config, Law::Admittance, DerivativeRule::None, &admittance_gains(0.0, old));
        for _ in 0..ticks {
            law.update(&input(0.0, force, 0.0), DT);
        }
        let (mut kept, mut changed) = (law.clone(), law);
        changed.set_gains(&admittance_gains(0.0, new)).unwrap();
        let soon = 1e-9;
        let (a, b) = (kept.update(&nothing(), soon).linear.z, changed.update(&nothing(), soon).linear.z);
        // ẍ = (F − b·ẋ − k·x)/m is below 1e5 m/s² here; in 1 ns that is 0.1 mm/s (of a displacement: nothing).
        prop_assert!((a - b).abs() < 1e-4, "{a} became {b}");
        prop_assert!(a != 0.0);
    }

    #[test]
    fn refused_gains_leave_those_in_force(
        (config, law, gains, _) in any_case(),
        bad in prop_oneof![Just(-1.0), Just(f64::NAN), Just(f64::INFINITY)],
        axis in 0..6usize,
        after in any_inputs(1..4),
    ) {
        let mut refused = build(&config, law, DerivativeRule::None, &gains);
        let expected = run(&mut refused.clone(), &after);
        for which in 0..3 {
            let mut wrong = gains;
            let (vector, name) = match (&mut wrong, which) {
                (Gains::Parallel(g), 0) => (&mut g.kp_x, "kp_x"),
                (Gains::Parallel(g), 1) => (&mut g.kp_f, "kp_f"),
                (Gains::Parallel(g), _) => (&mut g.selection, "selection"),
                (Gains::Admittance(g), 0) => (&mut g.kp_x, "kp_x"),
                (Gains::Admittance(g), _) => (&mut g.stiffness, "stiffness"),
            };
            vector[axis] = bad;
            let error = refused.set_gains(&wrong).unwrap_err().to_string();
            let key = format!("{name}.{} is {bad}", ["x", "y", "z", "rx", "ry", "rz"][axis]);
            prop_assert!(error.starts_with(&key), "{}", error);
        }
        let other = match law {
            Law::Parallel => admittance_gains(1.0, 300.0),
            Law::Admittance => parallel_gains(1.0, 5e-3, 0.5),
        };
        let wrong_law = format!("the {law} law was given the gains of the other law");
        prop_assert_eq!(refused.set_gains(&other).unwrap_err().to_string(), wrong_law);
        prop_assert_eq!(run(&mut refused, &after), expected);
    }

    #[test]
    fn point_3_a_refusal_takes_back_the_last_update_and_no_other(
        (config, law, gains, _) in any_case(),
        before in any_inputs(0..5),
        refused in any_input(),
        after in any_inputs(1..5),
        times in 1..5,
    ) {
        let mut held = build(&config, law, DerivativeRule::None, &gains);
        run(&mut held, &before);
        let mut never = held.clone();
        held.update(&refused, DT);
        for _ in 0..times {
            held.command_refused();
        }
        prop_assert_eq!(run(&mut held, &after), run(&mut never, &after));
    }

    #[test]
    fn point_3_the_derivative_spans_the_time_an_arm_was_held(
        (config, law, gains, _) in any_case(),
        rule in any_rule(),
        moved in any_input(),
        held in any_inputs(0..6),
        last in any_input(),
    ) {
        // ẋ_e since the last sample that led to motion, over all the time since.
        let mut with = build(&config, law, rule, &gains);
        let mut without = build(&config, law, DerivativeRule::None, &gains);
        for law in [&mut with, &mut without] {
            law.update(&moved, DT);
            for input in &held {
                law.update(input, DT);
                law.command_refused();
            }
        }
        let term = with.update(&last, DT).vector() - without.update(&last, DT).vector();
        let rate = (last.pose_error - moved.pose_error) / (DT * (held.len() + 1) as f64);
        let expected = derivative_gains(rule, &gains).component_mul(&rate);
        prop_assert!((term - expected).amax() <= 1e-9 * (1.0 + expected.amax()));
    }

    #[test]
    fn point_4_what_is_not_finite_passes_out_and_is_forgotten(
        (config, law, gains, _) in any_case(),
        rule in any_rule(),
        before in any_inputs(0..5),
        mut spoilt in any_input(),
        which in 0..3,
        axis in 0..6usize,
        value in prop_oneof![Just(f64::NAN), Just(f64::INFINITY), Just(f64::NEG_INFINITY)],
        after in any_inputs(1..5),
    ) {
        let vector = |v: Vector6| Vector6::from_fn(|j, _| if j == axis { value } else { v[j] });
        match which {
            0 => spoilt.pose_error = vector(spoilt.pose_error),
            1 => spoilt.wrench = vector(spoilt.wrench.vector()).into(),
            _ => spoilt.action = vector(spoilt.action.vector()).into(),
        }
        let mut law = build(&config, law, rule, &gains);
        run(&mut law, &before);
        let mut unspoilt = law.clone();
        prop_assert!(!law.update(&spoilt, DT).is_finite());
        law.command_refused();
        // A refused tick takes its time: the twin is refused a finite one.
        unspoilt.update(&nothing(), DT);
        unspoilt.command_refused();
        prop_assert_eq!(run(&mut law, &after), run(&mut unspoilt, &after));
    }
}

#[test]
fn a_nan_also_passes_the_speed_bounds() {
    for law in [Law::Parallel, Law::Admittance] {
        let mut law = Controller::new(&control(), law).unwrap();
        assert!(!law.update(&input(0.0, f64::NAN, 0.0), DT).is_finite());
    }
}

#[test]
fn an_arm_that_is_held_for_minutes_winds_nothing_up() {
    for (law, gains) in [
        (Law::Parallel, parallel_gains(1.0, 5e-3, 0.5)),
        (Law::Admittance, admittance_gains(1.0, 300.0)),
    ] {
        let mut held = Controller::new(&control(), law).unwrap();
        held.set_gains(&gains).unwrap();
        let mut fresh = held.clone();
        for _ in 0..100_000 {
            held.update(&input(0.003, 20.0, 0.01), DT);
            held.command_refused();
        }
        let next = input(0.002, 1.0, 0.0);
        assert_eq!(held.update(&next, DT), fresh.update(&next, DT));
    }
}

#[test]
fn the_speed_bounds_shorten_and_do_not_turn() {
    let mut law = Controller::new(&control(), Law::Parallel).unwrap();
    law.set_gains(&parallel_gains(100.0, 5e-3, 1.0)).unwrap();
    let mut error = input(0.0, 0.0, 0.0);
    error.pose_error = Vector6::new(0.3, -0.4, 0.0, 0.0, 0.05, 0.0);
    let u = law.update(&error, DT);
    // 0.25 m/s and 1 rad/s.
    assert!((u.linear - palpate_spatial::Vector3::new(0.15, -0.2, 0.0)).norm() < 1e-15);
    assert!((u.angular - palpate_spatial::Vector3::new(0.0, 1.0, 0.0)).norm() < 1e-15);
}
