//! Algorithm 1 of the paper, transcribed, against the layer.
#![expect(clippy::unwrap_used, reason = "our own arm loads")]

use std::cell::Cell;
use std::rc::Rc;

use palpate_kinematics::{IkOptions, SerialChain};
use palpate_robot_io::{IdealArm, IdealArmError, JointCommand, RobotBackend, RobotState};
use palpate_safety::{
    Measurement, Mode, Refusal, ResetLimits, Safe, SafetyConfig, SpeedReference, Verdict,
};
use palpate_spatial::{DOF, JointVector, Pose, UnitQuaternion, Vector3, Wrench};
use proptest::prelude::*;
use rand::{Rng as _, SeedableRng};
use rand_chacha::ChaCha8Rng;

const HOME: [f64; 6] = [0.0, -1.57, 1.57, -1.57, -1.57, 0.0];
const URDF: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../../assets/robots/ur3e.urdf");

/// An ideal arm whose sensor carries a load that taring does not remove.
#[derive(Debug)]
struct Loaded(IdealArm);

impl RobotBackend for Loaded {
    type Error = IdealArmError;
    fn period(&self) -> std::time::Duration {
        self.0.period()
    }
    fn read(&mut self) -> Result<RobotState, Self::Error> {
        self.0.read()
    }
    fn write(&mut self, command: &JointCommand) -> Result<(), Self::Error> {
        self.0.write(command)
    }
    fn stop(&mut self) -> Result<(), Self::Error> {
        self.0.stop()
    }
    fn recover(&mut self) -> Result<(), Self::Error> {
        self.0.recover()
    }
    fn tare(&mut self) -> Result<(), Self::Error> {
        Ok(())
    }
}

fn chain() -> SerialChain<DOF> {
    SerialChain::from_urdf_file(URDF, "base_link", "tool0").unwrap()
}

fn limits(mode: Mode) -> SafetyConfig {
    SafetyConfig {
        mode,
        force_max: 25.0,
        torque_max: 2.0,
        joint_velocity_max: JointVector::from_element(1.0),
        speed_reference: SpeedReference::Commanded,
        force_filter_cutoff: 50.0,
        ledger_entries: 100,
        reset: ResetLimits { force_max: 60.0, torque_max: 6.0 },
        shield: None,
    }
}

/// A robot in an episode, its filter settled on a load of `force_z` (N) along tool z.
fn loaded(chain: &SerialChain<DOF>, mode: Mode, force_z: f64) -> Safe<Loaded> {
    let mut arm = IdealArm::at(HOME.into());
    arm.load = Wrench::new(Vector3::new(0.0, 0.0, force_z), Vector3::zeros());
    let mut robot = Safe::new(Loaded(arm), chain.clone(), Pose::identity(), limits(mode)).unwrap();
    robot.begin_episode().unwrap();
    for _ in 0..40 {
        robot.sense().unwrap();
    }
    robot
}

fn home(chain: &SerialChain<DOF>) -> Pose {
    chain.forward(&HOME.into())
}

fn moved(pose: &Pose, x: f64, y: f64, z: f64) -> Pose {
    let mut pose = *pose;
    pose.translation.vector += Vector3::new(x, y, z);
    pose
}

/// An ideal arm whose load and last command can be seen and set from outside.
#[derive(Debug)]
struct Open(IdealArm, Rc<Cell<Wrench>>);

impl RobotBackend for Open {
    type Error = IdealArmError;
    fn period(&self) -> std::time::Duration {
        self.0.period()
    }
    fn read(&mut self) -> Result<RobotState, Self::Error> {
        self.0.load = self.1.get();
        self.0.read()
    }
    fn write(&mut self, command: &JointCommand) -> Result<(), Self::Error> {
        self.0.write(command)
    }
    fn stop(&mut self) -> Result<(), Self::Error> {
        self.0.stop()
    }
    fn recover(&mut self) -> Result<(), Self::Error> {
        self.0.recover()
    }
    fn tare(&mut self) -> Result<(), Self::Error> {
        Ok(())
    }
}

