//! Replay: a ring of transitions, and multi-step returns read from it.

use rand::Rng;
use rand_chacha::ChaCha8Rng;

/// One step of experience.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Transition<'a> {
    /// What the agent saw.
    pub observation: &'a [f32],
    /// What it chose, each in [−1, 1].
    pub action: &'a [f32],
    /// What was done of it: the same, or what a safety layer made of it.
    pub executed: &'a [f32],
    /// What it got, before [`reward_scale`](crate::SacConfig::reward_scale).
    pub reward: f32,
    /// What it saw then.
    pub next_observation: &'a [f32],
    /// Whether the task ended there: no value follows.
    pub terminal: bool,
    /// Whether the episode ended there, by the task or by a time limit. Implied by `terminal`.
    pub episode_end: bool,
}

/// A ring of transitions, oldest overwritten first.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Replay {
    pub(crate) capacity: usize,
    pub(crate) observation_dim: usize,
    pub(crate) action_dim: usize,
    /// Slot of the next transition.
    pub(crate) next: usize,
    pub(crate) observations: Vec<f32>,
    pub(crate) actions: Vec<f32>,
    pub(crate) executed: Vec<f32>,
    pub(crate) rewards: Vec<f32>,
    pub(crate) next_observations: Vec<f32>,
    pub(crate) terminals: Vec<u8>,
    pub(crate) episode_ends: Vec<u8>,
}

/// What the critic at one stored step learns from.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Return {
    /// Σ γᵏ r over the steps taken.
    pub(crate) reward: f64,
    /// γ^steps, or 0 after a terminal step: factor of the value at the bootstrap state.
    pub(crate) discount: f64,
    /// Slot whose next observation is the bootstrap state.
    pub(crate) slot: usize,
}

impl Replay {
    pub(crate) fn new(capacity: usize, observation_dim: usize, action_dim: usize) -> Self {
        Self {
            capacity,
            observation_dim,
            action_dim,
            next: 0,
            observations: Vec::new(),
            actions: Vec::new(),
            executed: Vec::new(),
            rewards: Vec::new(),
            next_observations: Vec::new(),
            terminals: Vec::new(),
            episode_ends: Vec::new(),
        }
    }

    pub(crate) fn len(&self) -> usize {
        self.rewards.len()
    }

    pub(crate) fn push(&mut self, t: &Transition<'_>) {
        let slot = self.next;
        put(&mut self.observations, slot, t.observation);
        put(&mut self.actions, slot, t.action);
        put(&mut self.executed, slot, t.executed);
        put(&mut self.rewards, slot, &[t.reward]);
        put(&mut self.next_observations, slot, t.next_observation);
        put(&mut self.terminals, slot, &[u8::from(t.terminal)]);
        put(&mut self.episode_ends, slot, &[u8::from(t.episode_end || t.terminal)]);
        self.next = (slot + 1) % self.capacity;
    }

    /// Ends the episode at the newest transition, if there is one.
    pub(crate) fn end_episode(&mut self) {
        if let Some(newest) = self.newest() {
            self.episode_ends[newest] = 1;
        }
    }

    fn newest(&self) -> Option<usize> {
        (self.len() > 0).then(|| (self.next + self.capacity - 1) % self.capacity)
    }

    /// A stored slot, each as likely.
    pub(crate) fn draw(&self, rng: &mut ChaCha8Rng) -> usize {
        rng.random_range(0..self.len() as u64) as usize
    }

    /// The return of up to `n` steps from `slot` on.
    ///
    /// It stops after n steps, at the end of the episode, or at the newest transition, past which
    /// the ring holds the oldest.
    pub(crate) fn n_step(&self, slot: usize, n: usize, gamma: f64) -> Return {
        let newest = self.newest();
        let mut r = Return { reward: 0.0, discount: 1.0, slot };
        for _ in 0..n {
            r.reward += r.discount * f64::from(self.rewards[r.slot]);
            r.discount *= gamma;
            if self.terminals[r.slot] == 1 {
                r.discount = 0.0;
            }
            if self.episode_ends[r.slot] == 1 || Some(r.slot) == newest {
                return r;
            }
            r.slot = (r.slot + 1) % self.capacity;
        }
        // The loop stepped past the last reward it took.
        r.slot = (r.slot + self.capacity - 1) % self.capacity;
        r
    }

