//! How a learner is beyond its losses: what announces that it stops learning.
//!
//! Computed on stored observations evenly spread over the replay. It draws no random number and changes nothing, so a
//! run is the same with it and without.

use crate::kernel::{self, sum_of_squares};
use crate::mlp::Shape;
use crate::network::Network;
use crate::norm::norm_relu;
use crate::{Sac, SacError};

/// Observations that are looked at.
const ROWS: usize = 256;
/// A unit is dormant below this part of its layer's mean activity (Sokar et al. 2023, τ).
const DORMANT: f32 = 0.025;
/// A mean action counts as saturated from here.
const SATURATED: f32 = 0.95;

/// How a learner is.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Diagnosis {
    /// Part of the actor's hidden units that hardly ever fire: capacity that is lost.
    pub dormant_actor: f32,
    /// The same of the critics'.
    pub dormant_critic: f32,
    /// Euclidean norm of the actor's weights.
    pub actor_weights: f32,
    /// The same of both critics'.
    pub critic_weights: f32,
    /// Part of the mean actions beyond ±0.95.
    pub saturation: f32,
    /// Mean age of what the replay holds, steps.
    pub replay_age: f32,
}

impl Sac {
    /// How the learner is now; `None` before the first step.
    ///
    /// # Errors
    /// If the weights cannot be read.
    pub fn diagnose(&self) -> Result<Option<Diagnosis>, SacError> {
        let (replay, stored) = (&self.memory.own, self.memory.own.len());
        if stored == 0 {
            return Ok(None);
        }
        let slots: Vec<usize> = (0..ROWS).map(|i| i * stored / ROWS).collect();
        let parameters = self.learner.actor.parameters()?;
        let mut actor = Activity::new(self.learner.actor.shape());
        let (mut saturated, dim) = (0, self.action_dim);
        for slot in &slots {
            let raw = actor.look(&parameters, &[replay.observation(*slot)]);
            let beyond = |mean: &&f32| mean.tanh().abs() > SATURATED;
            saturated += raw.iter().take(dim).filter(beyond).count();
        }
        let mut critics = Vec::new();
        let mut squares = 0.0;
        for critic in &self.learner.critics {
            let parameters = critic.parameters()?;
            squares += weights(critic, &parameters);
            let mut activity = Activity::new(critic.shape());
            for slot in &slots {
                activity.look(&parameters, &[replay.observation(*slot), replay.action(*slot)]);
            }
            critics.push(activity.dormant());
        }
        let part = |counts: &[(usize, usize)]| {
            let (dormant, all) = counts.iter().fold((0, 0), |(d, n), c| (d + c.0, n + c.1));
            dormant as f32 / all.max(1) as f32
        };
        Ok(Some(Diagnosis {
            dormant_actor: part(&[actor.dormant()]),
            dormant_critic: part(&critics),
            actor_weights: weights(&self.learner.actor, &parameters).sqrt(),
            critic_weights: squares.sqrt(),
            saturation: saturated as f32 / (ROWS * dim) as f32,
            replay_age: 0.5 * (stored - 1) as f32,
        }))
    }
}

/// Sum of squares of a network's weights, biases left out.
fn weights(network: &Network, parameters: &[f32]) -> f32 {
    network.shape().layers().iter().map(|l| sum_of_squares(&parameters[l.weight.clone()])).sum()
}

/// Sums of what the hidden units of a network gave.
struct Activity<'a> {
    shape: &'a Shape,
    /// Of each hidden layer, each unit.
    sums: Vec<Vec<f32>>,
}

impl<'a> Activity<'a> {
    fn new(shape: &'a Shape) -> Self {
        let hidden = &shape.layers()[..shape.layers().len() - 1];
        Self { shape, sums: hidden.iter().map(|layer| vec![0.0; layer.outputs]).collect() }
    }

    /// Computes the network's output for one row, in parts, and remembers what its hidden units gave.
    fn look(&mut self, parameters: &[f32], row: &[&[f32]]) -> Vec<f32> {
        let mut x = row.concat();
        for (index, layer) in self.shape.layers().iter().enumerate() {
            let mut y = parameters[layer.bias.clone()].to_vec();
            kernel::add_product(&mut y, &x, &parameters[layer.weight.clone()]);
            if let Some(sums) = self.sums.get_mut(index) {
                if self.shape.layer_norm {
                    let mut relu = vec![0.0; y.len()];
                    norm_relu(&mut y, relu.len(), &mut [0.0], &mut relu);
                    y = relu;
                } else {
                    kernel::relu(&mut y);
                }
                for (sum, y) in sums.iter_mut().zip(&y) {
                    *sum += y;
                }
            }
            x = y;
        }
        x
    }

