//! The shield's limits. There are no defaults: a configuration states every key.

use palpate_spatial::{JointVector, Vector3};

use super::capsule::Capsule;

/// `[safety.shield]`.
#[derive(Clone, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ShieldConfig {
    /// The arm's capsules: `ur3e`, `ur5e`, `ur10e`, or a path to a file like theirs.
    pub shape: String,
    /// Largest joint acceleration, rad/s².
    pub joint_acceleration_max: JointVector,
    /// Largest joint jerk, rad/s³.
    pub joint_jerk_max: JointVector,
    /// Distance that every joint keeps from the ends of its range, rad.
    pub joint_margin: f64,
    /// Longest stop from full speed that is accepted at load, s.
    pub stop_time_max: f64,
    /// Largest joint step of one command, rad: beyond it, it is a branch flip or a jump.
    pub branch_step_max: f64,
    /// Largest tool step of one command, m.
    pub tool_step_max: f64,
    /// Largest distance of the measured joints from their set-points, rad.
    pub tracking_error_max: f64,
    /// Distance that capsules keep from planes and from each other, m.
    pub clearance: f64,
    /// What is mounted on the flange, tool0 axes. Its capsule is called `tool`.
    pub tool: Capsule,
    /// Where the tool centre point may be.
    pub workspace: Workspace,
    /// Table and fixtures.
    pub planes: Vec<Plane>,
    /// Slow-down near singularities.
    pub singularity: SingularityConfig,
    /// Force supervision beyond `safety.force_max` and `safety.torque_max`.
    pub force: ForceConfig,
    /// What the sensors can and cannot say.
    pub sensor: SensorConfig,
    /// The way out of a contact after a force stop.
    pub retreat: RetreatConfig,
    /// When to try again and when to ask a person.
    pub recovery: RecoveryConfig,
}

/// A box for the tool centre point, base axes, m.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Workspace {
    /// Least coordinates.
    pub min: Vector3,
    /// Largest coordinates.
    pub max: Vector3,
}

/// A half-space n·p ≥ offset that some capsules must stay in.
#[derive(Clone, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Plane {
    /// A name for reports.
    pub name: String,
    /// Unit normal, base axes, pointing to where the arm may be.
    pub normal: Vector3,
    /// Distance of the plane from the base's origin along the normal, m.
    pub offset: f64,
    /// Capsules that it holds for, by name. Leave out what is meant to touch.
    pub capsules: Vec<String>,
}

/// Slow-down by the manipulability |det J| (m³·rad³ in SI; compare within one arm and tool).
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SingularityConfig {
    /// Below it, motion towards the singularity is slowed.
    pub slow_below: f64,
    /// Below it, there is none. Motion away is never slowed.
    pub stop_below: f64,
}

/// Force limits of the shield.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ForceConfig {
    /// Largest norm of the contact force, N (2 of 3 samples, like `force_max` per axis).
    pub force_norm_max: f64,
    /// Largest norm of the contact torque, N·m.
    pub torque_norm_max: f64,
    /// Force norm that trips at once, N, whatever the phase.
    pub force_hard_max: f64,
    /// Torque norm that trips at once, N·m.
    pub torque_hard_max: f64,
    /// Part of a limit below which the force must fall to count as gone.
    pub rearm_ratio: f64,
    /// Time that it must stay there, s.
    pub rearm_time: f64,
    /// Part of `force_max` that the approach aims at, so that a steady press does not trip.
    pub aim_ratio: f64,
    /// Stiffest contact to be expected, in series with tool, sensor and arm, N/m.
    pub stiffness: f64,
    /// Time from a force to the beginning of the brake at the joints: period, filter, servo lag; s. The time that
    /// the brake itself takes is added.
    pub reaction_time: f64,
}

/// Plausibility of the samples.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SensorConfig {
    /// Force per axis at which the sensor saturates, N.
    pub force_range: f64,
    /// Torque per axis at which the sensor saturates, N·m.
    pub torque_range: f64,
    /// Largest change of a force component between samples, N.
    pub force_jump_max: f64,
    /// Largest change of a torque component between samples, N·m.
    pub torque_jump_max: f64,
    /// Largest change of a joint between samples, rad.
    pub joint_jump_max: f64,
    /// Longest time between samples on the robot's clock, s.
    pub gap_max: f64,
    /// Samples with bitwise the same wrench that mean a frozen sensor; 0 for a sensor without noise.
    pub stuck_samples: u32,
    /// Implausible samples in a row after which the arm is stopped for a person.
    pub bad_samples_max: u32,
}

/// The compliant retreat: along the contact force, until it is gone.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RetreatConfig {
    /// Longest way, m.
    pub distance: f64,
    /// Speed, m/s.
    pub speed: f64,
    /// Force norm at which it ends, N.
    pub free_force: f64,
    /// Longest time, s.
    pub time_max: f64,
}

/// Trying again.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RecoveryConfig {
    /// Attempts at the way back before a person is asked.
    pub tries: u32,
    /// Force norm that still counts as free air, N: bias and drift, not contact.
    pub free_air_force: f64,
    /// Torque norm likewise, N·m.
    pub free_air_torque: f64,
    /// Time that it must stay there, s.
    pub free_air_time: f64,
    /// Longest wait for that, s.
    pub patience: f64,
}
