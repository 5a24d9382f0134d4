//! One step of experience, as the learner takes it and as the journal keeps it.

use palpate_env::{Env, Step, Summary};
use palpate_sac::Transition;
use palpate_safety::Guarded;

/// One step of experience.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct Lesson {
    /// What the policy saw.
    pub(crate) observation: Vec<f32>,
    /// What it did.
    pub(crate) action: Vec<f32>,
    /// What the fail-safe layer let be done of it.
    pub(crate) executed: Vec<f32>,
    /// What it saw then.
    pub(crate) next: Vec<f32>,
    /// What it got.
    pub(crate) reward: f32,
    /// The task ended there.
    pub(crate) terminal: bool,
    /// The episode ended there.
    pub(crate) episode_end: bool,
    /// The finished episode, on its last step.
    pub(crate) summary: Option<Summary>,
}

const TERMINAL: u8 = 1;
const EPISODE_END: u8 = 2;

impl Lesson {
    /// One with room for observations and actions of these lengths.
    pub(crate) fn blank(observation: usize, action: usize) -> Self {
        let (seen, done) = (|| Vec::with_capacity(observation), || Vec::with_capacity(action));
        Self {
            observation: seen(),
            action: done(),
            executed: done(),
            next: seen(),
            ..Self::default()
        }
    }

    /// Writes the step of `env` that `action` made on `observation` over what was here; takes no memory if there
    /// is room.
    pub(crate) fn write<R: Guarded>(
        &mut self,
        env: &Env<R>,
        observation: &[f32],
        action: &[f32],
        step: Step,
    ) {
        for (to, from) in [
            (&mut self.observation, observation),
            (&mut self.action, action),
            (&mut self.executed, action),
            (&mut self.next, env.observation()),
        ] {
            to.clear();
            to.extend_from_slice(from);
        }
        env.executed(&mut self.executed, &step.deviation);
        self.reward = step.reward.total() as f32;
        self.terminal = step.terminated;
        self.episode_end = step.terminated || step.truncated;
        self.summary = step.summary;
    }

    /// As the learner takes it.
    pub(crate) fn transition(&self) -> Transition<'_> {
        Transition {
            observation: &self.observation,
            action: &self.action,
            executed: &self.executed,
            reward: self.reward,
            next_observation: &self.next,
            terminal: self.terminal,
            episode_end: self.episode_end,
        }
    }

    /// As a record of the journal: step number u64, flags u8, reward, observation, action, executed action and next
    /// observation as f32, all little-endian, then the summary as JSON if there is one.
    pub(crate) fn record(&self, number: u64) -> Vec<u8> {
        let Self { observation, action, executed, next, reward, terminal, episode_end, summary } =
            self;
        let mut bytes = number.to_le_bytes().to_vec();
        let flag = |set: bool, flag| if set { flag } else { 0 };
        bytes.push(flag(*terminal, TERMINAL) | flag(*episode_end, EPISODE_END));
        let numbers = [*reward]
            .into_iter()
            .chain(observation.iter().chain(action).chain(executed).chain(next).copied());
        bytes.extend(numbers.flat_map(f32::to_le_bytes));
        // Numbers and names only: it has a JSON form.
        bytes.extend(summary.iter().flat_map(|s| serde_json::to_vec(s).unwrap_or_default()));
        bytes
    }

    /// Reads a record of a run whose observations and actions have these lengths; its number and what it holds.
    pub(crate) fn parse(bytes: &[u8], observation: usize, action: usize) -> Option<(u64, Self)> {
        let (number, bytes) = bytes.split_first_chunk::<8>()?;
        let (flags, bytes) = bytes.split_first()?;
        let size = 4 * (1 + 2 * (observation + action));
        let (numbers, summary) = bytes.split_at_checked(size)?;
        let (numbers, []) = numbers.as_chunks::<4>() else { return None };
        let numbers: Vec<f32> = numbers.iter().copied().map(f32::from_le_bytes).collect();
        let (reward, numbers) = numbers.split_first()?;
        let (seen, numbers) = numbers.split_at_checked(observation)?;
        let (chosen, numbers) = numbers.split_at_checked(action)?;
        let (executed, next) = numbers.split_at_checked(action)?;
        let summary = match summary {
            [] => None,
            json => Some(serde_json::from_slice(json).ok()?),
        };
        let lesson = Self {
            observation: seen.to_vec(),
            action: chosen.to_vec(),
            executed: executed.to_vec(),
            next: next.to_vec(),
            reward: *reward,
            terminal: flags & TERMINAL != 0,
            episode_end: flags & EPISODE_END != 0,
            summary,
        };
        Some((u64::from_le_bytes(*number), lesson))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use palpate_env::Outcome;
    use palpate_safety::{Counts, Tally};

    #[test]
    fn a_record_reads_back_as_the_same_bits() {
        let summary = Summary {
            episode: 7,
            outcome: Outcome::Collision,
            total_reward: -0.1 - 0.2,
            steps: 31,
            seconds: 1.55,
            peak_force: 31.25,
            mean_force: 1.0 / 3.0,
            final_distance: 1e-17,
            tally: Tally::default(),
            verdicts: Counts::default(),
        };
        for summary in [None, Some(summary)] {
            let lesson = Lesson {
                observation: vec![0.1, -0.0, f32::MIN_POSITIVE],
                action: vec![1.0, -1.0],
                executed: vec![0.5, -1.0],
                next: vec![1e-30, 3.0, f32::MAX],
                reward: -1.0 / 3.0,
                terminal: summary.is_some(),
                episode_end: true,
                summary,
            };
            let record = lesson.record(u64::MAX - 1);
            assert_eq!(Lesson::parse(&record, 3, 2), Some((u64::MAX - 1, lesson.clone())));
            assert_eq!(Lesson::parse(&record[..20], 3, 2), None);
            assert_eq!(Lesson::parse(&record, 4, 2), None, "another task's record");
        }
    }
}
