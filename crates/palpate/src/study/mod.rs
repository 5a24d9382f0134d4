//! `study`: many runs from one file, on one machine or shared out by the scheduler a lab already has.
//!
//! A run of a study is a function of the study file and its index alone; what is done is not done again, and what was
//! interrupted goes on. So Slurm arrays, Kubernetes indexed jobs, GNU parallel and make drive it unchanged.

mod block;
mod folder;
mod one;
mod plan;
mod report;
mod rows;
mod submit;
mod work;

use std::fmt::Write as _;
use std::io::Write as _;
use std::path::PathBuf;
use std::process::ExitCode;
use std::time::Duration;

use anyhow::Context as _;
use clap::{Args, Subcommand};

use crate::interrupt;
use crate::parallel::cores;
use folder::Folder;
use one::End;
use plan::Planned;

/// Exit code: interrupted, come again to go on (`EX_TEMPFAIL` of sysexits.h).
const REQUEUE: u8 = 75;
/// Exit code: a run failed.
const FAILED: u8 = 1;

/// `study`.
#[derive(Debug, Subcommand)]
pub enum Study {
    /// Write the table of a study's runs, and say what it will take.
    Plan(Which),
    /// Do a study, a share of it, or one run. What is done is not done again; what was interrupted goes on.
    ///
    /// Exit code 0: all done. 75: interrupted or out of time, start it again to go on. 1: a run failed; the others are
    /// done all the same. Ctrl-C, SIGTERM and SIGUSR1 end every run with a checkpoint.
    Run(Share),
    /// How far a study is, run by run.
    Status(Which),
    /// Collect the rows of all finished runs and write report.md, report.html and the figures.
    Report(Which),
    /// Hand a study to a scheduler: one array job, a task per run that is not done.
    Submit(submit::Submit),
}

/// Which study.
#[derive(Clone, Debug, Args)]
pub struct Which {
    /// A study file (TOML), the name of a built-in one (`paper`, `learner`, `tight`, `conditions`), or the folder of a study that was begun.
    study: PathBuf,
    /// Folder of the study. Default: studies/NAME.
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
}

impl Which {
    fn open(&self) -> anyhow::Result<Folder> {
        Folder::open(&self.study, self.out.as_deref())
    }
}

/// Which runs, and with what.
#[derive(Debug, Args)]
pub struct Share {
    #[command(flatten)]
    which: Which,
    /// This run alone, in this process; runs are counted from 0, as plan.csv does.
    #[arg(long, conflicts_with = "shard")]
    index: Option<usize>,
    /// The I-th of N equal shares, I from 1.
    #[arg(long, value_name = "I/N", value_parser = shard)]
    shard: Option<(usize, usize)>,
    /// Runs at a time. Default: one per core.
    #[arg(long, conflicts_with = "index", value_parser = clap::value_parser!(u16).range(1..))]
    jobs: Option<u16>,
    /// Threads of an update, 1 or 2. Default: the cores that each run has. Changes no result.
    #[arg(long, value_parser = clap::value_parser!(u8).range(1..=2))]
    threads: Option<u8>,
    /// Stop with checkpoints after this many seconds, before a scheduler does it without.
    #[arg(long, value_name = "SECONDS")]
    time_budget: Option<u64>,
    /// Ends with the process that started it.
    #[arg(long, hide = true)]
    worker: bool,
}

fn shard(text: &str) -> Result<(usize, usize), String> {
    let parts = text.split_once('/').and_then(|(i, n)| Some((i.parse().ok()?, n.parse().ok()?)));
    match parts {
        Some((i, n)) if (1..=n).contains(&i) => Ok((i, n)),
        _ => Err("write I/N with I from 1 to N, as in 2/8".into()),
    }
}

impl Share {
    /// Runs at a time, and threads of each.
    fn processes(&self) -> (usize, usize) {
        let cores = cores();
        let jobs = self.jobs.map_or(cores, usize::from);
        (jobs, self.threads.map_or_else(|| (cores / jobs).clamp(1, 2), usize::from))
    }

    /// Indices of the runs.
    fn indices(&self, of: usize) -> Vec<usize> {
        let (i, n) = self.shard.unwrap_or((1, 1));
        (0..of).filter(|index| index % n == i - 1).collect()
    }

