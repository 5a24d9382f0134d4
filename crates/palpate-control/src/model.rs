//! Policy models as data: which gains an action moves, and between which values.

use crate::config::ControlConfig;
use crate::error::{AXES, ControlError, bad};
use crate::law::Law;

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
    /// base + a·range: the paper, [P_base − P_range, P_base + P_range].
    Additive,
    /// Piecewise linear from base/range (a = −1) over base to base·range: the authors' later code.
    Multiplicative,
}

impl RangeMap {
    /// The gain for an action in [−1, 1].
    pub fn gain(self, action: f64, base: f64, range: f64) -> f64 {
        match self {
            Self::Additive => base + action * range,
            Self::Multiplicative if action < 0.0 => base + action * (base - base / range),
            Self::Multiplicative => base + action * (base * range - base),
        }
    }
}

/// One gain: axes x y z, then the rotations about them.
#[derive(Clone, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(deny_unknown_fields)]
pub struct GainSpec {
    /// How many actions move it.
    pub tie: Tie,
    /// P_base.
    pub base: [f64; 6],
    /// P_range: in the gain's units, or a factor ≥ 1 with [`RangeMap::Multiplicative`].
    pub range: [f64; 6],
}

impl GainSpec {
    /// Least and greatest value that actions reach on an axis.
    pub fn bounds(&self, map: RangeMap, axis: usize) -> (f64, f64) {
        let (base, range) = (self.base[axis], self.range[axis]);
        match self.tie {
            Tie::Fixed => (base, base),
            Tie::All | Tie::PerAxis => (map.gain(-1.0, base, range), map.gain(1.0, base, range)),
        }
    }
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

impl PolicyModel {
    /// Checks every corner of the gain ranges, and the settings of the laws.
    ///
    /// # Errors
    /// A range that reaches a gain without meaning (K_p or k_d not positive, S outside [0, 1]), naming the
    /// key, the axis and a range that would do; a gain that the law lacks or has no use for.
    pub fn validate(&self, control: &ControlConfig) -> Result<(), ControlError> {
        control.validate()?;
        self.check()
    }

    pub(crate) fn check(&self) -> Result<(), ControlError> {
        for (key, value) in [
            ("policy.motion.linear", self.motion.linear),
            ("policy.motion.angular", self.motion.angular),
        ] {
            if !(value > 0.0 && value.is_finite()) {
                return Err(bad(key, value, "positive and finite"));
            }
        }
        let g = &self.gains;
        let parallel = self.law == Law::Parallel;
        for (name, spec, needed) in [
            ("force", &g.force, parallel),
            ("selection", &g.selection, parallel),
            ("stiffness", &g.stiffness, !parallel),
        ] {
            let what = match (spec, needed) {
                (None, true) => "is missing: the law needs it",
                (Some(_), false) => "is of no use to the law",
                _ => continue,
            };
            return Err(ControlError::GainSet(name.into(), what));
        }
        for (name, spec) in self.specs() {
            let greatest = if name == "selection" { 1.0 } else { f64::INFINITY };
            for axis in 0..6 {
                spec.check_axis(self.range_map, name, greatest, axis)?;
            }
        }
        Ok(())
    }

    /// Gains in the order of their actions.
    pub(crate) fn specs(&self) -> impl Iterator<Item = (&'static str, &GainSpec)> {
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

/// 0.5 + 0.5 is 1, but 0.7 + 0.3 is 1 plus a rounding: no reason to refuse a file.
const ROUNDING: f64 = 1e-12;

impl GainSpec {
    /// S may reach 0 and 1 (`greatest` 1); every other gain must stay positive.
    fn check_axis(
        &self,
        map: RangeMap,
        name: &str,
        greatest: f64,
        axis: usize,
    ) -> Result<(), ControlError> {
        let key = |field: &str| format!("policy.gains.{name}.{field}[{axis}] ({})", AXES[axis]);
        let (base, range) = (self.base[axis], self.range[axis]);
        let is_selection = greatest == 1.0;
        let (base_fits, base_must) = if is_selection {
            ((0.0..=1.0).contains(&base), "within [0, 1]")
        } else {
            (base > 0.0 && base.is_finite(), "positive and finite")
        };
        if !base_fits {
            return Err(bad(key("base"), base, base_must));
        }
        if self.tie == Tie::Fixed {
            return Ok(());
        }
        let least = if map == RangeMap::Additive { 0.0 } else { 1.0 };
        if !(range >= least && range.is_finite()) {
            return Err(bad(key("range"), range, format!("at least {least} and finite")));
        }
        let (low, high) = self.bounds(map, axis);
        let fits =
            if is_selection { low >= -ROUNDING && high <= 1.0 + ROUNDING } else { low > 0.0 };
        if fits && high.is_finite() {
            return Ok(());
        }
        let must = match (map, is_selection) {
            (RangeMap::Additive, true) => {
                format!("at most {}, so that S stays within [0, 1]", advised(base.min(1.0 - base)))
            }
            (RangeMap::Multiplicative, true) => {
                format!("at most {}, so that S stays within [0, 1]", advised(1.0 / base))
            }
            (RangeMap::Additive, false) => format!(
                "less than the base of {base}, so that the gain stays positive ({} would do)",
                advised(0.8 * base)
            ),
            (RangeMap::Multiplicative, false) => {
                "a factor that leaves the gain positive and finite (5 would do)".into()
            }
        };
        Err(bad(key("range"), range, must))
    }
}

/// Nine digits of a number that a person will read, and not more than it but for rounding noise: what
/// is advised must be accepted.
fn advised(value: f64) -> f64 {
    let scale = 10f64.powi(8 - value.log10().floor() as i32);
    let digits = (value * scale).round();
    let above = digits / scale > value * (1.0 + 1e-13);
    let rounded = if above { (digits - 1.0) / scale } else { digits / scale };
    if rounded.is_finite() { rounded } else { value }
}
