//! The agent: acts, remembers, learns.

use candle_core::Tensor;
use rand::Rng;
use rand_chacha::ChaCha8Rng;

use crate::error::{check_length, check_vector};
use crate::heap;
use crate::learner::{Batch, Learner};
use crate::memory::{Drawn, Memory};
use crate::replay::Return;
use crate::rng::{Streams, fill_normal};
use crate::{LearnFrom, Policy, SacConfig, SacError, Transition, UpdateStats};

/// How an action is chosen.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Mode {
    /// A sample of the policy; uniform during warm-up.
    Explore,
    /// The mean of the policy.
    Exploit,
}

/// Soft actor-critic (Haarnoja et al. 2018, arXiv 1812.05905) with n-step returns.
///
/// The same configuration, dimensions, seed and calls give the same weights, bit for bit, on one
/// machine; so does [`save`](Self::save) followed by [`load`](Self::load) at any point.
#[derive(Debug)]
pub struct Sac {
    pub(crate) config: SacConfig,
    pub(crate) observation_dim: usize,
    pub(crate) action_dim: usize,
    pub(crate) seed: u64,
    pub(crate) learner: Learner,
    pub(crate) memory: Memory,
    pub(crate) streams: Streams,
    /// Transitions observed.
    pub(crate) steps: u64,
    /// Gradient updates done.
    pub(crate) updates: u64,
    /// The actor that acts; a copy of the learner's.
    pub(crate) policy: Policy,
}

impl Sac {
    /// A fresh agent.
    ///
    /// # Errors
    /// If a key of the configuration or a dimension cannot work.
    pub fn new(
        config: &SacConfig,
        observation_dim: usize,
        action_dim: usize,
        seed: u64,
    ) -> Result<Self, SacError> {
        config.validate()?;
        for (what, got) in [("an observation", observation_dim), ("an action", action_dim)] {
            if got == 0 {
                return Err(SacError::Dimension { what, expected: 1, got });
            }
        }
        heap::keep_room();
        let mut streams = Streams::new(seed);
        let learner = Learner::new(config, observation_dim, action_dim, &mut streams)?;
        Ok(Self {
            policy: learner.policy()?,
            learner,
            memory: Memory::new(config, observation_dim, action_dim),
            streams,
            steps: 0,
            updates: 0,
            config: config.clone(),
            observation_dim,
            action_dim,
            seed,
        })
    }

    /// Chooses an action, each value in [−1, 1].
    ///
    /// # Errors
    /// If a slice has the wrong length or the observation is not finite.
    pub fn act(
        &mut self,
        observation: &[f32],
        mode: Mode,
        action: &mut [f32],
    ) -> Result<(), SacError> {
        check_vector("observation", self.observation_dim, observation)?;
        check_length("action", self.action_dim, action.len())?;
        let rng = &mut self.streams.exploration;
        if mode == Mode::Explore && self.steps < self.config.warmup_steps {
            action.fill_with(|| rng.random_range(-1.0..=1.0));
            return Ok(());
        }
        match mode {
            Mode::Explore => self.policy.sample(observation, &mut self.streams.exploration, action),
            Mode::Exploit => self.policy.mean(observation, action),
        }
        Ok(())
    }

    /// Remembers one step of experience.
    ///
    /// # Errors
    /// If a vector has the wrong length or a number is not finite; nothing is stored then.
    pub fn observe(&mut self, transition: &Transition<'_>) -> Result<(), SacError> {
        self.check(transition)?;
        self.memory.own.push(transition);
        self.steps += 1;
        Ok(())
    }

    /// Remembers one step that somebody showed. Its kind makes [`demonstration_share`] of every batch from then on; it
    /// counts as no step of the agent's own and is never forgotten.
    ///
    /// [`demonstration_share`]: SacConfig::demonstration_share
    ///
    /// # Errors
    /// As of [`observe`](Self::observe).
    pub fn demonstrate(&mut self, transition: &Transition<'_>) -> Result<(), SacError> {
        self.check(transition)?;
        self.memory.demonstrations.replay.push(transition);
        Ok(())
    }

    /// Says that the episode that ends at the newest transition ended in a violation. Its last
    /// [`danger_steps`](SacConfig::danger_steps) are kept a second time if
    /// [`danger_share`](SacConfig::danger_share) is not 0.
    pub fn remember_danger(&mut self) {
        self.memory.remember_danger();
    }

    fn check(&self, transition: &Transition<'_>) -> Result<(), SacError> {
        check_vector("observation", self.observation_dim, transition.observation)?;
        check_vector("action", self.action_dim, transition.action)?;
        check_vector("executed action", self.action_dim, transition.executed)?;
        check_vector("reward", 1, &[transition.reward])?;
        check_vector("next observation", self.observation_dim, transition.next_observation)
    }

    /// Says that the running episode ends at the newest transition after all: whatever comes next
    /// starts elsewhere. For an episode cut short from outside.
    pub fn end_episode(&mut self) {
        self.memory.own.end_episode();
    }

    /// Learns: `updates_per_step` updates, or none while there is too little to learn from.
    ///
    /// # Errors
    /// [`SacError::Diverged`] if a loss or gradient is not finite.
    pub fn update(&mut self) -> Result<Option<UpdateStats>, SacError> {
        if self.memory.own.len() < self.config.start_training {
            return Ok(None);
        }
        let team = self.learner.team();
        let mean = team.enter(|| self.updates_of_a_step())?;
        self.learner.actor.copy_parameters(self.policy.parameters_mut())?;
        Ok(Some(mean))
    }

