//! What a model may do that is allowed and unwise.

use crate::config::ControlConfig;
use crate::error::AXES;
use crate::law::Law;
use crate::model::PolicyModel;

/// A corner of the gain ranges where a loop does not settle. Not an error: a lag of the servo or a
/// policy that stays away from the corner may make it harmless.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub enum Warning {
    /// S·(K_d + K_p·dt/2) ≥ 1, or half of it on a rotation, whose x_e is sin(θ/2): the position loop
    /// diverges, if the pose follows the command at once.
    Derivative {
        /// Axis.
        axis: usize,
        /// Greatest S that actions reach (1 in the admittance law).
        selection: f64,
        /// Greatest K_p^x that actions reach.
        kp: f64,
        /// Its K_d^x.
        kd: f64,
        /// The product that must stay below 1.
        product: f64,
    },
    /// ω_n·dt ≥ 1: the admittance model settles within a tick; inertia and damping are without
    /// effect and u follows F/k_d at once.
    ModelTooFast {
        /// Axis.
        axis: usize,
        /// Greatest k_d that actions reach.
        stiffness: f64,
        /// ω_n·dt.
        omega_dt: f64,
    },
    /// The contact is stiffer than the force loop stands at some gains: pressing limit-cycles.
    Contact {
        /// Axis, 0–2.
        axis: usize,
        /// Stiffness of the contact, N/m.
        contact: f64,
        /// Stiffness at which the loop starts to oscillate, N/m.
        limit: f64,
        /// Cut-off of the force filter, Hz.
        cutoff: f64,
    },
}

impl std::fmt::Display for Warning {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match *self {
            Self::Derivative { axis, selection, kp, kd, product } => write!(
                f,
                "axis {}: {}S·(K_d + K_p·dt/2) reaches {product:.2} (S {selection:.2}, K_p {kp:.2}, K_d {kd:.2}), \
                 and from 1 on the position loop diverges where the arm follows at once: lower S or K_p, \
                 or choose another derivative_rule",
                AXES[axis],
                if axis < 3 { "" } else { "½·" }
            ),
            Self::ModelTooFast { axis, stiffness, omega_dt } => write!(
                f,
                "axis {}: the admittance model has ω_n·dt = {omega_dt:.2} at k_d {stiffness:.1}, so that it \
                 settles within a tick: lower k_d or raise control.admittance.inertia",
                AXES[axis]
            ),
            Self::Contact { axis, contact, limit, cutoff } => write!(
                f,
                "axis {}: a contact of {contact:.0} N/m is stiffer than the {limit:.0} N/m at which the force \
                 loop starts to oscillate at its strongest gains behind a {cutoff} Hz filter",
                AXES[axis]
            ),
        }
    }
}

impl PolicyModel {
    /// Corners of a valid model's gain ranges where a sampled loop of period `dt` (s) does not settle.
    pub fn warnings(&self, control: &ControlConfig, dt: f64) -> Vec<Warning> {
        let mut warnings = Vec::new();
        let rule = match self.law {
            Law::Parallel => control.parallel.derivative_rule,
            Law::Admittance => control.admittance.derivative_rule,
        };
        for axis in 0..6 {
            let kp = self.gains.position.bounds(self.range_map, axis).1;
            let kd = rule.derivative_gain(kp, axis);
            let spec = self.gains.selection.as_ref();
            let selection = spec.map_or(1.0, |s| s.bounds(self.range_map, axis).1);
            // A rotation by θ moves x_e by θ/2.
            let moved = if axis < 3 { 1.0 } else { 0.5 };
            let product = moved * selection * (kd + 0.5 * kp * dt);
            if !(product < 1.0) {
                warnings.push(Warning::Derivative { axis, selection, kp, kd, product });
            }
        }
        for axis in 0..6 {
            let Some(spec) = &self.gains.stiffness else { break };
            let stiffness = spec.bounds(self.range_map, axis).1;
            let omega_dt = (stiffness / control.admittance.inertia).sqrt() * dt;
            if !(omega_dt < 1.0) {
                warnings.push(Warning::ModelTooFast { axis, stiffness, omega_dt });
            }
        }
        warnings
    }

    /// Axes on which a contact of `contact` N/m is stiffer than the force loop stands at its strongest
    /// gains, behind a force filter of `cutoff` Hz. See
    /// [`ParallelConfig::contact_limit`](crate::ParallelConfig::contact_limit) for what that leaves out.
    pub fn contact_warnings(
        &self,
        control: &ControlConfig,
        contact: f64,
        cutoff: f64,
    ) -> Vec<Warning> {
        let least = |axis| {
            let bounds = |spec: &crate::GainSpec| spec.bounds(self.range_map, axis);
            let g = &self.gains;
            match (&g.force, &g.selection, &g.stiffness) {
                (Some(force), Some(selection), _) => control.parallel.contact_limit(
                    bounds(&g.position).0,
                    bounds(force).1,
                    bounds(selection).0,
                    cutoff,
                ),
                (_, _, Some(stiffness)) => {
                    control.admittance.contact_limit(bounds(stiffness).0, cutoff)
                }
                _ => f64::NAN,
            }
        };
        (0..3)
            .map(|axis| Warning::Contact { axis, contact, limit: least(axis), cutoff })
            .filter(|w| !matches!(w, Warning::Contact { contact, limit, .. } if contact < limit))
            .collect()
    }
}
