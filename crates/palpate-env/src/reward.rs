//! The reward, one function per term.
//!
//! r = w₁·D(x_e) + w₂·A(a) + w₃·F(F_ext) + w₄·ρ + w₅·κ, each of D, A, F mapped to [0, 1] with 1 best; not in the
//! paper: a price for every control tick that the fail-safe layer did not simply pass, by cause.
//!
//! # References
//! Beltran-Hernandez et al. 2020, Sect. III-F, eqs. (5) and (6). The logarithmic form follows the
//! authors' analysis script (cambel/ur3-tools, `plot/simulate_cost.py`, 2020).

use std::collections::BTreeMap;

use palpate_safety::{Cause, Counts};
use palpate_spatial::{Vector6, Wrench};

/// How distance, action and force are mapped to [0, 1].
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum RewardForm {
    /// Plain norms: 1 − ‖·‖, clamped. A first touch costs little.
    Norm,
    /// The authors' script: L1,2 cost with a logarithm. Half of the force term is lost at 1 N.
    Log,
}

/// w₁ … w₅.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RewardWeights {
    /// w₁.
    pub distance: f64,
    /// w₂.
    pub action: f64,
    /// w₃.
    pub force: f64,
    /// w₄.
    pub step: f64,
    /// w₅.
    pub terminal: f64,
}

/// Constants of the reward. Every key must be stated.
#[derive(Clone, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RewardConfig {
    /// Mapping of the three shaped terms.
    pub form: RewardForm,
    /// w₁ … w₅.
    pub weights: RewardWeights,
    /// ρ, paid every step.
    pub step: f64,
    /// κ when the task is completed. The paper: 200.
    pub success: f64,
    /// κ on a safety violation (force limit). The paper: −10, or 0 without penalty.
    pub violation: f64,
    /// Paid for every control tick with this verdict of the fail-safe layer; a cause that is not stated costs nothing.
    pub verdicts: BTreeMap<Cause, f64>,
    /// Least x_max of a position axis, m: an axis that starts at zero error must not divide by zero.
    pub position_floor: f64,
    /// Least x_max of an attitude axis, in sin(θ/2).
    pub rotation_floor: f64,
    /// Weights of the six force axes (base axes; `log` form only). The authors put 1 on the first and
    /// 0.05 on the others; the insertion axis is the one that was meant.
    pub force_axis_weights: [f64; 6],
}

/// The weighted terms of one step's reward.
#[derive(Clone, Copy, Debug, Default, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct RewardTerms {
    /// w₁·D.
    pub distance: f64,
    /// w₂·A.
    pub action: f64,
    /// w₃·F.
    pub force: f64,
    /// w₄·ρ.
    pub step: f64,
    /// w₅·κ.
    pub terminal: f64,
    /// The price of the fail-safe layer's verdicts.
    pub verdicts: f64,
}

impl RewardTerms {
    /// r.
    pub fn total(&self) -> f64 {
        self.distance + self.action + self.force + self.step + self.terminal + self.verdicts
    }
}

impl RewardConfig {
    /// x_max: the initial error, axis by axis, floored.
    pub(crate) fn scale(&self, initial_error: &Vector6) -> Vector6 {
        let mut scale = initial_error.abs();
        for axis in 0..6 {
            let floor = if axis < 3 { self.position_floor } else { self.rotation_floor };
            scale[axis] = scale[axis].max(floor);
        }
        scale
    }

    /// D: 1 at the goal, 0 as far away as at the start.
    pub(crate) fn distance(&self, error: &Vector6, scale: &Vector6) -> f64 {
        let ratio = error.component_div(scale);
        match self.form {
            // ‖ratio‖ is √6 when every axis is where it started.
            RewardForm::Norm => unit(1.0 - ratio.norm() / 6f64.sqrt()),
            RewardForm::Log => falling(l12(&ratio, &[1.0; 6]), -70.0, 30.0),
        }
    }

    /// A: 1 for no action, 0 for every component at its bound.
    pub(crate) fn action(&self, action: &[f64]) -> f64 {
        let n = action.len() as f64;
        match self.form {
            RewardForm::Norm => {
                unit(1.0 - action.iter().map(|a| a * a).sum::<f64>().sqrt() / n.sqrt())
            }
            RewardForm::Log => falling(action.iter().map(|a| a.abs()).sum(), 0.0, n),
        }
    }

    /// F: 1 in free air, 0 at the limit.
    pub(crate) fn force(&self, wrench: &Wrench, force_max: f64, torque_max: f64) -> f64 {
        let (f, t) = (wrench.force / force_max, wrench.torque / torque_max);
        let ratio = Vector6::new(f.x, f.y, f.z, t.x, t.y, t.z);
        match self.form {
            RewardForm::Norm => unit(1.0 - ratio.norm()),
            RewardForm::Log => {
                let capped =
                    if ratio.amax() < 1.0 { l12(&ratio, &self.force_axis_weights) } else { 0.0 };
                falling(capped, -15.0, 0.0)
            }
        }
    }

    /// All terms of a step.
    pub(crate) fn terms(&self, parts: &Parts<'_>) -> RewardTerms {
        let kappa = match parts.end {
            Some(End::Success) => self.success,
            Some(End::Violation) => self.violation,
            None => 0.0,
        };
        let w = &self.weights;
        RewardTerms {
            distance: w.distance * self.distance(&parts.error, &parts.scale),
            action: w.action * self.action(parts.action),
            force: w.force * self.force(&parts.wrench, parts.force_max, parts.torque_max),
            step: w.step * self.step,
            terminal: w.terminal * kappa,
            verdicts: self
                .verdicts
                .iter()
                .map(|(cause, price)| price * parts.verdicts.of(*cause) as f64)
                .sum(),
        }
    }
}

