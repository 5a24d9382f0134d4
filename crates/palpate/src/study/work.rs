//! A share of a study: a process per run, a few at a time.
//!
//! Every run is a process of its own, so that one that fails takes nothing with it; it dies with this one.

use std::collections::VecDeque;
use std::fs::File;
use std::io::IsTerminal as _;
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

use anyhow::Context as _;
use palpate_runs::{Console, RunDir};

use super::folder::Folder;
use super::plan::Planned;
use super::{FAILED, REQUEUE, Share};
use crate::interrupt;

/// Between two looks at the processes.
const LOOK: Duration = Duration::from_millis(100);
/// Between two lines where nobody watches.
const PLAIN: Duration = Duration::from_secs(30);

/// What became of a share.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub(super) struct Tally {
    /// Runs that have their rows now.
    pub(super) done: usize,
    /// Runs that ended in an error.
    pub(super) failed: Vec<String>,
    /// Runs that are not finished.
    pub(super) left: usize,
}

impl Tally {
    /// For the scheduler: 0 all done, 75 come again, 1 something failed.
    pub(super) fn code(&self) -> u8 {
        match (self.failed.is_empty(), self.left) {
            (false, _) => FAILED,
            (true, 0) => 0,
            (true, _) => REQUEUE,
        }
    }
}

struct Running<'a> {
    run: &'a Planned,
    process: Child,
}

/// Does the runs with these indices, `jobs` at a time.
pub(super) fn all(folder: &Folder, indices: &[usize], share: &Share) -> anyhow::Result<Tally> {
    let (jobs, threads) = share.processes();
    let runs = || indices.iter().filter_map(|i| Some((*i, folder.plan.get(*i)?)));
    let mut waiting: VecDeque<_> = runs().filter(|(_, run)| !folder.is_done(run)).collect();
    let total: u64 = runs().map(|(_, run)| run.steps).sum();
    let mut tally = Tally { done: indices.len() - waiting.len(), ..Tally::default() };
    std::fs::create_dir_all(folder.path.join("runs")).context("cannot make the folder of runs")?;
    let mut view = View::new(folder, total, runs().map(|(_, run)| run));
    let mut running: Vec<Running<'_>> = Vec::new();
    let mut told = false;
    loop {
        let stop = interrupt::requested();
        while running.len() < jobs && !stop {
            let Some((index, run)) = waiting.pop_front() else { break };
            if RunDir::is_written(&folder.dir(run)) {
                view.console.note(&format!("{}: another process is at it", run.id));
                tally.left += 1;
                continue;
            }
            running.push(Running { run, process: begin(folder, run, index, threads)? });
        }
        if stop && !told {
            told = true;
            for job in &running {
                end(&job.process);
            }
        }
        let mut still = Vec::new();
        for mut job in running {
            match job.process.try_wait()?.map(|status| status.code()) {
                None => still.push(job),
                Some(Some(0)) => {
                    tally.done += 1;
                    view.console.note(&format!("done: {}", job.run.id));
                }
                Some(Some(code)) if code == i32::from(REQUEUE) => tally.left += 1,
                Some(_) => {
                    view.console.note(&format!(
                        "failed: {}: {}",
                        job.run.id,
                        words(folder, job.run)
                    ));
                    tally.failed.push(job.run.id.clone());
                }
            }
        }
        running = still;
        let over = running.is_empty() && (stop || waiting.is_empty());
        view.show(tally.done, indices.len(), &running, over);
        if over {
            break;
        }
        std::thread::sleep(LOOK);
    }
    tally.left += waiting.len();
    view.console.finish();
    Ok(tally)
}

/// Starts the process of a run.
fn begin(folder: &Folder, run: &Planned, index: usize, threads: usize) -> anyhow::Result<Child> {
    let log = folder.log(run);
    let log = File::options()
        .create(true)
        .append(true)
        .open(&log)
        .with_context(|| format!("cannot write {}", log.display()))?;
    let program = std::env::current_exe().context("cannot find this program")?;
    let mut command = Command::new(program);
    command
        .args(["study", "run", "--worker", "--index", &index.to_string()])
        .args(["--threads", &threads.to_string()])
        .arg(&folder.path)
        .stdin(Stdio::null())
        .stdout(log.try_clone()?)
        .stderr(log);
    // Ctrl-C reaches this process, which passes it on once.
    #[cfg(unix)]
    std::os::unix::process::CommandExt::process_group(&mut command, 0);
    command.spawn().with_context(|| format!("cannot start {}", run.id))
}

/// Asks a process to write a checkpoint and end.
fn end(process: &Child) {
    #[cfg(unix)]
    if let Some(id) = i32::try_from(process.id()).ok().and_then(rustix::process::Pid::from_raw) {
        // It may have ended by itself.
        let _ = rustix::process::kill_process(id, rustix::process::Signal::TERM);
    }
    #[cfg(not(unix))]
    let _ = process;
}

/// Makes this process end as if asked to when the one that started it is gone.
pub(super) fn end_with_parent() {
    #[cfg(target_os = "linux")]
    {
        use rustix::process::{Signal, set_parent_process_death_signal};
        let _ = set_parent_process_death_signal(Some(Signal::TERM));
    }
}

/// The last thing a run said, and where the rest is.
fn words(folder: &Folder, run: &Planned) -> String {
    let log = folder.log(run);
    let text = std::fs::read_to_string(&log).unwrap_or_default();
    let last = text.lines().rev().find(|line| line.starts_with("error")).or(text.lines().last());
    format!("{} ({})", last.unwrap_or("it said nothing"), log.display())
}

/// Steps that are taken of these runs.
fn taken(folder: &Folder, runs: &[&Planned]) -> u64 {
    let of = |run: &&Planned| {
        if folder.is_done(run) { run.steps } else { folder.steps(run).min(run.steps) }
    };
    runs.iter().map(of).sum()
}

/// The study in one line.
struct View<'a> {
    folder: &'a Folder,
    console: Console,
    runs: Vec<&'a Planned>,
    shown: Option<Instant>,
    pause: Duration,
}

impl<'a> View<'a> {
    fn new(folder: &'a Folder, total: u64, runs: impl Iterator<Item = &'a Planned>) -> Self {
        let runs: Vec<_> = runs.collect();
        let live = std::io::stdout().is_terminal();
        let (shown, pause) = (None, if live { Duration::from_secs(1) } else { PLAIN });
        let console = Console::new(total, taken(folder, &runs));
        Self { folder, console, runs, shown, pause }
    }

    fn show(&mut self, done: usize, of: usize, running: &[Running<'_>], surely: bool) {
        if !surely && self.shown.is_some_and(|shown| shown.elapsed() < self.pause) {
            return;
        }
        self.shown = Some(Instant::now());
        let one = |job: &Running<'_>| {
            let part = self.folder.steps(job.run) as f64 / job.run.steps.max(1) as f64;
            format!("{} {:.0} %", job.run.id, 100.0 * part.min(1.0))
        };
        let mut words = vec![format!(" {done} of {of} runs done")];
        words.extend(running.iter().map(one));
        let steps = taken(self.folder, &self.runs);
        self.console.update(steps, &words.join("; "));
    }
}
