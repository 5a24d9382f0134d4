//! From a policy's numbers to motion and gains.

use palpate_spatial::{Twist, Vector6};

use crate::error::{AXES, ControlError};
use crate::law::{AdmittanceGains, Gains, Law, ParallelGains};
use crate::model::{GainSpec, PolicyModel, Tie};

/// An action in physical units.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Decoded {
    /// a_x, m/s and rad/s.
    pub motion: Twist,
    /// a_p.
    pub gains: Gains,
}

/// The map from actions to motion and gains: [a_x 6 | K_p^x | K_p^f or k_d | S], each gain 0, 1 or 6
/// components by its [`Tie`] (Sect. III-D and Table I).
#[derive(Clone, Debug)]
pub struct ActionMap {
    model: PolicyModel,
    dim: usize,
}

impl ActionMap {
    /// The map of a model.
    ///
    /// # Errors
    /// What [`PolicyModel::validate`] says of the model: every action of a map that exists decodes to
    /// gains that its law takes.
    pub fn new(model: &PolicyModel) -> Result<Self, ControlError> {
        model.check()?;
        let dim = 6 + model.specs().map(|(_, spec)| actions(spec.tie)).sum::<usize>();
        Ok(Self { model: model.clone(), dim })
    }

    /// Components of an action.
    pub fn dim(&self) -> usize {
        self.dim
    }

    /// What each component moves: `motion.x`, …, `position`, `selection.rz`.
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
        let motion =
            Vector6::from_fn(|i, _| unit(i) * if i < 3 { bounds.linear } else { bounds.angular });

        let mut next = 6;
        let mut take = |name: &str, spec: Option<&GainSpec>| {
            let spec = spec.ok_or_else(|| {
                ControlError::GainSet(name.into(), "is missing: the law needs it")
            })?;
            let first = next;
            next += actions(spec.tie);
            Ok::<_, ControlError>(Vector6::from_fn(|axis, _| {
                let a = match spec.tie {
                    Tie::All => unit(first),
                    Tie::PerAxis => unit(first + axis),
                    Tie::Fixed => return spec.base[axis],
                };
                self.model.range_map.gain(a, spec.base[axis], spec.range[axis])
            }))
        };
        let g = &self.model.gains;
        let kp_x = take("position", Some(&g.position))?;
        let gains = match self.model.law {
            Law::Parallel => Gains::Parallel(ParallelGains {
                kp_x,
                kp_f: take("force", g.force.as_ref())?,
                // 0.7 + 0.3 may round to more than 1.
                selection: take("selection", g.selection.as_ref())?.map(|s| s.clamp(0.0, 1.0)),
            }),
            Law::Admittance => Gains::Admittance(AdmittanceGains {
                kp_x,
                stiffness: take("stiffness", g.stiffness.as_ref())?,
            }),
        };
        Ok(Decoded { motion: Twist::from(motion), gains })
    }

    /// Adds a motion (m/s, rad/s) to the a_x of an action and clamps it: an action that moves the arm that much
    /// more, with the same gains.
    pub fn deviate(&self, action: &mut [f32], by: &Twist) {
        let bounds = self.model.motion;
        for (i, (a, by)) in action.iter_mut().zip(by.vector().iter()).enumerate() {
            let bound = if i < 3 { bounds.linear } else { bounds.angular };
            // A motion that is bounded by 0 cannot be asked for.
            if bound > 0.0 {
                *a = (f64::from(*a) + by / bound).clamp(-1.0, 1.0) as f32;
            }
        }
    }
}

fn actions(tie: Tie) -> usize {
    match tie {
        Tie::All => 1,
        Tie::PerAxis => 6,
        Tie::Fixed => 0,
    }
}