/// Lines 12–19 of Algorithm 1 for one tick, as printed; `actuate` gets the joints that are sent.
fn transcription(
    chain: &SerialChain<DOF>,
    x_c: &Pose,
    m: &Measurement,
    l: &SafetyConfig,
    mut actuate: impl FnMut(JointVector),
) -> &'static str {
    let q_t =
        if l.speed_reference == SpeedReference::Measured { m.state.q } else { m.state.q_target };
    // 12: q_c = IK(x_c); 13: if it does not exist, continue
    let Ok(solution) = chain.solve_near(x_c, &m.state.q_target, &IkOptions::default()) else {
        return "continue";
    };
    let q_c = solution.q;
    // 14: if |q_t - q_c| / dt > q̇_max, continue
    for j in 0..6 {
        if ((q_t[j] - q_c[j]) / 0.002).abs() > l.joint_velocity_max[j] {
            return "continue";
        }
    }
    // 16: if F_ext > F_max in any direction, break
    for i in 0..3 {
        if m.wrench.force[i].abs() > l.force_max || m.wrench.torque[i].abs() > l.torque_max {
            return "break";
        }
    }
    // 18: actuate
    actuate(q_c);
    "actuate"
}

/// 10⁶ random commands and loads, one after another, against the transcription: the word and the set-point.
#[test]
fn paper_mode_is_the_transcription() {
    let chain = chain();
    let rng = &mut ChaCha8Rng::seed_from_u64(1);
    let mut said = [0u32; 3];
    for speed_reference in [SpeedReference::Measured, SpeedReference::Commanded] {
        let load = Rc::new(Cell::new(Wrench::zero()));
        let arm = Open(IdealArm::at(HOME.into()), Rc::clone(&load));
        let config = SafetyConfig { speed_reference, ..limits(Mode::Paper) };
        let mut robot = Safe::new(arm, chain.clone(), Pose::identity(), config).unwrap();
        robot.begin_episode().unwrap();
        let random = |rng: &mut ChaCha8Rng| Vector3::from_fn(|_, _| rng.random_range(-1.0..1.0));
        for _ in 0..500_000 {
            if rng.random_bool(0.02) {
                load.set(Wrench::new(random(rng) * 40.0, random(rng) * 3.0));
            }
            let m = robot.sense().unwrap();
            let size = [1e-4, 1e-3, 2e-3, 4e-3, 0.1, 2.0][rng.random_range(0..6)];
            let here = chain.forward(&m.state.q_target);
            let back = (home(&chain).translation.vector - here.translation.vector) * 1e-3;
            let x_c = Pose::from_parts(
                (here.translation.vector + random(rng) * size + back).into(),
                UnitQuaternion::from_scaled_axis(random(rng) * size) * here.rotation,
            );
            let mut sent = m.state.q_target;
            let expected = transcription(&chain, &x_c, &m, robot.limits(), |q_c| sent = q_c);
            let word = match robot.command(&x_c).unwrap() {
                Verdict::Accepted => "actuate",
                Verdict::Refused(_) => "continue",
                Verdict::ForceExceeded(_) => "break",
            };
            assert_eq!(word, expected);
            assert_eq!(robot.sense().unwrap().state.q_target, sent, "after {word}");
            said[["actuate", "continue", "break"].iter().position(|w| *w == word).unwrap()] += 1;
            if word == "break" {
                load.set(Wrench::zero());
                robot.begin_reset();
                robot.begin_episode().unwrap();
            }
        }
    }
    assert!(said.iter().all(|&n| n > 1_000), "{said:?}");
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(2000))]

    #[test]
    fn nothing_non_finite_is_ever_accepted(
        lane in 0usize..7,
        bad in prop::sample::select(vec![f64::NAN, f64::INFINITY, f64::NEG_INFINITY]),
    ) {
        let chain = chain();
        for mode in [Mode::Paper, Mode::ForceFirst] {
            let mut robot = loaded(&chain, mode, 0.0);
            let mut pose = home(&chain);
            if lane < 3 {
                pose.translation.vector[lane] = bad;
            } else {
                let mut q = *pose.rotation.quaternion();
                q.coords[lane - 3] = bad;
                pose.rotation = UnitQuaternion::new_unchecked(q);
            }
            prop_assert_eq!(robot.command(&pose).unwrap(), Verdict::Refused(Refusal::NonFinite));
            let mut q: JointVector = HOME.into();
            q[lane % 6] = bad;
            prop_assert_eq!(robot.command_joints(&q).unwrap(), Verdict::Refused(Refusal::NonFinite));
            prop_assert_eq!(robot.tally().non_finite, 2);
            prop_assert_eq!(robot.sense().unwrap().state.q_target, JointVector::from(HOME));
        }
    }
}

#[test]
fn an_accepted_command_moves_the_arm_there() {
    let chain = chain();
    let mut robot = loaded(&chain, Mode::ForceFirst, 0.0);
    let goal = moved(&home(&chain), 0.0, 0.0, 1e-4);
    assert_eq!(robot.command(&goal).unwrap(), Verdict::Accepted);
    for _ in 0..50 {
        robot.sense().unwrap();
    }
    let reached = robot.sense().unwrap().base_T_tool;
    assert!((reached.translation.vector - goal.translation.vector).norm() < 1e-7);
}

