//! Bad samples: what a shield makes of readings that are not to be believed.
#![expect(clippy::unwrap_used, reason = "our own limits load")]

mod support;

use std::cell::RefCell;
use std::rc::Rc;

use palpate_robot_io::{IdealArm, IdealArmError, JointCommand, RobotBackend, RobotState};
use palpate_safety::Cause;
use palpate_safety::shield::{Implausible, Standing};
use palpate_safety::{Refusal, Safe, SafeError, Verdict};
use support::{DT, chain, home, preset, tool0_T_tool};

/// An ideal arm that answers with what the test wants to see.
type Script = Rc<RefCell<dyn FnMut(&mut RobotState)>>;

struct Scripted(IdealArm, Script);

impl RobotBackend for Scripted {
    type Error = IdealArmError;
    fn period(&self) -> std::time::Duration {
        self.0.period()
    }
    fn read(&mut self) -> Result<RobotState, Self::Error> {
        let mut state = self.0.read()?;
        (self.1.borrow_mut())(&mut state);
        Ok(state)
    }
    fn write(&mut self, command: &JointCommand) -> Result<(), Self::Error> {
        self.0.write(command)
    }
    fn stop(&mut self) -> Result<(), Self::Error> {
        self.0.stop()
    }
    fn recover(&mut self) -> Result<(), Self::Error> {
        self.0.recover()
    }
    fn tare(&mut self) -> Result<(), Self::Error> {
        Ok(())
    }
}

fn scripted(script: impl FnMut(&mut RobotState) + 'static) -> Safe<Scripted> {
    let arm = Scripted(IdealArm::at(home()), Rc::new(RefCell::new(script)));
    Safe::new(arm, support::arm(), tool0_T_tool(), preset()).unwrap()
}

/// The same, in an episode.
fn in_episode(script: impl FnMut(&mut RobotState) + 'static) -> Safe<Scripted> {
    let mut robot = scripted(script);
    robot.sense().unwrap();
    robot.begin_episode().unwrap();
    robot
}

/// Moves up for `ticks` and returns the verdicts.
fn moved_up(robot: &mut Safe<Scripted>, ticks: u32) -> Vec<Verdict> {
    let mut reference = chain().forward(&home());
    let verdicts = (0..ticks).map(|_| {
        robot.sense().unwrap();
        reference.translation.z += 0.02 * DT;
        robot.command(&reference).unwrap()
    });
    verdicts.collect()
}

#[test]
fn bad_samples_brake_the_arm_and_a_few_of_them_are_survived() {
    type Fault = fn(&mut RobotState);
    let faults: [(&str, Fault); 4] = [
        ("not finite", |s| s.sensor_wrench.force.x = f64::NAN),
        ("stale", |s| s.time = 0.0),
        ("saturated", |s| s.sensor_wrench.torque.z = 15.0),
        ("joint jump", |s| s.q[1] += 0.5),
    ];
    for (name, fault) in faults {
        let mut tick = 0;
        let mut robot = scripted(move |state| {
            tick += 1;
            if (60..65).contains(&tick) {
                fault(state);
            }
        });
        let verdicts = moved_up(&mut robot, 100);
        assert!(verdicts[..59].iter().all(|v| *v == Verdict::Accepted), "{name}");
        assert!(
            matches!(verdicts[59], Verdict::Refused(Refusal::Implausible(_))),
            "{name}: {:?}",
            verdicts[59]
        );
        assert_eq!(verdicts[99], Verdict::Accepted, "{name}: over");
        assert!(robot.ledger().counts().of(Cause::Implausible) >= 1);
        assert!(robot.tally().shield >= 1);
    }
}

/// One sample that cannot be: braked for, not counted as a contact.
#[test]
fn a_spike_of_one_sample_is_no_force_stop() {
    for spike in [60.0, 39.0] {
        let mut tick = 0;
        let mut robot = in_episode(move |state| {
            tick += 1;
            state.sensor_wrench.force.z = if tick == 61 { spike } else { 0.0 };
        });
        let verdicts = moved_up(&mut robot, 100);
        assert!(
            verdicts.iter().all(|v| !matches!(v, Verdict::ForceExceeded(_))),
            "{spike} N: {verdicts:?}"
        );
        assert!(matches!(verdicts[59], Verdict::Refused(_)), "{spike} N: {:?}", verdicts[59]);
        assert_eq!(verdicts[99], Verdict::Accepted);
    }
}

