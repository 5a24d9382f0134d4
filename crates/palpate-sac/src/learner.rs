//! One update of soft actor-critic: critics, actor, temperature, targets.

use std::sync::Arc;

use candle_core::{Device, Result as TensorResult, Tensor, Var};

use crate::SacError;
use crate::config::{Ops, SacConfig};
use crate::mlp::Shape;
use crate::network::{Engine, Flow, Network};
use crate::optimiser::{Moments, step_variable, track};
use crate::policy::Policy;
use crate::rng::Streams;
use crate::squash::{LogStd, squash};
use crate::team::Team;

/// What one call of [`Sac::update`](crate::Sac::update) did, averaged over its updates.
#[derive(Clone, Copy, Debug, Default, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct UpdateStats {
    /// Σ over both critics of E[½ (Q − y)²].
    pub critic_loss: f32,
    /// E[α log π − min Q].
    pub actor_loss: f32,
    /// Temperature α that the losses used.
    pub alpha: f32,
    /// −E[log π] of the policy, nats.
    pub entropy: f32,
    /// Mean of the first critic over the batch, in units of scaled reward.
    pub q_mean: f32,
    /// Mean of the critics' target y.
    pub target_mean: f32,
    /// Norm of the gradient of both critics.
    pub critic_gradient_norm: f32,
    /// Norm of the gradient of the actor.
    pub actor_gradient_norm: f32,
}

impl UpdateStats {
    pub(crate) fn add(&mut self, other: &Self, share: f32) {
        self.critic_loss += share * other.critic_loss;
        self.actor_loss += share * other.actor_loss;
        self.alpha += share * other.alpha;
        self.entropy += share * other.entropy;
        self.q_mean += share * other.q_mean;
        self.target_mean += share * other.target_mean;
        self.critic_gradient_norm += share * other.critic_gradient_norm;
        self.actor_gradient_norm += share * other.actor_gradient_norm;
    }
}

/// What an update learns from: one row per transition.
#[derive(Debug)]
pub(crate) struct Batch {
    pub(crate) observation: Tensor,
    pub(crate) action: Tensor,
    /// Scaled n-step reward, (batch).
    pub(crate) reward: Tensor,
    /// Factor of the value at the bootstrap state, (batch).
    pub(crate) discount: Tensor,
    pub(crate) bootstrap_observation: Tensor,
    /// Standard normal, for the action at the bootstrap state.
    pub(crate) target_noise: Tensor,
    /// Standard normal, for the action the actor is improved at.
    pub(crate) actor_noise: Tensor,
}

/// The networks, their optimisers and the temperature.
#[derive(Debug)]
pub(crate) struct Learner {
    engine: Engine,
    bounds: LogStd,
    rates: Rates,
    tau: f64,
    target_entropy: f64,
    pub(crate) actor: Network,
    pub(crate) critics: [Network; 2],
    pub(crate) targets: [Network; 2],
    pub(crate) log_alpha: Var,
    pub(crate) actor_moments: Moments,
    pub(crate) critic_moments: [Moments; 2],
    pub(crate) alpha_moments: Moments,
}

#[derive(Clone, Copy, Debug)]
struct Rates {
    actor: f64,
    critic: f64,
    alpha: f64,
}

impl Learner {
    pub(crate) fn new(
        config: &SacConfig,
        observation_dim: usize,
        action_dim: usize,
        streams: &mut Streams,
    ) -> Result<Self, SacError> {
        // Plain operations bring candle's own threads.
        let threads = if config.ops == Ops::Fused { config.update_threads() } else { 1 };
        let device = config.device.device()?;
        let engine = Engine { ops: config.ops, device, team: Arc::new(Team::new(threads)) };
        let bounds = LogStd { min: config.log_std_min as f32, max: config.log_std_max as f32 };
        let actor_shape = Shape::new(observation_dim, &config.hidden, 2 * action_dim, false);
        let actor = initial_actor(&actor_shape, bounds.raw(config.init_std.ln() as f32), streams);
        let critic_shape =
            Shape::new(observation_dim + action_dim, &config.hidden, 1, config.critic_layer_norm);
        let critic = |streams: &mut Streams| {
            let parameters = critic_shape.init(&mut streams.init);
            Network::new(&engine, critic_shape.clone(), parameters)
        };
        let critics = [critic(streams)?, critic(streams)?];
        let targets = [critics[0].duplicate()?, critics[1].duplicate()?];
        let moments = || Moments::new(critic_shape.parameters());
        Ok(Self {
            bounds,
            rates: Rates {
                actor: config.actor_learning_rate,
                critic: config.critic_learning_rate,
                alpha: config.alpha_learning_rate,
            },
            tau: config.tau,
            target_entropy: config.target_entropy.nats(action_dim),
            actor_moments: Moments::new(actor_shape.parameters()),
            critic_moments: [moments(), moments()],
            alpha_moments: Moments::new(1),
            actor: Network::new(&engine, actor_shape, actor)?,
            critics,
            targets,
            log_alpha: Var::from_vec(vec![config.initial_alpha.ln() as f32], 1, &Device::Cpu)?,
            engine,
        })
    }

    /// Where batches have to be.
    pub(crate) fn device(&self) -> &Device {
        &self.engine.device
    }

    pub(crate) fn team(&self) -> Arc<Team> {
        Arc::clone(&self.engine.team)
    }

    pub(crate) fn policy(&self) -> TensorResult<Policy> {
        Ok(Policy::new(self.actor.shape().clone(), self.bounds, self.actor.parameters()?))
    }

