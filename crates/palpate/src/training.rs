//! What a training is told on the command line.

use std::io::Write as _;
use std::path::PathBuf;

use clap::Args;
use palpate::config::Choice;
use palpate::train;

#[derive(Debug, Args)]
pub(crate) struct Settings {
    /// Settings to start from: `palpate` (measured to learn) or `paper` (as printed) [default: palpate].
    #[arg(long)]
    preset: Option<String>,
    /// Task: a name from assets/tasks [default: peg-insertion].
    #[arg(long)]
    task: Option<String>,
    /// Policy model: P-9, P-14, P-19, P-24 (parallel position/force), A-8, A-13, A-13pd, A-18 (admittance);
    /// P-6 moves no gain [default: P-14].
    #[arg(long)]
    model: Option<String>,
    /// TOML file whose keys override the preset's.
    #[arg(long, value_name = "FILE")]
    config: Option<PathBuf>,
    /// Override one key, e.g. --set sac.gamma=0.95 --set task.distribution=fixed. May be repeated.
    #[arg(long, value_name = "KEY=VALUE")]
    set: Vec<String>,
}

#[derive(Debug, Args)]
pub(crate) struct Training {
    #[command(flatten)]
    settings: Settings,
    /// No reward penalty for exceeding the force limit (κ = 0 instead of −10).
    #[arg(long)]
    no_penalty: bool,
    /// Seed of every random number of the run.
    #[arg(long)]
    seed: Option<u64>,
    /// Environment steps (20 per second of robot time). The run ends with the episode that reaches them.
    #[arg(long)]
    steps: Option<u64>,
    /// What computes the updates: `cuda` is the first NVIDIA GPU, and brings `sac.ops = "plain"`. On two cores the
    /// CPU is quicker for networks of this size.
    #[arg(long, default_value = "cpu", value_parser = ["cpu", "cuda"])]
    device: String,
    /// Learn from this file of `demonstrate` as well: sac.demonstration_share of every batch, half by default.
    #[arg(long, value_name = "FILE", conflicts_with_all = ["resume"])]
    pub(crate) demonstrations: Option<PathBuf>,
    /// Run directory to create. Default: runs/DATE_TIME_TASK_MODEL_sSEED.
    #[arg(long, value_name = "DIR")]
    pub(crate) out: Option<PathBuf>,
}

#[derive(Debug, Args)]
pub(crate) struct TrainSim {
    #[command(flatten)]
    training: Training,
    /// Start a new run with the learner of this one, usually taught an easier task, under its configuration with --config
    /// and --set over it. Another --seed gives other starts.
    #[arg(long, value_name = "RUN", conflicts_with_all = ["demonstrations", "device"])]
    from: Option<PathBuf>,
    /// Continue a run from its last checkpoint, exactly; --steps may extend it.
    #[arg(long, value_name = "DIR", conflicts_with_all = ["preset", "task", "model", "config", "set", "no_penalty", "device", "seed", "out", "from"])]
    resume: Option<PathBuf>,
    /// Say at the end where the time went: simulation, control, inference, update, logging.
    #[arg(long)]
    profile: bool,
}

impl TrainSim {
    pub(crate) fn run(&self) -> anyhow::Result<()> {
        let spent = if let Some(dir) = &self.resume {
            train::resume(dir, self.training.steps)?
        } else {
            let (choice, out) =
                (self.training.going_on(self.from.is_some())?, self.training.out.as_deref());
            match (&self.from, &self.training.demonstrations) {
                (Some(run), _) => train::start_from(run, &choice, out)?,
                (None, Some(shown)) => train::start_shown(&choice, shown, out)?,
                (None, None) => train::start(&choice, out)?,
            }
        };
        if self.profile {
            write!(std::io::stdout(), "{spent}")?;
        }
        Ok(())
    }
}

impl Settings {
    /// Refuses what a run brings along itself.
    pub(crate) fn only_a_run(&self) -> anyhow::Result<()> {
        let given = [("preset", &self.preset), ("task", &self.task), ("model", &self.model)];
        match given.into_iter().find(|(_, value)| value.is_some()) {
            None => Ok(()),
            Some(("task", _)) => anyhow::bail!(
                "a run brings its task along: leave --task out, and change keys with --set, or many with \
                 --config FILE, such as a file of assets/tasks"
            ),
            Some((key, _)) => anyhow::bail!(
                "a run brings its preset and its model along, and its policy knows no others: leave --{key} out, and \
                 change keys with --set"
            ),
        }
    }

    pub(crate) fn choice(&self) -> Choice {
        let or = |given: &Option<String>, default: &str| given.as_deref().unwrap_or(default).into();
        Choice {
            preset: or(&self.preset, "palpate"),
            task: or(&self.task, "peg-insertion"),
            model: or(&self.model, "P-14"),
            file: self.config.clone(),
            set: self.set.clone(),
        }
    }
}

impl Training {
    /// The choice; where it goes on `from` a run, what that brings along may not be in it.
    pub(crate) fn going_on(&self, from: bool) -> anyhow::Result<Choice> {
        if from {
            self.settings.only_a_run()?;
        }
        Ok(self.choice())
    }

    pub(crate) fn choice(&self) -> Choice {
        let mut choice = self.settings.choice();
        choice.set.extend(self.seed.map(|seed| format!("run.seed={seed}")));
        choice.set.extend(self.steps.map(|steps| format!("run.steps={steps}")));
        if self.device == "cuda" {
            choice.set.extend(["sac.device=\"cuda\"", "sac.ops=\"plain\""].map(String::from));
        }
        if self.no_penalty {
            choice.set.push("reward.violation=0.0".into());
        }
        choice
    }
}
