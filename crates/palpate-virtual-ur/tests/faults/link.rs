//! Faults of the network.

use std::time::Duration;

use palpate_robot_io::{BackendError, FaultKind};
use palpate_ur::proto::SafetyStatus;
use palpate_ur::{UrArm, UrError};
use palpate_virtual_ur::{Fault, LinkFault};

use crate::rig::{Rig, link};

/// Five ticks of silence.
const SILENCE: Duration = Duration::from_millis(10);

#[test]
fn drop_is_a_closed_connection_in_the_next_tick() {
    let after = Rig::start().aftermath(&link(LinkFault::Drop));
    assert!(matches!(after.error, UrError::Closed), "{}", after.error);
    assert!(after.ticks <= 2 && after.angle < 1.3, "{} ticks, {}°", after.ticks, after.angle);
}

#[test]
fn reset_is_a_broken_connection_in_the_next_tick() {
    let after = Rig::start().aftermath(&link(LinkFault::Reset));
    assert!(matches!(after.error, UrError::Io(_)), "{}", after.error);
    assert!(after.ticks <= 2 && after.angle < 1.3, "{} ticks, {}°", after.ticks, after.angle);
}

#[test]
fn half_open_is_noticed_after_five_ticks_and_the_program_brakes_by_itself() {
    let after = Rig::start().aftermath(&link(LinkFault::HalfOpen(5.0)));
    assert!(matches!(after.error, UrError::Stalled { waited: SILENCE }), "{}", after.error);
    assert!(after.ticks <= 2 && after.angle < 1.3, "{} ticks, {}°", after.ticks, after.angle);
    assert_eq!(after.safety, SafetyStatus::Normal);
}

/// Nothing reaches this computer; the brake that it asks for reaches the arm.
#[test]
fn one_way_loss_towards_us_is_noticed_after_five_ticks() {
    let after = Rig::start().aftermath(&link(LinkFault::Mute(5.0)));
    assert!(matches!(after.error, UrError::Stalled { waited: SILENCE }), "{}", after.error);
    assert!(after.ticks <= 2 && after.angle < 1.3, "{} ticks, {}°", after.ticks, after.angle);
}

/// Nothing reaches the controller; its echo stands still.
#[test]
fn one_way_loss_towards_the_arm_is_noticed_after_five_ticks() {
    let after = Rig::start().aftermath(&link(LinkFault::Deaf(5.0)));
    assert!(matches!(after.error, UrError::NotHeard { ticks: 5 }), "{}", after.error);
    assert!(after.ticks <= 6 && after.angle < 1.3, "{} ticks, {}°", after.ticks, after.angle);
}

#[test]
fn stall_is_silence() {
    let after = Rig::start().aftermath(&Fault::Stall(0.5));
    assert!(matches!(after.error, UrError::Stalled { waited: SILENCE }), "{}", after.error);
    assert!(after.ticks <= 2 && after.angle < 1.3, "{} ticks, {}°", after.ticks, after.angle);
}

/// A command is 72 bytes: 50 a cycle let them queue up.
#[test]
fn slow_reader_is_behind() {
    let after = Rig::start().aftermath(&link(LinkFault::SlowReader(50, 5.0)));
    assert!(matches!(after.error, UrError::Behind { ticks: 11 }), "{}", after.error);
    assert!(after.error.to_string().contains("11 cycles old"));
    assert_eq!(after.error.kind(), FaultKind::Link);
}

#[test]
fn garbage_is_a_protocol_error() {
    for fault in [
        LinkFault::Header(0, b'U'),
        LinkFault::Header(4, b'U'),
        LinkFault::Header(60, b'X'),
        LinkFault::Garbage(500),
    ] {
        let after = Rig::start().aftermath(&link(fault));
        let error = &after.error;
        // Random bytes may announce more than ever comes: then it is silence.
        let silent = matches!(fault, LinkFault::Garbage(_)) && error.kind() == FaultKind::Link;
        assert!(error.kind() == FaultKind::Protocol || silent, "{fault:?}: {error}");
        assert!(after.ticks <= 2 && after.angle < 1.3, "{fault:?}: {} ticks", after.ticks);
    }
}

/// Bytes that come late, in pieces or together are the same bytes.
#[test]
fn split_merged_late_and_jittering_packets_change_nothing() {
    for fault in [
        LinkFault::Split(0.8),
        LinkFault::Merge(3, 0.8),
        LinkFault::Latency(0.006, 0.002),
        LinkFault::TextFlood(100),
    ] {
        let rig = Rig::start();
        // A computer that runs other tests beside this one is no real-time computer.
        let mut config = rig.config();
        (config.stale_ticks, config.stall_ticks) = (200, 100);
        let (mut arm, mut q) = rig.moving(config);
        rig.inject(link(fault));
        rig.robot.meanwhile(|| {
            for _ in 0..300 {
                q[5] += 0.0005;
                let moved = drive(&mut arm, &q);
                moved.unwrap_or_else(|e| panic!("{fault:?}: {e}: {}", rig.log()));
            }
        });
        rig.assert_continuous(&link(fault));
        assert_eq!(arm.stats().missed, 0, "{fault:?}");
        let safety = rig.safety();
        assert_eq!(safety, SafetyStatus::Normal, "{fault:?}");
    }
}

fn drive(arm: &mut UrArm, q: &palpate_spatial::JointVector) -> Result<(), UrError> {
    use palpate_robot_io::{JointCommand, RobotBackend as _};
    arm.write(&JointCommand { q: *q })?;
    arm.read().map(|_| ())
}

/// Twice the allowed age is a lost link, however steadily the samples come.
#[test]
fn latency_beyond_the_limit_is_behind_or_not_heard() {
    let rig = Rig::start();
    let mut config = rig.config();
    config.stall_ticks = 100;
    let (mut arm, mut q) = rig.moving(config);
    rig.inject(link(LinkFault::Latency(0.02, 0.0)));
    let error = rig.robot.meanwhile(|| {
        (0..1000).find_map(|_| {
            q[5] += 0.0005;
            drive(&mut arm, &q).err()
        })
    });
    let error = error.unwrap_or_else(|| panic!("unnoticed: {}", rig.log()));
    assert_eq!(error.kind(), FaultKind::Link, "{error}");
}

#[test]
fn a_controller_of_protocol_version_1_is_named() {
    let rig = Rig::start();
    rig.inject(Fault::OnlyVersion1);
    let error = rig.robot.meanwhile(|| {
        std::thread::sleep(Duration::from_millis(20));
        UrArm::connect(rig.config()).unwrap_err()
    });
    assert_eq!(error.kind(), FaultKind::Protocol, "{error}");
    assert!(error.to_string().contains("version 2, it speaks version 1"), "{error}");
}

#[test]
fn an_input_in_use_is_waited_for_then_named_with_its_likely_owner() {
    let rig = Rig::start();
    let mut config = rig.config();
    config.attempts = 2;
    rig.inject(Fault::InUse("input_int_register_25".into(), 3600.0));
    let error = rig.robot.meanwhile(|| {
        std::thread::sleep(Duration::from_millis(20));
        UrArm::connect(config).unwrap_err()
    });
    let said = error.to_string();
    assert!(said.contains("input_int_register_25") && said.contains("URCap"), "{said}");
    assert!(!said.contains("input_int_register_24"), "the others are free: {said}");
}
