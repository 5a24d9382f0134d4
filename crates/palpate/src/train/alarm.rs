//! What a person should know about a learner before it fails.
//!
//! A critic that expects much more than the policy gets comes before a policy that falls from success to failure; units
//! that never fire and saturated actions are known from the literature (Sokar et al. 2023). The thresholds are chosen
//! so that healthy trainings of the study in docs/results/paper-study say nothing; no failing one has been seen since.

use palpate_sac::{Diagnosis, SacConfig};

use crate::progress::Evaluation;

/// A gap counts from this part of what a success pays.
const GAP: f64 = 0.15;
/// Units or actions, as parts of all.
const MOST: f32 = 0.5;

/// What has been said already.
#[derive(Debug, Default)]
pub(super) struct Alarms {
    gap: bool,
    dormant: bool,
    saturated: bool,
}

impl Alarms {
    /// Warnings that are new. `best` is the best success so far: before a policy has succeeded a critic only guesses.
    pub(super) fn new_ones(
        &mut self,
        sac: &SacConfig,
        pays: f64,
        best: Option<&Evaluation>,
        now: &Evaluation,
        diagnosis: Option<&Diagnosis>,
    ) -> Vec<String> {
        let mut all = Vec::new();
        let gap = now.q_minus_return;
        let able = best.is_some_and(|best| best.success_rate >= 0.9);
        // A gap that is no number is not believable, and told.
        let believable = gap <= GAP * sac.reward_scale * pays;
        if begins(&mut self.gap, able && !believable) {
            all.push(format!(
                "the critic expects {gap:.1} more than the policy gets (eval/q_minus_return): the policy may be failing. The best one so far is kept; if this stays, try a larger sac.n_step (now {}) or a smaller sac.actor_learning_rate (now {})",
                sac.n_step, sac.actor_learning_rate
            ));
        }
        let Some(d) = diagnosis else { return all };
        let dormant = d.dormant_actor > MOST || d.dormant_critic > MOST;
        if begins(&mut self.dormant, dormant) {
            all.push(format!(
                "{:.0} % of the actor's and {:.0} % of the critics' hidden units are dormant: they learn less and less. Try a smaller sac.updates_per_step (now {}), or a new run",
                100.0 * d.dormant_actor, 100.0 * d.dormant_critic, sac.updates_per_step
            ));
        }
        if begins(&mut self.saturated, d.saturation > MOST) {
            all.push(format!(
                "{:.0} % of the policy's actions are at their limits: it would do more if it could. Look at the ranges of the policy model (policy.motion, policy.gains), or raise sac.target_entropy",
                100.0 * d.saturation
            ));
        }
        all
    }
}

/// Whether something is so that was not.
fn begins(was: &mut bool, is: bool) -> bool {
    !std::mem::replace(was, is) && is
}

#[cfg(test)]
mod tests {
    use super::*;

    fn evaluation(success_rate: f64, q_minus_return: f64) -> Evaluation {
        Evaluation {
            step: 1000,
            success_rate,
            mean_return: 0.0,
            mean_steps: 0.0,
            peak_force: 0.0,
            q_minus_return,
        }
    }

    fn said(alarms: &mut Alarms, best: f64, gap: f64, d: Option<&Diagnosis>) -> Vec<String> {
        let (best, now) = (evaluation(best, 0.0), evaluation(0.2, gap));
        alarms.new_ones(&SacConfig::default(), 200.0, Some(&best), &now, d)
    }

    #[test]
    fn a_gap_is_told_once_after_the_policy_was_able() {
        let mut alarms = Alarms::default();
        assert!(said(&mut alarms, 0.5, 9.0, None).is_empty(), "a beginner's critic only guesses");
        // A tenth of 200 is paid for a success: 3 is 15 % of it.
        assert!(said(&mut alarms, 0.9, 2.9, None).is_empty());
        let text = said(&mut alarms, 0.9, 9.9, None).concat();
        assert!(text.contains("9.9") && text.contains("n_step (now 5)"), "{text}");
        assert!(said(&mut alarms, 0.9, 12.0, None).is_empty(), "once");
        assert!(said(&mut alarms, 0.9, 0.1, None).is_empty());
        assert_eq!(said(&mut alarms, 0.9, f64::NAN, None).len(), 1, "and again when it is back");
        assert!(
            alarms
                .new_ones(&SacConfig::default(), 200.0, None, &evaluation(0.0, 9.0), None)
                .is_empty()
        );
    }

    #[test]
    fn dormant_units_and_saturated_actions_are_told() {
        let mut alarms = Alarms::default();
        let healthy = Diagnosis { dormant_critic: 0.4, saturation: 0.3, ..Diagnosis::default() };
        assert!(said(&mut alarms, 1.0, 0.0, Some(&healthy)).is_empty());
        let ill = Diagnosis { dormant_critic: 0.6, saturation: 0.7, ..Diagnosis::default() };
        let text = said(&mut alarms, 1.0, 0.0, Some(&ill)).concat();
        assert!(text.contains("60 % of the critics'") && text.contains("70 %"), "{text}");
    }
}
