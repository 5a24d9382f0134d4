//! What IK accepts and what it refuses, and why.
#![expect(clippy::unwrap_used, reason = "our own arms load")]

mod sets;

use std::f64::consts::{PI, TAU};

use nalgebra::SVector;
use palpate_kinematics::{IkError, IkOptions, SerialChain, UrModel};
use palpate_spatial::{JointVector, Pose, UnitQuaternion, Vector3};
use proptest::prelude::*;
use sets::apart;

const HOME: [f64; 6] = [0.0, -PI / 2.0, PI / 2.0, -PI / 2.0, -PI / 2.0, 0.0];

fn defaults() -> IkOptions {
    IkOptions::default()
}

proptest! {
    #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn a_near_seed_comes_back_to_its_pose(seed: u64) {
        let rng = &mut sets::stream(seed);
        for model in UrModel::ALL {
            let chain = sets::ur(model);
            let goal = sets::configuration(&chain, rng) * 0.98;
            let target = chain.forward(&goal);
            let start = goal.map(|x| x + 0.01 * (x * 12.9898).sin());
            let solution = chain.solve_near(&target, &start, &defaults()).unwrap();
            prop_assert!(sets::reaches(&chain, &solution.q, &target));
            prop_assert!(solution.position_error <= 1e-9 && solution.rotation_error <= 1e-9);
            prop_assert_eq!(solution.max_step, (solution.q - start).amax());
        }
    }

    #[test]
    fn what_is_returned_is_true_from_any_seed(seed: u64) {
        let rng = &mut sets::stream(seed);
        let chain = sets::ur(UrModel::Ur3e);
        let (goal, start) = (sets::configuration(&chain, rng), sets::configuration(&chain, rng));
        let target = chain.forward(&goal);
        if let Ok(solution) = chain.solve_near(&target, &start, &defaults()) {
            prop_assert!(sets::reaches(&chain, &solution.q, &target));
            prop_assert!((solution.q - start).amax() <= PI + 1e-12);
        }
    }

    #[test]
    fn both_signs_of_the_quaternion_give_the_same_bits(seed: u64) {
        let rng = &mut sets::stream(seed);
        let chain = sets::ur(UrModel::Ur5e);
        let (goal, start) = (sets::configuration(&chain, rng), sets::configuration(&chain, rng));
        let target = chain.forward(&goal);
        let negated = UnitQuaternion::new_unchecked(-target.rotation.into_inner());
        let mirrored = Pose::from_parts(target.translation, negated);
        let arm = palpate_kinematics::UrSolver::new(chain.clone(), UrModel::Ur5e).unwrap();
        prop_assert_eq!(chain.solve_near(&target, &start, &defaults()), chain.solve_near(&mirrored, &start, &defaults()));
        prop_assert_eq!(arm.solve_near(&target, &start, &defaults()), arm.solve_near(&mirrored, &start, &defaults()));
    }

    #[test]
    fn seeds_next_to_two_pi_keep_their_turn(
        joint in prop::sample::select(vec![0usize, 1, 3, 5]),
        side in prop::sample::select(vec![-1.0, 1.0]),
        before in 0.0..0.05f64,
        step in -0.05..0.05f64,
    ) {
        let chain = sets::ur(UrModel::Ur5e);
        let (mut seed, mut goal) = (JointVector::from(HOME), JointVector::from(HOME));
        seed[joint] = side * (TAU - before);
        goal[joint] = seed[joint] + step;
        prop_assume!((goal[joint].abs() - TAU).abs() > 1e-6);
        let found = chain.solve_near(&chain.forward(&goal), &seed, &defaults());
        if goal[joint].abs() <= TAU {
            prop_assert!((found.unwrap().q - goal).amax() < 1e-7);
        } else {
            let error = found.unwrap_err();
            let IkError::LimitViolation { joint: which, value, .. } = error else {
                return Err(TestCaseError::fail(error.to_string()));
            };
            prop_assert!(which == joint && (value - goal[joint]).abs() < 1e-7);
        }
    }

    #[test]
    fn what_is_out_of_reach_is_said_to_be(seed: u64, beyond in 1e-3..3.0f64) {
        let rng = &mut sets::stream(seed);
        for model in UrModel::ALL {
            let (chain, dh) = (sets::ur(model), model.dh());
            // From the shoulder the tool is never farther than all lengths after it.
            let longest = dh.a.iter().chain(&dh.d[1..]).map(|x| x.abs()).sum::<f64>();
            let start = sets::configuration(&chain, rng);
            let mut target = chain.forward(&sets::configuration(&chain, rng));
            let shoulder = Vector3::new(0.0, 0.0, dh.d[0]);
            let direction = (target.translation.vector - shoulder).normalize();
            target.translation.vector = shoulder + direction * (longest + beyond);
            let error = chain.solve_near(&target, &start, &defaults()).unwrap_err();
            prop_assert!(matches!(error, IkError::Unreachable { .. } | IkError::NotConverged { .. }), "{error}");
            let arm = palpate_kinematics::UrSolver::new(chain, model).unwrap();
            let error = arm.solve_near(&target, &start, &defaults()).unwrap_err();
            prop_assert!(matches!(error, IkError::Unreachable { beyond } if beyond > 0.0 && beyond < 10.0), "{error}");
        }
    }

    #[test]
    fn nothing_infinite_is_ever_solved(which in 0..13usize, bad in prop_oneof![Just(f64::NAN), Just(f64::INFINITY), Just(-f64::INFINITY)]) {
        let chain = sets::ur(UrModel::Ur3e);
        let mut q = JointVector::from(HOME);
        let mut target = chain.forward(&q);
        match which {
            0..3 => target.translation.vector[which] = bad,
            3..7 => {
                let mut quaternion = target.rotation.into_inner();
                quaternion.coords[which - 3] = bad;
                target.rotation = UnitQuaternion::new_unchecked(quaternion);
            }
            _ => q[which - 7] = bad,
        }
        let error = sets::solver(chain).solve_near(&target, &q, &defaults()).unwrap_err();
        match error {
            IkError::InvalidTarget => prop_assert!(which < 7),
            IkError::SeedOutOfLimits { joint, .. } => prop_assert_eq!(joint + 7, which),
            other => prop_assert!(false, "{other}"),
        }
    }
}

