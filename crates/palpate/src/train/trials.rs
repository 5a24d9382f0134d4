//! The account of an evaluation, wherever its episodes are run.

use palpate_env::Summary;
use palpate_sac::SacConfig;

use crate::evaluate;
use crate::progress::Evaluation;

/// Episodes of the policy's mean, so far.
#[derive(Debug)]
pub(crate) struct Trials {
    gamma: f64,
    scale: f64,
    summaries: Vec<Summary>,
    /// Sum over episodes of Q(start) minus the discounted return.
    gap: f64,
    /// Of the next reward.
    weight: f64,
}

impl Trials {
    pub(crate) fn new(sac: &SacConfig) -> Self {
        let (gamma, scale) = (sac.gamma, sac.reward_scale);
        Self { gamma, scale, summaries: Vec::new(), gap: 0.0, weight: 0.0 }
    }

    /// An episode starts.
    pub(crate) fn begin(&mut self) {
        self.weight = self.scale;
    }

    /// The critic expected this much at the start of an episode.
    pub(crate) fn expected(&mut self, q_start: f64) {
        self.gap += q_start;
    }

    /// A step of it.
    pub(crate) fn step(&mut self, reward: f64, summary: Option<&Summary>) {
        self.gap -= self.weight * reward;
        self.weight *= self.gamma;
        self.summaries.extend(summary.cloned());
    }

    /// Takes in the episodes of another account.
    pub(crate) fn join(&mut self, other: Self) {
        self.gap += other.gap;
        self.summaries.extend(other.summaries);
    }

    /// What it came to at this step of the run.
    pub(crate) fn result(&self, step: u64) -> Evaluation {
        let row = evaluate::Row::new("monitor", &self.summaries);
        Evaluation {
            step,
            success_rate: row.success_rate,
            mean_return: row.mean_return,
            mean_steps: row.mean_steps,
            peak_force: row.median_peak_force,
            q_minus_return: self.gap / self.summaries.len().max(1) as f64,
        }
    }
}
