//! What the shield says and does, case by case.
#![expect(clippy::unwrap_used, reason = "our own limits load")]

mod support;

use palpate_kinematics::Frame;
use palpate_robot_io::RobotState;
use palpate_safety::Cause;
use palpate_safety::shield::{Proposal, Shield, Standing};
use palpate_safety::{Mode, Refusal, SafetyConfig, Verdict};
use palpate_spatial::{JointVector, Pose, Twist, Vector3, Wrench, integrate};
use support::{DT, chain, home, preset, sample, tool0_T_tool, wide};

/// A shield with an arm that follows at once.
struct Rig {
    shield: Shield,
    q: JointVector,
    time: f64,
    wrench: Wrench,
    /// Where the next tool command starts from.
    reference: Pose,
}

impl Rig {
    fn new(safety: &SafetyConfig, q: JointVector) -> Self {
        let mut shield = Shield::new(safety, chain(), &tool0_T_tool(), DT).unwrap();
        shield.begin_episode();
        Self { shield, q, time: 0.0, wrench: Wrench::zero(), reference: chain().forward(&q) }
    }

    fn propose(&mut self, proposal: &Proposal) -> palpate_safety::shield::Decision {
        self.time += DT;
        let m = sample(&chain(), self.time, &self.q, &self.q, self.wrench);
        let decision = self.shield.tick(&m, proposal);
        self.q = decision.executed;
        decision
    }

    /// One tick of a tool velocity.
    fn twist(&mut self, v: Vector3) -> palpate_safety::shield::Decision {
        let twist = Twist::new(v, Vector3::zeros());
        let next = integrate(&self.reference, &twist, DT);
        let decision = self.propose(&Proposal::Pose(next));
        let accepted = decision.verdict == Verdict::Accepted;
        let here = if accepted { next } else { self.reference };
        self.reference = decision.governed.unwrap_or(here);
        decision
    }

    fn moving(&mut self) -> f64 {
        for _ in 0..100 {
            let _ = self.twist(Vector3::new(0.0, 0.0, 0.05));
        }
        self.shield.motion().unwrap().v.norm()
    }
}

#[test]
fn a_smooth_command_passes_unchanged_and_leaves_no_trace_in_the_ledger() {
    let mut rig = Rig::new(&preset(), home());
    let mut pose = chain().forward(&home());
    for tick in 1..=100 {
        // 1 − cos: starts without a jerk that needs shaping.
        let speed = 0.02 * (1.0 - (f64::from(tick) * 0.02).cos());
        pose.translation.z += speed * DT;
        let decision = rig.propose(&Proposal::Pose(pose));
        assert_eq!(
            (decision.verdict, decision.cause, decision.governed),
            (Verdict::Accepted, None, None)
        );
        assert_eq!(Some(decision.executed), decision.proposed);
        assert!(
            (chain().forward(&rig.q).translation.vector - pose.translation.vector).norm() < 1e-6
        );
    }
    assert!(rig.shield.ledger().counts().iter().all(|(_, n)| n == 0));
}

#[test]
fn a_step_in_speed_is_shaped_without_leaving_its_line() {
    let mut rig = Rig::new(&preset(), home());
    let start = chain().forward(&home()).translation.vector;
    let mut causes = Vec::new();
    for _ in 0..400 {
        causes.push(rig.twist(Vector3::new(0.02, 0.01, 0.03)).cause);
        let way = chain().forward(&rig.q).translation.vector - start;
        let along = Vector3::new(0.02, 0.01, 0.03).normalize();
        assert!((way - along * way.dot(&along)).norm() < 2e-5, "{way:?}");
    }
    assert_eq!(causes[0], Some(Cause::Shaped));
    assert_eq!(causes[399], None, "at full speed");
    let way = (chain().forward(&rig.q).translation.vector - start).norm();
    assert!(way > 0.8 * 0.0374 * 400.0 * DT, "{way}");
}

