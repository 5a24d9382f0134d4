//! The policy alone: a copy of the actor's weights for the control loop.

use rand::Rng;

use crate::kernel;
use crate::lanes::exp;
use crate::mlp::Shape;
use crate::rng::fill_normal;
use crate::squash::{LogStd, tanh};

/// A policy that decides in a few microseconds, with no graph, no allocation and no lock.
///
/// It is a copy: training goes on without it noticing. Numbers that are not finite come out of an
/// observation that is not finite; refusing those is the caller's business.
#[derive(Clone, Debug)]
pub struct Policy {
    shape: Shape,
    bounds: LogStd,
    parameters: Vec<f32>,
    /// Two buffers of the widest layer.
    buffers: [Vec<f32>; 2],
}

/// Equal if every decision is; what the buffers hold from the last one does not matter.
impl PartialEq for Policy {
    fn eq(&self, other: &Self) -> bool {
        let Self { shape, bounds, parameters, buffers: _ } = self;
        (shape, bounds, parameters) == (&other.shape, &other.bounds, &other.parameters)
    }
}

impl Policy {
    pub(crate) fn new(shape: Shape, bounds: LogStd, parameters: Vec<f32>) -> Self {
        let widest = shape.layers().iter().map(|l| l.inputs.max(l.outputs)).max().unwrap_or(0);
        Self { shape, bounds, parameters, buffers: [vec![0.0; widest], vec![0.0; widest]] }
    }

    pub(crate) fn shape(&self) -> &Shape {
        &self.shape
    }

    pub(crate) fn bounds(&self) -> LogStd {
        self.bounds
    }

    pub(crate) fn parameters_mut(&mut self) -> &mut [f32] {
        &mut self.parameters
    }

    /// Values in an observation.
    pub fn observation_dim(&self) -> usize {
        self.shape.inputs()
    }

    /// Values in an action.
    pub fn action_dim(&self) -> usize {
        self.shape.outputs() / 2
    }

    /// The deterministic action tanh μ, each value in [−1, 1].
    ///
    /// # Panics
    /// If a slice does not have the policy's dimension.
    pub fn mean(&mut self, observation: &[f32], action: &mut [f32]) {
        let raw = self.raw(observation, action.len());
        kernel::vectorised(
            #[inline(always)]
            || {
                for (action, mean) in action.iter_mut().zip(raw) {
                    *action = tanh(*mean);
                }
            },
        );
    }

    /// An action tanh(μ + σ ε) with ε from `rng`, each value in [−1, 1].
    ///
    /// # Panics
    /// If a slice does not have the policy's dimension.
    pub fn sample(&mut self, observation: &[f32], rng: &mut impl Rng, action: &mut [f32]) {
        let bounds = self.bounds;
        let raw = self.raw(observation, action.len());
        let (mean, raw_std) = raw.split_at(action.len());
        fill_normal(rng, action);
        kernel::vectorised(
            #[inline(always)]
            || {
                for ((action, mean), raw_std) in action.iter_mut().zip(mean).zip(raw_std) {
                    *action = tanh(mean + exp(bounds.bounded(tanh(*raw_std))) * *action);
                }
            },
        );
    }

    /// Output of the network: μ, then what log σ is made of.
    fn raw(&mut self, observation: &[f32], action_dim: usize) -> &[f32] {
        assert_eq!(observation.len(), self.observation_dim(), "values in the observation");
        assert_eq!(action_dim, self.action_dim(), "values in the action");
        let Self { shape, parameters, buffers: [below, above], .. } = self;
        below[..observation.len()].copy_from_slice(observation);
        let last = shape.layers().len() - 1;
        for (index, layer) in shape.layers().iter().enumerate() {
            let y = &mut above[..layer.outputs];
            y.copy_from_slice(&parameters[layer.bias.clone()]);
            kernel::add_product(y, &below[..layer.inputs], &parameters[layer.weight.clone()]);
            if index < last {
                kernel::relu(y);
            }
            std::mem::swap(below, above);
        }
        &self.buffers[0][..2 * action_dim]
    }
}
