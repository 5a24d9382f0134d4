//! Models that are refused: the error names the key, the axis and a range that would do.
#![expect(clippy::unwrap_used, reason = "what cannot go on fails")]

mod support;

use palpate_control::{ActionMap, ControlError, GainSpec, PolicyModel, RangeMap, Tie};
use proptest::prelude::*;
use support::*;

fn refusal(model: &PolicyModel) -> String {
    let error = model.validate(&control()).unwrap_err().to_string();
    assert_eq!(ActionMap::new(model).unwrap_err().to_string(), error);
    error
}

#[test]
fn a_range_that_reaches_zero_names_itself_and_one_that_would_do() {
    let mut model = model("a-13pd");
    // The authors' own file: K 5e4 ± 8e4.
    let stiffness = model.gains.stiffness.as_mut().unwrap();
    (stiffness.base[4], stiffness.range[4]) = (5e4, 8e4);
    assert_eq!(
        refusal(&model),
        "policy.gains.stiffness.range[4] (ry) is 80000, but it must be less than the base of 50000, so that \
         the gain stays positive (40000 would do)"
    );
    model.gains.stiffness.as_mut().unwrap().range[4] = 40000.0;
    model.validate(&control()).unwrap();
    // Zero itself is no gain either.
    model.gains.position.range[0] = model.gains.position.base[0];
    assert!(refusal(&model).starts_with("policy.gains.position.range[0] (x) is 1, but"));
}

#[test]
fn a_selection_beyond_one_is_refused_and_the_whole_of_it_is_not() {
    let mut model = model("p-24");
    model.gains.selection = Some(GainSpec {
        tie: Tie::PerAxis,
        base: [0.5, 0.7, 0.3, 0.0, 1.0, 0.9],
        range: [0.5, 0.3, 0.3, 0.0, 0.0, 0.1],
    });
    model.validate(&control()).unwrap();
    model.gains.selection.as_mut().unwrap().range[1] = 0.31;
    assert_eq!(
        refusal(&model),
        "policy.gains.selection.range[1] (y) is 0.31, but it must be at most 0.3, so that S stays within [0, 1]"
    );
    model.gains.selection.as_mut().unwrap().base[1] = 1.1;
    assert_eq!(
        refusal(&model),
        "policy.gains.selection.base[1] (y) is 1.1, but it must be within [0, 1]"
    );
}

#[test]
fn gains_that_the_law_lacks_or_has_no_use_for_are_named() {
    let spec = GainSpec { tie: Tie::All, base: [1.0; 6], range: [0.5; 6] };
    let refused = |change: &dyn Fn(&mut PolicyModel), name: &str| {
        let mut model = model(name);
        change(&mut model);
        refusal(&model)
    };
    let missing = |gain: &str| format!("policy.gains.{gain} is missing: the law needs it");
    let superfluous = |gain: &str| format!("policy.gains.{gain} is of no use to the law");
    assert_eq!(refused(&|m| m.gains.force = None, "p-9"), missing("force"));
    assert_eq!(refused(&|m| m.gains.selection = None, "p-14"), missing("selection"));
    assert_eq!(refused(&|m| m.gains.stiffness = None, "a-18"), missing("stiffness"));
    assert_eq!(
        refused(&|m| m.gains.stiffness = Some(spec.clone()), "p-9"),
        superfluous("stiffness")
    );
    assert_eq!(refused(&|m| m.gains.force = Some(spec.clone()), "a-8"), superfluous("force"));
    assert_eq!(
        refused(&|m| m.gains.selection = Some(spec.clone()), "a-8"),
        superfluous("selection")
    );
}

#[test]
fn keys_that_are_unknown_or_missing_do_not_load() {
    let text = toml::to_string(&model("p-9")).unwrap();
    assert_eq!(toml::from_str::<PolicyModel>(&text).unwrap(), model("p-9"));
    let misspelt = text.replace("range_map", "rangemap");
    assert!(toml::from_str::<PolicyModel>(&misspelt).unwrap_err().message().contains("rangemap"));
    let none = text.replace("range_map = \"additive\"", "");
    assert!(toml::from_str::<PolicyModel>(&none).unwrap_err().message().contains("range_map"));
}

