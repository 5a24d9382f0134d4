//! Settings of the laws. Every key must be stated.

use crate::error::{ControlError, bad};

/// Settings of both laws.
///
/// The cut-off of the force filter is not here: the wrench that the law sees is the one that the
/// fail-safe layer judges, so that layer owns the [`LowPass`](crate::LowPass).
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
    /// u = S·PD + a_x + (I−S)·PI: the paper, eq. 1. a_x moves the tool whatever S is.
    OutsideSelection,
    /// u = S·(PD + a_x) + (I−S)·PI: the authors' released controllers. S scales a_x too.
    InsideSelection,
}

/// K_d^x as a function of K_p^x.
///
/// ẋ_e is a backward difference. Where the pose follows the command at once, the loop
/// e⁺ = e − S·(K_p·dt·e + K_d·Δe) diverges unless S·(K_d + K_p·dt/2) < 1
/// ([`PolicyModel::warnings`](crate::PolicyModel::warnings)): the printed rule at K_p = 5 needs
/// S < 0.22. (A rotation moves its x_e = sin(θ/2) half as far: twice the limit.) It also slows the loop it damps, by 1 + S·K_d. Hence `none` in the default preset.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum DerivativeRule {
    /// K_d = 0.
    None,
    /// K_d = 2√K_p: the paper, Sect. III-D.1. The number is that of SI units; a velocity command has
    /// no mass for it to damp critically.
    Critical,
    /// K_d = 0.1·K_p: the authors' later controllers.
    Tenth,
    /// K_d = √(K_p·e) with e = 0.01 (translation), 0.06 (rotation): the authors' controllers of
    /// 2020. There K_p = p·e and K_d = √p·e with a scalar p (500 ± 400) and a base e per axis.
    RootTimesBase,
}

impl DerivativeRule {
    /// K_d for the K_p of an axis (0–2 translation, 3–5 rotation); both K_d and S are dimensionless.
    pub fn derivative_gain(self, kp: f64, axis: usize) -> f64 {
        match self {
            Self::None => 0.0,
            Self::Critical => 2.0 * kp.sqrt(),
            Self::Tenth => 0.1 * kp,
            Self::RootTimesBase => (kp * if axis < 3 { 0.01 } else { 0.06 }).sqrt(),
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
    /// Bound of the integral term, m/s and rad/s. The authors' code: 1, which never binds.
    pub integral_limit: f64,
}

/// What the admittance model's x is to the arm.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum AdmittanceOutput {
    /// A displacement from the nominal trajectory, as printed: u contains Δx/dt, so that the integrated
    /// pose contains x. At rest it yields F/k_d like a spring; the PD goes on pushing.
    Displacement,
    /// A velocity, as in the authors' code: u contains x. At rest it yields at F/k_d like a damper, and
    /// a press settles at F = k_d·PD.
    Velocity,
}

/// Settings of the admittance law.
#[derive(Clone, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(deny_unknown_fields)]
pub struct AdmittanceConfig {
    /// m_d, the same on all axes: kg, kg·m² (velocity output: kg·s, kg·m²·s). The paper: 0.1, printed
    /// with kg·m² for all six.
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
            return Err(bad(
                "control.parallel.integral_ratio",
                ratio,
                "zero or positive, and finite",
            ));
        }
        Ok(())
    }
}