#[test]
fn a_path_of_joints_is_caught_up_with() {
    let mut rig = Rig::new(&preset(), home());
    let (mut path, mut points) = (home(), 0);
    while points < 300 {
        // A timed path waits while it is slowed.
        let decision = rig.propose(&Proposal::Joints(path));
        assert_eq!(decision.verdict, Verdict::Accepted);
        if !decision.cause.is_some_and(Cause::is_slowed) {
            path += JointVector::from([0.3, -0.1, 0.2, 0.0, 0.1, -0.5]) * DT;
            points += 1;
        }
    }
    for _ in 0..300 {
        let _ = rig.propose(&Proposal::Joints(path));
    }
    assert!((rig.q - path).amax() < 1e-9, "{}", (rig.q - path).amax());
    assert_eq!(rig.shield.standing(), Standing::AtRest);
}

#[test]
fn a_refused_command_becomes_a_brake_and_not_a_frozen_set_point() {
    let mut rig = Rig::new(&preset(), home());
    let before = rig.moving();
    let mut far = chain().forward(&home());
    far.translation.x += 5.0;
    let decision = rig.propose(&Proposal::Pose(far));
    assert!(matches!(decision.verdict, Verdict::Refused(Refusal::ToolJump { .. })), "{decision:?}");
    let first = rig.shield.motion().unwrap().v.norm();
    assert!(first > 0.5 * before, "a frozen set-point would be a stop within one tick");
    let mut ticks = 1;
    while rig.shield.standing() != Standing::AtRest {
        let _ = rig.propose(&Proposal::Pose(far));
        ticks += 1;
        assert!(ticks < 100);
    }
    assert!(ticks > 5);
    assert!(decision.governed.is_some(), "the next command should start where the arm is");
    let entry = rig.shield.ledger().entries().last().unwrap();
    assert_eq!((entry.cause, entry.executed), (Cause::Branch, decision.executed));
    assert_eq!(entry.ticks, ticks);
}

#[test]
fn the_tool_stays_in_its_box_and_may_leave_the_wall() {
    let mut rig = Rig::new(&preset(), home());
    let mut slowed = 0;
    for _ in 0..3000 {
        let decision = rig.twist(Vector3::new(0.1, 0.0, 0.0));
        assert_eq!(decision.verdict, Verdict::Accepted, "it settles before the wall");
        slowed += u32::from(decision.cause == Some(Cause::SlowedByObstacle));
    }
    let reached = chain().forward(&rig.q).translation.vector;
    let x = reached.x;
    assert!(slowed > 1000 && x <= 0.43 && x > 0.429, "{slowed} times, {x}");
    let start = chain().forward(&home()).translation.vector;
    assert!((reached - start).yz().norm() < 1e-3, "straight ahead: {reached} from {start}");
    for _ in 0..500 {
        let _ = rig.twist(Vector3::new(-0.05, 0.0, 0.0));
    }
    assert!(chain().forward(&rig.q).translation.x < x - 0.035);
    // Along the wall it is as free as anywhere.
    let before = chain().forward(&rig.q).translation.y;
    for _ in 0..500 {
        let _ = rig.twist(Vector3::new(0.0, -0.05, 0.0));
    }
    assert!(chain().forward(&rig.q).translation.y < before - 0.035);
}

#[test]
fn an_arm_that_starts_outside_its_box_may_come_in_but_not_go_farther_out() {
    let mut safety = preset();
    safety.shield.as_mut().unwrap().workspace.max.z = 0.14;
    let mut rig = Rig::new(&safety, home());
    let start = chain().forward(&home()).translation.z;
    assert!(start > 0.141);
    for _ in 0..200 {
        let _ = rig.twist(Vector3::new(0.0, 0.0, 0.02));
    }
    assert!(chain().forward(&rig.q).translation.z <= start + 1e-9);
    for _ in 0..200 {
        let _ = rig.twist(Vector3::new(0.0, 0.0, -0.02));
    }
    assert!(chain().forward(&rig.q).translation.z < start - 0.003);
}

