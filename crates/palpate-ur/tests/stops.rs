//! What the user gets when the arm itself says no: safety system, slider, sensor, program.

#[expect(dead_code, reason = "network faults are another test's")]
mod support;

use palpate_robot_io::{BackendError, FaultKind, JointCommand, RobotBackend};
use palpate_ur::{UrArm, UrError};
use support::Controller;
use support::moves::{Outcome, goes_on, moving, rests, step, until_error};

#[test]
fn a_wrench_that_is_no_number() -> Outcome {
    let controller = Controller::start(1.0);
    let (mut arm, state) = moving(&controller)?;
    controller.lock().load[2] = f64::NAN;
    let error = until_error(&mut arm, state);
    assert_eq!(error.kind(), FaultKind::Sensor, "{error}");
    rests(&controller, &mut arm);
    controller.lock().load[2] = 0.0;
    goes_on(&controller, &mut arm)
}

#[test]
fn the_speed_slider() -> Outcome {
    let controller = Controller::start(1.0);
    let (mut arm, state) = moving(&controller)?;
    controller.lock().slider = 0.4;
    let error = until_error(&mut arm, state);
    assert!(error.to_string().contains("at 40 %"), "{error}");
    rests(&controller, &mut arm);
    controller.lock().slider = 1.0;
    goes_on(&controller, &mut arm)
}

#[test]
fn a_program_that_is_killed_is_loaded_again_by_recover_only() -> Outcome {
    let controller = Controller::start(1.0);
    let (mut arm, state) = moving(&controller)?;
    {
        let mut world = controller.lock();
        world.program = None;
        world.runtime = 1;
    }
    let error = until_error(&mut arm, state);
    assert!(matches!(error, UrError::Program(_)), "{error}");
    for _ in 0..20 {
        let _ = arm.read();
    }
    assert_eq!(controller.lock().uploads, 1);
    rests(&controller, &mut arm);
    goes_on(&controller, &mut arm)?;
    assert_eq!(controller.lock().uploads, 2);
    Ok(())
}

#[test]
fn a_stop_of_the_safety_system_waits_for_a_person() -> Outcome {
    let stops = std::env::var("PALPATE_UR_STOPS").ok().and_then(|n| n.parse().ok()).unwrap_or(20);
    let controller = Controller::start(4.0);
    let mut config = controller.config();
    config.stall_ticks = 100;
    let mut arm = UrArm::connect(config)?;
    let operator = arm.operator();
    for n in 0..stops {
        let mut state = arm.read()?;
        for _ in 0..n % 7 {
            state = step(&mut arm, &state)?;
        }
        let status = [3, 5, 6, 7, 8, 9, 2, 99][n % 8];
        controller.lock().safety = status;
        let error = until_error(&mut arm, state);
        assert!(matches!(error, UrError::Safety(s) if i32::from(s) == status), "{error}");
        let moved = controller.lock().moving_ticks;
        // Not while it lasts …
        assert_eq!(arm.recover().unwrap_err().kind(), FaultKind::RobotState);
        // … and not when it is over either, before a person has said so.
        controller.lock().safety = 1;
        let uploads = controller.lock().uploads;
        assert!(matches!(arm.recover(), Err(UrError::NeedsOperator(_) | UrError::Safety(_))));
        let q = arm.sample().q();
        assert_eq!(arm.write(&JointCommand { q }).unwrap_err().kind(), FaultKind::Stopped);
        let world = controller.lock();
        assert_eq!((world.moving_ticks, world.uploads), (moved, uploads));
        drop(world);
        operator.acknowledge();
        if let Err(error) = arm.recover() {
            // The last samples of the stop were still on their way.
            assert!(matches!(error, UrError::Safety(_)), "{error}");
            operator.acknowledge();
            arm.recover()?;
        }
    }
    Ok(())
}
