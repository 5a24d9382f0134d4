//! What a URDF may look like, and what is said about one that may not.
#![expect(clippy::unwrap_used, reason = "our own arms load")]

mod sets;

use palpate_kinematics::{ModelError, SerialChain, UrModel};
use palpate_spatial::Vector3;
use sets::{ODD_ARM, URDFS, apart};

/// A URDF with the given joints; every link they name exists.
fn robot(joints: &str) -> String {
    let named = joints.split("link=\"").skip(1).filter_map(|s| s.split('"').next());
    let names: std::collections::BTreeSet<&str> = named.collect();
    let links = names
        .into_iter()
        .fold(String::new(), |links, name| links + "<link name=\"" + name + "\"/>");
    format!("<robot name=\"test\">{links}{joints}</robot>")
}

fn joint(name: &str, kind: &str, parent: &str, child: &str, rest: &str) -> String {
    let ends = format!("<parent link=\"{parent}\"/><child link=\"{child}\"/>");
    format!("<joint name=\"{name}\" type=\"{kind}\">{ends}{rest}</joint>")
}

const LIMIT: &str = r#"<limit lower="-1" upper="1" velocity="1" effort="1"/>"#;

fn refused(urdf: &str, base: &str, tip: &str) -> ModelError {
    SerialChain::<1>::from_urdf_str(urdf, base, tip).unwrap_err()
}

#[test]
fn our_urdfs_hold_the_figures_of_their_model() {
    for (model, urdf) in URDFS {
        let chain = SerialChain::<6>::from_urdf_str(urdf, "base_link", "tool0").unwrap();
        assert_eq!(chain.limits(), &model.limits());
        assert_eq!(chain.joint_names(), palpate_kinematics::UR_JOINTS);
        let rng = &mut sets::stream(1);
        for _ in 0..100 {
            let q = sets::configuration(&chain, rng);
            let figures = UrModel::base_link_T_base() * model.dh().forward(&q);
            let (position, rotation) = apart(&chain.forward(&q), &figures);
            assert!(
                position < 1e-14 && rotation < 1e-14,
                "{model:?}: {position:.1e} m, {rotation:.1e} rad"
            );
        }
        // The controller's frame: `base` differs from `base_link` by half a turn.
        let robot = urdf_rs::read_from_string(urdf).unwrap();
        let base = robot.joints.iter().find(|j| j.child.link == "base").unwrap();
        assert_eq!(base.origin.rpy[2], std::f64::consts::PI);
    }
}

#[test]
fn base_and_tip_may_be_anywhere_in_the_tree() {
    let q7 = nalgebra::SVector::<f64, 7>::from([0.3, -1.1, 2.0, 0.2, 0.9, -0.4, 1.7]);
    let whole = SerialChain::<7>::from_urdf_str(ODD_ARM, "world", "tool").unwrap().forward(&q7);
    let upper = SerialChain::<2>::from_urdf_str(ODD_ARM, "world", "elbow_plate").unwrap();
    let lower = SerialChain::<5>::from_urdf_str(ODD_ARM, "elbow_plate", "tool").unwrap();
    let pieces =
        upper.forward(&q7.fixed_rows::<2>(0).into()) * lower.forward(&q7.fixed_rows::<5>(2).into());
    let (position, rotation) = apart(&whole, &pieces);
    assert!(position < 1e-14 && rotation < 1e-14);
    assert_eq!(
        SerialChain::<5>::from_urdf_str(ODD_ARM, "plate", "camera").unwrap().joint_names()[4],
        "bend"
    );
}

#[test]
fn nothing_moves_past_the_reach() {
    let rng = &mut sets::stream(2);
    let (odd, ur) = (sets::odd_arm(), sets::ur(UrModel::Ur3e));
    for _ in 0..2000 {
        assert!(
            odd.forward(&sets::configuration(&odd, rng)).translation.vector.norm() <= odd.reach()
        );
        assert!(ur.forward(&sets::configuration(&ur, rng)).translation.vector.norm() <= ur.reach());
    }
    assert!(ur.reach() < 0.15185 + 0.24355 + 0.2132 + 0.13105 + 0.08535 + 0.0921 + 1e-12);
}

