//! The closed form: eight configurations, each of them right.

mod sets;

use palpate_kinematics::{
    IkError, IkOptions, ModelError, SerialChain, UrAnalytic, UrModel, UrSolver,
};
use palpate_spatial::{JointVector, Pose, Vector3};
use proptest::prelude::*;
use std::f64::consts::TAU;

/// Distance between two configurations, whole turns aside, rad.
fn turned(a: &JointVector, b: &JointVector) -> f64 {
    (a - b).map(|x| (x - TAU * (x / TAU).round()).abs()).max()
}

proptest! {
    #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn every_branch_reaches_the_pose_and_the_original_is_among_them(seed: u64) {
        for model in UrModel::ALL {
            let (arm, dh) = (UrAnalytic::new(model), model.dh());
            let q = sets::configuration(&sets::ur(model), &mut sets::stream(seed));
            let target = dh.forward(&q);
            let found = arm.solve_all(&target, q[5]);
            let all = found.as_slice();
            prop_assert!(!all.is_empty() && found.shortfall() == 0.0);
            for (i, (branch, solution)) in all.iter().enumerate() {
                let (position, rotation) = sets::apart(&dh.forward(solution), &target);
                prop_assert!(position <= 1e-8 && rotation <= 1e-8, "{branch:?}: {position:.1e} m, {rotation:.1e} rad");
                prop_assert!(all[..i].iter().all(|(other, _)| other != branch));
                prop_assert!(all[..i].iter().all(|(_, other)| turned(other, solution) > 1e-6));
            }
            let same = all.iter().map(|(_, s)| turned(s, &q)).fold(f64::INFINITY, f64::min);
            prop_assert!(same < 1e-6, "the original is {same:.1e} rad away from the nearest");
        }
    }

    #[test]
    fn branches_are_told_apart_by_their_joints(seed: u64) {
        let arm = UrAnalytic::new(UrModel::Ur5e);
        let q = sets::configuration(&sets::ur(UrModel::Ur5e), &mut sets::stream(seed));
        for (branch, solution) in arm.solve_all(&UrModel::Ur5e.dh().forward(&q), q[5]).as_slice() {
            prop_assert_eq!(*branch, arm.branch(solution));
        }
    }
}

#[test]
fn most_poses_have_all_eight() {
    let rng = &mut sets::stream(21);
    let (chain, arm) = (sets::ur(UrModel::Ur3e), UrAnalytic::new(UrModel::Ur3e));
    let counts: Vec<usize> = (0..1000)
        .map(|_| {
            arm.solve_all(&UrModel::Ur3e.dh().forward(&sets::configuration(&chain, rng)), 0.0)
                .as_slice()
                .len()
        })
        .collect();
    assert!(counts.iter().all(|n| n % 2 == 0 && *n <= 8));
    assert!(counts.iter().filter(|n| **n == 8).count() > 500);
}

#[test]
fn at_a_wrist_singularity_the_last_joint_stays_where_it_was() {
    let (arm, dh) = (UrAnalytic::new(UrModel::Ur3e), UrModel::Ur3e.dh());
    let q = JointVector::from([0.4, -1.1, 1.3, -0.6, 0.0, 2.5]);
    let found = arm.solve_all(&dh.forward(&q), 2.5);
    assert!(found.as_slice().iter().any(|(_, s)| turned(s, &q) < 1e-9));
}

#[test]
fn a_pose_out_of_reach_says_by_how_much() {
    let arm = UrAnalytic::new(UrModel::Ur3e);
    // Stretched out sideways from the shoulder, then 50 mm further.
    let q = JointVector::from([0.0, 0.0, 0.0, -1.0, 1.5, 0.0]);
    let mut target = UrModel::Ur3e.dh().forward(&q);
    target.translation.x -= 0.05;
    let found = arm.solve_all(&target, 0.0);
    assert!(found.as_slice().is_empty());
    assert!((found.shortfall() - 0.05).abs() < 1e-3, "{}", found.shortfall());
    // On the base axis: the shoulder's offset alone keeps the wrist off it.
    let over_base = Pose::translation(0.0, 0.0, 0.5);
    let missing = arm.solve_all(&over_base, 0.0).shortfall();
    assert!((missing - 0.13105).abs() < 1e-12, "{missing}");
}

#[test]
fn a_nominal_arm_proves_what_it_cannot_reach() {
    let chain = sets::ur(UrModel::Ur3e);
    let seed = JointVector::from([0.0, 0.0, 0.1, -1.0, 1.5, 0.0]);
    let mut target = chain.forward(&JointVector::from([0.0, 0.0, 0.0, -1.0, 1.5, 0.0]));
    target.translation.vector += Vector3::new(0.05, 0.0, 0.0);
    assert!(target.translation.vector.norm() < chain.reach());
    let error = sets::solver(chain).solve_near(&target, &seed, &IkOptions::default()).unwrap_err();
    let IkError::Unreachable { beyond } = error else { panic!("{error}") };
    assert!((beyond - 0.05).abs() < 1e-3, "{beyond}");
}

#[test]
fn another_arm_is_recognised() {
    let error = UrSolver::new(sets::ur(UrModel::Ur5e), UrModel::Ur3e).unwrap_err();
    let ModelError::NotThisArm { position, .. } = error else { panic!("{error}") };
    assert!(position > 0.1);
    let odd = SerialChain::<6>::from_urdf_str(sets::ODD_ARM, "link_1", "tool").unwrap();
    assert!(matches!(UrSolver::new(odd, UrModel::Ur10e), Err(ModelError::NotThisArm { .. })));
}
