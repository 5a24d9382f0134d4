//! Bytes of a client to the RTDE server: no panic, no hang, a bounded answer.
#![no_main]

use libfuzzer_sys::fuzz_target;
use palpate_kinematics::UrModel;
use palpate_virtual_ur::rtde::ServerSession;
use palpate_virtual_ur::{Controller, ControllerConfig, LaggedArm};

fuzz_target!(|bytes: &[u8]| {
    let home = [0.0, -1.57, 1.57, -1.57, -1.57, 0.0].into();
    let arm = Box::new(LaggedArm::at(home));
    let Ok(mut robot) = Controller::new(ControllerConfig::new(UrModel::Ur3e), arm) else { return };
    let (mut session, mut out) = (ServerSession::new(1), Vec::new());
    for part in bytes.chunks(7) {
        if session.receive(part, &mut robot, &mut out).is_err() {
            return;
        }
        robot.tick();
        session.data(&robot, &mut out);
        out.clear();
    }
});
