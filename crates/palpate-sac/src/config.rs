//! Hyper-parameters, checked once.

use serde::{Deserialize, Serialize};

use crate::{Processor, SacError};

/// How the networks are computed.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Ops {
    /// One hand-written operation per network: several times faster.
    Fused,
    /// Ordinary candle operations: the reference that the fused ones are checked against.
    Plain,
}

/// Which action of a step the critics learn the value of, where a safety layer changed it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum LearnFrom {
    /// The policy's: the layer is part of the world, and what it does to an action is learned.
    Proposed,
    /// What came of it.
    Executed,
}

/// Entropy that the temperature steers the policy to, nats.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "EntropyKey", into = "EntropyKey")]
pub enum TargetEntropy {
    /// Minus the number of action dimensions, written `"-dim"`.
    NegativeDim,
    /// This number.
    Nats(f64),
}

impl TargetEntropy {
    /// The number, for so many action dimensions.
    pub fn nats(self, action_dim: usize) -> f64 {
        match self {
            Self::NegativeDim => -(action_dim as f64),
            Self::Nats(nats) => nats,
        }
    }
}

#[derive(Serialize, Deserialize)]
#[serde(untagged, expecting = "expected a number or \"-dim\"")]
enum EntropyKey {
    Number(f64),
    Text(String),
}

impl TryFrom<EntropyKey> for TargetEntropy {
    type Error = String;
    fn try_from(key: EntropyKey) -> Result<Self, String> {
        match key {
            EntropyKey::Number(nats) => Ok(Self::Nats(nats)),
            EntropyKey::Text(text) if text == "-dim" => Ok(Self::NegativeDim),
            EntropyKey::Text(text) => Err(format!("expected a number or \"-dim\", got \"{text}\"")),
        }
    }
}

impl From<TargetEntropy> for EntropyKey {
    fn from(target: TargetEntropy) -> Self {
        match target {
            TargetEntropy::NegativeDim => Self::Text("-dim".into()),
            TargetEntropy::Nats(nats) => Self::Number(nats),
        }
    }
}

/// Hyper-parameters of soft actor-critic.
///
/// A file states every key. [`Default`] is what was measured to learn contact tasks reliably; where
/// it departs from Haarnoja et al. 2018 (arXiv 1812.05905, Table 1) the field says so.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SacConfig {
    /// Which implementation of the networks.
    pub ops: Ops,
    /// What computes it. Files from before this key are read as the CPU.
    #[serde(default)]
    pub device: Processor,
    /// Threads of an update with [`Ops::Fused`]: 1 or 2, or 0 for as many of these as there are cores. No
    /// result depends on it. Files from before this key are read as 0.
    #[serde(default)]
    pub threads: usize,
    /// Units of each hidden layer, actor and critics alike.
    pub hidden: Vec<usize>,
    /// LayerNorm without affine part on the critics' hidden pre-activations (not in the paper).
    pub critic_layer_norm: bool,
    /// Discount per step γ.
    pub gamma: f64,
    /// Steps of reward before the critic target bootstraps (1 in the paper).
    pub n_step: usize,
    /// Share of the critics that flows into their targets per update, τ.
    pub tau: f64,
    /// Which action of a step is learned from.
    pub learn_from: LearnFrom,
    /// Transitions per update.
    pub batch_size: usize,
    /// Gradient updates per call of [`Sac::update`](crate::Sac::update), one call per step.
    pub updates_per_step: usize,
    /// Step size of the actor's Adam.
    pub actor_learning_rate: f64,
    /// Step size of the critics' Adam.
    pub critic_learning_rate: f64,
    /// Step size of the temperature's Adam (on log α).
    pub alpha_learning_rate: f64,
    /// Temperature α before the first update (1 in the paper).
    pub initial_alpha: f64,
    /// Entropy the temperature aims at (`"-dim"` in the paper).
    pub target_entropy: TargetEntropy,
    /// Standard deviation of a fresh policy before squashing; 1 makes tanh nearly uniform.
    pub init_std: f64,
    /// Lower bound of log σ, before squashing.
    pub log_std_min: f64,
    /// Upper bound of log σ, before squashing.
    pub log_std_max: f64,
    /// Factor on every reward before it reaches the critics.
    pub reward_scale: f64,
    /// Transitions kept; the oldest go first.
    pub replay_capacity: usize,
    /// Steps of uniform random actions before the policy acts.
    pub warmup_steps: u64,
    /// Transitions needed before the first update.
    pub start_training: usize,
    /// Part of every batch that is drawn from demonstrations once there are any; 0.5 is Ball et al. 2023
    /// (RLPD). Rows are rounded down. Files from before this key are read as 0.
    #[serde(default)]
    pub demonstration_share: f64,
    /// Steps of the run's own over which that part falls evenly to nothing; 0: it stays. Files from before this key
    /// are read as 0.
    #[serde(default)]
    pub demonstration_steps: usize,
    /// Part of every batch that is drawn from the last steps before violations once there was one; 0: none are
    /// kept apart. Files from before this key are read as 0.
    #[serde(default)]
    pub danger_share: f64,
    /// How many steps before a violation are kept apart. Files from before this key are read as 10.
    #[serde(default = "danger_steps")]
    pub danger_steps: usize,
}

