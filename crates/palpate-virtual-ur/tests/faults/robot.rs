//! Faults of the controller: safety system, pendant, power.

use palpate_robot_io::{BackendError, FaultKind, RobotBackend};
use palpate_ur::UrError;
use palpate_ur::proto::SafetyStatus;
use palpate_virtual_ur::Fault;

use crate::rig::{Aftermath, Rig};

/// The safety system's stops are named in the tick after, and last.
fn stops_with(fault: &Fault, status: SafetyStatus) {
    let Aftermath { error, ticks, safety, .. } = Rig::start().aftermath(fault);
    assert!(matches!(error, UrError::Safety(s) if s == status), "{error}");
    assert_eq!((error.kind(), safety), (FaultKind::RobotState, status));
    assert!(ticks <= 2, "{ticks} ticks");
}

#[test]
fn a_protective_stop_is_named_and_lasts() {
    stops_with(&Fault::ProtectiveStop, SafetyStatus::ProtectiveStop);
}

#[test]
fn an_emergency_stop_is_named_and_lasts() {
    stops_with(&Fault::EmergencyStop(true), SafetyStatus::RobotEmergencyStop);
}

#[test]
fn a_safeguard_stop_is_named_and_lasts() {
    stops_with(&Fault::SafeguardStop(true), SafetyStatus::SafeguardStop);
}

#[test]
fn a_safety_fault_is_named_and_lasts() {
    let Aftermath { error, safety, .. } = Rig::start().aftermath(&Fault::SafetyFault);
    assert!(matches!(error, UrError::Safety(s) if s == safety), "{error}, {safety}");
    assert_ne!(safety, SafetyStatus::Normal);
}

/// Cleared at the arm, and still nothing moves before a person has said so here.
#[test]
fn after_a_stop_recover_needs_a_person() {
    let rig = Rig::start();
    let (mut arm, mut q) = rig.moving(rig.config());
    let operator = arm.operator();
    rig.inject(Fault::SafeguardStop(true));
    let error = (0..10).find_map(|_| rig.step(&mut arm, &mut q).err());
    assert!(matches!(error, Some(UrError::Safety(_))), "{error:?}");
    rig.inject(Fault::SafeguardStop(false));
    let result = rig.robot.meanwhile(|| {
        std::thread::sleep(std::time::Duration::from_millis(100));
        arm.recover()
    });
    assert!(matches!(result, Err(UrError::NeedsOperator(_))), "{result:?}");
    operator.acknowledge();
    rig.robot.meanwhile(|| arm.recover()).unwrap_or_else(|e| panic!("{e}: {}", rig.log()));
}

#[test]
fn a_moved_slider_is_named() {
    let Aftermath { error, ticks, safety, .. } = Rig::start().aftermath(&Fault::Slider(0.5));
    assert!(error.to_string().contains("at 50 %"), "{error}");
    assert!(ticks <= 2 && safety == SafetyStatus::Normal, "{ticks} ticks, {safety}");
}

#[test]
fn a_killed_program_is_named() {
    let Aftermath { error, ticks, .. } = Rig::start().aftermath(&Fault::KillProgram);
    assert!(matches!(error, UrError::Program(_)) && ticks <= 2, "{error} after {ticks} ticks");
    assert!(error.to_string().contains("recover loads it again"), "{error}");
}

#[test]
fn a_paused_program_is_named() {
    let Aftermath { error, ticks, .. } = Rig::start().aftermath(&Fault::PauseProgram);
    assert!(matches!(error, UrError::Program(_)) && ticks <= 2, "{error} after {ticks} ticks");
}

#[test]
fn a_reboot_is_a_closed_connection() {
    let Aftermath { error, .. } = Rig::start().aftermath(&Fault::Reboot);
    assert_eq!(error.kind(), FaultKind::Link, "{error}");
}

#[test]
fn a_clock_that_goes_back_is_a_restart() {
    let Aftermath { error, ticks, .. } = Rig::start().aftermath(&Fault::Timestamp(-0.1));
    assert!(matches!(error, UrError::ClockBack { .. }) && ticks <= 2, "{error}, {ticks} ticks");
}
