//! The release binary from end to end: train, lose power, resume, interrupt, resume, evaluate, plot.
//!
//! The oracle is a second run that nothing happens to, on two threads instead of one: both must write the same
//! metrics, byte for byte.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

use anyhow::{Context as _, bail, ensure};

use crate::palpate;

const SHORT: &str = "600";
const LONG: &str = "900";

/// A run of this length learns, evaluates and writes several checkpoints. The multiples coincide on purpose:
/// an evaluation just before a checkpoint must survive it.
const RHYTHM: &[&str] = &[
    "sac.warmup_steps=100",
    "run.log_every=50",
    "run.checkpoint_every=150",
    "run.evaluate_every=300",
    "run.evaluate_episodes=2",
];

/// The runs' metrics, from the run directory.
const CURVES: &[&str] = &["metrics.csv", "episodes.csv"];

const EVALUATED: u64 = 5;

/// Time a run gets to write its next checkpoint.
const PATIENCE: Duration = Duration::from_mins(3);

/// Runs it all and says in a line what was seen.
pub(crate) fn run() -> anyhow::Result<String> {
    let binary = palpate::binary()?;
    let dir = std::env::temp_dir().join(format!("palpate-smoke-{}", std::process::id()));
    fs::create_dir_all(&dir).with_context(|| format!("cannot create {}", dir.display()))?;
    let seen = Smoke { binary, dir: dir.clone() }
        .story()
        .with_context(|| format!("the smoke test's runs are kept in {}", dir.display()))?;
    fs::remove_dir_all(&dir).with_context(|| format!("cannot remove {}", dir.display()))?;
    Ok(seen)
}

struct Smoke {
    binary: PathBuf,
    dir: PathBuf,
}

impl Smoke {
    fn story(&self) -> anyhow::Result<String> {
        let (straight, cut) = (self.dir.join("straight"), self.dir.join("cut"));
        self.finish(&mut self.train(&straight, LONG, "sac.threads=2"))?;

        println!("a run that is killed …");
        let mut child = self.start(&mut self.train(&cut, SHORT, "sac.threads=1"))?;
        await_checkpoint(&mut child, &cut, &[])?;
        child.kill().context("cannot kill the run")?;
        child.wait()?;

        println!("… is resumed, and interrupted by Ctrl-C …");
        let before = checkpoints(&cut);
        let mut child = self.start(&mut self.resume(&cut))?;
        await_checkpoint(&mut child, &cut, &before)?;
        interrupt(&mut child)?;
        ensure!(
            !fs::read_to_string(cut.join("summary.json"))?.contains("\"complete\": true"),
            "the interrupted run calls itself complete"
        );

        println!("… and resumed to its end");
        self.finish(&mut self.resume(&cut))?;
        let mut list = self.palpate(&["runs", "list"]);
        let said = String::from_utf8(list.arg(&self.dir).output()?.stdout)?;
        let line = said.lines().find(|line| line.ends_with("cut")).unwrap_or_default();
        ensure!(
            line.contains(&format!("/{LONG} ")) && line.contains("complete"),
            "a run that was extended to {LONG} steps is listed as `{line}`"
        );
        for name in CURVES {
            same_text(&straight.join(name), &cut.join(name))?;
        }
        let updates = last_value(&fs::read_to_string(cut.join(CURVES[0]))?, "train/n_updates")?;
        ensure!(updates > 0.0, "{LONG} steps without one update of the learner");

        println!("… and gone on from, on a harder task");
        self.inherit(&cut, updates)?;
        let policies = self.evaluate(&cut)?;
        self.interrupt_evaluation(&cut)?;
        self.interrupt_demonstration()?;
        let figures = self.plot(&cut)?;
        Ok(format!(
            "killed and interrupted run equals the straight one; {policies} policies evaluated; {figures} figures"
        ))
    }