fn danger_steps() -> usize {
    10
}

impl Default for SacConfig {
    fn default() -> Self {
        Self {
            ops: Ops::Fused,
            device: Processor::Cpu,
            threads: 0,
            hidden: vec![128, 128],
            critic_layer_norm: true,
            gamma: 0.98,
            n_step: 5,
            tau: 0.005,
            learn_from: LearnFrom::Proposed,
            batch_size: 128,
            updates_per_step: 2,
            actor_learning_rate: 3e-4,
            critic_learning_rate: 3e-4,
            alpha_learning_rate: 3e-4,
            initial_alpha: 0.02,
            target_entropy: TargetEntropy::Nats(0.0),
            init_std: 1.0,
            log_std_min: -5.0,
            log_std_max: 2.0,
            reward_scale: 0.1,
            replay_capacity: 1_000_000,
            warmup_steps: 0,
            start_training: 128,
            demonstration_share: 0.0,
            demonstration_steps: 0,
            danger_share: 0.0,
            danger_steps: danger_steps(),
        }
    }
}

impl SacConfig {
    /// How many threads an update uses on this machine.
    pub(crate) fn update_threads(&self) -> usize {
        let cores = || std::thread::available_parallelism().map_or(1, usize::from);
        if self.threads == 0 { cores().min(2) } else { self.threads }
    }

