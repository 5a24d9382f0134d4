//! Policy models as data: which gains an action moves, and between which values.

use palpate_spatial::{Twist, Vector6};

use crate::config::{ControlConfig, bad};
use crate::law::{AdmittanceGains, ControlError, Gains, Law, ParallelGains};

/// How many actions move a gain.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Tie {
    /// One action moves all six axes together.
    All,
    /// One action per axis.
    PerAxis,
    /// No action: the gain stays at its base.
    Fixed,
}

/// How an action in [−1, 1] becomes a gain.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum RangeMap {
    /// base + a·range, as printed.
    Additive,
    /// Piecewise linear from base/range over base to base·range, as in the authors' later code.
    Multiplicative,
}

/// One gain: axes x y z, then rotations.
#[derive(Clone, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(deny_unknown_fields)]
pub struct GainSpec {
    /// How many actions move it.
    pub tie: Tie,
    /// P_base.
    pub base: [f64; 6],
    /// P_range.
    pub range: [f64; 6],
}

/// The gains of a model; the law says which it needs.
#[derive(Clone, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(deny_unknown_fields)]
pub struct GainTable {
    /// K_p^x, both laws.
    pub position: GainSpec,
    /// K_p^f, parallel law.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub force: Option<GainSpec>,
    /// S, parallel law.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub selection: Option<GainSpec>,
    /// k_d, admittance law.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub stiffness: Option<GainSpec>,
}

/// Bounds of a_x: an action of 1 is this fast.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(deny_unknown_fields)]
pub struct MotionBounds {
    /// m/s.
    pub linear: f64,
    /// rad/s.
    pub angular: f64,
}

/// A policy model (Table I of the paper) or any other combination.
#[derive(Clone, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PolicyModel {
    /// Name, as in the paper where it is one of its.
    pub name: String,
    /// The law whose gains it moves.
    pub law: Law,
    /// How actions become gains.
    pub range_map: RangeMap,
    /// Bounds of a_x.
    pub motion: MotionBounds,
    /// The gains.
    pub gains: GainTable,
}

/// An action in physical units.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Decoded {
    /// a_x.
    pub motion: Twist,
    /// a_p.
    pub gains: Gains,
}

const AXES: [&str; 6] = ["x", "y", "z", "rx", "ry", "rz"];

impl PolicyModel {
    /// Checks every corner of the gain ranges.
    ///
    /// # Errors
    /// A range that reaches a gain without meaning (K_p or k_d not positive, S outside [0, 1]), naming the
    /// key and a range that would do; gains that the law lacks or does not have.
    pub fn validate(&self, control: &ControlConfig) -> Result<(), ControlError> {
        control.validate()?;
        for (key, value) in [("policy.motion.linear", self.motion.linear), ("policy.motion.angular", self.motion.angular)] {
            if !(value > 0.0 && value.is_finite()) {
                return Err(bad(key, value, "positive and finite"));
            }
        }
        let g = &self.gains;
        let parallel = self.law == Law::Parallel;
        for (name, spec, needed) in
            [("force", &g.force, parallel), ("selection", &g.selection, parallel), ("stiffness", &g.stiffness, !parallel)]
        {
            match (spec, needed) {
                (None, true) => return Err(ControlError::GainSet(name.into(), "is missing: the law needs it")),
                (Some(_), false) => return Err(ControlError::GainSet(name.into(), "is of no use to the law")),
                _ => {}
            }
        }
        for (name, spec) in self.specs() {
            for axis in 0..6 {
                self.check_axis(name, spec, axis)?;
            }
        }
        Ok(())
    }

    fn check_axis(&self, name: &str, spec: &GainSpec, axis: usize) -> Result<(), ControlError> {
        let (base, range) = (spec.base[axis], spec.range[axis]);
        let key = |field: &str| format!("policy.gains.{name}.{field}[{axis}]");
        let least = if self.range_map == RangeMap::Additive { 0.0 } else { 1.0 };
        if !(range >= least && range.is_finite()) {
            return Err(bad(&key("range"), range, format!("at least {least} and finite")));
        }
        if name == "selection" {
            if !(base >= 0.0 && base <= 1.0) {
                return Err(bad(&key("base"), base, "within [0, 1]"));
            }
            let room = base.min(1.0 - base);
            if self.range_map == RangeMap::Additive && !(range <= room + 1e-12) {
                return Err(bad(&key("range"), range, format!("at most {room}, or S leaves [0, 1]")));
            }
            return Ok(());
        }
        if !(base > 0.0 && base.is_finite()) {
            return Err(bad(&key("base"), base, "positive and finite"));
        }
        if self.range_map == RangeMap::Additive && spec.tie != Tie::Fixed && !(range < base) {
            return Err(bad(&key("range"), range, format!("less than the base {base}, or the gain reaches zero")));
        }
        Ok(())
    }

