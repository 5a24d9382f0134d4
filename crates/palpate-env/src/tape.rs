//! What happened in an episode, control period by control period.
//!
//! A tape takes its memory once and is written on the control thread; whoever keeps it, encodes it or draws it does
//! so elsewhere. See [`Env::swap_tape`](crate::Env::swap_tape).

use palpate_control::Decoded;
use palpate_robot_io::RobotState;
use palpate_safety::{Cause, Measurement};
use palpate_spatial::Pose;

use crate::{EpisodeStart, RewardTerms, Summary};

/// Control periods that coming to rest may take beyond the episode.
const REST: u32 = 1500;

/// One control period.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Tick {
    /// What was sensed.
    pub measurement: Measurement,
    /// x_c: the tool pose that was asked for then.
    pub base_T_command: Pose,
    /// What the fail-safe layer said to it; nothing where it let it pass.
    pub cause: Option<Cause>,
}

impl Tick {
    /// A period in which nothing was asked for.
    pub(crate) fn at_rest(measurement: &Measurement, cause: Option<Cause>) -> Self {
        Self { base_T_command: measurement.base_T_tool, measurement: *measurement, cause }
    }
}

/// One action of the policy.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Beat {
    /// The robot's clock when it was taken, s.
    pub time: f64,
    /// What it means: motion and gains.
    pub decoded: Decoded,
    /// What it was paid.
    pub reward: RewardTerms,
}

/// One episode.
#[derive(Clone, Debug)]
pub struct Tape {
    episode: u64,
    start: Option<EpisodeStart>,
    /// The robot's clock at the beginning, s.
    began: f64,
    ticks: Vec<Tick>,
    beats: Vec<Beat>,
    /// Actions as the policy gave them, one after the other.
    actions: Vec<f64>,
    action_dim: usize,
    summary: Option<Summary>,
    missed: u64,
}

impl Tape {
    pub(crate) fn new(steps: u32, ticks_per_step: u32, action_dim: usize) -> Self {
        Self {
            episode: 0,
            start: None,
            began: 0.0,
            ticks: Vec::with_capacity((steps * ticks_per_step + REST) as usize),
            beats: Vec::with_capacity(steps as usize),
            actions: Vec::with_capacity(steps as usize * action_dim),
            action_dim,
            summary: None,
            missed: 0,
        }
    }

    pub(crate) fn begin(&mut self, episode: u64, start: &EpisodeStart, state: &RobotState) {
        (self.episode, self.start, self.began) = (episode, Some(*start), state.time);
        self.ticks.clear();
        self.beats.clear();
        self.actions.clear();
        (self.summary, self.missed) = (None, 0);
    }

    pub(crate) fn act(&mut self, action: &[f64], beat: Beat) {
        if self.beats.len() < self.beats.capacity() && action.len() == self.action_dim {
            self.beats.push(beat);
            self.actions.extend_from_slice(action);
        }
    }

    pub(crate) fn tick(&mut self, tick: &Tick) {
        // Never grows: memory is not asked for on the control thread.
        if self.ticks.len() < self.ticks.capacity() {
            self.ticks.push(*tick);
        } else {
            self.missed += 1;
        }
    }

    pub(crate) fn reward(&mut self, reward: RewardTerms) {
        if let Some(beat) = self.beats.last_mut() {
            beat.reward = reward;
        }
    }

    pub(crate) fn end(&mut self, summary: &Summary, last: &Measurement) {
        // The shield's rest comes after the last sample of the episode.
        if self.ticks.last().is_none_or(|tick| tick.measurement.state.time < last.state.time) {
            self.tick(&Tick::at_rest(last, None));
        }
        self.summary = Some(summary.clone());
    }

    /// The episode's number.
    pub fn episode(&self) -> u64 {
        self.episode
    }

    /// Where it began and what the robot believed; none on a fresh tape.
    pub fn start(&self) -> Option<&EpisodeStart> {
        self.start.as_ref()
    }

    /// The robot's clock at its beginning, s.
    pub fn began(&self) -> f64 {
        self.began
    }

    /// The control periods.
    pub fn ticks(&self) -> &[Tick] {
        &self.ticks
    }

    /// The actions, decoded, and what they were paid.
    pub fn beats(&self) -> &[Beat] {
        &self.beats
    }

    /// The actions as the policy gave them, in [−1, 1].
    pub fn actions(&self) -> impl Iterator<Item = &[f64]> {
        self.actions.chunks_exact(self.action_dim.max(1))
    }

    /// How it ended, if it has.
    pub fn summary(&self) -> Option<&Summary> {
        self.summary.as_ref()
    }

    /// Control periods that found no room.
    pub fn missed(&self) -> u64 {
        self.missed
    }
}
