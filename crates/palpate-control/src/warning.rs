//! What a model may do that is allowed and unwise.
#![expect(clippy::neg_cmp_op_on_partial_ord, reason = "NaN is no all-clear")]

use palpate_spatial::Vector6;

use crate::config::ControlConfig;
use crate::error::AXES;
use crate::force_loop::ForceLoop;
use crate::law::{AdmittanceGains, Gains, Law, ParallelGains};
use crate::model::{GainSpec, PolicyModel};

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
        /// Lag of the servo, s.
        servo_lag: f64,
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
            Self::Contact { axis, contact, limit, cutoff, servo_lag } => write!(
                f,
                "axis {}: a contact of {contact:.0} N/m is stiffer than the {limit:.0} N/m at which the force \
                 loop starts to oscillate at its strongest gains behind a {cutoff} Hz filter and a servo lag of \
                 {:.0} ms: weaken the force gains (raise the least k_d), raise the cut-off or soften the contact. \
                 A policy may learn to keep away from such gains (docs/results/stability.md)",
                AXES[axis],
                1e3 * servo_lag
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

    /// Axes on which a contact of `contact` N/m is stiffer than the force loop stands at some corner of the
    /// gain ranges: [`ForceLoop::contact_limit`].
    pub fn contact_warnings(
        &self,
        control: &ControlConfig,
        contact: f64,
        force_loop: &ForceLoop,
    ) -> Vec<Warning> {
        let ForceLoop { cutoff, servo_lag, .. } = *force_loop;
        (0..3)
            .map(|axis| {
                let limit = self.least_contact_limit(control, force_loop, axis);
                Warning::Contact { axis, contact, limit, cutoff, servo_lag }
            })
            .filter(|w| !matches!(w, Warning::Contact { contact, limit, .. } if contact < limit))
            .collect()
    }

    /// The softest contact, N/m (N·m/rad), at which a corner of the gain ranges of `axis` stops settling.
    pub fn least_contact_limit(
        &self,
        control: &ControlConfig,
        force_loop: &ForceLoop,
        axis: usize,
    ) -> f64 {
        let ends = |spec: &Option<GainSpec>| {
            // A gain that a law lacks has no bounds, and no limit either.
            spec.as_ref().map_or((f64::NAN, f64::NAN), |s| s.bounds(self.range_map, axis)).into()
        };
        let g = &self.gains;
        let positions: [f64; 2] = g.position.bounds(self.range_map, axis).into();
        let (forces, selections): ([f64; 2], [f64; 2]) = match self.law {
            Law::Parallel => (ends(&g.force), ends(&g.selection)),
            Law::Admittance => (ends(&g.stiffness), [1.0; 2]),
        };
        let mut least = f64::INFINITY;
        for corner in 0..8 {
            let pick = |ends: [f64; 2], bit: usize| Vector6::repeat(ends[corner >> bit & 1]);
            let (kp_x, force, selection) =
                (pick(positions, 0), pick(forces, 1), pick(selections, 2));
            let gains = match self.law {
                Law::Parallel => Gains::Parallel(ParallelGains { kp_x, kp_f: force, selection }),
                Law::Admittance => Gains::Admittance(AdmittanceGains { kp_x, stiffness: force }),
            };
            let limit = force_loop.contact_limit(control, &gains, axis);
            if limit.is_nan() {
                return limit;
            }
            least = least.min(limit);
        }
        least
    }
}
