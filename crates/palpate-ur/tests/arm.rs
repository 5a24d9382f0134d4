//! The arm as a backend, against a controller on loopback: what it promises when nothing goes wrong.

#[expect(dead_code, reason = "the faults are another test's")]
mod support;

use palpate_robot_io::{
    BackendError, FaultKind, JointCommand, Recorder, Replay, RobotBackend, contract,
};
use palpate_spatial::JointVector;
use palpate_ur::UrArm;
use palpate_ur::registers::Mode;
use support::Controller;

type Outcome = Result<(), Box<dyn std::error::Error>>;

#[test]
fn it_keeps_the_contract() -> Outcome {
    let controller = Controller::start(2.0);
    controller.lock().load = [3.0, -2.0, 9.0, 0.1, 0.2, -0.3];
    let mut config = controller.config();
    config.stall_ticks = 100;
    let mut arm = Recorder::new(UrArm::connect(config)?, 20_000);
    contract::check(&mut arm)?;
    // So does its recording, without a controller.
    contract::check(&mut Replay::new(arm.take(), arm.period()))?;
    let world = controller.lock();
    assert!(world.largest_step < 0.0101, "the target jumped by {} rad", world.largest_step);
    assert_eq!((world.uploads, world.setups), (1, 1));
    Ok(())
}

#[test]
fn connecting_moves_nothing() -> Outcome {
    let controller = Controller::start(1.0);
    let before = controller.lock().q;
    let mut arm = UrArm::connect(controller.config())?;
    for _ in 0..100 {
        arm.read()?;
    }
    let world = controller.lock();
    assert_eq!((world.q, world.moving_ticks), (before, 0));
    Ok(())
}

#[test]
fn the_wrench_is_what_the_table_does_to_the_tool() -> Outcome {
    let controller = Controller::start(1.0);
    // The controller's tool points down; the table pushes up.
    controller.lock().load = [1.0, 2.0, 12.0, 0.1, 0.2, 0.3];
    let mut arm = UrArm::connect(controller.config())?;
    let wrench = arm.read()?.sensor_wrench;
    assert!((wrench.force - palpate_spatial::Vector3::new(1.0, -2.0, -12.0)).norm() < 1e-12);
    assert!((wrench.torque - palpate_spatial::Vector3::new(0.1, -0.2, -0.3)).norm() < 1e-12);
    Ok(())
}

#[test]
fn a_step_that_is_too_long_is_refused_and_changes_nothing() -> Outcome {
    let controller = Controller::start(1.0);
    let mut arm = UrArm::connect(controller.config())?;
    let start = arm.read()?.q;
    let turned = |joint: usize, by: f64| {
        let mut q = start;
        q[joint] += by;
        JointCommand { q }
    };
    let error = arm.write(&turned(2, 0.03)).unwrap_err();
    assert_eq!(error.kind(), FaultKind::InvalidCommand);
    assert!(error.to_string().contains("joint 2 would step by 0.0300"), "{error}");
    arm.write(&turned(2, 0.0))?;
    arm.read()?;
    // 180 °/s in 2 ms is 0.0063 rad.
    assert_eq!(arm.write(&turned(2, 0.007)).unwrap_err().kind(), FaultKind::InvalidCommand);
    arm.write(&turned(2, 0.006))?;
    arm.read()?;
    Ok(())
}

#[test]
fn a_tare_zeroes_the_sensor_and_leaves_the_arm_ready() -> Outcome {
    let controller = Controller::start(1.0);
    controller.lock().load = [0.0, 0.0, 4.0, 0.0, 0.0, 0.0];
    let mut arm = UrArm::connect(controller.config())?;
    let mut q = arm.read()?.q;
    for _ in 0..20 {
        q[5] += 0.001;
        arm.write(&JointCommand { q })?;
        arm.read()?;
    }
    arm.tare()?;
    let state = arm.read()?;
    assert!(state.sensor_wrench.force.norm() < 1e-12);
    // No recover in between, and from the last command on.
    arm.write(&JointCommand { q })?;
    arm.read()?;
    assert_eq!(arm.sample().report.tares, 1);
    Ok(())
}

#[test]
fn an_observer_takes_nothing_and_commands_nothing() -> Outcome {
    let controller = Controller::start(1.0);
    controller.lock().safety = 3;
    let mut observer = UrArm::observe(controller.config())?;
    for _ in 0..20 {
        observer.read()?;
    }
    assert_eq!(i32::from(observer.sample().safety), 3);
    let error = observer.write(&JointCommand { q: JointVector::zeros() }).unwrap_err();
    assert_eq!(error.kind(), FaultKind::Stopped);
    assert_eq!(controller.lock().uploads, 0);
    Ok(())
}

#[test]
fn dropping_the_arm_ends_its_program() -> Outcome {
    let controller = Controller::start(1.0);
    let mut arm = UrArm::connect(controller.config())?;
    arm.read()?;
    drop(arm);
    controller.until(|world| world.ints[24] == Mode::End as i32 && world.program.is_none());
    Ok(())
}

#[test]
fn counts_add_up() -> Outcome {
    let controller = Controller::start(1.0);
    let mut arm = UrArm::connect(controller.config())?;
    let q = arm.read()?.q;
    let before = (arm.stats(), arm.sample().timestamp);
    for _ in 0..300 {
        arm.write(&JointCommand { q })?;
        arm.read()?;
    }
    let (stats, time) = (arm.stats(), arm.sample().timestamp);
    let ticks = ((time - before.1) / 0.002).round() as u64;
    assert_eq!(stats.samples + stats.missed - before.0.samples - before.0.missed, ticks);
    assert_eq!(stats.sent - before.0.sent, 300);
    assert!(stats.success_rate() > 0.5, "{stats:?}");
    Ok(())
}

#[test]
fn a_tick_takes_nothing_from_the_heap() -> Outcome {
    let controller = Controller::start(1.0);
    let mut arm = UrArm::connect(controller.config())?;
    let q = arm.read()?.q;
    let command = JointCommand { q };
    let mut failed = None;
    let allocations = allocation_counter::measure(|| {
        for _ in 0..200 {
            if let Err(e) = arm.write(&command).and_then(|()| arm.read()) {
                failed = Some(e);
            }
        }
    });
    assert!(failed.is_none(), "{failed:?}");
    assert_eq!(allocations.count_total, 0);
    Ok(())
}
