//! What a run writes, column by column.

/// Columns of metrics.csv. Names as in Stable-Baselines3 where it has one.
pub(super) const METRICS: &[&str] = &[
    "time/total_timesteps",
    "time/episodes",
    "rollout/ep_rew_mean",
    "rollout/ep_len_mean",
    "rollout/success_rate",
    "rollout/peak_force_mean",
    "safety/collisions",
    "safety/refused_ik",
    "safety/refused_speed",
    "safety/refused_non_finite",
    "sim/faults",
    "train/n_updates",
    "train/critic_loss",
    "train/actor_loss",
    "train/ent_coef",
    "train/entropy",
    "train/q_mean",
    "eval/success_rate",
    "eval/mean_reward",
    "eval/mean_ep_length",
    "eval/peak_force",
    "eval/q_minus_return",
];

/// Columns of episodes.csv.
pub(super) const EPISODES: &[&str] = &[
    "episode",
    "step",
    "return",
    "length",
    "success",
    "collision",
    "fault",
    "peak_force",
    "mean_force",
    "final_distance",
    "refused_ik",
    "refused_speed",
];