    fn updates_of_a_step(&mut self) -> Result<UpdateStats, SacError> {
        let mut mean = UpdateStats::default();
        for _ in 0..self.config.updates_per_step {
            let batch = self.draw_batch()?;
            let stats = self.learner.update(&batch, self.updates)?;
            self.updates += 1;
            mean.add(&stats, 1.0 / self.config.updates_per_step as f32);
        }
        Ok(mean)
    }

    fn draw_batch(&mut self) -> Result<Batch, SacError> {
        let Self { config, memory, streams: Streams { replay, update, .. }, learner, .. } = self;
        let (rows, a) = (config.batch_size, self.action_dim);
        // The two streams have nothing to do with each other.
        let (columns, [target_noise, actor_noise]) = learner.team().both(
            || Columns::draw(config, memory, replay),
            || {
                [(); 2].map(|()| {
                    let mut noise = vec![0.0; rows * a];
                    fill_normal(update, &mut noise);
                    noise
                })
            },
        );
        let device = learner.device();
        let matrix = |values: Vec<f32>| {
            let width = values.len() / rows;
            Tensor::from_vec(values, (rows, width), device)
        };
        Ok(Batch {
            target_noise: matrix(target_noise)?,
            actor_noise: matrix(actor_noise)?,
            observation: matrix(columns.observation)?,
            action: matrix(columns.action)?,
            reward: Tensor::from_vec(columns.reward, rows, device)?,
            discount: Tensor::from_vec(columns.discount, rows, device)?,
            bootstrap_observation: matrix(columns.bootstrap_observation)?,
        })
    }

    /// Draws from another seed from now on; the one it has changes nothing.
    pub fn reseed(&mut self, seed: u64) {
        if seed != self.seed {
            self.seed = seed;
            self.streams = Streams::new(seed);
        }
    }

    /// A copy of the policy as it is now.
    pub fn policy(&self) -> Policy {
        self.policy.clone()
    }

    /// min Q at an observation and the policy's mean action, in units of scaled reward.
    ///
    /// At the start of an episode, compare it with the discounted scaled return that follows: a
    /// value far above is the sign of a policy about to fail.
    ///
    /// # Errors
    /// If the observation has the wrong length or is not finite.
    pub fn q_start(&self, observation: &[f32]) -> Result<f32, SacError> {
        check_vector("observation", self.observation_dim, observation)?;
        let mut action = vec![0.0; self.action_dim];
        self.policy().mean(observation, &mut action);
        Ok(self.learner.value(observation, &action)?)
    }

    /// Gradient updates done so far.
    pub fn updates(&self) -> u64 {
        self.updates
    }

    /// Transitions observed so far.
    pub fn steps(&self) -> u64 {
        self.steps
    }

    /// What the agent went through, as far as the replay holds it, oldest first.
    pub fn transitions(&self) -> impl Iterator<Item = Transition<'_>> {
        self.memory.own.transitions()
    }

    /// Transitions in the replay, of the agent's own.
    pub fn replay_len(&self) -> usize {
        self.memory.own.len()
    }

    /// Transitions that were [demonstrated](Self::demonstrate).
    pub fn demonstrated(&self) -> usize {
        self.memory.demonstrations.replay.len()
    }

    /// The configuration the agent was made with.
    pub fn config(&self) -> &SacConfig {
        &self.config
    }

    /// Values in an observation.
    pub fn observation_dim(&self) -> usize {
        self.observation_dim
    }

    /// Values in an action.
    pub fn action_dim(&self) -> usize {
        self.action_dim
    }
}

/// What a batch holds of the memory, a row each transition.
struct Columns {
    observation: Vec<f32>,
    action: Vec<f32>,
    reward: Vec<f32>,
    discount: Vec<f32>,
    bootstrap_observation: Vec<f32>,
}

impl Columns {
    fn draw(config: &SacConfig, memory: &Memory, rng: &mut ChaCha8Rng) -> Self {
        let SacConfig { batch_size, n_step, gamma, reward_scale, learn_from, .. } = *config;
        // One column after the other: reads that do not wait for each other hide the distance to memory.
        let drawn: Vec<Drawn<'_>> = memory.draw(batch_size, rng);
        let returns: Vec<Return> =
            drawn.iter().map(|(replay, slot)| replay.n_step(*slot, n_step, gamma)).collect();
        let ends = drawn.iter().zip(&returns);
        Self {
            observation: gather(drawn.iter().map(|(replay, slot)| replay.observation(*slot))),
            action: gather(drawn.iter().map(|(replay, slot)| match learn_from {
                LearnFrom::Proposed => replay.action(*slot),
                LearnFrom::Executed => replay.executed(*slot),
            })),
            reward: returns.iter().map(|r| (reward_scale * r.reward) as f32).collect(),
            discount: returns.iter().map(|r| r.discount as f32).collect(),
            bootstrap_observation: gather(
                ends.map(|((replay, _), r)| replay.next_observation(r.slot)),
            ),
        }
    }
}

/// Rows one after the other.
fn gather<'a>(rows: impl ExactSizeIterator<Item = &'a [f32]>) -> Vec<f32> {
    let mut rows = rows.peekable();
    let size = rows.len() * rows.peek().map_or(0, |row| row.len());
    let mut values = Vec::with_capacity(size);
    rows.for_each(|row| values.extend_from_slice(row));
    values
}
