//! The control program that palpate-ur uploads, run here: what the client promises is what the arm does.

#![expect(clippy::unwrap_used, reason = "a helper that cannot go on fails its test")]

use palpate_kinematics::UrModel;
use palpate_spatial::JointVector;
use palpate_ur::proto::{RuntimeState, SafetyStatus};
use palpate_ur::{Payload, UrConfig, control_program};
use palpate_virtual_ur::controller::DT;
use palpate_virtual_ur::{Controller, ControllerConfig, LaggedArm};

const HOME: [f64; 6] = [0.0, -1.57, 1.57, -1.57, -1.57, 0.0];
const TOKEN: i32 = 4711;

const IDLE: i32 = 0;
const SERVO: i32 = 1;
const STOP: i32 = 2;
const TARE: i32 = 3;
const END: i32 = 4;

/// The client's side of the registers, without its network.
struct Client {
    robot: Controller,
    sequence: i32,
}

impl Client {
    fn new(config: &UrConfig) -> Self {
        let plant = Box::new(LaggedArm::at(HOME.into()));
        let mut robot = Controller::new(ControllerConfig::new(UrModel::Ur3e), plant).unwrap();
        robot.run_script(&control_program(config, TOKEN));
        robot.tick();
        let events = robot.take_events();
        assert_eq!(robot.runtime(), RuntimeState::Playing, "{events:?}");
        Self { robot, sequence: 0 }
    }

    fn write(&mut self, mode: i32, q: &JointVector) {
        self.sequence += 1;
        let now = self.robot.ticks();
        let registers = self.robot.registers_mut();
        registers.input.ints[24] = mode;
        registers.input.ints[25] = self.sequence;
        registers.input.ints[26] = TOKEN;
        registers.input.floats[24..30].copy_from_slice(q.as_slice());
        let check = q.iter().fold(f64::from(self.sequence), |sum, x| sum + x);
        registers.input.floats[30] = check;
        registers.touch("input_int_register_25", now);
    }

    fn tick(&mut self) {
        self.robot.tick();
    }

    fn step(&mut self, mode: i32, q: &JointVector) {
        self.write(mode, q);
        self.tick();
    }

    /// Version, sequence, status, tares, reason.
    fn report(&self) -> [i32; 5] {
        let ints = &self.robot.registers().output.ints;
        [ints[24], ints[25], ints[26], ints[29], ints[30]]
    }

    fn status(&self) -> i32 {
        self.report()[2]
    }

    fn q(&self) -> JointVector {
        self.robot.actual().q
    }

    /// Streams joint 6 at `speed` for so many cycles; the last set-point.
    fn stream(&mut self, speed: f64, cycles: u32) -> JointVector {
        let mut q = self.robot.target().q;
        for _ in 0..cycles {
            q[5] += speed * DT;
            self.step(SERVO, &q);
        }
        q
    }
}

#[test]
fn it_reports_and_follows() {
    let mut client = Client::new(&UrConfig::at("robot"));
    let home = client.q();
    client.step(IDLE, &home);
    assert_eq!(client.report(), [1, 1, 1, 0, 0]);
    let goal = client.stream(0.5, 200);
    assert_eq!((client.status(), client.report()[1]), (2, client.sequence));
    (0..150).for_each(|_| client.step(SERVO, &goal));
    assert!((client.q() - goal).amax() < 1e-4, "{}", client.q() - goal);
    assert_eq!(client.robot.safety(), SafetyStatus::Normal);
}

#[test]
fn silence_brakes_the_arm_and_motion_never_resumes_by_itself() {
    let mut client = Client::new(&UrConfig::at("robot"));
    let home = client.q();
    client.step(IDLE, &home);
    client.stream(0.5, 200);
    let last = client.q();
    assert!((client.robot.actual().dq[5] - 0.5).abs() < 0.01);
    (0..200).for_each(|_| client.tick());
    let turned = (client.q() - last).amax().to_degrees();
    assert!(turned <= 1.3, "{turned}° after the last packet at 0.5 rad/s");
    assert_eq!((client.status(), client.robot.target().dq), (6, JointVector::zeros()));
    // The stream comes back: nothing moves until idle is asked for.
    let rest = client.q();
    for _ in 0..100 {
        client.step(SERVO, &rest.add_scalar(0.001));
    }
    assert_eq!(client.status(), 6);
    assert!((client.q() - rest).amax() < 1e-6);
    client.step(IDLE, &rest);
    client.step(SERVO, &rest);
    assert_eq!(client.status(), 2);
}

