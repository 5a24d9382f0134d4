//! The limits, which have no defaults: a configuration states every one.
#![expect(clippy::neg_cmp_op_on_partial_ord, reason = "NaN must fail")]

use palpate_spatial::{JointVector, Wrench};

use crate::shield::ShieldConfig;
use crate::{Excess, Refusal};

/// Order of the checks.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Mode {
    /// Algorithm 1 as printed: IK, then joint speed, then force. A refused command skips the force
    /// check of its step.
    Paper,
    /// Force before anything else, every tick, so that a press is noticed even while commands are
    /// being refused.
    ForceFirst,
    /// Only commands after which the arm can still brake legally; see [`shield`](crate::shield). Needs
    /// `[safety.shield]`.
    Shield,
}

/// What a commanded joint step is measured from.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum SpeedReference {
    /// q_t, the measured joints, as printed. Behind a servo lag τ a steady speed v looks like
    /// v·(τ + dt)/dt, so commands are refused far below the limit.
    Measured,
    /// The last accepted set-point.
    Commanded,
}

/// Limits of the fail-safe layer. Every key must be stated.
#[derive(Clone, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SafetyConfig {
    /// Order of the checks.
    pub mode: Mode,
    /// Largest contact force along any base axis, N, on the filtered wrench at the tool centre point.
    pub force_max: f64,
    /// Largest contact torque about any base axis, N·m, likewise.
    pub torque_max: f64,
    /// Largest joint speed per joint, rad/s.
    pub joint_velocity_max: JointVector,
    /// What a joint step is measured from.
    pub speed_reference: SpeedReference,
    /// Cut-off of the force filter (second-order Butterworth), Hz.
    pub force_filter_cutoff: f64,
    /// Verdicts that the ledger keeps until they are written; older ones are only counted.
    pub ledger_entries: usize,
    /// Limits while the arm is driven back to its start.
    pub reset: ResetLimits,
    /// Limits of the shield. The other modes ignore them.
    pub shield: Option<ShieldConfig>,
}

/// Limits that hold during a reset, when the tool may first have to come out of a jam.
#[derive(Clone, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ResetLimits {
    /// Largest contact force along any base axis, N.
    pub force_max: f64,
    /// Largest contact torque about any base axis, N·m.
    pub torque_max: f64,
}

/// A limit that makes no sense.
#[derive(Debug, thiserror::Error)]
#[error("safety.{key} is {value}, but it must be {must}")]
pub struct LimitsError {
    key: String,
    value: String,
    must: String,
}

impl LimitsError {
    pub(crate) fn new(key: &str, value: impl std::fmt::Display, must: impl Into<String>) -> Self {
        Self { key: key.into(), value: format!("{value}"), must: must.into() }
    }

    pub(crate) fn no_shield() -> Self {
        Self::new(
            "shield",
            "missing",
            "stated in full for safety.mode = \"shield\": it has no defaults",
        )
    }
}

impl SafetyConfig {
    /// Checks that every limit is positive and no looser than the arm's own joint speeds (rad/s) and
    /// that the filter's cut-off is below half the sample rate (Hz).
    pub fn validate(
        &self,
        arm_velocity: &JointVector,
        sample_rate: f64,
    ) -> Result<(), LimitsError> {
        let positive = [
            ("force_max", self.force_max),
            ("torque_max", self.torque_max),
            ("reset.force_max", self.reset.force_max),
            ("reset.torque_max", self.reset.torque_max),
        ];
        for (key, value) in positive {
            if !(value > 0.0 && value.is_finite()) {
                return Err(LimitsError::new(key, value, "positive and finite"));
            }
        }
        for (joint, (&value, &arm)) in self.joint_velocity_max.iter().zip(arm_velocity).enumerate()
        {
            if !(value > 0.0 && value <= arm) {
                let key = format!("joint_velocity_max[{joint}]");
                return Err(LimitsError::new(
                    &key,
                    value,
                    format!("positive and at most the arm's own limit of {arm:.4} rad/s"),
                ));
            }
        }
        let nyquist = sample_rate / 2.0;
        if !(self.force_filter_cutoff > 0.0 && self.force_filter_cutoff < nyquist) {
            return Err(LimitsError::new(
                "force_filter_cutoff",
                self.force_filter_cutoff,
                format!("positive and below half the sample rate ({nyquist} Hz)"),
            ));
        }
        Ok(())
    }
}

/// |F_i| ≤ force_max and |τ_i| ≤ torque_max for every axis; NaN exceeds.
pub(crate) fn check_wrench(wrench: &Wrench, force_max: f64, torque_max: f64) -> Result<(), Excess> {
    let components = wrench.vector();
    for (axis, value) in components.iter().copied().enumerate() {
        let limit = if axis < 3 { force_max } else { torque_max };
        if !(value.abs() <= limit) {
            return Err(Excess { axis, value, limit });
        }
    }
    Ok(())
}

/// |q_c − q_t| / dt ≤ q̇_max for every joint; NaN fails.
pub(crate) fn check_speed(
    from: &JointVector,
    to: &JointVector,
    dt: f64,
    max: &JointVector,
) -> Result<(), Refusal> {
    for joint in 0..from.len() {
        let speed = (to[joint] - from[joint]).abs() / dt;
        if !(speed <= max[joint]) {
            return Err(Refusal::JointSpeed { joint, speed, limit: max[joint] });
        }
    }
    Ok(())
}
