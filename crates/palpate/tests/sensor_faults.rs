//! What the user of an arm gets when its force/torque sensor fails: the table of docs/virtual-ur.md, its last rows.
//!
//! The client behind the fail-safe layer in shield mode, as `train-real` has it, against the virtual controller with
//! contact. Commanded joints stay continuous in all of them.
#![expect(clippy::unwrap_used, reason = "helpers of tests")]

use std::f64::consts::PI;

use palpate::Config;
use palpate::config::Choice;
use palpate::stack::chain;
use palpate::virtual_ur::{Setup, controller};
use palpate_robot_io::FaultKind;
use palpate_safety::shield::{Implausible, Standing};
use palpate_safety::{Safe, SafeError, Verdict};
use palpate_spatial::{JointVector, Pose};
use palpate_ur::proto::SafetyStatus;
use palpate_ur::{Ports, UrArm, UrConfig, UrError};
use palpate_virtual_ur::controller::SensorFault;
use palpate_virtual_ur::{Fault, Handle, Port};

const DT: f64 = 0.002;
/// Joint speed, rad/s.
const SPEED: f64 = 0.3;

struct Rig {
    robot: Handle,
    safe: Safe<UrArm>,
    q: JointVector,
    /// Executed set-points.
    executed: Vec<JointVector>,
}

/// How it ended.
enum End {
    Stopped(SafeError<UrError>),
    Force,
    Never,
}

impl Rig {
    /// A tared arm at home, in free air.
    fn new() -> Self {
        let choice = Choice {
            preset: "palpate".into(),
            task: "peg-insertion".into(),
            model: "P-14".into(),
            ..Choice::default()
        };
        let setup = Setup { address: [127, 0, 0, 1].into(), any_ports: true, faults: Vec::new() };
        let (options, plant) = controller(&choice, setup).unwrap();
        let robot = Handle::start(options, Box::new(plant)).unwrap();
        let port = |port| robot.address(port).port();
        let ports = Ports {
            rtde: port(Port::Rtde),
            script: port(Port::Secondary),
            dashboard: port(Port::Dashboard),
        };
        // A computer that runs other tests beside this one is no real-time computer.
        let (stale_ticks, stall_ticks) = (200, 100);
        let ur = UrConfig { ports, stale_ticks, stall_ticks, ..UrConfig::at("127.0.0.1") };
        let mut config = Config::load_for(&choice, &ur).unwrap();
        config.safety.shield.as_mut().unwrap().sensor.gap_max = 0.4;
        let arm = UrArm::connect(ur).unwrap();
        let [x, y, z] = config.robot.tcp;
        let tool = Pose::translation(x, y, z);
        let chain = chain(&config.robot).unwrap();
        let mut safe = Safe::new(arm, chain, tool, config.safety.clone()).unwrap();
        let q = safe.sense().unwrap().state.q;
        safe.begin_episode().unwrap();
        Self { robot, safe, q, executed: Vec::new() }
    }

    fn inject(&self, fault: SensorFault) {
        self.robot.inject(Fault::Sensor(fault));
    }

    /// A control period in which the last joint turns.
    fn tick(&mut self) -> Result<Verdict, SafeError<UrError>> {
        self.safe.sense()?;
        self.q[5] += SPEED * DT;
        let verdict = self.safe.command_joints(&self.q)?;
        let executed = self.safe.decision().unwrap().executed;
        self.executed.push(executed);
        // What was held back is not made up for in a jump.
        self.q = executed;
        Ok(verdict)
    }

    fn turn(&mut self, ticks: u32) {
        for _ in 0..ticks {
            let verdict = self.tick().unwrap();
            assert!(matches!(verdict, Verdict::Accepted), "{verdict:?}");
        }
    }

    /// Goes on until it stops, for so many periods.
    fn until_stopped(&mut self, ticks: u32) -> End {
        for _ in 0..ticks {
            match self.tick() {
                Ok(Verdict::ForceExceeded(_)) => return End::Force,
                Ok(_) => {}
                Err(error) => return End::Stopped(error),
            }
        }
        End::Never
    }

    /// No jump, here or for the controller, and at rest in the end.
    fn came_to_rest(&mut self) {
        for _ in 0..400 {
            // After a latched force stop the layer brakes and backs off; after an error the arm has been stopped.
            if self.safe.sense().is_ok() {
                _ = self.safe.brake();
            }
        }
        let steps: Vec<_> = self.executed.windows(2).map(|w| (w[1] - w[0]) / DT).collect();
        let jump = steps.windows(2).map(|s| (s[1] - s[0]).amax() / DT).fold(0.0, f64::max);
        assert!(jump < 150.0, "{jump} rad/s²");
        let (speed, safety) = self
            .robot
            .with(|s| (s.controller().target().dq.amax(), s.controller().safety()))
            .unwrap();
        assert_eq!(safety, SafetyStatus::Normal, "the controller saw a jump");
        assert!(speed < 1e-4, "still at {speed} rad/s");
    }
}

