//! What the tests share.

use palpate_kinematics::UrModel;
use palpate_ur::proto::RuntimeState;
use palpate_virtual_ur::controller::DT;
use palpate_virtual_ur::{Controller, ControllerConfig, LaggedArm};

pub(crate) const HOME: [f64; 6] = [0.0, -1.57, 1.57, -1.57, -1.57, 0.0];

pub(crate) fn config() -> ControllerConfig {
    ControllerConfig::new(UrModel::Ur3e)
}

pub(crate) fn robot() -> Controller {
    Controller::new(config(), Box::new(LaggedArm::at(HOME.into()))).unwrap()
}

pub(crate) fn ticks(robot: &mut Controller, n: u32) {
    (0..n).for_each(|_| robot.tick());
}

pub(crate) fn seconds(robot: &mut Controller, s: f64) {
    ticks(robot, (s / DT).round() as u32);
}

pub(crate) fn said(robot: &mut Controller) -> Vec<String> {
    robot.take_events().into_iter().map(|e| e.text).collect()
}

/// Runs a program until it ends, at most ten seconds; everything it said, and what the controller did.
pub(crate) fn run(robot: &mut Controller, text: &str) -> Vec<String> {
    robot.run_script(text);
    for _ in 0..5000 {
        robot.tick();
        if robot.runtime() == RuntimeState::Stopped {
            break;
        }
    }
    said(robot)
}