    /// All that is stored, oldest first.
    pub(crate) fn transitions(&self) -> impl Iterator<Item = Transition<'_>> {
        let oldest = if self.len() < self.capacity { 0 } else { self.next };
        (0..self.len()).map(move |i| self.transition((oldest + i) % self.capacity))
    }

    /// The newest steps, at most `n` and of one episode, oldest first.
    pub(crate) fn tail(&self, n: usize) -> impl Iterator<Item = Transition<'_>> {
        let back = |i: usize| (self.next + 2 * self.capacity - 1 - i) % self.capacity;
        let most = n.min(self.len());
        let mut count = most.min(1);
        while count < most && self.episode_ends[back(count)] == 0 {
            count += 1;
        }
        (0..count).rev().map(move |i| self.transition(back(i)))
    }

    fn transition(&self, slot: usize) -> Transition<'_> {
        Transition {
            observation: self.observation(slot),
            action: self.action(slot),
            executed: self.executed(slot),
            reward: self.rewards[slot],
            next_observation: self.next_observation(slot),
            terminal: self.terminals[slot] == 1,
            episode_end: self.episode_ends[slot] == 1,
        }
    }

    pub(crate) fn observation(&self, slot: usize) -> &[f32] {
        row(&self.observations, slot, self.observation_dim)
    }

    pub(crate) fn action(&self, slot: usize) -> &[f32] {
        row(&self.actions, slot, self.action_dim)
    }

    pub(crate) fn executed(&self, slot: usize) -> &[f32] {
        row(&self.executed, slot, self.action_dim)
    }

    pub(crate) fn next_observation(&self, slot: usize) -> &[f32] {
        row(&self.next_observations, slot, self.observation_dim)
    }
}

fn row(values: &[f32], slot: usize, width: usize) -> &[f32] {
    &values[slot * width..][..width]
}

