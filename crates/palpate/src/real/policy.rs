//! `run-policy`: a trained policy on an arm, without the trainer.

use std::io::Write as _;
use std::path::PathBuf;
use std::sync::mpsc::RecvTimeoutError;
use std::time::Duration;

use anyhow::{Context as _, bail};
use palpate_env::Summary;
use palpate_runs::CheckpointStore;
use palpate_sac::Policy;

use super::exchange::Exchange;
use super::thread::{Control, News, Order};
use super::{Address, connect, ended, permitted};
use crate::baselines::Actor;
use crate::record::{OnArm, Recorder};
use crate::stack::{Purpose, sim_env};
use crate::{Config, evaluate, interrupt};

/// Which policy, where and how often.
#[derive(Clone, Debug)]
pub struct PolicyRun {
    /// Run directory.
    pub run: PathBuf,
    /// `last`, `best` or a checkpoint's name.
    pub checkpoint: String,
    /// The controller.
    pub address: Address,
    /// Episodes.
    pub episodes: u64,
    /// Seed of the episodes' starts.
    pub seed: u64,
    /// Changes to the run's configuration.
    pub set: Vec<String>,
    /// Look, and move nothing.
    pub dry_run: bool,
    /// A TOML file whose keys override the run's.
    pub file: Option<PathBuf>,
    /// Do not ask.
    pub yes: bool,
    /// Folder for recordings of the episodes.
    pub record: Option<PathBuf>,
    /// JSON instead of a table.
    pub json: bool,
}

/// Runs it. What was measured is printed even if the arm stops in between.
pub fn run_policy(what: &PolicyRun) -> anyhow::Result<()> {
    let mut set = what.set.clone();
    set.push(format!("run.seed={}", what.seed));
    let config = Config::of_run_for(&what.run, &what.address.arm(), what.file.as_deref(), &set)?;
    let path = CheckpointStore::open(&what.run)?.find(&what.checkpoint)?.with_context(|| {
        format!("{} holds no checkpoint {}", what.run.display(), what.checkpoint)
    })?;
    let policy = Policy::load(&path)
        .with_context(|| format!("cannot load the policy in {}", path.display()))?;
    evaluate::check_shape(&policy, &sim_env(&config, what.seed, Purpose::Train)?)?;
    if !permitted(&config, what.yes, what.dry_run)? {
        return Ok(());
    }
    let arm = connect(&config, Actor::learned(policy, None), Exchange::default())?;
    palpate_ur::background(&arm.realtime);
    if let Some(folder) = &what.record {
        let recorder = Recorder::new(&config, folder)?;
        arm.control.orders.send(Order::Record(Box::new(OnArm::all(recorder, "arm"))))?;
    }
    let mut summaries = Vec::new();
    let mut result = Ok(());
    for episode in 0..what.episodes {
        arm.control.orders.send(Order::Episode(episode))?;
        match outcome(&arm.control) {
            Ok(Some(summary)) => {
                show(&summary)?;
                summaries.push(summary);
            }
            Ok(None) => break,
            Err(e) => {
                result = Err(e);
                break;
            }
        }
    }
    let link = arm.release();
    let row = evaluate::Row::new("learned", &summaries);
    let mut out = std::io::stdout().lock();
    if what.json {
        let report = serde_json::json!({ "policy": row, "link": link });
        writeln!(out, "{}", serde_json::to_string_pretty(&report)?)?;
    } else {
        writeln!(out, "{}", evaluate::table(&[row]).trim_end())?;
    }
    result
}

/// How the episode under way ends; `None` after an interrupt.
fn outcome(control: &Control) -> anyhow::Result<Option<Summary>> {
    loop {
        match control.news.recv_timeout(Duration::from_millis(50)) {
            Ok(News::Step(x)) => {
                let summary = x.summary.clone();
                control.give_back(x);
                if summary.is_some() {
                    return Ok(summary);
                }
            }
            Ok(News::Fault(_)) | Err(RecvTimeoutError::Timeout) if interrupt::requested() => {
                return Ok(None);
            }
            Ok(News::Fault(fault)) => return Err(ended(&fault)),
            Ok(News::Ready | News::Measured(_)) | Err(RecvTimeoutError::Timeout) => {}
            Err(RecvTimeoutError::Disconnected) => bail!("the control thread has ended"),
        }
    }
}

fn show(s: &Summary) -> std::io::Result<()> {
    writeln!(
        std::io::stderr(),
        "episode {}: {:?} after {:.2} s, peak {:.1} N, {:.1} mm from the goal",
        s.episode,
        s.outcome,
        s.seconds,
        s.peak_force,
        s.final_distance * 1e3
    )
}