#[test]
fn settings_of_the_laws_are_refused_by_name() {
    type Change = fn(&mut palpate_control::ControlConfig, f64);
    let changes: [(&str, Change); 6] = [
        ("control.max_linear_speed", |c, x| c.max_linear_speed = x),
        ("control.max_angular_speed", |c, x| c.max_angular_speed = x),
        ("control.parallel.integral_limit", |c, x| c.parallel.integral_limit = x),
        ("control.parallel.integral_ratio", |c, x| c.parallel.integral_ratio = x),
        ("control.admittance.inertia", |c, x| c.admittance.inertia = x),
        ("control.admittance.damping_ratio", |c, x| c.admittance.damping_ratio = x),
    ];
    for (key, change) in changes {
        for value in [-0.1, f64::NAN, f64::INFINITY] {
            let mut config = control();
            change(&mut config, value);
            let error = config.validate().unwrap_err().to_string();
            assert!(error.starts_with(&format!("{key} is {value}, but it must be ")), "{error}");
            assert!(
                palpate_control::Controller::new(&config, palpate_control::Law::Parallel).is_err()
            );
        }
    }
    let mut config = control();
    config.parallel.integral_ratio = 0.0; // a P action on force
    config.validate().unwrap();
}

#[test]
fn motion_bounds_are_refused_by_name() {
    for value in [0.0, -0.02, f64::NAN, f64::INFINITY] {
        let mut model = model("p-14");
        model.motion.angular = value;
        let error = refusal(&model);
        assert!(error.starts_with(&format!("policy.motion.angular is {value}, but")), "{error}");
    }
}

/// The number an error says would do: the last of its message's numbers before "would do", or after "at most".
fn advice(error: &ControlError) -> f64 {
    let ControlError::BadValue { must, .. } = error else { panic!("{error}") };
    let word = match (must.split_once("at most "), must.split_once(" would do")) {
        (Some((_, rest)), _) => rest.split([',', ' ']).next().unwrap(),
        (_, Some((rest, _))) => rest.rsplit('(').next().unwrap(),
        _ => panic!("no advice in {must:?}"),
    };
    word.parse().unwrap()
}

proptest! {
    /// What an error says would do, does: for any base, in both range maps.
    #[test]
    fn the_advised_range_is_accepted(
        exponent in -12.0..6.0,
        base_selection in 0.0..=1.0,
        additive in any::<bool>(),
        axis in 0..6usize,
    ) {
        let map = if additive { RangeMap::Additive } else { RangeMap::Multiplicative };
        let too_much = if additive { 1e9 } else { f64::MAX };
        for selection in [false, true] {
            let mut model = model("p-24");
            model.range_map = map;
            for spec in [&mut model.gains.position, model.gains.force.as_mut().unwrap(), model.gains.selection.as_mut().unwrap()] {
                spec.range = [if additive { 0.0 } else { 1.0 }; 6];
            }
            let base = if selection { base_selection } else { 10f64.powf(exponent) };
            fn spec(m: &mut PolicyModel, selection: bool) -> &mut GainSpec {
                if selection { m.gains.selection.as_mut().unwrap() } else { &mut m.gains.position }
            }
            spec(&mut model, selection).base[axis] = base;
            spec(&mut model, selection).range[axis] = too_much;
            let Err(error) = model.validate(&control()) else {
                // ×/÷ f64::MAX of a base small enough stays finite, and of a zero S stays zero.
                prop_assert!(!additive);
                continue;
            };
            spec(&mut model, selection).range[axis] = advice(&error);
            prop_assert_eq!(model.validate(&control()), Ok(()), "base {}, advice {}", base, error);
        }
    }
}
