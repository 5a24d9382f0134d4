//! Limits that contradict each other are found when they are loaded, not when the arm moves.

use palpate_kinematics::SerialChain;
use palpate_spatial::{DOF, Vector3};

use super::brake::Brake;
use super::config::ShieldConfig;
use super::headroom::Headroom;
use crate::limits::{LimitsError, SafetyConfig};

/// An arm that may not approach faster than this in free air cannot do its task, m/s.
const LEAST_SPEED: f64 = 1e-3;

fn require(ok: bool, key: &str, value: f64, must: impl Into<String>) -> Result<(), LimitsError> {
    if ok { Ok(()) } else { Err(LimitsError::new(&format!("shield.{key}"), value, must)) }
}

/// Checks `safety.shield` against itself, against the rest of `safety`, and against the arm.
pub(crate) fn consistent(
    safety: &SafetyConfig,
    shield: &ShieldConfig,
    chain: &SerialChain<DOF>,
    dt: f64,
) -> Result<(), LimitsError> {
    numbers(shield)?;
    stops(safety, shield, dt)?;
    ranges(shield, chain)?;
    workspace(shield, chain)?;
    planes(shield)?;
    forces(safety, shield, dt)
}

fn numbers(s: &ShieldConfig) -> Result<(), LimitsError> {
    let positive = [
        ("stop_time_max", s.stop_time_max),
        ("branch_step_max", s.branch_step_max),
        ("tool_step_max", s.tool_step_max),
        ("tracking_error_max", s.tracking_error_max),
        ("tool.radius", s.tool.radius),
        ("singularity.slow_below", s.singularity.slow_below),
        ("force.rearm_time", s.force.rearm_time),
        ("force.stiffness", s.force.stiffness),
        ("sensor.force_range", s.sensor.force_range),
        ("sensor.torque_range", s.sensor.torque_range),
        ("sensor.force_jump_max", s.sensor.force_jump_max),
        ("sensor.torque_jump_max", s.sensor.torque_jump_max),
        ("sensor.joint_jump_max", s.sensor.joint_jump_max),
        ("retreat.distance", s.retreat.distance),
        ("retreat.speed", s.retreat.speed),
        ("retreat.free_force", s.retreat.free_force),
        ("retreat.time_max", s.retreat.time_max),
        ("recovery.free_air_force", s.recovery.free_air_force),
        ("recovery.free_air_torque", s.recovery.free_air_torque),
        ("recovery.free_air_time", s.recovery.free_air_time),
    ];
    for (key, value) in positive {
        require(value > 0.0 && value.is_finite(), key, value, "positive and finite")?;
    }
    for (key, value) in [("joint_margin", s.joint_margin), ("clearance", s.clearance)] {
        require(value >= 0.0 && value.is_finite(), key, value, "zero or positive, and finite")?;
    }
    let (slow, stop) = (s.singularity.slow_below, s.singularity.stop_below);
    let must = format!("zero or positive, and below singularity.slow_below ({slow})");
    require(stop >= 0.0 && stop < slow, "singularity.stop_below", stop, must)?;
    let ratio = s.force.rearm_ratio;
    require(ratio > 0.0 && ratio < 1.0, "force.rearm_ratio", ratio, "between 0 and 1")?;
    let aim = s.force.aim_ratio;
    require(aim > 0.0 && aim <= 1.0, "force.aim_ratio", aim, "above 0 and at most 1")?;
    let (wait, calm) = (s.recovery.patience, s.recovery.free_air_time);
    let must = format!("at least recovery.free_air_time ({calm} s)");
    require(wait >= calm && wait.is_finite(), "recovery.patience", wait, must)?;
    for (key, value) in
        [("recovery.tries", s.recovery.tries), ("sensor.bad_samples_max", s.sensor.bad_samples_max)]
    {
        require(value > 0, key, f64::from(value), "at least 1")?;
    }
    let tool = s.tool.from.iter().chain(&s.tool.to).copied().find(|x| !x.is_finite());
    require(tool.is_none(), "tool", tool.unwrap_or(0.0), "finite")
}

/// Every joint can stop from its full speed in the time allowed.
fn stops(safety: &SafetyConfig, s: &ShieldConfig, dt: f64) -> Result<(), LimitsError> {
    for joint in 0..DOF {
        let (a, jerk) = (s.joint_acceleration_max[joint], s.joint_jerk_max[joint]);
        let key = |name: &str| format!("{name}[{joint}]");
        let must = "positive and finite";
        require(a > 0.0 && a.is_finite(), &key("joint_acceleration_max"), a, must)?;
        require(jerk > 0.0 && jerk.is_finite(), &key("joint_jerk_max"), jerk, must)?;
        let speed = safety.joint_velocity_max[joint];
        let time = Brake::new(a, jerk, dt).stopping_time(speed, 0.0);
        let must = format!(
            "larger: a stop from {speed:.3} rad/s takes {time:.3} s, more than shield.stop_time_max ({} s); or lower \
             joint_velocity_max[{joint}], or raise joint_jerk_max[{joint}]",
            s.stop_time_max
        );
        require(time <= s.stop_time_max, &key("joint_acceleration_max"), a, must)?;
        let per_tick = speed * dt;
        let must = format!(
            "at least the {per_tick:.4} rad that joint {joint} may move in one period at full speed"
        );
        require(s.branch_step_max >= per_tick, "branch_step_max", s.branch_step_max, must)?;
        let must = format!(
            "at least the {per_tick:.4} rad that joint {joint} moves in one period at full speed"
        );
        require(
            s.sensor.joint_jump_max >= per_tick,
            "sensor.joint_jump_max",
            s.sensor.joint_jump_max,
            must,
        )?;
    }
    Ok(())
}