#[test]
fn stop_tare_and_end() {
    let config = UrConfig {
        payload: Some(Payload { mass: 0.3, cog: [0.0, 0.0, 0.05] }),
        tcp: Some([0.0, 0.0, 0.15, 0.0, 0.0, 0.0]),
        ..UrConfig::at("robot")
    };
    let mut client = Client::new(&config);
    let home = client.q();
    client.step(IDLE, &home);
    client.step(TARE, &home);
    for _ in 0..60 {
        client.step(TARE, &home);
    }
    assert_eq!(client.report()[3], 1, "one tare per request");
    client.step(IDLE, &home);
    client.stream(0.5, 100);
    let q = client.q();
    client.step(STOP, &q);
    (0..100).for_each(|_| client.step(STOP, &q));
    assert_eq!((client.status(), client.robot.target().dq), (5, JointVector::zeros()));
    client.step(IDLE, &q);
    client.step(END, &q);
    (0..10).for_each(|_| client.step(END, &q));
    assert_eq!((client.status(), client.robot.runtime()), (8, RuntimeState::Stopped));
}

#[test]
fn what_is_not_whole_far_or_not_ours_is_refused() {
    let fresh = || {
        let mut client = Client::new(&UrConfig::at("robot"));
        let home = client.q();
        client.step(IDLE, &home);
        (client, home)
    };
    // A check value that does not fit.
    let (mut client, home) = fresh();
    client.write(SERVO, &home);
    client.robot.registers_mut().input.floats[30] += 1.0;
    client.tick();
    assert_eq!(client.report()[2..], [7, 0, 1]);
    // A first set-point far away.
    let (mut client, home) = fresh();
    client.step(SERVO, &home.add_scalar(0.1));
    assert_eq!(client.report()[2..], [7, 0, 2]);
    // A jump in the stream: refused, and the arm comes to rest near where it was.
    let (mut client, _) = fresh();
    let q = client.stream(0.2, 100);
    client.step(SERVO, &q.add_scalar(0.2));
    (0..100).for_each(|_| client.tick());
    assert_eq!(client.report()[2..], [7, 0, 3]);
    assert!((client.q() - q).amax() < 0.02 && client.robot.safety() == SafetyStatus::Normal);
    // NaN counts as far, whichever joint.
    for joint in 0..6 {
        let (mut client, mut q) = fresh();
        q[joint] = f64::NAN;
        client.step(SERVO, &q);
        (0..20).for_each(|_| client.tick());
        assert_eq!(client.status(), 7, "joint {joint}");
        assert_eq!(client.robot.target().q, JointVector::from(HOME));
    }
    // Another connection's leftovers.
    let (mut client, home) = fresh();
    client.write(SERVO, &home);
    client.robot.registers_mut().input.ints[26] = TOKEN + 1;
    client.tick();
    assert_eq!(client.status(), 1);
}

#[test]
fn the_controllers_watchdog_is_the_second_line() {
    let mut client = Client::new(&UrConfig::at("robot"));
    let home = client.q();
    client.step(IDLE, &home);
    (0..499).for_each(|_| client.tick());
    assert_eq!(client.robot.runtime(), RuntimeState::Playing);
    (0..5).for_each(|_| client.tick());
    assert_eq!(client.robot.runtime(), RuntimeState::Stopped);
}

#[test]
fn a_protective_stop_ends_it_for_good() {
    let mut client = Client::new(&UrConfig::at("robot"));
    let home = client.q();
    client.step(IDLE, &home);
    client.stream(0.5, 100);
    client.robot.protective_stop(palpate_virtual_ur::controller::StopCause::Requested);
    (0..50).for_each(|_| client.tick());
    let rest = client.q();
    client.stream(0.5, 200);
    assert!((client.q() - rest).amax() < 1e-9);
    assert_eq!(client.robot.runtime(), RuntimeState::Stopped);
}