    /// Refuses values that cannot work, naming the key.
    ///
    /// # Errors
    /// [`SacError::Config`] for the first such key.
    pub fn validate(&self) -> Result<(), SacError> {
        let refuse = |key, reason: String| Err(SacError::Config { key, reason });
        if self.hidden.is_empty() || self.hidden.contains(&0) {
            return refuse(
                "hidden",
                format!("needs layers of at least one unit, got {:?}", self.hidden),
            );
        }
        if self.device == Processor::Cuda && self.ops == Ops::Fused {
            let reason = "cuda computes plain operations only: set sac.ops = \"plain\" with it";
            return refuse("device", reason.into());
        }
        if self.threads > 2 {
            let got = self.threads;
            return refuse("threads", format!("an update runs on 1 or 2 (0: by cores), got {got}"));
        }
        for (key, value) in [
            ("n_step", self.n_step),
            ("batch_size", self.batch_size),
            ("updates_per_step", self.updates_per_step),
            ("replay_capacity", self.replay_capacity),
            ("start_training", self.start_training),
            ("danger_steps", self.danger_steps),
        ] {
            if value == 0 {
                return refuse(key, "must be at least 1".into());
            }
        }
        if self.start_training > self.replay_capacity {
            let (start, capacity) = (self.start_training, self.replay_capacity);
            return refuse(
                "start_training",
                format!("{start} transitions never fit into a replay_capacity of {capacity}"),
            );
        }
        let shares = [self.demonstration_share, self.danger_share];
        for (key, share) in ["demonstration_share", "danger_share"].into_iter().zip(shares) {
            if !(0.0..1.0).contains(&share) {
                return refuse(key, format!("must be in [0, 1), got {share}"));
            }
        }
        if shares.iter().sum::<f64>() >= 1.0 {
            let [shown, danger] = shares;
            let reason = format!(
                "{danger} and a demonstration_share of {shown} leave nothing of a batch to the run's own steps"
            );
            return refuse("danger_share", reason);
        }
        if !(0.0..1.0).contains(&self.gamma) {
            return refuse("gamma", format!("must be in [0, 1), got {}", self.gamma));
        }
        if !(self.tau > 0.0 && self.tau <= 1.0) {
            return refuse("tau", format!("must be in (0, 1], got {}", self.tau));
        }
        for (key, value) in [
            ("actor_learning_rate", self.actor_learning_rate),
            ("critic_learning_rate", self.critic_learning_rate),
            ("initial_alpha", self.initial_alpha),
            ("init_std", self.init_std),
            ("reward_scale", self.reward_scale),
        ] {
            if !(value > 0.0 && value.is_finite()) {
                return refuse(key, format!("must be positive and finite, got {value}"));
            }
        }
        // Zero freezes the temperature, which is a way to run SAC.
        if !(self.alpha_learning_rate >= 0.0 && self.alpha_learning_rate.is_finite()) {
            let value = self.alpha_learning_rate;
            return refuse(
                "alpha_learning_rate",
                format!("must be finite and not negative, got {value}"),
            );
        }
        if !self.target_entropy.nats(1).is_finite() {
            return refuse(
                "target_entropy",
                format!("must be finite, got {}", self.target_entropy.nats(1)),
            );
        }
        let (min, max, init) = (self.log_std_min, self.log_std_max, self.init_std.ln());
        if !(min < max && min >= -20.0 && max <= 5.0) {
            return refuse(
                "log_std_min",
                format!("must be below log_std_max, both within [-20, 5], got {min} and {max}"),
            );
        }
        if !(min < init && init < max) {
            return refuse(
                "init_std",
                format!("log {} = {init:.3} is not inside ({min}, {max})", self.init_std),
            );
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn refused(edit: impl FnOnce(&mut SacConfig)) -> String {
        let mut config = SacConfig::default();
        edit(&mut config);
        config.validate().unwrap_err().to_string()
    }

    #[test]
    fn defaults_are_accepted_and_survive_toml() {
        let config = SacConfig::default();
        config.validate().unwrap();
        let text = toml::to_string(&config).unwrap();
        assert_eq!(toml::from_str::<SacConfig>(&text).unwrap(), config);
    }

    #[test]
    fn target_entropy_is_a_number_or_minus_dim() {
        let with = |value: &str| {
            let text = toml::to_string(&SacConfig::default()).unwrap();
            toml::from_str::<SacConfig>(
                &text.replace("target_entropy = 0.0", &format!("target_entropy = {value}")),
            )
        };
        assert_eq!(with("\"-dim\"").unwrap().target_entropy.nats(14), -14.0);
        assert_eq!(with("-7").unwrap().target_entropy.nats(14), -7.0);
        assert_eq!(with("2.5").unwrap().target_entropy.nats(14), 2.5);
        assert!(with("\"dim\"").unwrap_err().to_string().contains("got \"dim\""));
    }

    #[test]
    fn a_file_must_state_every_key_and_no_other() {
        let text = toml::to_string(&SacConfig::default()).unwrap();
        let missing = toml::from_str::<SacConfig>(&text.replace("n_step = 5\n", "")).unwrap_err();
        assert!(missing.to_string().contains("n_step"), "{missing}");
        let extra = toml::from_str::<SacConfig>(&format!("batchsize = 3\n{text}")).unwrap_err();
        assert!(extra.to_string().contains("batchsize"), "{extra}");
    }

    #[test]
    fn files_from_before_demonstrations_are_read_as_without() {
        let text = toml::to_string(&SacConfig::default()).unwrap();
        let old: Vec<&str> = text
            .lines()
            .filter(|line| !["demonstration_", "danger_"].iter().any(|new| line.starts_with(new)))
            .collect();
        assert_eq!(old.len(), text.lines().count() - 4);
        assert_eq!(toml::from_str::<SacConfig>(&old.join("\n")).unwrap(), SacConfig::default());
    }

    #[test]
    fn bad_values_are_refused_by_name() {
        assert!(refused(|c| c.gamma = 1.0).contains("gamma"));
        assert!(refused(|c| c.gamma = f64::NAN).contains("gamma"));
        assert!(refused(|c| c.tau = f64::NAN).contains("tau"));
        assert!(refused(|c| c.tau = 0.0).contains("tau"));
        assert!(refused(|c| c.hidden = vec![]).contains("hidden"));
        assert!(refused(|c| c.hidden = vec![4, 0]).contains("hidden"));
        assert!(refused(|c| c.batch_size = 0).contains("batch_size"));
        assert!(refused(|c| c.threads = 3).contains("threads"));
        assert!(refused(|c| c.device = Processor::Cuda).contains("sac.ops"));
        assert!(refused(|c| c.actor_learning_rate = f64::INFINITY).contains("actor_learning_rate"));
        assert!(refused(|c| c.alpha_learning_rate = f64::NAN).contains("alpha_learning_rate"));
        assert!(refused(|c| c.init_std = 10.0).contains("init_std"));
        assert!(refused(|c| c.log_std_max = f64::NAN).contains("log_std"));
        assert!(refused(|c| c.start_training = 2_000_000).contains("start_training"));
        assert!(refused(|c| c.demonstration_share = f64::NAN).contains("demonstration_share"));
        assert!(refused(|c| c.danger_share = 1.0).contains("danger_share"));
        assert!(refused(|c| c.danger_share = -0.1).contains("danger_share"));
        assert!(refused(|c| c.danger_steps = 0).contains("danger_steps"));
        let both = refused(|c| (c.demonstration_share, c.danger_share) = (0.5, 0.5));
        assert!(both.contains("leave nothing"), "{both}");
        assert!(
            refused(|c| c.target_entropy = TargetEntropy::Nats(f64::NAN))
                .contains("target_entropy")
        );
    }
}