    /// Dormant hidden units, and all of them.
    fn dormant(&self) -> (usize, usize) {
        let of = |sums: &Vec<f32>| {
            let mean = sums.iter().sum::<f32>() / sums.len() as f32;
            // Without any activity a layer is dormant as a whole.
            sums.iter().filter(|sum| **sum <= DORMANT * mean).count()
        };
        (self.sums.iter().map(of).sum(), self.sums.iter().map(Vec::len).sum())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Mode, SacConfig, Transition};

    fn agent(layer_norm: bool) -> Sac {
        let config = SacConfig {
            hidden: vec![16, 8],
            critic_layer_norm: layer_norm,
            batch_size: 8,
            start_training: 8,
            ..SacConfig::default()
        };
        let mut agent = Sac::new(&config, 3, 2, 5).unwrap();
        let mut action = [0.0; 2];
        for i in 0..40u8 {
            let observation = [f32::from(i % 7) - 3.0, f32::from(i % 5) - 2.0, 0.5];
            agent.act(&observation, Mode::Explore, &mut action).unwrap();
            agent
                .observe(&Transition {
                    observation: &observation,
                    action: &action,
                    executed: &action,
                    reward: 1.0,
                    next_observation: &observation,
                    terminal: false,
                    episode_end: i % 10 == 9,
                })
                .unwrap();
            agent.update().unwrap();
        }
        agent
    }

    #[test]
    fn it_computes_the_networks_it_looks_at() {
        for layer_norm in [true, false] {
            let agent = agent(layer_norm);
            let (observation, action) = ([0.3, -1.0, 2.0], [0.2, -0.4]);
            let q = agent.learner.critics.iter().map(|critic| {
                let parameters = critic.parameters().unwrap();
                Activity::new(critic.shape()).look(&parameters, &[&observation, &action])[0]
            });
            let lower = q.reduce(f32::min).unwrap();
            let expected = agent.learner.value(&observation, &action).unwrap();
            assert!((lower - expected).abs() < 1e-5, "{lower} {expected}");
        }
    }

    #[test]
    fn units_that_never_fire_are_counted() {
        let agent = agent(true);
        let healthy = agent.diagnose().unwrap().unwrap();
        assert!(healthy.dormant_actor < 0.5 && healthy.saturation < 0.5, "{healthy:?}");
        assert_eq!(healthy.replay_age, 19.5);
        let mut parameters = agent.learner.actor.parameters().unwrap();
        let first = agent.learner.actor.shape().layers()[0].clone();
        // Twelve of the first layer's sixteen units lie far below zero.
        parameters[first.bias.clone()][..12].fill(-1e3);
        // And every mean action far above one.
        let last = agent.learner.actor.shape().last().clone();
        parameters[last.bias.clone()][..2].fill(1e3);
        agent.learner.actor.assign(parameters).unwrap();
        let ill = agent.diagnose().unwrap().unwrap();
        assert!(ill.dormant_actor >= 12.0 / 24.0, "{ill:?}");
        assert_eq!(ill.saturation, 1.0);
        assert_eq!(ill.dormant_critic, healthy.dormant_critic);
    }

    #[test]
    fn weights_are_measured() {
        let agent = agent(true);
        let norm = |network: &Network| -> f64 {
            let parameters = network.parameters().unwrap();
            let of = |l: &crate::mlp::Layer| parameters[l.weight.clone()].to_vec();
            let all = network.shape().layers().iter().flat_map(of);
            all.map(|w| f64::from(w) * f64::from(w)).sum()
        };
        let found = agent.diagnose().unwrap().unwrap();
        let actor = norm(&agent.learner.actor).sqrt();
        let critics = agent.learner.critics.iter().map(norm).sum::<f64>().sqrt();
        assert!((f64::from(found.actor_weights) / actor - 1.0).abs() < 1e-5);
        assert!((f64::from(found.critic_weights) / critics - 1.0).abs() < 1e-5);
    }

    #[test]
    fn it_changes_nothing() {
        let (mut looked_at, mut left_alone) = (agent(true), agent(true));
        assert_eq!(Sac::new(looked_at.config(), 3, 2, 5).unwrap().diagnose().unwrap(), None);
        for _ in 0..5 {
            looked_at.diagnose().unwrap();
            assert_eq!(looked_at.update().unwrap(), left_alone.update().unwrap());
        }
    }
}
