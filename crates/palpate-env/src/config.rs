//! Settings of the loops, the observation and the way back to the start.

use crate::ObservationConfig;

/// Where the commanded pose x_c is integrated from.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Reference {
    /// From the last accepted x_c. A servo lag then delays the motion but does not shrink it.
    Integrated,
    /// From the measured pose, as the paper's authors do. Behind a servo lag τ the realised speed
    /// shrinks by 1 − exp(−dt/τ).
    Measured,
}

/// Settings of an environment. Every key must be stated.
#[derive(Clone, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(deny_unknown_fields)]
pub struct EnvConfig {
    /// Time between two actions, s. The paper: 0.05.
    pub policy_period: f64,
    /// Steps after which an episode is truncated. The paper: 150.
    pub max_steps: u32,
    /// Where x_c is integrated from.
    pub reference: Reference,
    /// What the policy sees.
    pub observation: ObservationConfig,
    /// How the arm drives back to its start.
    pub reset: ResetConfig,
}

/// The way back: out along the hole's axis, over to the start in joint space, settle, tare.
#[derive(Clone, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ResetConfig {
    /// Height of the tool above the hole's mouth before it moves sideways, m.
    pub clearance: f64,
    /// Speed of the way out, m/s.
    pub linear_speed: f64,
    /// Largest joint speed on the way over, rad/s.
    pub joint_speed: f64,
    /// Time at rest before the sensor is tared, s.
    pub settle_time: f64,
}

/// A setting that makes no sense.
#[derive(Debug, thiserror::Error)]
#[error("{key} is {value}, but it must be {must}")]
pub struct ConfigError {
    /// Path of the key.
    pub key: &'static str,
    /// What it is.
    pub value: f64,
    /// What it must be.
    pub must: &'static str,
}

pub(crate) fn require(
    ok: bool,
    key: &'static str,
    value: f64,
    must: &'static str,
) -> Result<(), ConfigError> {
    if ok { Ok(()) } else { Err(ConfigError { key, value, must }) }
}

impl EnvConfig {
    /// Checks ranges; returns the control ticks per action for a control period (s).
    pub fn validate(&self, control_period: f64) -> Result<u32, ConfigError> {
        let ticks = (self.policy_period / control_period).round();
        require(
            ticks >= 1.0 && (ticks * control_period - self.policy_period).abs() < 1e-9,
            "env.policy_period",
            self.policy_period,
            "a whole number of control periods",
        )?;
        require(self.max_steps > 0, "env.max_steps", self.max_steps.into(), "positive")?;
        let reset = &self.reset;
        let positive = |x: f64| x > 0.0 && x.is_finite();
        require(positive(reset.clearance), "env.reset.clearance", reset.clearance, "positive")?;
        require(
            positive(reset.linear_speed),
            "env.reset.linear_speed",
            reset.linear_speed,
            "positive",
        )?;
        require(
            positive(reset.joint_speed),
            "env.reset.joint_speed",
            reset.joint_speed,
            "positive",
        )?;
        require(
            reset.settle_time >= 0.0 && reset.settle_time.is_finite(),
            "env.reset.settle_time",
            reset.settle_time,
            "zero or positive",
        )?;
        Ok(ticks as u32)
    }
}
