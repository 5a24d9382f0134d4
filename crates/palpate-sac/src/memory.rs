//! What batches are drawn from: the run's own replay, demonstrations, and what led to violations.
//!
//! One mechanism: a part that holds something gives its share of every batch, the run's own replay the rest. With
//! half from demonstrations it is the symmetric sampling of Ball et al. 2023 (RLPD, arXiv 2302.02948). Returns of
//! several steps stay inside the part that they begin in.

use rand_chacha::ChaCha8Rng;

use crate::SacConfig;
use crate::replay::Replay;

/// Room of a part that forgets nothing.
const FOR_GOOD: usize = i32::MAX as usize;

/// Everything that is remembered.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Memory {
    /// What the run went through.
    pub(crate) own: Replay,
    /// What somebody showed.
    pub(crate) demonstrations: Part,
    /// The last steps before violations, a second time.
    pub(crate) danger: Part,
    danger_steps: usize,
    demonstration_steps: usize,
}

/// A replay with its share of every batch.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Part {
    share: f64,
    pub(crate) replay: Replay,
}

/// A stored step: where it is kept, and its slot there.
pub(crate) type Drawn<'a> = (&'a Replay, usize);

impl Memory {
    pub(crate) fn new(config: &SacConfig, observation_dim: usize, action_dim: usize) -> Self {
        let replay = |capacity| Replay::new(capacity, observation_dim, action_dim);
        Self {
            own: replay(config.replay_capacity),
            demonstrations: Part { share: config.demonstration_share, replay: replay(FOR_GOOD) },
            danger: Part { share: config.danger_share, replay: replay(config.replay_capacity) },
            danger_steps: config.danger_steps,
            demonstration_steps: config.demonstration_steps,
        }
    }

    /// Keeps the last steps of the episode that ended with the newest one apart, if danger has a share.
    pub(crate) fn remember_danger(&mut self) {
        if self.danger.share > 0.0 {
            for step in self.own.tail(self.danger_steps) {
                self.danger.replay.push(&step);
            }
            self.danger.replay.end_episode();
        }
    }

    /// So many stored steps: of each part its share, rounded down, of the run's own the rest.
    pub(crate) fn draw(&self, rows: usize, rng: &mut ChaCha8Rng) -> Vec<Drawn<'_>> {
        let of = |part: &Part, rows: f64| if part.replay.len() > 0 { part.rows(rows) } else { 0 };
        let all = rows as f64;
        let shown = of(&self.demonstrations, all * self.demonstrations_left());
        let danger = of(&self.danger, all);
        let mut drawn = Vec::with_capacity(rows);
        for (replay, count) in [
            (&self.own, rows.saturating_sub(shown + danger)),
            (&self.demonstrations.replay, shown),
            (&self.danger.replay, danger),
        ] {
            drawn.extend((0..count).map(|_| (replay, replay.draw(rng))));
        }
        drawn
    }

    /// The part of the demonstrations' share that is left: it falls evenly as the run learns for itself.
    fn demonstrations_left(&self) -> f64 {
        match self.demonstration_steps {
            0 => 1.0,
            steps => (1.0 - self.own.len() as f64 / steps as f64).max(0.0),
        }
    }
}

impl Part {
    fn rows(&self, of: f64) -> usize {
        (self.share * of).floor() as usize
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Transition;
    use crate::rng::Streams;

    fn step(number: f32, episode_end: bool) -> Transition<'static> {
        // Lives as long as the test: what is stored is compared by its number.
        let row: &'static [f32] = Box::leak(Box::new([number]));
        Transition {
            observation: row,
            action: &[0.0],
            executed: &[0.0],
            reward: number,
            next_observation: row,
            terminal: episode_end,
            episode_end,
        }
    }

    fn memory(demonstration_share: f64, danger_share: f64) -> Memory {
        let config = SacConfig {
            demonstration_share,
            danger_share,
            danger_steps: 3,
            replay_capacity: 100,
            ..SacConfig::default()
        };
        Memory::new(&config, 1, 1)
    }

    /// Rows of a batch of 128 from the run, the demonstrations and danger.
    fn counts(memory: &Memory) -> [usize; 3] {
        let drawn = memory.draw(128, &mut Streams::new(1).replay);
        assert_eq!(drawn.len(), 128);
        [&memory.own, &memory.demonstrations.replay, &memory.danger.replay]
            .map(|part| drawn.iter().filter(|(from, _)| std::ptr::eq(*from, part)).count())
    }

    #[test]
    fn a_part_gives_its_share_once_it_holds_something() {
        let mut memory = memory(0.5, 0.1);
        memory.own.push(&step(1.0, true));
        assert_eq!(counts(&memory), [128, 0, 0]);
        memory.demonstrations.replay.push(&step(2.0, true));
        assert_eq!(counts(&memory), [64, 64, 0]);
        memory.remember_danger();
        assert_eq!(counts(&memory), [52, 64, 12]);
    }

    #[test]
    fn what_was_shown_fades_as_the_run_learns_for_itself() {
        let mut memory = memory(0.5, 0.1);
        memory.demonstration_steps = 8;
        memory.demonstrations.replay.push(&step(2.0, true));
        for shown in [56, 48, 40, 32, 24, 16, 8, 0, 0] {
            memory.own.push(&step(1.0, true));
            assert_eq!(counts(&memory), [128 - shown, shown, 0]);
        }
    }

    #[test]
    fn without_other_parts_the_draws_are_those_of_the_replay_alone() {
        let mut memory = memory(0.5, 0.5);
        (0..40u8).for_each(|i| memory.own.push(&step(i.into(), false)));
        let (mut here, mut there) = (Streams::new(3).replay, Streams::new(3).replay);
        let drawn: Vec<usize> = memory.draw(64, &mut here).iter().map(|(_, slot)| *slot).collect();
        let alone: Vec<usize> = (0..64).map(|_| memory.own.draw(&mut there)).collect();
        assert_eq!(drawn, alone);
        assert_eq!(here, there);
    }

    #[test]
    fn danger_is_the_end_of_the_last_episode_and_of_no_other() {
        let mut memory = memory(0.0, 0.1);
        let kept = |memory: &Memory| -> Vec<f32> {
            memory.danger.replay.transitions().map(|t| t.reward).collect()
        };
        for (number, end) in [(1.0, false), (2.0, true), (3.0, false), (4.0, true)] {
            memory.own.push(&step(number, end));
        }
        memory.remember_danger();
        assert_eq!(kept(&memory), [3.0, 4.0]);
        for number in 5..10u8 {
            memory.own.push(&step(number.into(), number == 9));
        }
        memory.remember_danger();
        assert_eq!(kept(&memory), [3.0, 4.0, 7.0, 8.0, 9.0]);
        // A return from before the first violation does not run into the second.
        let r = memory.danger.replay.n_step(0, 5, 1.0);
        assert_eq!((r.reward, r.discount), (7.0, 0.0));
    }

    #[test]
    fn danger_without_a_share_takes_no_memory() {
        let mut memory = memory(0.5, 0.0);
        memory.own.push(&step(1.0, true));
        memory.remember_danger();
        assert_eq!(memory.danger.replay.len(), 0);
    }
}
