//! The client's backend against this controller, over TCP in real time: the contract that every backend passes.

use palpate_kinematics::UrModel;
use palpate_robot_io::contract;
use palpate_ur::{Ports, UrArm, UrConfig};
use palpate_virtual_ur::{ControllerConfig, Handle, LaggedArm, Options, Port};

#[test]
fn the_backend_contract_holds() {
    let home = [0.0, -1.57, 1.57, -1.57, -1.57, 0.0].into();
    let options = Options { any_ports: true, ..Options::new(ControllerConfig::new(UrModel::Ur3e)) };
    let robot = Handle::start(options, Box::new(LaggedArm::at(home))).unwrap();
    let port = |port| robot.address(port).port();
    let config = UrConfig {
        ports: Ports {
            rtde: port(Port::Rtde),
            script: port(Port::Secondary),
            dashboard: port(Port::Dashboard),
        },
        // A computer that runs other tests beside this one is no real-time computer.
        stale_ticks: 400,
        stall_ticks: 100,
        boot_settle: 0.1,
        ..UrConfig::at("127.0.0.1")
    };
    let mut arm = UrArm::connect(config).unwrap_or_else(|e| {
        let events = robot.with(|server| server.controller_mut().take_events());
        panic!("{e}: {events:?}")
    });
    if let Err(violation) = contract::check(&mut arm) {
        let events = robot.with(|server| server.controller_mut().take_events());
        panic!("{violation}: {events:?}");
    }
}
