//! The safe path back to the start.
#![expect(clippy::neg_cmp_op_on_partial_ord, reason = "a height that is NaN ends the way out")]

mod loosen;

use palpate_kinematics::IkOptions;
use palpate_safety::Cause;
use palpate_safety::shield::{Action, Recovery, Seen, Standing};
use palpate_safety::{Guarded, Measurement, Mode, Refusal, Verdict};
use palpate_spatial::{JointVector, Pose, Vector3, integrate};

use crate::{EnvError, ResetConfig};
use loosen::{Progress, give};

/// Refused commands in a row after which the path counts as blocked.
const PATIENCE: u32 = 50;

/// Longest time that the set-point gets to arrive after its path, s.
const CATCH_UP: f64 = 2.0;

/// The way from wherever an episode ended to the start of the next.
pub(crate) struct WayBack<'a> {
    pub(crate) config: &'a ResetConfig,
    pub(crate) base_T_hole: &'a Pose,
    pub(crate) base_T_start: &'a Pose,
    pub(crate) q_home: &'a JointVector,
}

/// Drives the tool out of the hole, over to the start, lets it settle and tares.
///
/// The start's joints are solved from `q_home`, never from where the arm happens to be, so that the
/// same start always means the same joints.
pub(crate) fn drive_to_start<R: Guarded>(
    robot: &mut R,
    way: &WayBack<'_>,
) -> Result<Measurement, EnvError<R::Error>> {
    let q_start = robot
        .chain()
        .solve_near(way.base_T_start, way.q_home, &IkOptions::default())
        .map_err(EnvError::StartUnreachable)?
        .q;
    let dt = robot.period().as_secs_f64();
    let shield = robot.limits().shield.as_ref().filter(|_| robot.limits().mode == Mode::Shield);
    match shield.map(|s| s.recovery) {
        None => path(robot, way, &q_start)?,
        Some(config) => {
            let stopped =
                robot.decision().is_some_and(|d| matches!(d.verdict, Verdict::ForceExceeded(_)));
            let recovery = if stopped {
                Recovery::after_stop(config, dt)
            } else {
                Recovery::after_rest(config, dt)
            };
            recover(robot, way, &q_start, recovery)?;
        }
    }
    robot.begin_episode().map_err(EnvError::Robot)?;
    robot.sense().map_err(EnvError::Robot)
}

/// The path, and around it the shield's recovery: what to do before it and after a failure.
fn recover<R: Guarded>(
    robot: &mut R,
    way: &WayBack<'_>,
    q_start: &JointVector,
    mut recovery: Recovery,
) -> Result<(), EnvError<R::Error>> {
    let mut m = robot.sense().map_err(EnvError::Robot)?;
    let mut failure = None;
    loop {
        let seen = Seen {
            standing: robot.standing(),
            wrench: m.wrench,
            armed: robot.is_armed(),
            arrived: failure.is_none(),
        };
        match recovery.step(&seen) {
            Action::Brake | Action::Retreat | Action::Watch => {
                let _: Verdict = robot.brake().map_err(EnvError::Robot)?;
            }
            Action::Tare => robot.tare().map_err(EnvError::Robot)?,
            Action::Path => {
                failure = match path(robot, way, q_start) {
                    Ok(()) => None,
                    Err(
                        e @ (EnvError::ResetForce(_)
                        | EnvError::ResetRefused(_)
                        | EnvError::ResetStuck { .. }),
                    ) => Some(e.to_string()),
                    Err(e) => return Err(e),
                };
            }
            Action::Done => return Ok(()),
            Action::AskHuman => {
                let last = failure.unwrap_or_default();
                return Err(EnvError::AskHuman { tries: recovery.tries(), last });
            }
        }
        m = robot.sense().map_err(EnvError::Robot)?;
    }
}

/// Out, over, and to rest at the start.
fn path<R: Guarded>(
    robot: &mut R,
    way: &WayBack<'_>,
    q_start: &JointVector,
) -> Result<(), EnvError<R::Error>> {
    robot.begin_reset();
    let m = robot.sense().map_err(EnvError::Robot)?;
    let m = way_out(robot, way.config, way.base_T_hole, m)?;
    let mut refused = 0;
    way_over(robot, way.config, m.state.q_target, q_start, &mut refused)?;
    arrive(robot, q_start, &mut refused)?;
    let dt = robot.period().as_secs_f64();
    for _ in 0..(way.config.settle_time / dt).ceil() as u64 {
        follow_joints(robot, q_start, &mut refused)?;
    }
    come_to_rest(robot)?;
    Ok(())
}

/// Behind a shield the set-point may still be on its way when the path ends. Nothing to do without one.
fn arrive<R: Guarded>(
    robot: &mut R,
    q: &JointVector,
    refused: &mut u32,
) -> Result<(), EnvError<R::Error>> {
    let ticks = (CATCH_UP / robot.period().as_secs_f64()) as u64;
    for _ in 0..ticks {
        if robot.decision().is_none_or(|decision| decision.executed == *q) {
            break;
        }
        follow_joints(robot, q, refused)?;
    }
    Ok(())
}