#[test]
fn a_quaternion_that_is_not_a_rotation_is_refused() {
    let chain = sets::ur(UrModel::Ur3e);
    let q = JointVector::from(HOME);
    let mut target = chain.forward(&q);
    target.rotation = UnitQuaternion::new_unchecked(target.rotation.into_inner() * 1.01);
    assert_eq!(chain.solve_near(&target, &q, &defaults()), Err(IkError::InvalidTarget));
}

#[test]
fn a_seed_outside_the_limits_is_refused_by_joint() {
    let chain = sets::ur(UrModel::Ur3e);
    let mut q = JointVector::from(HOME);
    q[2] = 3.2;
    let error = chain.solve_near(&chain.forward(&q), &q, &defaults()).unwrap_err();
    assert_eq!(error, IkError::SeedOutOfLimits { joint: 2, value: 3.2, lower: -PI, upper: PI });
    assert_eq!(error.to_string(), "the seed has joint 2 at 3.2000 rad, outside [-3.1416, 3.1416]");
}

#[test]
fn a_target_beyond_the_reach_says_how_far() {
    let chain = sets::ur(UrModel::Ur3e);
    let target = Pose::translation(5.0, 0.0, 0.0);
    let error = chain.solve_near(&target, &JointVector::from(HOME), &defaults()).unwrap_err();
    assert_eq!(error, IkError::Unreachable { beyond: 5.0 - chain.reach() });
    let far = Pose::translation(1e300, 1e300, 0.0);
    assert!(matches!(
        chain.solve_near(&far, &JointVector::from(HOME), &defaults()),
        Err(IkError::Unreachable { .. })
    ));
    // Within the sum of all lengths, but still out of reach: the search says what remains.
    let stretched = Pose::translation(0.0, 0.0, chain.reach() - 1e-3);
    let error = chain.solve_near(&stretched, &JointVector::from(HOME), &defaults()).unwrap_err();
    let IkError::NotConverged { iterations, position, .. } = error else { panic!("{error}") };
    assert!(iterations == 40 && position.is_finite() && position > 1e-3);
}