fn ranges(s: &ShieldConfig, chain: &SerialChain<DOF>) -> Result<(), LimitsError> {
    for joint in 0..DOF {
        let (lower, upper) = (chain.limits().lower[joint], chain.limits().upper[joint]);
        let must =
            format!("less than half the range of joint {joint} ([{lower:.3}, {upper:.3}] rad)");
        require(upper - lower > 2.0 * s.joint_margin, "joint_margin", s.joint_margin, must)?;
    }
    Ok(())
}

/// The box is a box, and the tool can be in it.
fn workspace(s: &ShieldConfig, chain: &SerialChain<DOF>) -> Result<(), LimitsError> {
    let (min, max) = (s.workspace.min, s.workspace.max);
    for axis in 0..3 {
        let must = format!("finite and below workspace.max[{axis}] ({})", max[axis]);
        let ok = min[axis] < max[axis] && min[axis].is_finite() && max[axis].is_finite();
        require(ok, &format!("workspace.min[{axis}]"), min[axis], must)?;
    }
    let nearest = Vector3::from_fn(|i, _| 0.0f64.clamp(min[i], max[i]));
    let reach = chain.reach();
    let must = format!(
        "nearer: the box begins {:.3} m from the base and the tool reaches {reach:.3} m",
        nearest.norm()
    );
    require(nearest.norm() < reach, "workspace.min[0]", min[0], must)
}

fn planes(s: &ShieldConfig) -> Result<(), LimitsError> {
    for (i, plane) in s.planes.iter().enumerate() {
        let norm = plane.normal.norm();
        let key = |what: &str| format!("planes[{i}].{what}");
        require((norm - 1.0).abs() < 1e-6, &key("normal"), norm, "a unit vector")?;
        require(plane.offset.is_finite(), &key("offset"), plane.offset, "finite")?;
        let must = "a list of at least one capsule";
        require(!plane.capsules.is_empty(), &key("capsules"), 0.0, must)?;
    }
    Ok(())
}

/// Soft < hard < range, per axis ≤ norm, and an approach speed that leaves something to do.
fn forces(safety: &SafetyConfig, s: &ShieldConfig, dt: f64) -> Result<(), LimitsError> {
    let f = &s.force;
    let kinds = [
        (
            "force",
            safety.force_max,
            safety.reset.force_max,
            f.force_norm_max,
            f.force_hard_max,
            s.sensor.force_range,
        ),
        (
            "torque",
            safety.torque_max,
            safety.reset.torque_max,
            f.torque_norm_max,
            f.torque_hard_max,
            s.sensor.torque_range,
        ),
    ];
    for (what, axis, reset, norm, hard, range) in kinds {
        let key = format!("force.{what}_norm_max");
        let must = format!(
            "between {what}_max ({axis}) and √3 times that, or one of the two says nothing"
        );
        require(norm >= axis && norm <= axis * 3f64.sqrt() + 1e-9, &key, norm, must)?;
        let key = format!("force.{what}_hard_max");
        let soft = norm.max(reset * norm / axis);
        let must = format!(
            "at least the largest soft limit on the norm, {soft:.2} (the reset's, scaled alike)"
        );
        require(hard >= soft, &key, hard, must)?;
        let key = format!("sensor.{what}_range");
        let must = format!(
            "above force.{what}_hard_max ({hard}): what the sensor cannot read cannot trip"
        );
        require(range * super::plausible::SATURATED > hard, &key, range, must)?;
    }
    let reaction = f.reaction_time;
    let must = format!("at least two control periods ({} s)", 2.0 * dt);
    require(reaction >= 2.0 * dt && reaction.is_finite(), "force.reaction_time", reaction, must)?;
    let speed =
        Headroom::new(f.stiffness, reaction).free_speed(f.aim_ratio * safety.force_max, 0.0);
    let must = format!(
        "smaller, or force.reaction_time must be: {speed:.5} m/s is all that force_max leaves for the approach, \
         less than {LEAST_SPEED} m/s"
    );
    require(speed >= LEAST_SPEED, "force.stiffness", f.stiffness, must)?;
    let free = s.retreat.free_force;
    let must = format!("below force_max ({})", safety.force_max);
    require(free < safety.force_max, "retreat.free_force", free, must)?;
    let free = s.recovery.free_air_force;
    let must = format!("below force_max ({})", safety.force_max);
    require(free < safety.force_max, "recovery.free_air_force", free, must)?;
    let gap = s.sensor.gap_max;
    let must = format!("at least the control period ({dt} s)");
    require(gap >= dt && gap.is_finite(), "sensor.gap_max", gap, must)
}