    /// A new run begins with the learner of another, which had done so many updates.
    fn inherit(&self, run: &Path, before: f64) -> anyhow::Result<()> {
        let heir = self.dir.join("heir");
        let mut command = self.palpate(&["train-sim", "--steps", "150", "--seed", "8", "--set"]);
        command.arg("sim.hole.chamfer=0").arg("--from").arg(run).arg("--out").arg(&heir);
        self.finish(&mut command)?;
        let metrics = fs::read_to_string(heir.join(CURVES[0]))?;
        let after = last_value(&metrics, "train/n_updates")?;
        let steps = last_value(&metrics, "time/total_timesteps")?;
        ensure!(
            after > before && steps < 600.0,
            "{steps} steps of an heir: {after} updates after {before}"
        );
        let first = checkpoints(&heir).pop().context("an heir without a checkpoint")?;
        let state = fs::read_to_string(heir.join("checkpoints").join(first).join("state.json"))?;
        ensure!(state.contains("\"seed\": 8,"), "an heir draws by its parent's seed");
        let refused = command.args(["--set", "sac.n_step=1"]).output()?;
        let said = String::from_utf8_lossy(&refused.stderr).into_owned();
        ensure!(said.contains("sac.n_step was 5 and is 1"), "another learner is inherited: {said}");
        // Without its first checkpoint it would begin from nothing.
        fs::remove_dir_all(heir.join("checkpoints"))?;
        let refused = self.resume(&heir).output()?;
        let said = String::from_utf8_lossy(&refused.stderr).into_owned();
        ensure!(
            !refused.status.success() && said.contains("begin it again, with --from"),
            "an heir without a checkpoint is resumed: {said}"
        );
        Ok(())
    }

    /// Ctrl-C: figures of what was finished, and an error that says so.
    fn interrupt_evaluation(&self, run: &Path) -> anyhow::Result<()> {
        let mut command = self.palpate(&["evaluate", "--json", "--episodes", "1000000"]);
        command.arg(run).stdout(Stdio::piped()).stderr(Stdio::piped());
        let child = self.start(&mut command)?;
        std::thread::sleep(Duration::from_secs(3));
        kill_softly(&child)?;
        let output = child.wait_with_output()?;
        let said = String::from_utf8_lossy(&output.stderr).into_owned();
        let rows: Vec<serde_json::Value> = serde_json::from_slice(&output.stdout)
            .with_context(|| format!("an interrupted evaluation printed no JSON: {said}"))?;
        ensure!(
            !output.status.success()
                && said.contains("interrupted")
                && rows.len() == 1
                && rows[0]["episodes"].as_u64() > Some(0),
            "an interrupted evaluation: {rows:?} {said}"
        );
        Ok(())
    }

    /// Ctrl-C: what was shown by then can be learned from.
    fn interrupt_demonstration(&self) -> anyhow::Result<()> {
        let file = self.dir.join("shown.demo");
        let mut command = self.palpate(&["demonstrate", "--episodes", "1000000", "--out"]);
        let mut child = self.start(command.arg(&file))?;
        std::thread::sleep(Duration::from_secs(3));
        interrupt(&mut child)?;
        let mut pupil = self.palpate(&["train-sim", "--steps", "150", "--demonstrations"]);
        self.finish(pupil.arg(&file).arg("--out").arg(self.dir.join("pupil")))
    }

    /// On all cores; and, as recordings are made, on one: the same figures.
    fn evaluate(&self, run: &Path) -> anyhow::Result<usize> {
        let quick = self.judged(run, &[])?;
        let recorded = self.judged(run, &["--record", "recorded"])?;
        ensure!(quick == recorded, "on all cores evaluate says\n{quick}\nand on one\n{recorded}");
        evaluated(&quick)
    }

    fn judged(&self, run: &Path, more: &[&str]) -> anyhow::Result<String> {
        let mut command = self.palpate(&["evaluate"]);
        command.arg(run).args(["--episodes", &EVALUATED.to_string(), "--json"]).args(more);
        let said = command.output().context("cannot run palpate evaluate")?;
        ensure!(
            said.status.success(),
            "palpate evaluate: {}: {}",
            said.status,
            String::from_utf8_lossy(&said.stderr)
        );
        Ok(String::from_utf8_lossy(&said.stdout).into_owned())
    }

