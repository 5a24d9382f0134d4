//! The commands that look at this computer, at the software and after run directories.

use std::path::PathBuf;

use clap::{Args, Subcommand};
use palpate::config::Choice;
use palpate::demonstrate;
use palpate::real::{Probe, probe, soak};
use palpate::runs;

use super::training::Settings;

/// `rt-probe`.
#[derive(Debug, Args)]
pub(crate) struct RtProbe {
    /// How long to measure, half of it beside a learner on every processor. Minutes say more than seconds.
    #[arg(long, default_value_t = 20.0)]
    seconds: f64,
}

impl RtProbe {
    pub(crate) fn run(&self) -> anyhow::Result<()> {
        probe(&Probe { seconds: self.seconds })
    }
}

/// `soak`.
#[derive(Debug, Subcommand)]
pub(crate) enum Soak {
    /// The 500 Hz loop against a virtual controller, beside a learner that never rests.
    ///
    /// Prints what a tick costs, what the control thread took from the heap, and for every cycle of the controller
    /// that the loop did not see where it went. Fails beyond 60 µs (median) or 500 µs (99.99 %) per tick, on any
    /// allocation, or if a cycle is left over. The limits of the link are wide here (200 ms), because the virtual
    /// controller shares this computer; --set ur.stale_ticks=5 gives an arm's.
    Link {
        /// For how long; 60 is an hour.
        #[arg(long, default_value_t = 10.0)]
        minutes: f64,
        /// Override one key. May be repeated.
        #[arg(long, value_name = "KEY=VALUE")]
        set: Vec<String>,
    },
    /// Damaged packets at full speed through the protocol cores of the client and of the virtual controller.
    ///
    /// Each packet gives an event, a wait or a typed error; a panic, a queue that grows or a packet that takes long
    /// ends the soak.
    Packets {
        /// To each side.
        #[arg(long, default_value_t = 10_000_000)]
        count: u64,
        /// Of the damage.
        #[arg(long, default_value_t = 1)]
        seed: u64,
    },
    /// Protective stops of an arm on the move: none may be unlocked but by a person, and nothing may move before.
    Stops {
        /// How many.
        #[arg(long, default_value_t = 10_000)]
        count: u64,
    },
}

impl Soak {
    pub(crate) fn run(self) -> anyhow::Result<()> {
        match self {
            Self::Link { minutes, set } => {
                let mut wide =
                    ["ur.stale_ticks=100", "ur.stall_ticks=100"].map(String::from).to_vec();
                wide.extend(set);
                let (preset, task, model) =
                    ("palpate".into(), "peg-insertion".into(), "P-14".into());
                let choice = Choice { preset, task, model, file: None, set: wide };
                soak::link(&soak::Link { minutes, choice }, allocations)
            }
            Self::Packets { count, seed } => soak::packets(&soak::Packets { count, seed }),
            Self::Stops { count } => soak::stops(count),
        }
    }
}

/// Counts what a closure takes from the heap on this thread.
fn allocations(job: &mut dyn FnMut()) -> u64 {
    allocation_counter::measure(job).count_total
}

/// `demonstrate`.
#[derive(Debug, Args)]
pub(crate) struct Demonstrate {
    #[command(flatten)]
    settings: Settings,
    /// Who shows it: `scripted` (align, descend, spiral on contact), or a run, whose kept policy acts in the run's own
    /// task and settings.
    #[arg(long, default_value = "scripted", value_name = "scripted|RUN")]
    by: String,
    /// Episodes to keep; ten times as many are tried.
    #[arg(long, default_value_t = 10)]
    episodes: u64,
    /// Keep those that reach the goal and no others.
    #[arg(long, default_value_t = true, action = clap::ArgAction::Set, value_name = "true|false")]
    only_successes: bool,
    /// Seed of the episodes' starts; none of them is one of a training's.
    #[arg(long)]
    seed: Option<u64>,
    /// File to create.
    #[arg(long, value_name = "FILE")]
    out: PathBuf,
    /// Write what the demonstrations suggest as a file for --config: force limits, workspace, gains, goal.
    #[arg(long, value_name = "FILE")]
    propose: Option<PathBuf>,
}

impl Demonstrate {
    pub(crate) fn run(self) -> anyhow::Result<()> {
        let mut choice = self.settings.choice();
        if self.by != "scripted" {
            self.settings.only_a_run()?;
        }
        choice.set.extend(self.seed.map(|seed| format!("run.seed={seed}")));
        let (episodes, only_successes) = (self.episodes, self.only_successes);
        let options = demonstrate::Options { episodes, only_successes };
        let (by, out, propose) = (self.by, self.out, self.propose);
        let session = demonstrate::Session { choice, by, options, out, propose };
        demonstrate::command(&session, &mut std::io::stdout())
    }
}

/// `runs`.
#[derive(Debug, Subcommand)]
pub(crate) enum Runs {
    /// List the runs of a folder: task, model, seed, steps, success of the latest evaluation, state.
    List {
        /// Folder that holds runs.
        #[arg(default_value = "runs")]
        folder: PathBuf,
    },
    /// Read every byte of a run and say of each part whether it is whole. Changes nothing.
    Verify {
        /// Run directory.
        run: PathBuf,
    },
    /// Save what can be saved: damaged checkpoints go to damaged/, half rows and records are cut, config.toml
    /// comes back from a checkpoint.
    Repair {
        /// Run directory; nobody may be writing it.
        run: PathBuf,
    },
    /// Copy a run, also while it is being trained: only whole checkpoints. The copy can be continued by itself.
    Copy {
        /// Run directory.
        run: PathBuf,
        /// Folder to create.
        to: PathBuf,
    },
    /// Write every transition as CSV: step, flags, reward, observation, action, next observation.
    ///
    /// Of a run on an arm all that its journal holds; of a simulated run the replay of its last checkpoint.
    Export {
        /// Run directory.
        run: PathBuf,
        /// CSV file to create.
        to: PathBuf,
    },
}

impl Runs {
    pub(crate) fn run(self) -> anyhow::Result<()> {
        let out = &mut std::io::stdout();
        match self {
            Self::List { folder } => runs::show(&folder, out),
            Self::Verify { run } => runs::verify(&run, out),
            Self::Repair { run } => runs::mend(&run, out),
            Self::Copy { run, to } => runs::duplicate(&run, &to, out),
            Self::Export { run, to } => runs::export(&run, &to, out),
        }
    }
}
