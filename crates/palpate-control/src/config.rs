//! Settings of the laws. Every key must be stated.

use crate::ControlError;

/// Settings of both laws.
#[derive(Clone, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ControlConfig {
    /// Bound of the commanded linear speed, m/s.
    pub max_linear_speed: f64,
    /// Bound of the commanded angular speed, rad/s.
    pub max_angular_speed: f64,
    /// The parallel position/force law.
    pub parallel: ParallelConfig,
    /// The admittance law.
    pub admittance: AdmittanceConfig,
}

/// Where the policy's motion enters the parallel law.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum ActionPlacement {
    /// u = S·PD + a_x + (I−S)·PI, as printed.
    OutsideSelection,
    /// u = S·(PD + a_x) + (I−S)·PI, as in the authors' code.
    InsideSelection,
}

/// K_d^x as a function of K_p^x.
///
/// ẋ_e is a backward difference. If the pose follows the command at once, the loop diverges unless
/// S·(K_d + K_p·dt/2) < 1: with the printed rule at K_p = 1, S < 0.5.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum DerivativeRule {
    /// K_d = 0.
    None,
    /// K_d = 2√K_p, as printed.
    Critical,
    /// K_d = 0.1·K_p, as in the authors' later code.
    Tenth,
}

impl DerivativeRule {
    /// K_d for a K_p.
    pub fn derivative_gain(self, kp: f64) -> f64 {
        match self {
            Self::None => 0.0,
            Self::Critical => 2.0 * kp.sqrt(),
            Self::Tenth => 0.1 * kp,
        }
    }
}

/// Settings of the parallel law.
#[derive(Clone, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ParallelConfig {
    /// Where a_x enters.
    pub action_placement: ActionPlacement,
    /// K_d^x.
    pub derivative_rule: DerivativeRule,
    /// K_i^f / K_p^f, 1/s. The paper: 0.01.
    pub integral_ratio: f64,
    /// Bound of the integral term, m/s and rad/s.
    pub integral_limit: f64,
}

/// What the admittance model's output is.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum AdmittanceOutput {
    /// x is a displacement from the nominal trajectory, as printed; u contains its rate of change.
    Displacement,
    /// x is added to u as a velocity, as in the authors' code. At rest u = F/k_d: a damper.
    Velocity,
}

/// Settings of the admittance law.
#[derive(Clone, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(deny_unknown_fields)]
pub struct AdmittanceConfig {
    /// m_d, the same on all axes. The paper: 0.1.
    pub inertia: f64,
    /// ζ. The paper: constant, value not given.
    pub damping_ratio: f64,
    /// K_d^x of the nominal trajectory.
    pub derivative_rule: DerivativeRule,
    /// What x is.
    pub output: AdmittanceOutput,
}

impl ControlConfig {
    /// Checks that every number makes sense.
    ///
    /// # Errors
    /// The first key that does not, by name.
    pub fn validate(&self) -> Result<(), ControlError> {
        let positive = [
            ("control.max_linear_speed", self.max_linear_speed),
            ("control.max_angular_speed", self.max_angular_speed),
            ("control.parallel.integral_limit", self.parallel.integral_limit),
            ("control.admittance.inertia", self.admittance.inertia),
            ("control.admittance.damping_ratio", self.admittance.damping_ratio),
        ];
        for (key, value) in positive {
            if !(value > 0.0 && value.is_finite()) {
                return Err(bad(key, value, "positive and finite"));
            }
        }
        let ratio = self.parallel.integral_ratio;
        if !(ratio >= 0.0 && ratio.is_finite()) {
            return Err(bad("control.parallel.integral_ratio", ratio, "zero or positive"));
        }
        Ok(())
    }
}

pub(crate) fn bad(key: &str, value: f64, must: impl Into<String>) -> ControlError {
    ControlError::BadValue { key: key.into(), value, must: must.into() }
}
