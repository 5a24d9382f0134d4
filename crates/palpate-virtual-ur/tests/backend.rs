//! The client's backend against this controller, over TCP in real time: the contract that every backend passes, and what
//! its user gets at each fault.

#![expect(clippy::unwrap_used, reason = "a helper that cannot go on fails its test")]

use palpate_kinematics::UrModel;
use palpate_robot_io::{BackendError, FaultKind, JointCommand, RobotBackend, contract};
use palpate_ur::proto::SafetyStatus;
use palpate_ur::{Ports, UrArm, UrConfig};
use palpate_virtual_ur::controller::SensorFault;
use palpate_virtual_ur::{ControllerConfig, Fault, Handle, LaggedArm, LinkFault, Options, Port};

fn robot() -> Handle {
    let home = [0.0, -1.57, 1.57, -1.57, -1.57, 0.0].into();
    let options = Options { any_ports: true, ..Options::new(ControllerConfig::new(UrModel::Ur3e)) };
    Handle::start(options, Box::new(LaggedArm::at(home))).unwrap()
}

fn connect(robot: &Handle) -> UrArm {
    let port = |port| robot.address(port).port();
    let config = UrConfig {
        ports: Ports {
            rtde: port(Port::Rtde),
            script: port(Port::Secondary),
            dashboard: port(Port::Dashboard),
        },
        // A computer that runs other tests beside this one is no real-time computer.
        stale_ticks: 200,
        stall_ticks: 100,
        boot_settle: 0.1,
        // The sensor of an arm in free air has no noise here.
        frozen_ticks: 0,
        ..UrConfig::at("127.0.0.1")
    };
    UrArm::connect(config).unwrap_or_else(|e| panic!("{e}: {}", log(robot)))
}

fn log(robot: &Handle) -> String {
    let events = robot.with(|server| server.controller_mut().take_events());
    format!("{events:#?}")
}

#[test]
fn the_backend_contract_holds() {
    let robot = robot();
    if let Err(violation) = contract::check(&mut connect(&robot)) {
        panic!("{violation}: {}", log(&robot));
    }
}

#[test]
fn an_arm_that_is_let_go_in_motion_comes_to_rest_and_its_program_ends() {
    let robot = robot();
    let mut arm = connect(&robot);
    let mut q = arm.read().unwrap().q;
    for _ in 0..200 {
        q[5] += 0.001;
        arm.write(&JointCommand { q }).unwrap();
        arm.read().unwrap();
    }
    drop(arm);
    let mut said = String::new();
    for _ in 0..50 {
        std::thread::sleep(std::time::Duration::from_millis(20));
        said += &log(&robot);
        if said.contains("palpate control program ended") {
            return;
        }
    }
    panic!("the program goes on: {said}");
}

/// Turns the last joint at 0.2 rad/s, lets something go wrong, and goes on until there is an error.
fn until_error(robot: &Handle, arm: &mut UrArm, fault: &Fault) -> Option<FaultKind> {
    let mut q = arm.read().unwrap().q;
    for tick in 0..1000 {
        if tick == 100 {
            robot.inject(fault.clone());
        }
        q[5] += 0.0004;
        let result = arm.write(&JointCommand { q }).and_then(|()| arm.read());
        if let Err(error) = result {
            assert!(tick >= 100, "{error} before the fault: {}", log(robot));
            return Some(error.kind());
        }
    }
    None
}

#[test]
fn every_fault_is_named_and_the_arm_comes_to_rest_without_a_jump() {
    let link = |fault| Fault::Link(Port::Rtde, fault);
    for (fault, kind, safety) in [
        (link(LinkFault::Drop), FaultKind::Link, SafetyStatus::Normal),
        (link(LinkFault::Reset), FaultKind::Link, SafetyStatus::Normal),
        (link(LinkFault::HalfOpen(5.0)), FaultKind::Link, SafetyStatus::Normal),
        (link(LinkFault::Mute(5.0)), FaultKind::Link, SafetyStatus::Normal),
        (link(LinkFault::Header(0, b'U')), FaultKind::Protocol, SafetyStatus::Normal),
        (link(LinkFault::Header(4, b'U')), FaultKind::Protocol, SafetyStatus::Normal),
        (Fault::Stall(0.6), FaultKind::Link, SafetyStatus::Normal),
        (Fault::Reboot, FaultKind::Link, SafetyStatus::Normal),
        (Fault::Timestamp(-0.1), FaultKind::Link, SafetyStatus::Normal),
        (Fault::Slider(0.5), FaultKind::RobotState, SafetyStatus::Normal),
        (Fault::PauseProgram, FaultKind::RobotState, SafetyStatus::Normal),
        (Fault::ProtectiveStop, FaultKind::RobotState, SafetyStatus::ProtectiveStop),
        (Fault::EmergencyStop(true), FaultKind::RobotState, SafetyStatus::RobotEmergencyStop),
        (Fault::SafeguardStop(true), FaultKind::RobotState, SafetyStatus::SafeguardStop),
        (Fault::KillProgram, FaultKind::RobotState, SafetyStatus::Normal),
        (Fault::Sensor(SensorFault::NotANumber), FaultKind::Sensor, SafetyStatus::Normal),
    ] {
        let robot = robot();
        let mut arm = connect(&robot);
        assert_eq!(until_error(&robot, &mut arm, &fault), Some(kind), "{fault:?}: {}", log(&robot));
        // Nothing is asked any more: what moves now moves by itself.
        let q = arm.sample().q();
        arm.write(&JointCommand { q }).unwrap_err();
        drop(arm);
        let mut rest = None;
        for _ in 0..50 {
            std::thread::sleep(std::time::Duration::from_millis(20));
            let now = robot
                .with(|server| {
                    let controller = server.controller();
                    (controller.target().dq.amax(), controller.target().q, controller.safety())
                })
                .unwrap();
            // The controller itself calls a step in speed a protective stop.
            assert_eq!(now.2, safety, "{fault:?}: {}", log(&robot));
            match rest {
                None if now.0 == 0.0 => rest = Some(now.1),
                Some(rest) => assert_eq!(now.1, rest, "{fault:?} moved again"),
                None => {}
            }
        }
        assert!(rest.is_some(), "{fault:?}: still moving");
    }
}

#[test]
fn what_changes_no_byte_changes_nothing() {
    for fault in [
        LinkFault::Split(1.0),
        LinkFault::Merge(3, 1.0),
        LinkFault::TextFlood(100),
        LinkFault::Latency(0.006, 0.002),
    ] {
        let robot = robot();
        let mut arm = connect(&robot);
        let error = until_error(&robot, &mut arm, &Fault::Link(Port::Rtde, fault));
        assert_eq!(error, None, "{fault:?}: {}", log(&robot));
    }
}
