//! Policies to compare with: nothing, noise, and what an engineer would script.

use palpate_env::{Env, ScriptedPolicy};
use palpate_sac::Policy;
use palpate_safety::Guarded;
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;

use crate::Config;
use crate::demonstrate::View;

/// Anything that can be evaluated.
#[derive(Clone, Debug)]
pub enum Actor {
    /// a = 0: the force controller alone, at its base gains.
    Zero(Vec<f64>),
    /// Uniform random actions, seeded by episode.
    Random(Box<ChaCha8Rng>, u64, Vec<f64>),
    /// Align, descend, spiral on contact.
    Scripted(ScriptedPolicy),
    /// A learned policy: its mean action, or a sample with the given stream.
    Learned(Box<Learned>),
}

/// A learned policy and the buffers it needs.
#[derive(Clone, Debug)]
pub struct Learned {
    policy: Policy,
    sample: Option<ChaCha8Rng>,
    /// Whether to sample, where there is a stream.
    exploring: bool,
    seed: u64,
    single: Vec<f32>,
    double: Vec<f64>,
}

impl Actor {
    /// a = 0.
    pub fn zero(action_dim: usize) -> Self {
        Self::Zero(vec![0.0; action_dim])
    }

    /// Uniform random actions.
    pub fn random(action_dim: usize, seed: u64) -> Self {
        Self::Random(Box::new(ChaCha8Rng::seed_from_u64(seed)), seed, vec![0.0; action_dim])
    }

    /// The scripted policy for the configured task and model.
    pub fn scripted(config: &Config, action_dim: usize) -> Self {
        let motion = &config.policy.motion;
        Self::Scripted(ScriptedPolicy::new(
            &config.task.base_T_hole(),
            config.task.depth,
            motion.linear,
            motion.angular,
            action_dim,
        ))
    }

    /// A learned policy: deterministic, or sampled from `stochastic_seed`.
    pub fn learned(policy: Policy, stochastic_seed: Option<u64>) -> Self {
        let dim = policy.action_dim();
        Self::Learned(Box::new(Learned {
            policy,
            sample: stochastic_seed.map(ChaCha8Rng::seed_from_u64),
            exploring: true,
            seed: stochastic_seed.unwrap_or(0),
            single: vec![0.0; dim],
            double: vec![0.0; dim],
        }))
    }

    /// The learned policy, to put another one in its place.
    pub fn policy_mut(&mut self) -> Option<&mut Policy> {
        match self {
            Self::Learned(learned) => Some(&mut learned.policy),
            _ => None,
        }
    }

    /// Samples (as at first) or takes the mean; without a stream to sample from it is always the mean.
    pub fn explore(&mut self, on: bool) {
        if let Self::Learned(learned) = self {
            learned.exploring = on;
        }
    }

    /// Prepares for an episode.
    pub fn reset(&mut self, episode: u64) {
        match self {
            Self::Zero(_) => {}
            Self::Random(rng, seed, _) => **rng = episode_rng(*seed, episode),
            Self::Scripted(script) => script.reset(),
            Self::Learned(learned) => {
                if let Some(rng) = &mut learned.sample {
                    *rng = episode_rng(learned.seed, episode);
                }
            }
        }
    }

    /// The action for what the environment shows now.
    pub fn act<R: Guarded>(&mut self, env: &Env<R>) -> &[f64] {
        self.decide(&View::of(env))
    }

    /// The action for what is seen.
    pub fn decide(&mut self, view: &View<'_>) -> &[f64] {
        match self {
            Self::Zero(action) => action,
            Self::Random(rng, _, action) => {
                action.fill_with(|| rng.random_range(-1.0..=1.0));
                action
            }
            Self::Scripted(script) => script.act(&view.error, &view.wrench),
            Self::Learned(learned) => {
                let Learned { policy, sample, exploring, single, double, .. } = &mut **learned;
                match sample.as_mut().filter(|_| *exploring) {
                    None => policy.mean(view.observation, single),
                    Some(rng) => policy.sample(view.observation, rng, single),
                }
                for (to, from) in double.iter_mut().zip(&*single) {
                    *to = f64::from(*from);
                }
                double
            }
        }
    }
}

fn episode_rng(seed: u64, episode: u64) -> ChaCha8Rng {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    rng.set_stream(episode);
    rng
}
