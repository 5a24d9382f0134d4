//! The safe path back to the start.

use palpate_kinematics::IkOptions;
use palpate_safety::{Guarded, Measurement, Refusal, Verdict};
use palpate_spatial::{JointVector, Pose, Vector3};

use crate::{EnvError, ResetConfig};

/// Refused commands in a row after which the path counts as blocked.
const PATIENCE: u32 = 50;

/// Drives the tool out of the hole, over to `base_T_start`, lets it settle and tares.
///
/// The start's joints are solved from `q_home`, never from where the arm happens to be, so that the
/// same start always means the same joints.
pub(crate) fn drive_to_start<R: Guarded>(
    robot: &mut R,
    config: &ResetConfig,
    base_T_hole: &Pose,
    base_T_start: &Pose,
    q_home: &JointVector,
) -> Result<Measurement, EnvError<R::Error>> {
    let q_start = robot
        .chain()
        .solve_near(base_T_start, q_home, &IkOptions::default())
        .map_err(EnvError::StartUnreachable)?
        .q;
    robot.begin_reset();
    let m = robot.sense().map_err(EnvError::Robot)?;
    let m = way_out(robot, config, base_T_hole, m)?;
    way_over(robot, config, m.state.q_target, &q_start)?;
    let dt = robot.period().as_secs_f64();
    for _ in 0..(config.settle_time / dt).ceil() as u64 {
        follow_joints(robot, &q_start)?;
    }
    robot.begin_episode().map_err(EnvError::Robot)?;
    robot.sense().map_err(EnvError::Robot)
}

/// Straight out along the hole's axis until the tool is clear of the board.
fn way_out<R: Guarded>(
    robot: &mut R,
    config: &ResetConfig,
    base_T_hole: &Pose,
    mut m: Measurement,
) -> Result<Measurement, EnvError<R::Error>> {
    let step = config.linear_speed * robot.period().as_secs_f64();
    let axis = base_T_hole.rotation * Vector3::z();
    let mut base_T_tool = robot.chain().forward(&m.state.q_target);
    let mut refused = 0;
    loop {
        let height = (base_T_tool.translation.vector - base_T_hole.translation.vector).dot(&axis);
        if !(height < config.clearance) {
            return Ok(m);
        }
        let mut next = base_T_tool;
        next.translation.vector += axis * step;
        match robot.command(&next).map_err(EnvError::Robot)? {
            Verdict::Accepted => {
                base_T_tool = next;
                refused = 0;
            }
            Verdict::Refused(refusal) => {
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
) -> Result<(), EnvError<R::Error>> {
    let dt = robot.period().as_secs_f64();
    let path = to - from;
    // The fastest joint peaks at π/2 times its mean speed.
    let duration = path.amax() * std::f64::consts::FRAC_PI_2 / config.joint_speed;
    let ticks = (duration / dt).ceil().max(1.0) as u64;
    for tick in 1..=ticks {
        let s = tick as f64 / ticks as f64;
        let blend = (1.0 - (std::f64::consts::PI * s).cos()) / 2.0;
        follow_joints(robot, &(from + path * blend))?;
    }
    // Exactly the goal, whatever the cosine rounded to.
    follow_joints(robot, to)
}

fn follow_joints<R: Guarded>(robot: &mut R, q: &JointVector) -> Result<(), EnvError<R::Error>> {
    match robot.command_joints(q).map_err(EnvError::Robot)? {
        Verdict::Accepted => {}
        Verdict::Refused(refusal @ (Refusal::NonFinite | Refusal::JointRange { .. })) => {
            return Err(EnvError::ResetRefused(refusal));
        }
        // A speed refusal behind a lagging arm clears itself: the next set-point is closer.
        Verdict::Refused(_) => {}
        Verdict::ForceExceeded(excess) => return Err(EnvError::ResetForce(excess)),
    }
    robot.sense().map(|_| ()).map_err(EnvError::Robot)
}
