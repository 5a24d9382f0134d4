//! An arm on the move, and what must be true of it after a fault.

use palpate_robot_io::{JointCommand, RobotBackend, RobotState};
use palpate_ur::{UrArm, UrError};

use super::Controller;

/// rad per tick: 0.5 rad/s.
const STEP: f64 = 0.001;

pub(crate) type Outcome = Result<(), Box<dyn std::error::Error>>;

pub(crate) fn moving(controller: &Controller) -> Result<(UrArm, RobotState), UrError> {
    let mut arm = UrArm::connect(controller.config())?;
    let mut state = arm.read()?;
    for _ in 0..30 {
        state = step(&mut arm, &state)?;
    }
    controller.lock().largest_step = 0.0;
    Ok((arm, state))
}

pub(crate) fn step(arm: &mut UrArm, state: &RobotState) -> Result<RobotState, UrError> {
    let mut q = state.q_target;
    q[5] += STEP;
    arm.write(&JointCommand { q })?;
    arm.read()
}

/// Moves until something fails.
pub(crate) fn until_error(arm: &mut UrArm, mut state: RobotState) -> UrError {
    for _ in 0..2000 {
        match step(arm, &state) {
            Ok(next) => state = next,
            Err(error) => return error,
        }
    }
    panic!("nothing failed");
}

/// The arm refuses to move, has come to rest without a jump, and stays there.
pub(crate) fn rests(controller: &Controller, arm: &mut UrArm) {
    let q = controller.lock().q;
    let refused = arm.write(&JointCommand { q: q.into() });
    assert!(matches!(refused, Err(UrError::Stopped)), "{refused:?}");
    let start = controller.lock().tick;
    controller.until(|w| w.tick > start + 60);
    let (goal, tick) = controller.see(|w| (w.target, w.tick));
    controller.until(|w| w.tick > tick + 60);
    let world = controller.lock();
    assert_eq!(world.target, goal, "the arm still moves");
    // A busy computer may send two set-points between two cycles; a jump is more than that.
    assert!(world.largest_step < 12.0 * STEP, "the target jumped by {} rad", world.largest_step);
}

/// After `recover` the arm waits for a command, and then follows it from where it is.
pub(crate) fn goes_on(controller: &Controller, arm: &mut UrArm) -> Outcome {
    let moved = controller.lock().moving_ticks;
    arm.recover()?;
    let mut state = arm.read()?;
    for _ in 0..20 {
        state = arm.read()?;
    }
    assert_eq!(controller.lock().moving_ticks, moved, "it moved without a command");
    for _ in 0..10 {
        state = step(arm, &state)?;
    }
    assert!(controller.lock().moving_ticks > moved);
    Ok(())
}