#[test]
fn joints_keep_their_turn() {
    let chain = sets::ur(UrModel::Ur3e);
    // Across 2π: 6.2 → 6.25, not −0.03. And wrist 3 has no end at all.
    for (joint, at, to) in [(0, 6.2, 6.25), (4, -6.27, -6.2), (5, 6.2, 6.35), (5, 300.0, 300.05)] {
        let (mut seed, mut goal) = (JointVector::from(HOME), JointVector::from(HOME));
        (seed[joint], goal[joint]) = (at, to);
        let solution = chain.solve_near(&chain.forward(&goal), &seed, &defaults()).unwrap();
        assert!((solution.q - goal).amax() < 1e-8, "{}", solution.q);
    }
}

#[test]
fn a_turn_that_ends_past_the_limit_is_refused() {
    let chain = sets::ur(UrModel::Ur3e);
    let (mut seed, mut goal) = (JointVector::from(HOME), JointVector::from(HOME));
    (seed[0], goal[0]) = (6.2, 6.4);
    let target = chain.forward(&goal);
    let error = chain.solve_near(&target, &seed, &defaults()).unwrap_err();
    let IkError::LimitViolation { joint: 0, value, upper: TAU, .. } = error else {
        panic!("{error}")
    };
    assert!((value - 6.4).abs() < 1e-8);
    // A cold start may unwind; a control loop, with its speed limit, may not.
    let arm = sets::solver(chain);
    let cold = arm.solve_near(&target, &seed, &defaults()).unwrap();
    assert!(sets::reaches(arm.chain(), &cold.q, &target) && cold.max_step > 1.0);
    let in_time = IkOptions { period: Some(0.002), ..defaults() };
    assert!(matches!(
        arm.solve_near(&target, &seed, &in_time),
        Err(IkError::LimitViolation { joint: 0, .. })
    ));
}

#[test]
fn margins_steps_speeds_and_singular_values_are_gates() {
    let chain = sets::ur(UrModel::Ur3e);
    let seed = JointVector::from(HOME);
    let goal = seed + JointVector::from([0.001, 0.002, -0.003, 0.004, 0.005, 0.02]);
    let target = chain.forward(&goal);
    let solve = |options| chain.solve_near(&target, &seed, &options);
    assert!((solve(defaults()).unwrap().max_step - 0.02).abs() < 1e-8);

    let limit_margin = PI / 2.0 + 0.01;
    let error = solve(IkOptions { limit_margin, ..defaults() }).unwrap_err();
    assert!(
        matches!(error, IkError::LimitViolation { joint: 2, upper, .. } if upper == PI - limit_margin),
        "{error}"
    );
    assert!(solve(IkOptions { limit_margin: PI / 2.0 - 0.01, ..defaults() }).is_ok());

    assert!(solve(IkOptions { max_step: 0.0201, ..defaults() }).is_ok());
    let error = solve(IkOptions { max_step: 0.0199, ..defaults() }).unwrap_err();
    assert!(matches!(error, IkError::Discontinuous { joint: 5, allowed: 0.0199, .. }), "{error}");

    // Wrist 3 turns at 2π rad/s, so 0.02 rad takes 3.2 ms.
    assert!(solve(IkOptions { period: Some(0.0033), ..defaults() }).is_ok());
    let error = solve(IkOptions { period: Some(0.003), ..defaults() }).unwrap_err();
    assert!(matches!(error, IkError::Discontinuous { joint: 5, .. }), "{error}");

    let sigma_min = chain.kinematics(&goal).smallest_singular_value();
    assert!(solve(IkOptions { min_singular_value: sigma_min * 0.999, ..defaults() }).is_ok());
    let error =
        solve(IkOptions { min_singular_value: sigma_min * 1.001, ..defaults() }).unwrap_err();
    assert!(matches!(error, IkError::NearSingular { .. }), "{error}");

    for broken in [
        IkOptions { max_step: f64::NAN, ..defaults() },
        IkOptions { period: Some(f64::NAN), ..defaults() },
        IkOptions { limit_margin: f64::NAN, ..defaults() },
        IkOptions { accept: f64::NAN, ..defaults() },
        IkOptions { min_singular_value: f64::NAN, ..defaults() },
    ] {
        assert!(solve(broken).is_err(), "{broken:?} let a solution pass");
    }
}