#[test]
fn a_refused_command_leaves_the_arm_where_it_is_and_is_counted_by_cause() {
    let chain = chain();
    let mut robot = loaded(&chain, Mode::Paper, 0.0);
    let far = robot.command(&moved(&home(&chain), 5.0, 0.0, 0.0)).unwrap();
    assert!(matches!(far, Verdict::Refused(Refusal::NoIk(_))), "{far:?}");
    let fast = robot.command(&moved(&home(&chain), 0.02, 0.0, 0.0)).unwrap();
    assert!(matches!(fast, Verdict::Refused(Refusal::JointSpeed { .. })), "{fast:?}");
    assert_eq!((robot.tally().no_ik, robot.tally().joint_speed), (1, 1));
    assert_eq!(robot.sense().unwrap().state.q, JointVector::from(HOME));
}

#[test]
fn the_force_limit_latches_until_the_next_reset() {
    let chain = chain();
    let step = moved(&home(&chain), 0.0, 0.0, 1e-4);
    for mode in [Mode::Paper, Mode::ForceFirst] {
        let mut robot = loaded(&chain, mode, 30.0);
        for _ in 0..3 {
            assert!(
                matches!(robot.command(&step).unwrap(), Verdict::ForceExceeded(e) if e.axis == 2),
                "{mode:?}"
            );
        }
        assert_eq!(robot.tally().force, 1, "counted once per latch");
        assert_eq!(robot.sense().unwrap().state.q, JointVector::from(HOME));
        robot.begin_reset();
        assert_eq!(
            robot.command(&step).unwrap(),
            Verdict::Accepted,
            "30 N is within the reset limit"
        );
    }
}

#[test]
fn paper_mode_skips_the_force_check_of_a_refused_command_and_force_first_does_not() {
    let chain = chain();
    let far = moved(&home(&chain), 5.0, 0.0, 0.0);
    let said = |mode| loaded(&chain, mode, 30.0).command(&far).unwrap();
    assert!(matches!(said(Mode::Paper), Verdict::Refused(_)));
    assert!(matches!(said(Mode::ForceFirst), Verdict::ForceExceeded(_)));
}

#[test]
fn a_sample_that_is_not_finite_stops_the_arm() {
    let mut arm = IdealArm::at(HOME.into());
    arm.load.torque.y = f64::NAN;
    let mut robot = Safe::new(arm, chain(), Pose::identity(), limits(Mode::ForceFirst)).unwrap();
    assert!(robot.sense().is_err());
    assert!(robot.command_joints(&HOME.into()).is_err(), "no command before a good sample");
}

#[test]
fn the_wrench_is_moved_to_the_tool_centre_point_and_turned_to_base_axes() {
    let mut arm = IdealArm::at(HOME.into());
    let tip = Vector3::new(0.0, 0.0, 0.15);
    // 4 N along tool x at the tip: a pure force there, a torque at the sensor.
    let force = Vector3::new(4.0, 0.0, 0.0);
    arm.load = Wrench::new(force, tip.cross(&force));
    let tool0_T_tool = Pose::from_parts(tip.into(), UnitQuaternion::identity());
    let mut robot = Safe::new(arm, chain(), tool0_T_tool, limits(Mode::ForceFirst)).unwrap();
    let m = robot.sense().unwrap();
    assert!(m.raw_wrench.torque.norm() < 1e-12);
    assert!((m.raw_wrench.force - m.base_T_tool.rotation * force).norm() < 1e-12);
    assert!((m.raw_wrench.force - force).norm() > 1.0, "tool axes are not base axes here");
}

#[test]
fn limits_that_make_no_sense_are_refused_by_name() {
    let build = |change: fn(&mut SafetyConfig)| {
        let mut config = limits(Mode::ForceFirst);
        change(&mut config);
        Safe::new(IdealArm::at(HOME.into()), chain(), Pose::identity(), config)
            .map(|_| ())
            .unwrap_err()
            .to_string()
    };
    let loose = build(|c| c.joint_velocity_max[3] = 7.0);
    assert!(loose.contains("joint_velocity_max[3]") && loose.contains("6.28"), "{loose}");
    assert!(build(|c| c.force_max = f64::NAN).contains("force_max"));
    assert!(build(|c| c.force_filter_cutoff = 300.0).contains("250"));
}