/// Brakes until the set-point rests; the last sample, if it moved at all. Nothing to do without a shield.
fn come_to_rest<R: Guarded>(robot: &mut R) -> Result<Option<Measurement>, EnvError<R::Error>> {
    let mut last = None;
    while robot.standing() != Standing::AtRest {
        if let Verdict::ForceExceeded(excess) = robot.brake().map_err(EnvError::Robot)? {
            return Err(EnvError::ResetForce(excess));
        }
        last = Some(robot.sense().map_err(EnvError::Robot)?);
    }
    Ok(last)
}

/// Out along the hole's axis until the tool is clear of the board, giving way to what else holds it.
fn way_out<R: Guarded>(
    robot: &mut R,
    config: &ResetConfig,
    base_T_hole: &Pose,
    mut m: Measurement,
) -> Result<Measurement, EnvError<R::Error>> {
    let dt = robot.period().as_secs_f64();
    let pull_max = robot.limits().reset.force_max;
    let axis = base_T_hole.rotation * Vector3::z();
    let mut base_T_tool = robot.chain().forward(&m.state.q_target);
    let (mut refused, mut progress) = (0, Progress::new(dt));
    loop {
        let height = (base_T_tool.translation.vector - base_T_hole.translation.vector).dot(&axis);
        if !(height < config.clearance) {
            return Ok(come_to_rest(robot)?.unwrap_or(m));
        }
        if !progress.made(height) {
            return Err(EnvError::ResetStuck {
                force: m.wrench.force.norm(),
                torque: m.wrench.torque.norm(),
            });
        }
        let twist = give(&m.wrench, &axis, config.linear_speed, pull_max);
        let next = integrate(&base_T_tool, &twist, dt);
        let verdict = robot.command(&next).map_err(EnvError::Robot)?;
        let governed = robot.decision().and_then(|decision| decision.governed);
        match verdict {
            Verdict::Accepted => {
                base_T_tool = governed.unwrap_or(next);
                refused = 0;
            }
            Verdict::Refused(refusal) => {
                base_T_tool = governed.unwrap_or(base_T_tool);
                refused += 1;
                if refused > PATIENCE {
                    return Err(EnvError::ResetRefused(refusal));
                }
            }
            Verdict::ForceExceeded(excess) => return Err(EnvError::ResetForce(excess)),
        }
        m = robot.sense().map_err(EnvError::Robot)?;
    }
}

/// Joint-space move with zero speed at both ends: q(s) = q₀ + (q₁ − q₀)·(1 − cos πs)/2.
fn way_over<R: Guarded>(
    robot: &mut R,
    config: &ResetConfig,
    from: JointVector,
    to: &JointVector,
    refused: &mut u32,
) -> Result<(), EnvError<R::Error>> {
    let dt = robot.period().as_secs_f64();
    let path = to - from;
    // The fastest joint peaks at π/2 times its mean speed.
    let duration = path.amax() * std::f64::consts::FRAC_PI_2 / config.joint_speed;
    let ticks = (duration / dt).ceil().max(1.0) as u64;
    let (mut tick, mut progress) = (1, Progress::new(dt));
    while tick <= ticks {
        let s = tick as f64 / ticks as f64;
        let blend = (1.0 - (std::f64::consts::PI * s).cos()) / 2.0;
        follow_joints(robot, &(from + path * blend), refused)?;
        // A shield may slow the arm down: the path waits for it.
        let slowed = robot.decision().and_then(|d| d.cause).is_some_and(Cause::is_slowed);
        tick += u64::from(!slowed);
        if !progress.made(tick as f64) {
            let wrench = robot.sense().map_err(EnvError::Robot)?.wrench;
            let (force, torque) = (wrench.force.norm(), wrench.torque.norm());
            return Err(EnvError::ResetStuck { force, torque });
        }
    }
    // Exactly the goal, whatever the cosine rounded to.
    follow_joints(robot, to, refused)
}

fn follow_joints<R: Guarded>(
    robot: &mut R,
    q: &JointVector,
    refused: &mut u32,
) -> Result<(), EnvError<R::Error>> {
    match robot.command_joints(q).map_err(EnvError::Robot)? {
        Verdict::Accepted => *refused = 0,
        Verdict::Refused(refusal @ (Refusal::NonFinite | Refusal::JointRange { .. })) => {
            return Err(EnvError::ResetRefused(refusal));
        }
        // A speed refusal behind a lagging arm clears itself: the next set-point is closer.
        Verdict::Refused(Refusal::JointSpeed { .. }) => {}
        Verdict::Refused(refusal) => {
            *refused += 1;
            if *refused > PATIENCE {
                return Err(EnvError::ResetRefused(refusal));
            }
        }
        Verdict::ForceExceeded(excess) => return Err(EnvError::ResetForce(excess)),
    }
    robot.sense().map(|_| ()).map_err(EnvError::Robot)
}
