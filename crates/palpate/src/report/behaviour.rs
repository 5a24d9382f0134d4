//! What a policy does on a few frozen starts.

use anyhow::Context as _;
use palpate_control::Gains;
use palpate_env::{Env, Outcome, Summary, Tape};
use palpate_sac::Policy;
use palpate_safety::Guarded;

use crate::Config;
use crate::baselines::Actor;

/// Episodes that are looked at.
pub(super) const EPISODES: u64 = 5;
/// A contact force counts as contact from here, N.
const CONTACT: f64 = 1.0;
/// The tip counts as inserted this far below the mouth, m.
const INSIDE: f64 = 0.002;

/// What the tool is about.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Phase {
    /// In free air.
    Free,
    /// In contact, not in the hole yet.
    Contact,
    /// Below the mouth.
    Inside,
}

impl Phase {
    pub(super) const ALL: [Self; 3] = [Self::Free, Self::Contact, Self::Inside];

    pub(super) fn name(self) -> &'static str {
        match self {
            Self::Free => "free air",
            Self::Contact => "in contact, outside",
            Self::Inside => "in the hole",
        }
    }

    /// By height above the mouth (m) and contact force (N).
    pub(crate) fn of(height: f64, force: f64) -> Self {
        if height < -INSIDE {
            Self::Inside
        } else if force > CONTACT {
            Self::Contact
        } else {
            Self::Free
        }
    }
}

/// One episode as curves over time, s.
#[derive(Clone, Debug, Default)]
pub(super) struct Trace {
    /// Norm of the filtered contact force, N.
    pub(super) force: Vec<(f64, f64)>,
    /// Height of the tip above the hole's mouth, mm.
    pub(super) height: Vec<(f64, f64)>,
    /// Distance of the tip from the hole's axis, mm.
    pub(super) offset: Vec<(f64, f64)>,
}

/// What a policy does.
#[derive(Debug)]
pub(super) struct Behaviour {
    pub(super) traces: Vec<Trace>,
    pub(super) summaries: Vec<Summary>,
    /// Gains along the hole's axis and across it by phase: name, then their means; none where a phase was never
    /// entered.
    pub(super) gains: Vec<(String, [Option<f64>; 3])>,
}

impl Behaviour {
    pub(super) fn of<R: Guarded>(
        env: &mut Env<R>,
        config: &Config,
        policy: Policy,
    ) -> anyhow::Result<Self> {
        let mut actor = Actor::learned(policy, None);
        let (mut traces, mut summaries) = (Vec::new(), Vec::new());
        let mut sums = Sums::default();
        let mut tape = env.new_tape();
        for episode in 0..EPISODES {
            env.swap_tape(Some(tape));
            env.set_next_episode(episode);
            env.reset()?;
            actor.reset(episode);
            let summary = loop {
                let action = actor.act(env).to_vec();
                if let Some(summary) = env.step(&action)?.summary {
                    break summary;
                }
            };
            tape = env.swap_tape(None).context("the tape is gone")?;
            traces.push(trace(config, &tape));
            sums.take(config, &tape);
            summaries.push(summary);
        }
        Ok(Self { traces, summaries, gains: sums.means() })
    }

    pub(super) fn successes(&self) -> usize {
        self.summaries.iter().filter(|s| s.outcome == Outcome::Success).count()
    }
}

/// Every 10 ms is enough to see.
const STRIDE: usize = 5;

fn trace(config: &Config, tape: &Tape) -> Trace {
    let hole_T_base = config.task.base_T_hole().inverse();
    let mut trace = Trace::default();
    for tick in tape.ticks().iter().step_by(STRIDE) {
        let m = &tick.measurement;
        let t = m.state.time - tape.began();
        let p = hole_T_base * nalgebra::Point3::from(m.base_T_tool.translation.vector);
        trace.force.push((t, m.wrench.force.norm()));
        trace.height.push((t, 1e3 * p.z));
        trace.offset.push((t, 1e3 * p.x.hypot(p.y)));
    }
    trace
}

/// Sums of gains by phase.
#[derive(Debug, Default)]
struct Sums {
    names: Vec<String>,
    totals: [Vec<f64>; 3],
    counts: [f64; 3],
}

impl Sums {
    fn take(&mut self, config: &Config, tape: &Tape) {
        let hole_T_base = config.task.base_T_hole().inverse();
        for beat in tape.beats() {
            let Some(tick) =
                tape.ticks().iter().find(|tick| tick.measurement.state.time >= beat.time)
            else {
                continue;
            };
            let m = &tick.measurement;
            let p = hole_T_base * nalgebra::Point3::from(m.base_T_tool.translation.vector);
            let phase = Phase::of(p.z, m.wrench.force.norm()) as usize;
            let named = gains(&beat.decoded.gains);
            self.names = named.iter().map(|(name, _)| name.clone()).collect();
            self.totals[phase].resize(named.len(), 0.0);
            for (sum, (_, value)) in self.totals[phase].iter_mut().zip(&named) {
                *sum += value;
            }
            self.counts[phase] += 1.0;
        }
    }

    fn means(self) -> Vec<(String, [Option<f64>; 3])> {
        let mean = |i: usize, phase: usize| {
            (self.counts[phase] > 0.0).then(|| self.totals[phase][i] / self.counts[phase])
        };
        let row = |(i, name): (usize, &String)| {
            (name.clone(), std::array::from_fn(|phase| mean(i, phase)))
        };
        self.names.iter().enumerate().map(row).collect()
    }
}

/// Each gain along base z, which is the hole's axis in the tasks here, and the mean of those across it.
fn gains(gains: &Gains) -> Vec<(String, f64)> {
    let sets = match gains {
        Gains::Parallel(g) => {
            vec![("Kₚˣ, 1/s", g.kp_x), ("Kₚᶠ, (m/s)/N", g.kp_f), ("S", g.selection)]
        }
        Gains::Admittance(g) => vec![("Kₚˣ, 1/s", g.kp_x), ("k_d, N·s/m", g.stiffness)],
    };
    sets.into_iter()
        .flat_map(|(name, v)| {
            let across = f64::midpoint(v[0], v[1]);
            let turn = (v[3] + v[4] + v[5]) / 3.0;
            [
                (format!("{name}, along z"), v[2]),
                (format!("{name}, along x and y"), across),
                (format!("{name}, rotations"), turn),
            ]
        })
        .collect()
}
