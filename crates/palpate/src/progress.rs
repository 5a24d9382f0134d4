//! What a training run remembers besides the learner: counters and the last episodes.

use std::collections::VecDeque;

use palpate_env::{Outcome, Summary};
use palpate_runs::Mark;
use palpate_safety::{Counts, Tally};

/// Episodes behind the rolling figures.
const WINDOW: usize = 20;

/// Counters of a run; part of every checkpoint.
#[derive(Clone, Debug, Default, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Progress {
    /// Environment steps taken.
    pub step: u64,
    /// Episodes finished.
    pub episodes: u64,
    /// Episodes that reached the goal.
    pub successes: u64,
    /// Episodes ended by the force limit.
    pub collisions: u64,
    /// Episodes that were given up on an arm, after a stop or an interrupt. They have used their starts.
    #[serde(default)]
    pub aborted: u64,
    /// Episodes cut by a simulator fault.
    pub faults: u64,
    /// Simulated worlds rebuilt to free a stuck tool or after a fault.
    pub rebuilt: u64,
    /// Refused commands and force stops, control ticks.
    pub tally: Tally,
    /// Verdicts of the fail-safe layer other than a plain pass, control ticks.
    pub verdicts: Counts,
    /// Step of the first success.
    pub first_success: Option<u64>,
    /// Where metrics.csv and episodes.csv end.
    pub tables: (Mark, Mark),
    /// Where ledger.csv ends.
    pub ledger: Mark,
    /// Latest evaluation.
    pub evaluated: Option<Evaluation>,
    /// An evaluation that no row of metrics.csv shows yet.
    pub(crate) pending: Option<Evaluation>,
    /// The evaluation that the kept policy won with.
    pub best: Option<Evaluation>,
    /// The last [`WINDOW`] episodes, oldest first.
    pub recent: VecDeque<Recent>,
}

/// An evaluation during training, on frozen starts.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Evaluation {
    /// Environment step.
    pub step: u64,
    /// Share of episodes that reached the goal.
    pub success_rate: f64,
    /// Mean sum of rewards.
    pub mean_return: f64,
    /// Mean actions per episode.
    pub mean_steps: f64,
    /// Median over episodes of the peak contact force, N.
    pub peak_force: f64,
    /// Mean over episodes of Q(start) minus the discounted return that followed, in scaled reward: the
    /// one signal that announces a collapsing policy (a critic that believes what does not happen).
    pub q_minus_return: f64,
}

impl Evaluation {
    /// Worth keeping instead of an earlier one: no fewer successes. Of equals the later one has learned more; to go by
    /// their returns as well kept policies that were lucky on these few starts.
    pub(crate) fn beats(&self, earlier: &Self) -> bool {
        self.success_rate >= earlier.success_rate
    }
}

/// What the rolling figures need of an episode.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Recent {
    total_reward: f64,
    steps: u32,
    success: bool,
    peak_force: f64,
}

impl Progress {
    /// Takes in a finished episode.
    pub(crate) fn record(&mut self, summary: &Summary) {
        self.episodes += 1;
        self.tally += summary.tally;
        self.verdicts += summary.verdicts;
        match summary.outcome {
            Outcome::Success => {
                self.successes += 1;
                self.first_success.get_or_insert(self.step);
            }
            Outcome::Collision => self.collisions += 1,
            Outcome::Fault => self.faults += 1,
            Outcome::TimeLimit => {}
        }
        if self.recent.len() == WINDOW {
            self.recent.pop_front();
        }
        self.recent.push_back(Recent {
            total_reward: summary.total_reward,
            steps: summary.steps,
            success: summary.outcome == Outcome::Success,
            peak_force: summary.peak_force,
        });
    }

    /// Mean sum of rewards of the recent episodes.
    pub(crate) fn mean_return(&self) -> Option<f64> {
        self.mean(|r| r.total_reward)
    }

    /// Mean length of the recent episodes.
    pub(crate) fn mean_steps(&self) -> Option<f64> {
        self.mean(|r| f64::from(r.steps))
    }

    /// Share of the recent episodes that reached the goal.
    pub(crate) fn success_rate(&self) -> Option<f64> {
        self.mean(|r| if r.success { 1.0 } else { 0.0 })
    }

    /// Mean peak contact force of the recent episodes, N.
    pub(crate) fn mean_peak_force(&self) -> Option<f64> {
        self.mean(|r| r.peak_force)
    }

    fn mean(&self, f: impl Fn(&Recent) -> f64) -> Option<f64> {
        let n = self.recent.len();
        (n > 0).then(|| self.recent.iter().map(f).sum::<f64>() / n as f64)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn summary(outcome: Outcome, total_reward: f64) -> Summary {
        Summary {
            episode: 0,
            outcome,
            total_reward,
            steps: 10,
            seconds: 0.5,
            peak_force: 3.0,
            mean_force: 1.0,
            final_distance: 0.0,
            tally: Tally::default(),
            verdicts: Counts::default(),
        }
    }

    #[test]
    fn rolling_figures_forget_old_episodes() {
        let mut progress = Progress::default();
        assert_eq!(progress.success_rate(), None);
        for _ in 0..WINDOW {
            progress.record(&summary(Outcome::Collision, 0.0));
        }
        assert_eq!((progress.success_rate(), progress.collisions), (Some(0.0), WINDOW as u64));
        progress.step = 77;
        for _ in 0..WINDOW / 2 {
            progress.record(&summary(Outcome::Success, 200.0));
        }
        assert_eq!(progress.success_rate(), Some(0.5));
        assert_eq!(progress.mean_return(), Some(100.0));
        assert_eq!(progress.first_success, Some(77));
    }

    #[test]
    fn success_counts_before_return() {
        let e = |success_rate, mean_return| Evaluation {
            step: 0,
            success_rate,
            mean_return,
            mean_steps: 0.0,
            peak_force: 0.0,
            q_minus_return: 0.0,
        };
        assert!(e(0.9, 10.0).beats(&e(0.8, 200.0)));
        assert!(e(0.9, 9.0).beats(&e(0.9, 10.0)));
        assert!(!e(0.8, 200.0).beats(&e(0.9, 10.0)));
    }
}
