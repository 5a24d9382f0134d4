//! Actions to motion and gains: Table I of the paper as the files of `assets/policies/`.
#![expect(clippy::unwrap_used, reason = "what cannot go on fails")]

mod support;

use approx::assert_relative_eq;
use palpate_control::{
    ActionMap, ControlError, Decoded, GainSpec, Gains, Law, PolicyModel, RangeMap, Tie,
};
use palpate_spatial::Vector6;
use proptest::prelude::*;
use support::*;

const AXES: [&str; 6] = ["x", "y", "z", "rx", "ry", "rz"];

/// Gains of a model in the order of its actions, by name.
fn gains(decoded: &Decoded) -> Vec<(&'static str, Vector6)> {
    match decoded.gains {
        Gains::Parallel(g) => {
            vec![("position", g.kp_x), ("force", g.kp_f), ("selection", g.selection)]
        }
        Gains::Admittance(g) => vec![("position", g.kp_x), ("stiffness", g.stiffness)],
    }
}

fn spec<'a>(model: &'a PolicyModel, name: &str) -> &'a GainSpec {
    let g = &model.gains;
    match name {
        "position" => &g.position,
        "force" => g.force.as_ref().unwrap(),
        "selection" => g.selection.as_ref().unwrap(),
        _ => g.stiffness.as_ref().unwrap(),
    }
}

#[test]
fn all_eight_models_have_the_dimensions_and_the_order_of_table_1() {
    // Components of [K_p^x | K_p^f or k_d | S].
    let parts: [&[(&str, usize)]; 8] = [
        &[("position", 1), ("force", 1), ("selection", 1)],
        &[("position", 1), ("force", 1), ("selection", 6)],
        &[("position", 6), ("force", 6), ("selection", 1)],
        &[("position", 6), ("force", 6), ("selection", 6)],
        &[("position", 1), ("stiffness", 1)],
        &[("position", 1), ("stiffness", 6)],
        &[("position", 6), ("stiffness", 1)],
        &[("position", 6), ("stiffness", 6)],
    ];
    for ((name, dim), parts) in MODELS.into_iter().zip(parts) {
        let model = model(name);
        assert_eq!(model.name.to_lowercase(), name);
        model.validate(&control()).unwrap();
        let map = ActionMap::new(&model).unwrap();
        assert_eq!(map.dim(), dim, "{name}");
        let mut expected: Vec<String> = AXES.iter().map(|axis| format!("motion.{axis}")).collect();
        for &(gain, count) in parts {
            match count {
                1 => expected.push(gain.into()),
                _ => expected.extend(AXES.iter().map(|axis| format!("{gain}.{axis}"))),
            }
        }
        assert_eq!(map.labels(), expected, "{name}");
    }
}

#[test]
fn corners_and_middle_of_every_model_are_base_and_range() {
    for (name, dim) in MODELS {
        let model = model(name);
        let map = ActionMap::new(&model).unwrap();
        for corner in [-1.0, 0.0, 1.0] {
            let decoded = map.decode(&vec![corner; dim]).unwrap();
            let motion = Vector6::new(0.02, 0.02, 0.02, 0.1, 0.1, 0.1) * corner;
            assert_eq!(decoded.motion.vector(), motion);
            for (gain, values) in gains(&decoded) {
                let GainSpec { base, range, .. } = spec(&model, gain);
                for axis in 0..6 {
                    let expected = base[axis] + corner * range[axis];
                    assert_relative_eq!(values[axis], expected, max_relative = 1e-15);
                }
            }
        }
    }
}

#[test]
fn one_component_moves_what_its_label_says_and_nothing_else() {
    for (name, dim) in MODELS {
        let map = ActionMap::new(&model(name)).unwrap();
        let at_rest = map.decode(&vec![0.0; dim]).unwrap();
        for (component, label) in map.labels().into_iter().enumerate() {
            let mut action = vec![0.0; dim];
            action[component] = 1.0;
            let moved = map.decode(&action).unwrap();
            let mut changed: Vec<String> = Vec::new();
            let mut compare = |part: &str, a: Vector6, b: Vector6| {
                let axes: Vec<&str> = (0..6).filter(|&j| a[j] != b[j]).map(|j| AXES[j]).collect();
                match axes.len() {
                    6 => changed.push(part.into()),
                    _ => changed.extend(axes.iter().map(|axis| format!("{part}.{axis}"))),
                }
            };
            compare("motion", moved.motion.vector(), at_rest.motion.vector());
            for ((gain, a), (_, b)) in gains(&moved).into_iter().zip(gains(&at_rest)) {
                compare(gain, a, b);
            }
            assert_eq!(changed, [label], "{name}, component {component}");
        }
    }
}