#[test]
fn an_axis_opposite_to_z_turns_backwards() {
    let flipped =
        robot(&joint("j", "revolute", "a", "b", &format!(r#"<axis xyz="0 0 -3"/>{LIMIT}"#)));
    let pose = SerialChain::<1>::from_urdf_str(&flipped, "a", "b").unwrap().forward(&[0.4].into());
    assert!((pose.rotation.scaled_axis() - Vector3::new(0.0, 0.0, -0.4)).norm() < 1e-15);
}

#[test]
fn a_continuous_joint_has_no_end_whatever_its_limit_says() {
    let urdf = robot(&joint("j", "continuous", "a", "b", LIMIT));
    let chain = SerialChain::<1>::from_urdf_str(&urdf, "a", "b").unwrap();
    assert_eq!(
        (chain.limits().lower[0], chain.limits().upper[0]),
        (f64::NEG_INFINITY, f64::INFINITY)
    );
}

#[test]
fn a_missing_link_is_answered_with_the_links_there_are() {
    let said =
        |base, tip| SerialChain::<6>::from_urdf_str(URDFS[0].1, base, tip).unwrap_err().to_string();
    let links = "base_link, shoulder_link, upper_arm_link, forearm_link, wrist_1_link, wrist_2_link, wrist_3_link, \
                 tool0, base";
    assert_eq!(
        said("base_link", "Tool_0"),
        format!("the URDF has no link `Tool_0`; did you mean `tool0`? its links are: {links}")
    );
    assert_eq!(
        said("quux", "tool0"),
        format!("the URDF has no link `quux`; its links are: {links}")
    );
}

#[test]
fn joints_that_no_serial_chain_has_are_named() {
    for kind in ["floating", "planar"] {
        let said = refused(&robot(&joint("hover", kind, "a", "b", "")), "a", "b").to_string();
        assert!(said.starts_with(&format!("joint `hover` is a {kind} joint")), "{said}");
    }
    let mimic = format!(r#"{LIMIT}<mimic joint="other"/>"#);
    let said =
        refused(&robot(&joint("finger", "revolute", "a", "b", &mimic)), "a", "b").to_string();
    assert!(said.starts_with("joint `finger` is a mimic joint"), "{said}");
}

#[test]
fn broken_trees_are_refused_by_kind() {
    let fork = joint("l", "revolute", "a", "b", LIMIT) + &joint("r", "revolute", "a", "c", LIMIT);
    assert!(matches!(refused(&robot(&fork), "b", "c"), ModelError::NotConnected { .. }));
    assert!(matches!(refused(&robot(&fork), "b", "a"), ModelError::NotConnected { .. }));
    let ring = joint("l", "revolute", "a", "b", LIMIT)
        + &joint("r", "revolute", "b", "a", LIMIT)
        + &joint("x", "revolute", "c", "d", LIMIT);
    assert!(matches!(refused(&robot(&ring), "d", "a"), ModelError::Loop(tip) if tip == "a"));
    let twice = joint("l", "revolute", "a", "c", LIMIT) + &joint("r", "revolute", "b", "c", LIMIT);
    assert!(
        matches!(refused(&robot(&twice), "a", "c"), ModelError::TwoParents(link) if link == "c")
    );
    let error = refused(URDFS[0].1, "base_link", "tool0");
    assert!(
        error.to_string().starts_with("the chain has 6 moving joints (shoulder_pan_joint, "),
        "{error}"
    );
    assert!(matches!(refused("<robot", "a", "b"), ModelError::Urdf(_)));
}

#[test]
fn broken_joints_are_refused_with_their_numbers() {
    let cases = [
        (
            format!(r#"<axis xyz="0 0 0"/>{LIMIT}"#),
            "joint `j`: its axis [0.0, 0.0, 0.0] has no direction",
        ),
        (
            format!(r#"<axis xyz="nan 0 1"/>{LIMIT}"#),
            "joint `j`: its axis [NaN, 0.0, 1.0] has no direction",
        ),
        (format!(r#"<origin xyz="inf 0 0"/>{LIMIT}"#), "joint `j`: its origin is not finite"),
        (
            r#"<limit lower="1" upper="-1" velocity="1" effort="1"/>"#.into(),
            "[1, -1] are empty or missing",
        ),
        (
            r#"<limit lower="nan" upper="1" velocity="1" effort="1"/>"#.into(),
            "[NaN, 1] are empty or missing",
        ),
        (
            r#"<limit lower="-1" upper="1" velocity="0" effort="1"/>"#.into(),
            "must be positive, not 0",
        ),
        (String::new(), "[0, 0] are empty or missing"),
    ];
    for (rest, expected) in cases {
        let said = refused(&robot(&joint("j", "revolute", "a", "b", &rest)), "a", "b").to_string();
        assert!(said.contains(expected), "{said}");
    }
}

#[test]
fn delta_dh_moves_the_tool_and_not_the_reach() {
    let rng = &mut sets::stream(3);
    for model in UrModel::ALL {
        for size in sets::CALIBRATIONS {
            let delta = sets::delta_dh(model, size, rng);
            let chain = model.calibrated_chain(&delta).unwrap();
            let table = model.dh().calibrated(&delta);
            let q = sets::configuration(&chain, rng);
            let figures = UrModel::base_link_T_base() * table.forward(&q);
            let (position, rotation) = apart(&chain.forward(&q), &figures);
            // δd of 500 m leaves about 1e-13 of rounding.
            assert!(position < 1e-12 && rotation < 1e-14, "{position:.1e} m, {rotation:.1e} rad");
            assert!(chain.reach() < 2.0 * sets::ur(model).reach(), "{} m", chain.reach());
            let moved = apart(&chain.forward(&q), &sets::ur(model).forward(&q)).0;
            assert!((1e-5..0.05).contains(&moved), "the calibration moved the tool by {moved} m");
        }
    }
    let nan = palpate_kinematics::DhTable { d: [f64::NAN; 6], ..UrModel::Ur3e.dh() };
    assert!(matches!(UrModel::Ur3e.calibrated_chain(&nan), Err(ModelError::BadJoint { .. })));
}