    fn run(&self) -> anyhow::Result<ExitCode> {
        if self.worker {
            work::end_with_parent();
        }
        if let Some(seconds) = self.time_budget {
            std::thread::spawn(move || {
                std::thread::sleep(Duration::from_secs(seconds));
                interrupt::flag().store(true, std::sync::atomic::Ordering::SeqCst);
            });
        }
        let folder = self.which.open()?;
        if let Some(index) = self.index {
            let run = folder.plan.get(index).with_context(|| {
                format!("there is no run {index}: the study has {}, from 0", folder.plan.len())
            })?;
            let threads = self.threads.map_or_else(|| cores().min(2), usize::from);
            return Ok(match one::run(&folder, run, threads)? {
                End::Done => ExitCode::SUCCESS,
                End::Interrupted => ExitCode::from(REQUEUE),
            });
        }
        let tally = work::all(&folder, &self.indices(folder.plan.len()), self)?;
        let path = folder.path.display();
        let next = match tally.code() {
            0 => format!("next: cargo xtask study report {path}"),
            REQUEUE => format!("go on with: cargo xtask study run {path}"),
            _ => format!(
                "look at the logs of {}; then go on with: cargo xtask study run {path}",
                tally.failed.join(", ")
            ),
        };
        let (done, left, failed) = (tally.done, tally.left, tally.failed.len());
        writeln!(std::io::stdout(), "{done} runs done, {left} left, {failed} failed\n{next}")?;
        Ok(ExitCode::from(tally.code()))
    }
}

impl Study {
    /// Runs the command.
    pub fn run(&self) -> anyhow::Result<ExitCode> {
        let mut out = std::io::stdout().lock();
        match self {
            Self::Run(share) => {
                drop(out);
                return share.run();
            }
            Self::Plan(which) => write!(out, "{}", planned(&which.open()?)?)?,
            Self::Status(which) => write!(out, "{}", status(&which.open()?))?,
            Self::Report(which) => {
                for path in report::write(&which.open()?)? {
                    writeln!(out, "{}", path.display())?;
                }
            }
            Self::Submit(submit) => {
                drop(out);
                submit.run()?;
            }
        }
        Ok(ExitCode::SUCCESS)
    }
}

/// A row of plan.csv.
#[derive(serde::Serialize)]
struct PlanRow<'a> {
    index: usize,
    run: &'a str,
    block: &'a str,
    task: &'a str,
    model: &'a str,
    policy: plan::Kind,
    penalty: bool,
    seed: u64,
    steps: u64,
    demonstrations: u64,
    varied: String,
}

impl<'a> PlanRow<'a> {
    fn of(index: usize, run: &'a Planned) -> Self {
        Self {
            index,
            run: &run.id,
            block: &run.block,
            task: &run.task,
            model: &run.model,
            policy: run.kind,
            penalty: run.penalty,
            seed: run.seed,
            steps: run.steps,
            demonstrations: run.demonstrations,
            varied: run.variation(),
        }
    }
}

/// Writes plan.csv and says what it holds.
fn planned(folder: &Folder) -> anyhow::Result<String> {
    let row = |(index, run)| PlanRow::of(index, run);
    let rows: Vec<PlanRow<'_>> = folder.plan.iter().enumerate().map(row).collect();
    let path = folder.path.join("plan.csv");
    rows::write(&path, &rows)?;
    let mut text = format!("{}: {}\n", folder.study.name, folder.study.about);
    let mut blocks: Vec<&str> = folder.plan.iter().map(|run| run.block.as_str()).collect();
    blocks.dedup();
    blocks.sort_unstable();
    blocks.dedup();
    let mut line = |name: &str, of: &dyn Fn(&Planned) -> bool| {
        let runs: Vec<u64> =
            folder.plan.iter().filter(|run| of(run)).map(|run| run.steps).collect();
        let steps: u64 = runs.iter().sum();
        _ = writeln!(text, "  {name}: {} runs, {steps} steps", runs.len());
    };
    for block in &blocks {
        line(block, &|run| run.block == *block);
    }
    if blocks.len() > 1 {
        line("all", &|_| true);
    }
    let path = path.display();
    let dir = folder.path.display();
    _ = writeln!(
        text,
        "{path}\nnext: cargo xtask study run {dir}    (--shard I/N for a part, --index I for one)"
    );
    Ok(text)
}

/// A line per run, and one for all.
fn status(folder: &Folder) -> String {
    let (mut text, mut done, mut taken, mut all) = (String::new(), 0, 0, 0);
    for run in &folder.plan {
        let finished = folder.is_done(run);
        let steps = if finished { run.steps } else { folder.steps(run).min(run.steps) };
        let state = match (finished, palpate_runs::RunDir::is_written(&folder.dir(run))) {
            (true, _) => "done",
            (false, true) => "running",
            (false, false) if steps > 0 => "stopped",
            (false, false) => "waiting",
        };
        _ = writeln!(text, "{state:<8} {steps:>7}/{:<7} {}", run.steps, run.id);
        done += usize::from(finished);
        taken += steps;
        all += run.steps;
    }
    let part = 100.0 * taken as f64 / f64::max(1.0, all as f64);
    let count = folder.plan.len();
    let name = &folder.study.name;
    _ = writeln!(text, "{name}: {done} of {count} runs done, {taken} of {all} steps ({part:.1} %)");
    text
}

#[cfg(test)]
mod tests;