    /// Gains in the order of their actions.
    fn specs(&self) -> impl Iterator<Item = (&'static str, &GainSpec)> {
        let g = &self.gains;
        [
            ("position", Some(&g.position)),
            ("force", g.force.as_ref()),
            ("stiffness", g.stiffness.as_ref()),
            ("selection", g.selection.as_ref()),
        ]
        .into_iter()
        .filter_map(|(name, spec)| Some((name, spec?)))
    }
}

/// The map from actions to motion and gains: [a_x 6 | K_p^x | K_p^f or k_d | S].
#[derive(Clone, Debug)]
pub struct ActionMap {
    model: PolicyModel,
    dim: usize,
}

impl ActionMap {
    /// For a model that has been validated.
    ///
    /// # Errors
    /// Gains that the law lacks.
    pub fn new(model: &PolicyModel) -> Result<Self, ControlError> {
        let dim = 6 + model.specs().map(|(_, s)| actions(s.tie)).sum::<usize>();
        let map = Self { model: model.clone(), dim };
        map.decode(&vec![0.0; dim])?;
        Ok(map)
    }

    /// Components of an action.
    pub fn dim(&self) -> usize {
        self.dim
    }

    /// What each component moves.
    pub fn labels(&self) -> Vec<String> {
        let mut labels: Vec<String> = AXES.iter().map(|axis| format!("motion.{axis}")).collect();
        for (name, spec) in self.model.specs() {
            match spec.tie {
                Tie::All => labels.push(name.into()),
                Tie::PerAxis => labels.extend(AXES.iter().map(|axis| format!("{name}.{axis}"))),
                Tie::Fixed => {}
            }
        }
        labels
    }

    /// Maps an action to motion and gains; components beyond ±1 are clamped.
    ///
    /// # Errors
    /// Another length, or a component that is not finite.
    pub fn decode(&self, action: &[f64]) -> Result<Decoded, ControlError> {
        if action.len() != self.dim {
            return Err(ControlError::ActionLength { found: action.len(), expected: self.dim });
        }
        if let Some((index, &value)) = action.iter().enumerate().find(|(_, a)| !a.is_finite()) {
            return Err(ControlError::ActionNotFinite { index, value });
        }
        let unit = |i: usize| action[i].clamp(-1.0, 1.0);
        let bounds = self.model.motion;
        let motion = Vector6::from_fn(|i, _| unit(i) * if i < 3 { bounds.linear } else { bounds.angular });
        let mut next = 6;
        let mut take = |spec: &GainSpec| {
            let first = next;
            next += actions(spec.tie);
            Vector6::from_fn(|axis, _| {
                let a = match spec.tie {
                    Tie::All => unit(first),
                    Tie::PerAxis => unit(first + axis),
                    Tie::Fixed => 0.0,
                };
                map(self.model.range_map, a, spec.base[axis], spec.range[axis])
            })
        };
        let missing = |name: &str| ControlError::GainSet(name.into(), "is missing: the law needs it");
        let g = &self.model.gains;
        let kp_x = take(&g.position);
        let gains = match self.model.law {
            Law::Parallel => {
                let kp_f = take(g.force.as_ref().ok_or_else(|| missing("force"))?);
                let selection = take(g.selection.as_ref().ok_or_else(|| missing("selection"))?);
                Gains::Parallel(ParallelGains { kp_x, kp_f, selection: selection.map(|s| s.clamp(0.0, 1.0)) })
            }
            Law::Admittance => {
                let stiffness = take(g.stiffness.as_ref().ok_or_else(|| missing("stiffness"))?);
                Gains::Admittance(AdmittanceGains { kp_x, stiffness })
            }
        };
        Ok(Decoded { motion: Twist::from(motion), gains })
    }
}

fn actions(tie: Tie) -> usize {
    match tie {
        Tie::All => 1,
        Tie::PerAxis => 6,
        Tie::Fixed => 0,
    }
}

fn map(how: RangeMap, a: f64, base: f64, range: f64) -> f64 {
    match how {
        RangeMap::Additive => base + a * range,
        RangeMap::Multiplicative if a < 0.0 => base + a * (base - base / range),
        RangeMap::Multiplicative => base + a * (base * range - base),
    }
}