/// Inputs of one step's reward.
pub(crate) struct Parts<'a> {
    pub(crate) error: Vector6,
    pub(crate) scale: Vector6,
    pub(crate) action: &'a [f64],
    pub(crate) wrench: Wrench,
    pub(crate) force_max: f64,
    pub(crate) torque_max: f64,
    pub(crate) end: Option<End>,
    /// Verdicts of this step.
    pub(crate) verdicts: Counts,
}

/// How a step ended the episode, as far as κ cares.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum End {
    Success,
    Violation,
}

/// Σ w·(½·l₂·d² + l₁·ln(α + d²)) with l₁ = 1, l₂ = 10, α = 1e-5 (Levine et al. 2016; authors' constants).
fn l12(d: &Vector6, weights: &[f64; 6]) -> f64 {
    d.iter().zip(weights).map(|(d, w)| w * (5.0 * d * d + (1e-5 + d * d).ln())).sum()
}

/// Linear from 1 at `best` down to 0 at `worst`, clamped: the paper's L_m.
fn falling(x: f64, best: f64, worst: f64) -> f64 {
    unit((worst - x) / (worst - best))
}

fn unit(x: f64) -> f64 {
    x.clamp(0.0, 1.0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use approx::assert_abs_diff_eq;
    use palpate_spatial::Vector3;

    fn config(form: RewardForm) -> RewardConfig {
        RewardConfig {
            form,
            weights: RewardWeights {
                distance: 1.0,
                action: 1.0,
                force: 1.0,
                step: 1.0,
                terminal: 1.0,
            },
            step: -1.0,
            success: 200.0,
            violation: -10.0,
            verdicts: BTreeMap::new(),
            position_floor: 0.005,
            rotation_floor: 0.01,
            force_axis_weights: [1.0, 0.05, 0.05, 0.05, 0.05, 0.05],
        }
    }

    #[test]
    fn logarithmic_distance_matches_the_authors_script() {
        // (all six ratios, D) recomputed from the published script.
        let table = [
            (1.0, 0.0),
            (0.75, 0.166),
            (0.5, 0.308),
            (0.25, 0.448),
            (0.1, 0.573),
            (0.01, 0.847),
            (0.0, 0.991),
        ];
        for (ratio, expected) in table {
            let d =
                config(RewardForm::Log).distance(&Vector6::repeat(ratio), &Vector6::repeat(1.0));
            assert_abs_diff_eq!(d, expected, epsilon = 6e-4);
        }
    }

    #[test]
    fn logarithmic_force_matches_the_authors_script() {
        let c = config(RewardForm::Log);
        for (ratio, expected) in
            [(0.0, 0.959), (0.05, 0.590), (0.1, 0.496), (0.2, 0.393), (0.5, 0.201), (0.8, 0.008)]
        {
            let wrench = Wrench::new(Vector3::new(25.0 * ratio, 0.0, 0.0), Vector3::zeros());
            assert_abs_diff_eq!(c.force(&wrench, 25.0, 2.0), expected, epsilon = 6e-4);
        }
        let at_limit = Wrench::new(Vector3::new(0.0, 0.0, 25.0), Vector3::zeros());
        assert_eq!(c.force(&at_limit, 25.0, 2.0), 0.0);
    }

    #[test]
    fn norm_terms_are_one_at_best_and_zero_at_worst() {
        let c = config(RewardForm::Norm);
        let scale = Vector6::new(0.01, 0.02, 0.03, 0.1, 0.2, 0.3);
        assert_eq!(c.distance(&Vector6::zeros(), &scale), 1.0);
        assert_abs_diff_eq!(c.distance(&scale, &scale), 0.0, epsilon = 1e-12);
        assert_abs_diff_eq!(c.distance(&(scale * 0.5), &scale), 0.5, epsilon = 1e-12);
        assert_eq!(c.action(&[0.0; 14]), 1.0);
        assert_abs_diff_eq!(c.action(&[-1.0; 14]), 0.0, epsilon = 1e-12);
        let half = Wrench::new(Vector3::new(0.0, -12.5, 0.0), Vector3::zeros());
        assert_abs_diff_eq!(c.force(&half, 25.0, 2.0), 0.5, epsilon = 1e-12);
    }

    #[test]
    fn terms_add_up_with_kappa_only_at_the_end() {
        let mut c = config(RewardForm::Norm);
        c.weights =
            RewardWeights { distance: 1.0, action: 0.1, force: 0.4, step: 0.5, terminal: 1.0 };
        let mut parts = Parts {
            error: Vector6::zeros(),
            scale: Vector6::repeat(1.0),
            action: &[0.0; 4],
            wrench: Wrench::zero(),
            force_max: 25.0,
            torque_max: 2.0,
            end: None,
            verdicts: Counts::default(),
        };
        assert_abs_diff_eq!(c.terms(&parts).total(), 1.0 + 0.1 + 0.4 - 0.5, epsilon = 1e-12);
        parts.end = Some(End::Success);
        assert_abs_diff_eq!(c.terms(&parts).total(), 201.0, epsilon = 1e-12);
        parts.end = Some(End::Violation);
        assert_abs_diff_eq!(c.terms(&parts).total(), -9.0, epsilon = 1e-12);
        c.violation = 0.0;
        assert_abs_diff_eq!(c.terms(&parts).total(), 1.0, epsilon = 1e-12);
    }

    #[test]
    fn an_axis_without_initial_error_is_floored() {
        let scale = config(RewardForm::Norm).scale(&Vector6::new(0.0, -0.02, 0.001, 0.0, 0.5, 0.0));
        assert_eq!(scale, Vector6::new(0.005, 0.02, 0.005, 0.01, 0.5, 0.01));
    }
}
