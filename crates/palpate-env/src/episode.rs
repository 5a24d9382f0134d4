//! The running account of one episode.

use palpate_safety::{Counts, Measurement, Tally};
use palpate_spatial::{Pose, Vector6};

use crate::EpisodeStart;

/// How an episode ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Outcome {
    /// The tool reached the goal.
    Success,
    /// The contact force exceeded its limit.
    Collision,
    /// The step limit.
    TimeLimit,
    /// The robot or its simulation broke down.
    Fault,
}

/// One finished episode.
#[derive(Clone, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct Summary {
    /// Episode number, from 0.
    pub episode: u64,
    /// How it ended.
    pub outcome: Outcome,
    /// Sum of rewards.
    pub total_reward: f64,
    /// Actions taken.
    pub steps: u32,
    /// Time from the first action to the end, s.
    pub seconds: f64,
    /// Largest norm of the unfiltered contact force, N.
    pub peak_force: f64,
    /// Mean norm of the unfiltered contact force, N.
    pub mean_force: f64,
    /// Distance of the tool from the true goal at the end, m.
    pub final_distance: f64,
    /// Refused commands and force stops, in control ticks.
    pub tally: Tally,
    /// Everything but plain passes by cause, in control ticks.
    #[serde(default)]
    pub verdicts: Counts,
}

/// The episode under way.
#[derive(Clone, Debug)]
pub(crate) struct Episode {
    pub(crate) number: u64,
    pub(crate) start: EpisodeStart,
    /// x_c: the last accepted tool pose.
    pub(crate) reference: Pose,
    /// x_max of the reward.
    pub(crate) error_scale: Vector6,
    pub(crate) measurement: Measurement,
    pub(crate) tally_before: Tally,
    verdicts_before: Counts,
    pub(crate) steps: u32,
    pub(crate) total_reward: f64,
    pub(crate) over: bool,
    ticks: u64,
    peak_force: f64,
    force_sum: f64,
}

impl Episode {
    pub(crate) fn new(
        number: u64,
        start: EpisodeStart,
        reference: Pose,
        error_scale: Vector6,
        measurement: &Measurement,
        tally_before: Tally,
        verdicts_before: Counts,
    ) -> Self {
        Self {
            number,
            start,
            reference,
            error_scale,
            measurement: *measurement,
            tally_before,
            verdicts_before,
            steps: 0,
            total_reward: 0.0,
            over: false,
            ticks: 0,
            peak_force: 0.0,
            force_sum: 0.0,
        }
    }

    /// Takes in a sample from after the end: only its force counts.
    pub(crate) fn observe_peak(&mut self, measurement: &Measurement) {
        self.peak_force = self.peak_force.max(measurement.raw_wrench.force.norm());
    }

    /// Takes in the next sample.
    pub(crate) fn observe(&mut self, measurement: &Measurement) {
        let force = measurement.raw_wrench.force.norm();
        self.ticks += 1;
        self.peak_force = self.peak_force.max(force);
        self.force_sum += force;
        self.measurement = *measurement;
    }

    pub(crate) fn summary(
        &self,
        outcome: Outcome,
        tick: f64,
        final_distance: f64,
        tally: Tally,
        verdicts: Counts,
    ) -> Summary {
        Summary {
            episode: self.number,
            outcome,
            total_reward: self.total_reward,
            steps: self.steps,
            seconds: self.ticks as f64 * tick,
            peak_force: self.peak_force,
            mean_force: self.force_sum / self.ticks.max(1) as f64,
            final_distance,
            tally: tally - self.tally_before,
            verdicts: verdicts - self.verdicts_before,
        }
    }
}

/// From one pose to another, base axes: m, and rad as a rotation vector.
pub(crate) fn displacement(from: &Pose, to: &Pose) -> Vector6 {
    let linear = to.translation.vector - from.translation.vector;
    let angular = (to.rotation * from.rotation.inverse()).scaled_axis();
    Vector6::new(linear.x, linear.y, linear.z, angular.x, angular.y, angular.z)
}
