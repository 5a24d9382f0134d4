//! What the user gets when a connection cannot be made: one test per reason.

use crate::Outcome;
use crate::support::Controller;
use palpate_robot_io::{BackendError, FaultKind};
use palpate_ur::UrArm;

#[test]
fn a_controller_of_protocol_version_1() {
    let controller = Controller::start(1.0);
    controller.lock().only_version_1 = true;
    let error = UrArm::connect(controller.config()).unwrap_err();
    assert_eq!(error.kind(), FaultKind::Protocol);
    assert!(error.to_string().contains("version 2, it speaks version 1"), "{error}");
}

#[test]
fn registers_in_use_are_waited_for_then_named() -> Outcome {
    let controller = Controller::start(1.0);
    controller.lock().in_use = 2;
    drop(UrArm::connect(controller.config())?);
    controller.lock().in_use = u32::MAX;
    let mut config = controller.config();
    config.attempts = 2;
    let error = UrArm::connect(config).unwrap_err().to_string();
    for part in ["input_int_register_24", "input_double_register_30", "URCap"] {
        assert!(error.contains(part), "{error}");
    }
    Ok(())
}

#[test]
fn missing_variables_are_all_named() {
    let controller = Controller::start(1.0);
    controller.lock().missing = vec!["safety_status".into(), "payload".into()];
    let error = UrArm::connect(controller.config()).unwrap_err().to_string();
    assert!(error.contains("payload") && error.contains("safety_status"), "{error}");
}

#[test]
fn nobody_there() {
    let mut config = palpate_ur::UrConfig::at("127.0.0.1");
    config.ports.rtde = 1;
    config.attempts = 2;
    let error = UrArm::connect(config).unwrap_err();
    assert_eq!(error.kind(), FaultKind::Link);
    assert!(error.to_string().contains("127.0.0.1:1"), "{error}");
}