#[test]
fn the_authors_range_map_multiplies_and_divides() {
    let mut model = model("p-9");
    model.range_map = RangeMap::Multiplicative;
    model.gains.position = GainSpec { tie: Tie::All, base: [5.0; 6], range: [2.0; 6] };
    model.gains.force = Some(GainSpec { tie: Tie::All, base: [5e-3; 6], range: [1.0; 6] });
    model.gains.selection = Some(GainSpec { tie: Tie::All, base: [0.5; 6], range: [2.0; 6] });
    let map = ActionMap::new(&model).unwrap();
    for (a, kp, s) in [
        (-1.0, 2.5, 0.25),
        (-0.5, 3.75, 0.375),
        (0.0, 5.0, 0.5),
        (0.5, 7.5, 0.75),
        (1.0, 10.0, 1.0),
    ] {
        let Gains::Parallel(g) = map.decode(&[a; 9]).unwrap().gains else { unreachable!() };
        assert_relative_eq!(g.kp_x.z, kp, max_relative = 1e-15);
        assert_relative_eq!(g.selection.z, s, max_relative = 1e-15);
        assert_eq!(g.kp_f.z, 5e-3);
    }
}

#[test]
fn p_6_moves_and_leaves_every_gain_at_its_base() {
    let (p_6, p_9) =
        (ActionMap::new(&model("p-6")).unwrap(), ActionMap::new(&model("p-9")).unwrap());
    assert_eq!(p_6.dim(), 6);
    let mut nine = [0.0; 9];
    nine[..6].fill(0.7);
    let (six, nine) = (p_6.decode(&[0.7; 6]).unwrap(), p_9.decode(&nine).unwrap());
    assert_eq!((six.motion, six.gains), (nine.motion, nine.gains));
}

#[test]
fn a_fixed_gain_takes_no_action_and_stays_at_its_base() {
    let mut model = model("p-14");
    let base = [0.1, 0.2, 0.3, 0.4, 0.5, 1.0];
    model.gains.selection = Some(GainSpec { tie: Tie::Fixed, base, range: [0.0; 6] });
    let map = ActionMap::new(&model).unwrap();
    assert_eq!(map.dim(), 8);
    for a in [-1.0, 1.0] {
        let Gains::Parallel(g) = map.decode(&[a; 8]).unwrap().gains else { unreachable!() };
        assert_eq!(g.selection, Vector6::from(base));
    }
}

#[test]
fn other_lengths_and_numbers_that_are_none_are_refused() {
    let map = ActionMap::new(&model("a-8")).unwrap();
    for length in [0, 7, 9] {
        let error = map.decode(&vec![0.0; length]).unwrap_err();
        assert_eq!(error, ControlError::ActionLength { found: length, expected: 8 });
    }
    for value in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
        for component in 0..8 {
            let mut action = [0.0; 8];
            action[component] = value;
            let error = map.decode(&action).unwrap_err().to_string();
            assert_eq!(error, format!("component {component} of the action is {value}"));
        }
    }
}

proptest! {
    /// Every action of every model decodes to gains that its law takes; beyond ±1 is as ±1.
    #[test]
    fn every_action_gives_gains_that_the_law_takes(
        which in 0..MODELS.len(),
        actions in prop::collection::vec(-3.0..3.0, 24),
    ) {
        use palpate_control::{Controller, ForceController};
        let (name, dim) = MODELS[which];
        let model = model(name);
        let map = ActionMap::new(&model).unwrap();
        let decoded = map.decode(&actions[..dim]).unwrap();
        Controller::new(&control(), model.law).unwrap().set_gains(&decoded.gains).unwrap();
        prop_assert_eq!(model.law, if name.starts_with('p') { Law::Parallel } else { Law::Admittance });
        let clamped: Vec<f64> = actions[..dim].iter().map(|a: &f64| a.clamp(-1.0, 1.0)).collect();
        prop_assert_eq!(map.decode(&clamped).unwrap(), decoded);
        for (gain, values) in gains(&decoded) {
            for axis in 0..6 {
                let (low, high) = spec(&model, gain).bounds(model.range_map, axis);
                prop_assert!(values[axis] >= low && values[axis] <= high);
            }
        }
    }
}
