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
    "train/critic_gradient_norm",
    "train/actor_gradient_norm",
    "train/critic_weight_norm",
    "train/actor_weight_norm",
    "train/dormant_critic",
    "train/dormant_actor",
    "train/action_saturation",
    "train/replay_age",
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

/// Columns of ledger.csv: circumstances of the first of `ticks` control ticks in a row, base axes, m, N, N·m, rad.
pub(super) const LEDGER: &[&str] = &[
    "cause",
    "episode",
    "step",
    "time",
    "ticks",
    "distance",
    "x",
    "y",
    "z",
    "fx",
    "fy",
    "fz",
    "tx",
    "ty",
    "tz",
    "proposed_q0",
    "proposed_q1",
    "proposed_q2",
    "proposed_q3",
    "proposed_q4",
    "proposed_q5",
    "executed_q0",
    "executed_q1",
    "executed_q2",
    "executed_q3",
    "executed_q4",
    "executed_q5",
];

#[cfg(test)]
mod tests {
    use super::*;
    use palpate_safety::Cause;

    #[test]
    fn the_reference_names_every_column_and_every_cause() {
        let page = include_str!("../../../../docs/reference/tables.md");
        let joints = |column: &&str| !column.contains("_q") || column.ends_with(['0', '5']);
        let columns = [METRICS, EPISODES, LEDGER].into_iter().flatten().copied();
        for name in columns.filter(joints).chain(Cause::ALL.iter().map(|cause| cause.name())) {
            assert!(page.contains(&format!("`{name}`")), "{name}");
        }
    }
}