#[test]
fn too_many_bad_samples_in_a_row_are_an_error_and_stop_the_arm() {
    let mut tick = 0;
    let mut robot = scripted(move |state| {
        tick += 1;
        if tick > 10 {
            state.dq[3] = f64::INFINITY;
        }
    });
    let mut seen = 0;
    let error = loop {
        match robot.sense() {
            Ok(_) => {
                seen += 1;
                let _ = robot.brake().unwrap();
            }
            Err(e) => break e,
        }
        assert!(seen < 100);
    };
    assert_eq!(seen, 10 + 24, "25 in a row");
    assert!(matches!(error, SafeError::Blind(Implausible::NonFinite)));
    assert!(robot.brake().is_err(), "the backend is stopped");
    robot.recover().unwrap();
}

#[test]
fn the_sensor_is_not_zeroed_in_contact_or_on_the_way() {
    let mut robot = scripted(|state| state.sensor_wrench.force.z = 8.0);
    for _ in 0..50 {
        robot.sense().unwrap();
    }
    let error = robot.begin_episode().unwrap_err();
    assert!(
        matches!(error, SafeError::NotFree { force, .. } if (force - 8.0).abs() < 0.1),
        "{error}"
    );
    let mut robot = scripted(|_| {});
    let _ = moved_up(&mut robot, 50);
    assert!(matches!(robot.begin_episode(), Err(SafeError::NotFree { .. })), "moving");
    while robot.standing() != Standing::AtRest {
        let _ = robot.brake().unwrap();
        robot.sense().unwrap();
    }
    robot.begin_episode().unwrap();
}

/// What was a contact a moment ago may be one again: not zeroed before the force has been gone for the re-arm time.
#[test]
fn the_sensor_is_not_zeroed_right_after_a_contact() {
    let rearm = preset().shield.unwrap().force.rearm_time;
    let mut tick = 0;
    let mut robot = scripted(move |state| {
        tick += 1;
        state.sensor_wrench.force.z = if tick < 300 { 24.0 } else { 0.0 };
    });
    let wait = |robot: &mut Safe<Scripted>, ticks: u32| {
        for _ in 0..ticks {
            robot.sense().unwrap();
            let _ = robot.brake().unwrap();
        }
    };
    robot.sense().unwrap();
    robot.begin_reset();
    wait(&mut robot, 200);
    assert!(robot.is_armed(), "24 N are far below the way back's limit");
    // The same force beside the episode's limit of 25 N.
    let mut tick = 0;
    let mut robot = scripted(move |state| {
        tick += 1;
        state.sensor_wrench.force.z = if (100..150).contains(&tick) { 24.0 } else { 0.0 };
    });
    robot.sense().unwrap();
    robot.begin_episode().unwrap();
    wait(&mut robot, 120);
    assert!(!robot.is_armed());
    // Until the filter is calm as well, and then the time itself.
    wait(&mut robot, 40);
    assert!(matches!(robot.begin_episode(), Err(SafeError::NotFree { .. })));
    wait(&mut robot, (rearm / DT) as u32 + 10);
    robot.begin_episode().unwrap();
}

/// A tare moves the reading, and that is no jump.
#[test]
fn what_the_tare_moves_is_believed() {
    let mut tick = 0;
    let mut robot = scripted(move |state| {
        tick += 1;
        // A bias that is taken away: farther than a reading may jump.
        state.sensor_wrench.force.x = if tick <= 50 { 3.0 } else { -45.0 };
    });
    for _ in 0..50 {
        robot.sense().unwrap();
    }
    robot.begin_episode().unwrap();
    robot.sense().unwrap();
    assert!(!robot.shield().unwrap().is_blind());
    let verdict = robot.command(&chain().forward(&home())).unwrap();
    assert!(!matches!(verdict, Verdict::Refused(Refusal::Implausible(_))), "{verdict:?}");
}
