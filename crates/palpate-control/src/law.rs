//! What every law has in common.

use palpate_spatial::{Twist, Vector6, Wrench};

/// Everything one control tick sees; base axes, about the tool centre point.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ControlInput {
    /// x_e = x_g − x: m, and sin(θ/2)·n.
    pub pose_error: Vector6,
    /// F_ext: environment on tool, filtered and tared.
    pub wrench: Wrench,
    /// a_x: the policy's motion, m/s and rad/s.
    pub action: Twist,
}

/// The family of a law.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Law {
    /// Parallel position/force control.
    Parallel,
    /// Admittance control.
    Admittance,
}

/// Gains of the parallel law, per axis.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ParallelGains {
    /// K_p^x, 1/s (angular part: rad/s per unit of sin(θ/2)).
    pub kp_x: Vector6,
    /// K_p^f, (m/s)/N and (rad/s)/(N·m).
    pub kp_f: Vector6,
    /// s_j in [0, 1]: 1 is all position, 0 all force.
    pub selection: Vector6,
}

/// Gains of the admittance law, per axis.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AdmittanceGains {
    /// K_p^x, 1/s.
    pub kp_x: Vector6,
    /// k_d: N/m and N·m/rad (velocity output: N·s/m and N·m·s/rad).
    pub stiffness: Vector6,
}

/// Gains of either law.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Gains {
    /// For [`Law::Parallel`].
    Parallel(ParallelGains),
    /// For [`Law::Admittance`].
    Admittance(AdmittanceGains),
}

/// Why a law, its gains or a policy model was refused.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum ControlError {
    /// Gains of the other family.
    #[error("gains of another law were given to the {0:?} law")]
    WrongLaw(Law),
    /// A number that makes no sense.
    #[error("{key} is {value}, but it must be {must}")]
    BadValue {
        /// Path of the key.
        key: String,
        /// Its value.
        value: f64,
        /// What it must be.
        must: String,
    },
    /// A gain that the law needs and the model lacks, or the other way round.
    #[error("policy.gains.{0} {1}")]
    GainSet(String, &'static str),
    /// An action of the wrong length.
    #[error("the action has {found} components, but the policy model has {expected}")]
    ActionLength {
        /// Components given.
        found: usize,
        /// Components expected.
        expected: usize,
    },
    /// An action that is not finite.
    #[error("component {index} of the action is {value}")]
    ActionNotFinite {
        /// Component.
        index: usize,
        /// Its value.
        value: f64,
    },
}

/// A force-control law whose gains may change from tick to tick.
pub trait ForceController {
    /// Sets the gains. Bumpless: what the law has integrated so far is kept in output units.
    ///
    /// # Errors
    /// Gains of another law.
    fn set_gains(&mut self, gains: &Gains) -> Result<(), ControlError>;

    /// One tick of `dt` seconds.
    fn update(&mut self, input: &ControlInput, dt: f64) -> Twist;

    /// The last update's command was refused: takes back what it integrated, so that a held arm winds
    /// nothing up.
    fn command_refused(&mut self);

    /// Forgets everything but the gains.
    fn reset(&mut self);
}