/// |det J| at a configuration.
fn manipulability(q: &JointVector) -> f64 {
    chain().kinematics(q).jacobian(Frame::BaseAligned).determinant().abs()
}

#[test]
fn the_way_to_a_singularity_slows_down_and_the_way_out_does_not() {
    let mut safety = wide();
    let shield = safety.shield.as_mut().unwrap();
    (shield.workspace.min, shield.workspace.max) = (Vector3::repeat(-1.0), Vector3::repeat(1.0));
    let stop = safety.shield.as_ref().unwrap().singularity.stop_below;
    let mut rig = Rig::new(&safety, home());
    // Up and out until the elbow is nearly straight.
    let out = Vector3::new(0.05, 0.0, 0.04);
    let mut slowed = 0;
    for _ in 0..6000 {
        slowed += u32::from(rig.twist(out).cause == Some(Cause::SlowedBySingularity));
    }
    let near = manipulability(&rig.q);
    assert!(slowed > 20 && near < 3.0 * stop && near > 0.5 * stop, "{slowed} times, {near:.2e}");
    let here = chain().forward(&rig.q).translation.vector;
    for _ in 0..1000 {
        assert_ne!(rig.twist(-out).cause, Some(Cause::SlowedBySingularity));
    }
    let back = chain().forward(&rig.q).translation.vector;
    assert!((back - here).norm() > 0.08, "it left at full speed: {} m", (back - here).norm());
}

#[test]
fn a_branch_flip_is_refused() {
    let mut rig = Rig::new(&wide(), home());
    let mut flipped = home();
    flipped[3] += std::f64::consts::PI;
    flipped[4] *= -1.0;
    flipped[5] += std::f64::consts::PI;
    let decision = rig.propose(&Proposal::Joints(flipped));
    assert!(
        matches!(decision.verdict, Verdict::Refused(Refusal::Jump { joint: 3, .. })),
        "{decision:?}"
    );
    // The same tool pose half a turn away can be reached only by a jump.
    let mut turned = chain().forward(&home());
    turned.rotation *= palpate_spatial::UnitQuaternion::from_axis_angle(&Vector3::x_axis(), 1.0);
    let decision = rig.propose(&Proposal::Pose(turned));
    assert!(matches!(decision.cause, Some(Cause::Branch | Cause::NoIk)), "{decision:?}");
    assert_eq!(rig.q, home());
}

#[test]
fn a_joint_that_does_not_follow_makes_the_arm_brake() {
    let mut rig = Rig::new(&preset(), home());
    let _ = rig.moving();
    let mut behind = rig.q;
    behind[2] -= 0.11;
    let m = sample(&chain(), 9.0, &behind, &rig.q, Wrench::zero());
    let decision = rig.shield.tick(&m, &Proposal::Joints(rig.q));
    assert!(
        matches!(decision.verdict, Verdict::Refused(Refusal::Tracking { joint: 2, .. })),
        "{decision:?}"
    );
}

#[test]
fn a_force_that_rises_too_fast_brakes_before_it_is_there() {
    let mut rig = Rig::new(&preset(), home());
    let _ = rig.moving();
    // Slowly up to 10 N, then by 1.5 N in one tick: 10 ticks ahead that is 11.5 N + 10 · 1.5 N.
    while rig.wrench.force.z < 10.0 {
        rig.wrench.force.z += 0.1;
        let verdict = rig.twist(Vector3::new(0.0, 0.0, 0.01)).verdict;
        assert_eq!(verdict, Verdict::Accepted);
    }
    rig.wrench.force.z += 1.5;
    let decision = rig.twist(Vector3::new(0.0, 0.0, 0.01));
    assert!(
        matches!(decision.verdict, Verdict::Refused(Refusal::ForceRising(e)) if e.axis == 2),
        "{decision:?}"
    );
    let decision = rig.twist(Vector3::new(0.0, 0.0, 0.01));
    assert_eq!(decision.verdict, Verdict::Accepted, "11.5 N and steady is no reason to stop");
}

