//! The backend contract on every backend there is: the simulator, the virtual controller, and recordings of both.
#![expect(clippy::unwrap_used, reason = "helpers of tests")]

use palpate::Config;
use palpate::config::Choice;
use palpate::stack::chain;
use palpate::virtual_ur::{Setup, controller};
use palpate_robot_io::{Recorder, Replay, RobotBackend, contract};
use palpate_sim::SimArm;
use palpate_ur::proto::SafetyStatus;
use palpate_ur::{Ports, UrArm, UrConfig};
use palpate_virtual_ur::{Handle, Port};

fn choice() -> Choice {
    let (preset, task, model) = ("palpate".into(), "peg-insertion".into(), "P-14".into());
    Choice { preset, task, model, ..Choice::default() }
}

/// The suite on the arm, and on the recording of that.
fn holds<B: RobotBackend>(arm: B) {
    let mut arm = Recorder::new(arm, 20_000);
    contract::check(&mut arm).unwrap();
    assert_eq!(arm.dropped(), 0);
    let period = arm.period();
    let mut recording = Replay::new(arm.take(), period);
    contract::check(&mut recording).unwrap();
    assert_eq!(recording.remaining(), 0);
}

#[test]
fn the_simulator_and_its_recording() {
    let config = Config::load(&choice()).unwrap();
    let (task, chain) = (&config.task, chain(&config.robot).unwrap());
    holds(SimArm::new(chain, task.base_T_hole(), &config.sim, task.q_home, 1).unwrap());
}

#[test]
fn a_virtual_ur_with_contact_and_its_recording() {
    let setup = Setup { address: [127, 0, 0, 1].into(), any_ports: true, faults: Vec::new() };
    let (options, plant) = controller(&choice(), setup).unwrap();
    let robot = Handle::start(options, Box::new(plant)).unwrap();
    let port = |port| robot.address(port).port();
    let ports = Ports {
        rtde: port(Port::Rtde),
        script: port(Port::Secondary),
        dashboard: port(Port::Dashboard),
    };
    // A computer that runs other tests beside this one is no real-time computer.
    let (stale_ticks, stall_ticks) = (200, 100);
    let config = UrConfig { ports, stale_ticks, stall_ticks, ..UrConfig::at("127.0.0.1") };
    holds(UrArm::connect(config).unwrap());
    let safety = robot.with(|server| server.controller().safety());
    assert_eq!(safety, Some(SafetyStatus::Normal), "no jump");
}