    fn plot(&self, run: &Path) -> anyhow::Result<usize> {
        self.finish(self.palpate(&["plot"]).arg(run))?;
        let mut figures = 0;
        for entry in
            fs::read_dir(run.join("plots")).context("palpate plot made no folder plots/")?
        {
            let path = entry?.path();
            let text = fs::read_to_string(&path)?;
            ensure!(
                text.contains("<svg") && text.trim_end().ends_with("</svg>"),
                "{} is no whole SVG",
                path.display()
            );
            figures += 1;
        }
        ensure!(figures > 0, "palpate plot drew nothing");
        Ok(figures)
    }

    fn train(&self, out: &Path, steps: &str, threads: &str) -> Command {
        let mut command = self.palpate(&["train-sim", "--seed", "7", "--steps", steps]);
        command.args(["--set", threads]);
        command.args(RHYTHM.iter().flat_map(|key| ["--set", key])).arg("--out").arg(out);
        command
    }

    fn resume(&self, run: &Path) -> Command {
        let mut command = self.palpate(&["train-sim", "--steps", LONG, "--resume"]);
        command.arg(run);
        command
    }

    fn palpate(&self, args: &[&str]) -> Command {
        let mut command = Command::new(&self.binary);
        command.args(args).current_dir(&self.dir).stdin(Stdio::null());
        command
    }

    fn start(&self, command: &mut Command) -> anyhow::Result<Child> {
        command.spawn().with_context(|| format!("cannot run {}", self.binary.display()))
    }

    fn finish(&self, command: &mut Command) -> anyhow::Result<()> {
        let status = self.start(command)?.wait()?;
        ensure!(status.success(), "{command:?}: {status}");
        Ok(())
    }
}

/// Names of a run's numbered checkpoints. One that is still being written has another name.
fn checkpoints(run: &Path) -> Vec<String> {
    let entries = fs::read_dir(run.join("checkpoints")).into_iter().flatten().flatten();
    let names = entries.filter_map(|entry| entry.file_name().into_string().ok());
    names
        .filter(|name| name.strip_prefix("step_").is_some_and(|n| n.parse::<u64>().is_ok()))
        .collect()
}

/// Waits for a checkpoint that is not in `old`. The child must still be running then.
fn await_checkpoint(child: &mut Child, run: &Path, old: &[String]) -> anyhow::Result<()> {
    let started = Instant::now();
    loop {
        if let Some(status) = child.try_wait()? {
            bail!("the run ended ({status}) before its next checkpoint was seen");
        }
        if checkpoints(run).iter().any(|name| !old.contains(name)) {
            return Ok(());
        }
        if started.elapsed() > PATIENCE {
            child.kill()?;
            bail!("no checkpoint within {} s", PATIENCE.as_secs());
        }
        std::thread::sleep(Duration::from_millis(20));
    }
}

/// Ctrl-C. Without `unsafe`, the signal has to come from a program.
fn kill_softly(child: &Child) -> anyhow::Result<()> {
    let sent = Command::new("kill")
        .args(["-INT", &child.id().to_string()])
        .status()
        .context("cannot run kill")?;
    ensure!(sent.success(), "kill -INT: {sent}");
    Ok(())
}

/// Ctrl-C once: the run must end well.
fn interrupt(child: &mut Child) -> anyhow::Result<()> {
    kill_softly(child)?;
    let status = child.wait()?;
    ensure!(status.success(), "an interrupted run must end with exit code 0, this one: {status}");
    Ok(())
}