#[test]
fn no_tick_allocates() {
    let mut rig = Rig::new(&preset(), home());
    let _ = rig.moving();
    let up = chain().forward(&rig.q);
    let mut far = up;
    far.translation.x += 3.0;
    let mut wall = home();
    wall[0] += 0.05;
    let nan = Pose::from_parts(Vector3::repeat(f64::NAN).into(), up.rotation);
    let allocations = allocation_counter::measure(|| {
        for tick in 0..6000 {
            let proposal = match tick % 600 {
                0..200 => Proposal::Pose(integrate(
                    &up,
                    &Twist::new(Vector3::new(0.1, 0.02, 0.0), Vector3::zeros()),
                    f64::from(tick % 200) * DT,
                )),
                200..300 => Proposal::Pose(far),
                300..400 => Proposal::Joints(wall),
                400..450 => Proposal::Pose(nan),
                _ => Proposal::Rest,
            };
            rig.wrench.force.x = if tick == 3000 { 95.0 } else { 0.0 };
            // The sample of tick 1000 comes late.
            let time = f64::from(tick) * DT + if tick >= 1000 { 0.1 } else { 0.0 };
            let m = palpate_safety::Measurement {
                state: RobotState {
                    time,
                    q: rig.q,
                    dq: JointVector::zeros(),
                    q_target: rig.q,
                    sensor_wrench: rig.wrench,
                },
                base_T_tool: up,
                tool_twist: Twist::zero(),
                wrench: rig.wrench,
                raw_wrench: rig.wrench,
            };
            let _ = rig.shield.watch(&m.state);
            rig.q = rig.shield.tick(&m, &proposal).executed;
            if tick == 4000 {
                rig.shield.begin_reset();
            }
        }
    });
    assert_eq!(allocations.count_total, 0);
    let counts = rig.shield.ledger().counts();
    for cause in [
        Cause::Branch,
        Cause::NonFinite,
        Cause::Stopped,
        Cause::ForceHard,
        Cause::Shaped,
        Cause::Implausible,
    ] {
        assert!(counts.of(cause) > 0, "{cause:?} did not happen");
    }
    assert_eq!(preset().mode, Mode::Shield);
}

/// Asked for 0.25 m/s along x and z.
#[test]
fn a_path_of_joints_is_no_faster_than_the_force_that_is_left_allows() {
    let safety = preset();
    let force = safety.shield.as_ref().unwrap().force;
    let mut rig = Rig::new(&safety, home());
    rig.shield.begin_reset();
    let goal = integrate(
        &chain().forward(&home()),
        &Twist::new(Vector3::new(0.05, 0.0, 0.05), Vector3::zeros()),
        1.0,
    );
    let options = palpate_kinematics::IkOptions::default();
    let q = chain().solve_near(&goal, &home(), &options).unwrap().q;
    let bound = force.aim_ratio * safety.reset.force_max / (force.stiffness * force.reaction_time);
    let mut fastest = 0.0f64;
    for tick in 0..400 {
        let part = (f64::from(tick) / 100.0).min(1.0);
        let _ = rig.propose(&Proposal::Joints(home() + (q - home()) * part));
        let J = chain().kinematics(&rig.q).jacobian(Frame::BaseAligned);
        let v = J * rig.shield.motion().unwrap().v;
        fastest = fastest.max(v.fixed_rows::<3>(0).amax());
    }
    assert!(fastest < 1.05 * bound, "{fastest} m/s, {bound} are allowed");
    assert!(fastest > 0.5 * bound, "{fastest} m/s of {bound}: it does move");
}