    /// One gradient step of everything, in the order of Haarnoja et al. 2018, Algorithm 1.
    ///
    /// A loss or gradient that is not finite is an error, before the network it belongs to changes.
    pub(crate) fn update(&mut self, batch: &Batch, update: u64) -> Result<UpdateStats, SacError> {
        let mut stats =
            UpdateStats { alpha: scalar(self.log_alpha.as_tensor())?.exp(), ..Default::default() };
        let finite = |what, value: f32| {
            if value.is_finite() {
                Ok(value)
            } else {
                Err(SacError::Diverged { what, value, update })
            }
        };
        finite("alpha", stats.alpha)?;

        let target = self.target(batch, stats.alpha)?;
        stats.target_mean = finite("mean of the critic target", scalar(&target.mean_all()?)?)?;

        let held = Some(&batch.observation);
        let q = Network::call_both(&self.critics, held, &batch.action, Flow::Parameters)?;
        stats.q_mean = scalar(&q.detach().narrow(1, 0, 1)?.mean_all()?)?;
        // Mean over the batch, sum over the critics.
        let rows = q.dim(0)? as f64;
        let loss = (q.broadcast_sub(&target.unsqueeze(1)?)?.sqr()?.sum_all()? * (0.5 / rows))?;
        stats.critic_loss = finite("critic loss", scalar(&loss)?)?;
        let gradients = &loss.backward()?;
        let ([first, second], [m_first, m_second]) = (&self.critics, &mut self.critic_moments);
        let rate = self.rates.critic;
        let norms = self.engine.team.both(
            || first.step(gradients, m_first, rate),
            || second.step(gradients, m_second, rate),
        );
        let norm = norms.0?.hypot(norms.1?);
        stats.critic_gradient_norm = finite("critic gradient norm", norm)?;

        let raw = self.actor.call(None, &batch.observation, Flow::Parameters)?;
        let (action, log_probability) =
            squash(self.engine.ops, self.bounds, &raw, &batch.actor_noise)?;
        let q = Self::lower(&self.critics, &batch.observation, &action, Flow::Input)?;
        let loss = ((&log_probability * f64::from(stats.alpha))? - q)?.mean_all()?;
        stats.actor_loss = finite("actor loss", scalar(&loss)?)?;
        let norm = self.actor.step(&loss.backward()?, &mut self.actor_moments, self.rates.actor)?;
        stats.actor_gradient_norm = finite("actor gradient norm", norm)?;

        // J(log α) = −log α · E[log π + target]: its gradient is entropy − target.
        stats.entropy = -scalar(&log_probability.detach().mean_all()?)?;
        let surplus = f64::from(stats.entropy) - self.target_entropy;
        let loss = (self.log_alpha.as_tensor() * surplus)?.sum_all()?;
        if let Some(gradient) = loss.backward()?.get(self.log_alpha.as_tensor()) {
            step_variable(
                &self.log_alpha,
                &gradient.to_vec1()?,
                &mut self.alpha_moments,
                self.rates.alpha,
            )?;
        }

        let follow = |i: usize| {
            track(self.targets[i].variable(), self.critics[i].variable().as_tensor(), self.tau)
        };
        let followed = self.engine.team.both(|| follow(0), || follow(1));
        followed.0.and(followed.1)?;
        Ok(stats)
    }

    /// y = R + discount · (min Q' − α log π') at the bootstrap state; a constant.
    fn target(&self, batch: &Batch, alpha: f32) -> TensorResult<Tensor> {
        let raw = self.actor.call(None, &batch.bootstrap_observation, Flow::Nowhere)?;
        let (action, log_probability) =
            squash(self.engine.ops, self.bounds, &raw, &batch.target_noise)?;
        let q = Self::lower(&self.targets, &batch.bootstrap_observation, &action, Flow::Nowhere)?;
        let value = (q - (log_probability * f64::from(alpha))?)?;
        Ok((&batch.reward + (&batch.discount * value)?)?.detach())
    }

    /// The lower of two critics' values, (batch).
    fn lower(
        critics: &[Network; 2],
        observation: &Tensor,
        action: &Tensor,
        flow: Flow,
    ) -> TensorResult<Tensor> {
        let q = Network::call_both(critics, Some(observation), action, flow)?;
        q.narrow(1, 0, 1)?.minimum(&q.narrow(1, 1, 1)?)?.squeeze(1)
    }

    /// The lower critic's value of one action.
    pub(crate) fn value(&self, observation: &[f32], action: &[f32]) -> TensorResult<f32> {
        let row =
            |values: &[f32]| Tensor::from_slice(values, (1, values.len()), &self.engine.device);
        scalar(&Self::lower(&self.critics, &row(observation)?, &row(action)?, Flow::Nowhere)?)
    }
}

/// Ordinary weights below; a head near zero, so that the first policy is the same everywhere:
/// mean action 0, log σ as `raw_log_std` gives.
fn initial_actor(shape: &Shape, raw_log_std: f32, streams: &mut Streams) -> Vec<f32> {
    const HEAD_SCALE: f32 = 0.01;
    let mut parameters = shape.init(&mut streams.init);
    let head = shape.last();
    for w in &mut parameters[head.weight.clone()] {
        *w *= HEAD_SCALE;
    }
    let bias = &mut parameters[head.bias.clone()];
    let half = bias.len() / 2;
    bias[..half].fill(0.0);
    bias[half..].fill(raw_log_std);
    parameters
}

/// The one number of a tensor.
fn scalar(tensor: &Tensor) -> TensorResult<f32> {
    tensor.flatten_all()?.squeeze(0)?.to_scalar()
}