/// Names the first line that differs.
fn same_text(expected: &Path, found: &Path) -> anyhow::Result<()> {
    let read = |path: &Path| {
        fs::read_to_string(path).with_context(|| format!("cannot read {}", path.display()))
    };
    let (a, b) = (read(expected)?, read(found)?);
    if a == b {
        return Ok(());
    }
    let line = a
        .lines()
        .zip(b.lines())
        .position(|(a, b)| a != b)
        .unwrap_or(a.lines().count().min(b.lines().count()));
    let at = |text: &str| text.lines().nth(line).unwrap_or("(no such line)").to_owned();
    bail!(
        "resuming changed {}: line {} is\n  {}\nwhere the uninterrupted run has\n  {}",
        found.display(),
        line + 1,
        at(&b),
        at(&a)
    )
}

/// The last value of a CSV column.
fn last_value(csv: &str, column: &str) -> anyhow::Result<f64> {
    let mut lines = csv.lines();
    let header = lines.next().context("an empty table")?;
    let at = header
        .split(',')
        .position(|name| name == column)
        .with_context(|| format!("no column {column} in {header}"))?;
    let cell = lines
        .last()
        .and_then(|row| row.split(',').nth(at))
        .with_context(|| format!("no row with {column}"))?;
    cell.parse().with_context(|| format!("{column} is `{cell}`"))
}

/// Checks what `evaluate --json` printed: a learned policy and the three baselines, all on all episodes.
fn evaluated(json: &str) -> anyhow::Result<usize> {
    let value: serde_json::Value = serde_json::from_str(json)
        .with_context(|| format!("evaluate --json printed no JSON: {json}"))?;
    let rows = value
        .as_array()
        .or_else(|| value["policies"].as_array())
        .context("evaluate --json holds no rows")?;
    for policy in ["learned", "a = 0", "uniform random", "scripted"] {
        let named = |row: &&serde_json::Value| {
            row["policy"].as_str().is_some_and(|name| name.starts_with(policy))
        };
        let row = rows
            .iter()
            .find(named)
            .with_context(|| format!("evaluate shows no policy called {policy}"))?;
        ensure!(
            row["episodes"] == EVALUATED,
            "{policy} ran {} episodes, not {EVALUATED}",
            row["episodes"]
        );
    }
    Ok(rows.len())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn row(policy: &str, episodes: u64) -> String {
        format!(r#"{{"policy": "{policy}", "episodes": {episodes}}}"#)
    }

    #[test]
    fn an_evaluation_without_a_baseline_or_an_episode_is_refused() {
        let all = ["learned (last)", "learned (kept)", "a = 0", "uniform random", "scripted"];
        let json = |rows: &[String]| format!("[{}]", rows.join(","));
        let rows = all.map(|policy| row(policy, EVALUATED));
        assert_eq!(evaluated(&json(&rows)).unwrap(), 5);
        assert!(evaluated(&json(&rows[..4])).unwrap_err().to_string().contains("scripted"));
        let mut short = rows;
        short[2] = row("a = 0", 4);
        assert!(evaluated(&json(&short)).unwrap_err().to_string().contains("4 episodes"));
        assert!(evaluated("a table").is_err());
    }

    #[test]
    fn the_last_row_is_read_by_column() {
        let csv = "time/total_timesteps,train/n_updates\n50,\n100,40\n";
        assert_eq!(last_value(csv, "train/n_updates").unwrap(), 40.0);
        assert!(last_value(csv, "train/loss").is_err());
        assert!(last_value("a,b\n", "a").is_err());
    }

    #[test]
    fn a_difference_is_named_by_line() {
        let dir = std::env::temp_dir().join(format!("xtask-same-text-{}", std::process::id()));
        fs::create_dir_all(&dir).unwrap();
        let (a, b) = (dir.join("a"), dir.join("b"));
        fs::write(&a, "h\n1\n2\n").unwrap();
        fs::write(&b, "h\n1\n2\n").unwrap();
        same_text(&a, &b).unwrap();
        fs::write(&b, "h\n1\n3\n").unwrap();
        assert!(same_text(&a, &b).unwrap_err().to_string().contains("line 3 is\n  3\n"));
        fs::write(&b, "h\n1\n").unwrap();
        assert!(same_text(&a, &b).unwrap_err().to_string().contains("(no such line)"));
        fs::remove_dir_all(&dir).unwrap();
    }
}