/// Writes a row, growing the column while the ring fills for the first time.
fn put<T: Copy>(column: &mut Vec<T>, slot: usize, row: &[T]) {
    let at = slot * row.len();
    if at == column.len() {
        column.extend_from_slice(row);
    } else {
        column[at..at + row.len()].copy_from_slice(row);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::rng::Streams;

    const GAMMA: f64 = 0.5;

    #[derive(Clone, Copy, PartialEq)]
    enum End {
        No,
        Terminal,
        Truncated,
    }

    /// Steps with reward 1, 2, 4, …: every sum says which steps are in it. Next observation is −i.
    fn replay(capacity: usize, ends: &[End]) -> Replay {
        let mut replay = Replay::new(capacity, 1, 1);
        for (i, end) in (0..).zip(ends) {
            let number = i as f32;
            replay.push(&Transition {
                observation: &[number],
                action: &[0.0],
                executed: &[0.0],
                reward: 2f32.powi(i),
                next_observation: &[-number],
                terminal: *end == End::Terminal,
                episode_end: *end == End::Truncated,
            });
        }
        replay
    }

    fn of(replay: &Replay, slot: usize, n: usize) -> (f64, f64, f32) {
        let r = replay.n_step(slot, n, GAMMA);
        (r.reward, r.discount, replay.next_observation(r.slot)[0])
    }

    #[test]
    fn takes_n_rewards_inside_an_episode() {
        let replay = replay(10, &[End::No; 6]);
        // 1 + ½·2 + ¼·4, then γ³ times the value after step 2.
        assert_eq!(of(&replay, 0, 3), (3.0, 0.125, -2.0));
        assert_eq!(of(&replay, 2, 1), (4.0, 0.5, -2.0));
    }

    #[test]
    fn a_terminal_step_ends_it_without_a_value() {
        let replay = replay(10, &[End::No, End::Terminal, End::No, End::No]);
        assert_eq!(of(&replay, 0, 3).0, 2.0);
        assert_eq!(of(&replay, 0, 3).1, 0.0);
        assert_eq!(of(&replay, 1, 1).1, 0.0);
    }

    #[test]
    fn a_time_limit_ends_it_with_the_value_there() {
        let replay = replay(10, &[End::No, End::Truncated, End::No, End::No]);
        assert_eq!(of(&replay, 0, 3), (2.0, 0.25, -1.0));
        assert_eq!(of(&replay, 1, 3), (2.0, 0.5, -1.0));
        assert_eq!(of(&replay, 2, 2), (8.0, 0.25, -3.0));
    }

    #[test]
    fn the_newest_transition_ends_it_with_the_value_there() {
        let replay = replay(10, &[End::No; 4]);
        assert_eq!(of(&replay, 2, 5), (4.0 + 4.0, 0.25, -3.0));
        assert_eq!(of(&replay, 3, 5), (8.0, 0.5, -3.0));
    }

    #[test]
    fn a_wrapped_ring_goes_on_over_its_seam_and_never_into_the_oldest() {
        // Capacity 4, six pushes: slots hold steps 4, 5, 2, 3; the newest is slot 1.
        let replay = replay(4, &[End::No; 6]);
        assert_eq!(replay.len(), 4);
        assert_eq!(of(&replay, 3, 2), (8.0 + 8.0, 0.25, -4.0));
        assert_eq!(of(&replay, 3, 9), (8.0 + 8.0 + 8.0, 0.125, -5.0));
        assert_eq!(of(&replay, 1, 9), (32.0, 0.5, -5.0));
        assert_eq!(of(&replay, 2, 3), (4.0 + 4.0 + 4.0, 0.125, -4.0));
    }

    #[test]
    fn what_is_stored_comes_out_oldest_first() {
        let numbers = |pushed: usize| -> Vec<f32> {
            replay(4, &vec![End::No; pushed]).transitions().map(|t| t.observation[0]).collect()
        };
        assert_eq!(numbers(3), [0.0, 1.0, 2.0]);
        assert_eq!(numbers(4), [0.0, 1.0, 2.0, 3.0]);
        assert_eq!(numbers(6), [2.0, 3.0, 4.0, 5.0]);
    }

    #[test]
    fn a_tail_stops_at_the_episode_before_and_goes_back_over_the_seam() {
        let numbers = |replay: &Replay, n: usize| -> Vec<f32> {
            replay.tail(n).map(|t| t.observation[0]).collect()
        };
        let mut ends = [End::No; 6];
        ends[2] = End::Truncated;
        assert_eq!(numbers(&replay(10, &ends), 9), [3.0, 4.0, 5.0]);
        assert_eq!(numbers(&replay(10, &ends), 2), [4.0, 5.0]);
        assert_eq!(numbers(&replay(4, &[End::No; 6]), 9), [2.0, 3.0, 4.0, 5.0]);
        assert_eq!(numbers(&replay(4, &[]), 9), [0.0; 0]);
    }

    #[test]
    fn an_overwritten_end_is_forgotten() {
        let mut ends = [End::No; 6];
        ends[1] = End::Terminal;
        let replay = replay(4, &ends);
        // Step 1 is overwritten by step 5, the newest, which ends nothing.
        assert_eq!(of(&replay, 0, 9), (16.0 + 16.0, 0.25, -5.0));
    }

    #[test]
    fn an_episode_cut_from_outside_does_not_run_into_the_next() {
        let mut replay = replay(10, &[End::No; 2]);
        replay.end_episode();
        replay.push(&Transition {
            observation: &[9.0],
            action: &[0.0],
            executed: &[0.0],
            reward: 100.0,
            next_observation: &[-9.0],
            terminal: false,
            episode_end: false,
        });
        assert_eq!(of(&replay, 0, 5), (2.0, 0.25, -1.0));
    }

    #[test]
    fn draws_every_slot_alike() {
        let replay = replay(5, &[End::No; 7]);
        let (mut counts, mut rng) = ([0u32; 5], Streams::new(2).replay);
        for _ in 0..50_000 {
            counts[replay.draw(&mut rng)] += 1;
        }
        assert!(counts.iter().all(|c| (9_500..10_500).contains(c)), "{counts:?}");
    }
}