#[test]
fn a_redundant_arm_takes_small_steps() {
    let odd = sets::odd_arm();
    let rng = &mut sets::stream(31);
    for _ in 0..500 {
        let goal = sets::configuration(&odd, rng) * 0.9;
        let seed = goal + sets::configuration(&odd, rng) * 0.01;
        let solution = odd
            .solve_near(&odd.forward(&goal), &seed, &defaults())
            .unwrap_or_else(|e| panic!("{e} {goal} {seed}"));
        let (position, rotation) = apart(&odd.forward(&solution.q), &odd.forward(&goal));
        assert!(position <= 1e-9 && rotation <= 1e-9);
        // Of all the ways to get there it takes one that is hardly longer than the shortest known.
        assert!((solution.q - seed).norm() <= (goal - seed).norm() * 1.1);
    }
}

/// Two parallel turns, a slide and a turn of the tool: a SCARA arm, four joints.
fn scara() -> SerialChain<4> {
    let urdf = r#"<robot name="scara">
      <link name="base"/><link name="a"/><link name="b"/><link name="c"/><link name="tool"/>
      <joint name="shoulder" type="revolute"><parent link="base"/><child link="a"/><origin xyz="0 0 0.4"/>
        <axis xyz="0 0 1"/><limit lower="-2.5" upper="2.5" velocity="3" effort="1"/></joint>
      <joint name="elbow" type="revolute"><parent link="a"/><child link="b"/><origin xyz="0.35 0 0"/>
        <axis xyz="0 0 1"/><limit lower="-2.5" upper="2.5" velocity="3" effort="1"/></joint>
      <joint name="quill" type="prismatic"><parent link="b"/><child link="c"/><origin xyz="0.25 0 0"/>
        <axis xyz="0 0 -1"/><limit lower="0" upper="0.2" velocity="1" effort="1"/></joint>
      <joint name="tool" type="revolute"><parent link="c"/><child link="tool"/>
        <axis xyz="0 0 1"/><limit lower="-3" upper="3" velocity="6" effort="1"/></joint>
    </robot>"#;
    SerialChain::from_urdf_str(urdf, "base", "tool").unwrap()
}

#[test]
fn a_short_arm_reaches_what_it_can_and_tracks_what_it_is_asked() {
    let arm = scara();
    let seed = SVector::<f64, 4>::from([0.3, 0.8, 0.1, -0.5]);
    let goal = SVector::<f64, 4>::from([0.35, 0.7, 0.12, -0.4]);
    let target = arm.forward(&goal);
    let solution = arm.solve_near(&target, &seed, &defaults()).unwrap();
    assert!((solution.q - goal).amax() < 1e-8);

    // A tilt is beyond it, and said to be, unless nobody asks for it.
    let tilt = UnitQuaternion::from_scaled_axis(Vector3::new(0.1, 0.0, 0.0));
    let tilted = Pose::from_parts(target.translation, tilt * target.rotation);
    let error = arm.solve_near(&tilted, &seed, &defaults()).unwrap_err();
    assert!(matches!(error, IkError::NotConverged { rotation, .. } if rotation > 0.05), "{error}");
    let positions = IkOptions { task: [true, true, true, false, false, false], ..defaults() };
    let solution = arm.solve_near(&tilted, &seed, &positions).unwrap();
    assert!(
        (arm.forward(&solution.q).translation.vector - target.translation.vector).norm() < 1e-8
    );
    assert!(solution.rotation_error == 0.0);
    // The tool's own turn does not move its origin: left alone.
    assert!((solution.q[3] - seed[3]).abs() < 1e-9);
}

#[test]
fn a_slide_is_not_wound() {
    // A quill of 10 m: 7 m are more than a full turn's worth of radians.
    let urdf = r#"<robot name="rail"><link name="a"/><link name="b"/>
      <joint name="rail" type="prismatic"><parent link="a"/><child link="b"/><axis xyz="1 0 0"/>
        <limit lower="0" upper="10" velocity="1" effort="1"/></joint></robot>"#;
    let rail = SerialChain::<1>::from_urdf_str(urdf, "a", "b").unwrap();
    let solution =
        rail.solve_near(&Pose::translation(8.0, 0.0, 0.0), &[1.0].into(), &defaults()).unwrap();
    assert!((solution.q[0] - 8.0).abs() < 1e-8);
}