/// Between two episodes, with a bias of so many newtons: what the tare says.
fn tared(newtons: f64) -> (Rig, Result<(), SafeError<UrError>>) {
    let mut rig = Rig::new();
    // Slowly enough for no impact.
    for _ in 0..20 {
        rig.inject(SensorFault::Bias([0.0, 0.0, newtons / 20.0, 0.0, 0.0, 0.0]));
        rig.turn(10);
    }
    rig.turn(50);
    let felt = rig.safe.sense().unwrap().wrench.force.norm();
    assert!((felt - newtons).abs() < 0.5, "{felt} N");
    while rig.safe.standing() != Standing::AtRest {
        _ = rig.safe.brake().unwrap();
        rig.safe.sense().unwrap();
    }
    // The brake is not in the list.
    rig.executed.clear();
    rig.safe.begin_reset();
    let result = rig.safe.begin_episode();
    (rig, result)
}

#[test]
fn a_small_bias_is_tared_away() {
    let (mut rig, result) = tared(1.5);
    result.unwrap();
    rig.q = rig.safe.sense().unwrap().state.q_target;
    rig.turn(50);
    let felt = rig.safe.sense().unwrap().wrench.force.norm();
    assert!(felt < 0.5, "{felt} N after the tare");
    rig.came_to_rest();
}

/// It may be a contact: that is not tared away.
#[test]
fn a_large_bias_is_taken_for_a_contact_and_asks_for_a_person() {
    let (mut rig, result) = tared(8.0);
    assert!(matches!(result, Err(SafeError::NotFree { force, .. }) if force > 7.0), "{result:?}");
    rig.came_to_rest();
}

#[test]
fn a_bias_beyond_the_force_limit_is_a_force_stop() {
    let mut rig = Rig::new();
    rig.turn(100);
    rig.inject(SensorFault::Bias([0.0, 0.0, 35.0, 0.0, 0.0, 0.0]));
    assert!(matches!(rig.until_stopped(100), End::Force));
    rig.came_to_rest();
}

#[test]
fn drift_is_a_force_stop_when_it_reaches_the_limit() {
    let mut rig = Rig::new();
    rig.turn(50);
    rig.inject(SensorFault::Drift([0.0, 0.0, 40.0, 0.0, 0.0, 0.0]));
    assert!(matches!(rig.until_stopped(1000), End::Force));
    rig.came_to_rest();
}

#[test]
fn nan_stops_the_arm_in_the_next_tick() {
    let mut rig = Rig::new();
    rig.turn(100);
    rig.inject(SensorFault::NotANumber);
    let End::Stopped(error) = rig.until_stopped(50) else { panic!("unnoticed") };
    assert!(matches!(error, SafeError::Backend(UrError::WrenchReading(_))), "{error}");
    assert_eq!(error.fault(), Some(FaultKind::Sensor));
    rig.came_to_rest();
}

/// The reading stands still in the sensor's own axes: in base axes, as it is sent, it turns with the arm.
#[test]
fn a_frozen_reading_is_noticed_while_the_axes_turn() {
    let mut rig = Rig::new();
    rig.turn(100);
    let turned = rig.q[5];
    rig.inject(SensorFault::Stuck);
    let End::Stopped(error) = rig.until_stopped(400) else { panic!("unnoticed") };
    assert!(matches!(error, SafeError::Backend(UrError::WrenchFrozen { ticks: 100 })), "{error}");
    assert_eq!(error.fault(), Some(FaultKind::Sensor));
    assert!(rig.q[5] - turned > 0.04 && rig.q[5] - turned < PI, "it turned on meanwhile");
    rig.came_to_rest();
}

/// At the end of its range a sensor says no more than "at least this": not to be believed.
#[test]
fn a_saturated_sensor_is_not_believed_and_the_arm_brakes() {
    let mut rig = Rig::new();
    rig.turn(100);
    rig.inject(SensorFault::Saturated(150.0, 15.0));
    rig.inject(SensorFault::Bias([0.0, 0.0, 500.0, 0.0, 0.0, 0.0]));
    let End::Stopped(error) = rig.until_stopped(100) else { panic!("unnoticed") };
    let named = matches!(
        error,
        SafeError::Blind(Implausible::Saturated { axis: 2, .. } | Implausible::WrenchJump { .. })
    );
    assert!(named, "{error}");
    rig.came_to_rest();
}
