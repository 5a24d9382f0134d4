//! Limits that contradict each other or the arm are refused when they are loaded.
#![expect(clippy::unwrap_used, reason = "our own limits load")]

mod support;

use palpate_robot_io::IdealArm;
use palpate_safety::shield::{Obstacle, Shield, ShieldConfig};
use palpate_safety::{Safe, SafetyConfig};
use palpate_spatial::{DOF, JointVector, Vector3};
use support::{DT, chain, home, preset, tool0_T_tool, wide};

/// What is said about a configuration with one change.
fn refused(change: impl Fn(&mut SafetyConfig, &mut ShieldConfig)) -> String {
    let mut safety = preset();
    let mut shield = safety.shield.take().unwrap();
    change(&mut safety, &mut shield);
    safety.shield = Some(shield);
    Shield::new(&safety, chain(), &tool0_T_tool(), DT).map(|_| ()).unwrap_err().to_string()
}

#[test]
fn limits_that_contradict_each_other_are_refused_by_name() {
    type Change = fn(&mut SafetyConfig, &mut ShieldConfig);
    let cases: [(&str, Change); 18] = [
        ("joint_acceleration_max[1]", |_, s| s.joint_acceleration_max[1] = 5.0),
        ("joint_acceleration_max[0]", |_, s| s.joint_acceleration_max[0] = f64::NAN),
        ("joint_jerk_max[5]", |_, s| s.joint_jerk_max[5] = 0.0),
        ("branch_step_max", |_, s| s.branch_step_max = 0.001),
        ("joint_margin", |_, s| s.joint_margin = 4.0),
        ("workspace.min[2]", |_, s| s.workspace.min.z = 0.5),
        ("workspace.min[0]", |_, s| (s.workspace.min.x, s.workspace.max.x) = (2.0, 3.0)),
        ("planes[1].normal", |_, s| s.planes[1].normal.z = 2.0),
        ("planes[0].capsules", |_, s| s.planes[0].capsules.clear()),
        ("force.force_norm_max", |_, s| s.force.force_norm_max = 20.0),
        ("force.torque_norm_max", |_, s| s.force.torque_norm_max = 4.0),
        ("force.force_hard_max", |_, s| s.force.force_hard_max = 50.0),
        ("sensor.force_range", |_, s| s.sensor.force_range = 30.0),
        ("force.reaction_time", |_, s| s.force.reaction_time = 0.001),
        ("force.stiffness", |_, s| s.force.stiffness = 1e7),
        ("singularity.stop_below", |_, s| s.singularity.stop_below = 1.0),
        ("sensor.gap_max", |_, s| s.sensor.gap_max = 0.001),
        ("recovery.tries", |_, s| s.recovery.tries = 0),
    ];
    for (key, change) in cases {
        let said = refused(change);
        assert!(said.starts_with(&format!("safety.shield.{key} is ")), "{key}: {said}");
        assert!(said.contains("must be"), "{said}");
    }
    let unknown = refused(|_, s| s.planes[1].capsules = vec!["elbow".into()]);
    assert!(unknown.contains("no capsule `elbow`") && unknown.contains("forearm"), "{unknown}");
    let nowhere = refused(|_, s| s.shape = "ur4".into());
    assert!(nowhere.contains("ur3e, ur5e, ur10e"), "{nowhere}");
}

#[test]
fn the_mode_needs_its_section_and_the_section_needs_every_key_and_no_other() {
    let safety = SafetyConfig { shield: None, ..preset() };
    let missing = Safe::new(IdealArm::at(home()), support::arm(), tool0_T_tool(), safety)
        .map(|_| ())
        .unwrap_err();
    assert!(missing.to_string().contains("safety.shield is missing"), "{missing}");
    let whole = toml::Table::try_from(preset().shield.unwrap()).unwrap();
    for key in whole.keys() {
        let mut part = whole.clone();
        part.remove(key);
        let error = part.try_into::<ShieldConfig>().unwrap_err().to_string();
        assert!(error.contains(key.as_str()), "{key}: {error}");
    }
    let mut more = whole;
    more.insert("spede".into(), 1.0.into());
    assert!(more.try_into::<ShieldConfig>().is_err());
}

#[test]
fn the_built_in_shapes_clear_themselves_at_home_and_collide_when_folded() {
    for (name, urdf) in [("ur3e", "ur3e"), ("ur5e", "ur5e"), ("ur10e", "ur10e")] {
        let file = format!("{}/../../assets/robots/{urdf}.urdf", env!("CARGO_MANIFEST_DIR"));
        let chain =
            palpate_kinematics::SerialChain::<DOF>::from_urdf_file(file, "base_link", "tool0")
                .unwrap()
                .with_tool(tool0_T_tool());
        let mut safety = wide();
        safety.joint_velocity_max = JointVector::from_element(2.0);
        let config = safety.shield.as_mut().unwrap();
        config.shape = name.into();
        (config.workspace.min, config.workspace.max) =
            (Vector3::repeat(-2.0), Vector3::repeat(2.0));
        config.planes.clear();
        let shield = Shield::new(&safety, chain.clone(), &tool0_T_tool(), DT).unwrap();
        let clear = |q: JointVector| shield.geometry().clearance(&chain, &q);
        assert!(clear(home()).distance > 0.02, "{name}: {:?}", clear(home()));
        let mut folded = home();
        folded[2] = 3.0;
        let folded = clear(folded);
        assert!(
            folded.distance < 0.0 && matches!(folded.obstacle, Obstacle::Pair(..)),
            "{name}: {folded:?}"
        );
    }
}
