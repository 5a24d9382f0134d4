//! What every law has in common.

use palpate_spatial::{Twist, Vector6, Wrench};

use crate::error::{AXES, ControlError, bad};

/// Everything one control tick sees; base axes, about the tool centre point.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ControlInput {
    /// x_e = x_g − x: m, and sin(θ/2)·n.
    pub pose_error: Vector6,
    /// F_ext: environment on tool, N and N·m, filtered and tared.
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

impl std::fmt::Display for Law {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(match self {
            Self::Parallel => "parallel",
            Self::Admittance => "admittance",
        })
    }
}

/// Gains of the parallel law, per base axis.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ParallelGains {
    /// K_p^x, 1/s (angular part: rad/s per unit of sin(θ/2)).
    pub kp_x: Vector6,
    /// K_p^f, (m/s)/N and (rad/s)/(N·m).
    pub kp_f: Vector6,
    /// s_j in [0, 1]: 1 is all position, 0 all force.
    pub selection: Vector6,
}

/// Gains of the admittance law, per base axis.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AdmittanceGains {
    /// K_p^x, 1/s (angular part: rad/s per unit of sin(θ/2)).
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

impl ParallelGains {
    /// No motion whatever happens: what a law starts with.
    pub(crate) const ZERO: Self = Self { kp_x: ZERO, kp_f: ZERO, selection: ZERO };

    pub(crate) fn check(&self) -> Result<(), ControlError> {
        not_negative("kp_x", &self.kp_x)?;
        not_negative("kp_f", &self.kp_f)?;
        each("selection", &self.selection, "within [0, 1]", |s| (0.0..=1.0).contains(&s))
    }
}

impl AdmittanceGains {
    pub(crate) fn check(&self) -> Result<(), ControlError> {
        not_negative("kp_x", &self.kp_x)?;
        each("stiffness", &self.stiffness, "positive and finite", |k| k > 0.0 && k.is_finite())
    }
}

const ZERO: Vector6 = Vector6::from_array_storage(nalgebra::ArrayStorage([[0.0; 6]]));

fn not_negative(name: &str, values: &Vector6) -> Result<(), ControlError> {
    each(name, values, "zero or positive, and finite", |k| k >= 0.0 && k.is_finite())
}

fn each(
    name: &str,
    values: &Vector6,
    must: &str,
    good: impl Fn(f64) -> bool,
) -> Result<(), ControlError> {
    match (0..6).find(|&axis| !good(values[axis])) {
        Some(axis) => Err(bad(format!("{name}.{}", AXES[axis]), values[axis], must)),
        None => Ok(()),
    }
}

/// A force-control law whose gains may change from tick to tick.
///
/// # Contract
///
/// 1. The first [`update`](Self::update) after a [`reset`](Self::reset) has no derivative term:
///    there is no earlier sample to differ from.
/// 2. [`set_gains`](Self::set_gains) moves no state. What was integrated is kept in output units, so
///    the output changes by what the new gains make of the present input, and by nothing else.
/// 3. [`command_refused`](Self::command_refused) takes back the last update, once: an arm that is
///    held winds nothing up, however long it is held.
/// 4. A non-finite input gives a non-finite output, which the fail-safe layer refuses; after
///    [`command_refused`](Self::command_refused) nothing of it remains.
pub trait ForceController {
    /// Sets the gains; those in force stay if these are refused.
    ///
    /// # Errors
    /// Gains of another law, or a gain without meaning.
    fn set_gains(&mut self, gains: &Gains) -> Result<(), ControlError>;

    /// The tool's twist for the next `dt` seconds (positive); base axes, m/s and rad/s.
    fn update(&mut self, input: &ControlInput, dt: f64) -> Twist;

    /// The last update's command was not carried out: takes back what it integrated.
    fn command_refused(&mut self);

    /// Forgets everything but the gains.
    fn reset(&mut self);
}
