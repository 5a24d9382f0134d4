//! A study is the same rows however it is shared out, killed and taken up again.
#![cfg(unix)]
#![expect(clippy::unwrap_used, reason = "helpers of tests")]

use std::path::{Path, PathBuf};
use std::process::{Child, Command, Output, Stdio};
use std::time::{Duration, Instant};

/// Five short runs, one of them shown how, and two baselines.
const STUDY: &str = r#"
name = "small"
evaluation = { episodes = 2 }
[set]
sac.hidden = [32, 32]
sac.updates_per_step = 1
run.evaluate_every = 100
run.evaluate_episodes = 2
run.checkpoint_every = 50
run.log_every = 50
[[runs]]
name = "peg"
task = "peg-insertion"
model = ["P-14", "A-13pd"]
penalty = [true, false]
steps = 400
[[runs]]
name = "shown"
task = "peg-insertion"
model = "P-14"
steps = 100
demonstrations = 1
[[runs]]
name = "baseline"
task = "peg-insertion"
model = "P-14"
policy = ["zero", "scripted"]
[[conditions]]
name = "held"
set = { env.max_steps = 3 }
"#;

/// The tables that must not depend on how the runs were done; times.csv may.
const ROWS: [&str; 4] = ["runs.csv", "episodes.csv", "evaluation.csv", "curves.csv"];

struct Place {
    _dir: tempfile::TempDir,
    file: PathBuf,
    folder: PathBuf,
}

impl Place {
    fn new() -> Self {
        let dir = tempfile::tempdir().unwrap();
        let (file, folder) = (dir.path().join("small.toml"), dir.path().join("out"));
        std::fs::write(&file, STUDY).unwrap();
        Self { _dir: dir, file, folder }
    }

    fn command(&self, what: &str, more: &[&str]) -> Command {
        let mut command = Command::new(env!("CARGO_BIN_EXE_palpate"));
        command.args(["study", what]).arg(&self.file).arg("--out").arg(&self.folder).args(more);
        command.stdin(Stdio::null()).stdout(Stdio::piped()).stderr(Stdio::piped());
        command
    }

    fn run(&self, more: &[&str]) -> Output {
        self.command("run", more).output().unwrap()
    }

    fn rows(&self) -> Vec<String> {
        let report = self.command("report", &[]).output().unwrap();
        assert!(report.status.success(), "{}", String::from_utf8_lossy(&report.stderr));
        ROWS.map(|name| std::fs::read_to_string(self.folder.join(name)).unwrap()).into()
    }

    fn results(&self) -> usize {
        let runs = std::fs::read_dir(self.folder.join("runs")).into_iter().flatten().flatten();
        runs.filter(|run| run.path().join("result.json").is_file()).count()
    }
}

fn wait_until(what: &str, mut is: impl FnMut() -> bool) {
    let start = Instant::now();
    while !is() {
        assert!(start.elapsed() < Duration::from_mins(2), "waited for {what}");
        std::thread::sleep(Duration::from_millis(5));
    }
}

fn ended(mut child: Child) -> Option<i32> {
    child.wait().unwrap().code()
}

fn signal(child: &Child, name: &str) {
    let id = child.id().to_string();
    assert!(Command::new("kill").args([name, &id]).status().unwrap().success());
}

fn has_checkpoint(run: &Path) -> bool {
    let names = std::fs::read_dir(run.join("checkpoints")).into_iter().flatten().flatten();
    names.into_iter().any(|name| name.file_name().to_string_lossy().starts_with("step_"))
}

#[test]
fn shards_kills_and_signals_change_no_row() {
    let whole = Place::new();
    let out = whole.run(&["--jobs", "2"]);
    let said = String::from_utf8_lossy(&out.stdout).into_owned();
    assert_eq!(out.status.code(), Some(0), "{said}");
    assert!(said.contains("7 runs done, 0 left, 0 failed"), "{said}");
    let rows = whole.rows();
    assert_eq!(rows[0].lines().count(), 1 + 7);
    assert!(rows[1].lines().count() > 1 + 4 && rows[3].lines().count() > 1 + 4);
    // Five trained runs, mean and sampled actions of the last and of the kept policy, and two baselines; under the
    // condition the last policy's mean action and the baselines.
    assert_eq!(rows[2].lines().count(), 1 + 5 * 4 * 2 + 2 * 2 + 5 * 2 + 2 * 2);
    let held: Vec<&str> = rows[2].lines().filter(|row| row.contains(",held,")).collect();
    assert!(held.iter().all(|row| row.contains(",last,mean,") != row.contains("baseline_")));
    assert!(held.len() == 14 && held.iter().all(|row| row.contains(",0,0,")), "3 steps: {held:?}");
    let shown = rows[0].lines().find(|row| row.starts_with("shown_")).unwrap();
    assert!(shown.contains(",learned,true,1,1,"), "one demonstration: {shown}");
    let runs: Vec<String> = std::fs::read_dir(whole.folder.join("runs"))
        .unwrap()
        .map(|entry| entry.unwrap().file_name().into_string().unwrap())
        .collect();
    assert!(runs.iter().all(|name| !name.contains(".demo")), "{runs:?}");
    assert!(whole.folder.join("runs/shown_P-14_s1").join(palpate_runs::DEMONSTRATIONS).is_file());

    // Again is nothing to do, in no time.
    let written = |place: &Place| {
        let result = place.folder.join("runs/peg_P-14_penalty_s1/result.json");
        std::fs::metadata(result).unwrap().modified().unwrap()
    };
    let before = written(&whole);
    let again = whole.run(&[]);
    assert_eq!(again.status.code(), Some(0));
    assert_eq!((written(&whole), whole.rows()), (before, rows.clone()));

    let parts = Place::new();
    // A run by its number, killed in the middle; then told to end by a signal; then gone on with.
    let first = parts.folder.join("runs/peg_P-14_penalty_s1");
    let killed = parts.command("run", &["--index", "0"]).spawn().unwrap();
    wait_until("a checkpoint", || has_checkpoint(&first));
    signal(&killed, "-KILL");
    assert_eq!(ended(killed), None);
    assert_eq!(parts.results(), 0);
    let told = parts.command("run", &["--index", "0", "--threads", "2"]).spawn().unwrap();
    std::thread::sleep(Duration::from_millis(300));
    signal(&told, "-USR1");
    let code = ended(told);
    assert!(code == Some(75) || code == Some(0), "{code:?}");
    // Two shards, the first one's processes killed with it and begun anew.
    let shard = parts.command("run", &["--shard", "1/2", "--jobs", "2"]).spawn().unwrap();
    std::thread::sleep(Duration::from_millis(300));
    signal(&shard, "-KILL");
    ended(shard);
    for shard in ["2/2", "1/2"] {
        wait_until("orphans to end", || {
            let out = parts.run(&["--shard", shard]);
            assert_ne!(out.status.code(), Some(1), "{}", String::from_utf8_lossy(&out.stdout));
            out.status.code() == Some(0)
        });
    }
    assert_eq!(parts.results(), 7);
    assert_eq!(parts.rows(), rows);

    // The collected rows are enough: nothing is done again, and the report is the same.
    let report = std::fs::read_to_string(parts.folder.join("report.md")).unwrap();
    for chapter in [
        "- 7 of 7 runs are in it",
        "![peg, peg-insertion: parallel, with penalty](success-",
        "| peg | peg-insertion | A-13pd, no penalty | 1 |",
        "## The finished policies",
        "## The paper's orderings",
        "## In a changed world",
        "- held: `env.max_steps=3`",
        "sac.hidden=[32, 32], sac.updates_per_step=1",
        "`cargo xtask study run study.toml`",
        "| held | shown | peg-insertion | P-14, 1 demonstration | learned | 0.0 %",
        "| held | baseline | peg-insertion | P-14 | scripted | 0.0 %",
        "| peg-insertion | P-14 | align, descend, spiral search with force control |",
        "![A-13pd, last policy: k_d](evolution-",
    ] {
        assert!(report.contains(chapter), "{chapter} in {report}");
    }
    std::fs::remove_dir_all(parts.folder.join("runs")).unwrap();
    assert_eq!(parts.run(&[]).status.code(), Some(0));
    assert_eq!(parts.results(), 0);
    assert_eq!(parts.rows(), rows);
    assert_eq!(std::fs::read_to_string(parts.folder.join("report.md")).unwrap(), report);
    for name in ["report.html", "plan.csv"] {
        let plan = parts.command("plan", &[]).output().unwrap();
        assert!(plan.status.success());
        assert!(parts.folder.join(name).is_file(), "{name}");
    }
}

#[test]
fn a_run_that_fails_is_named_and_stops_no_other() {
    let place = Place::new();
    // A robot that is not there: known only when the world is built.
    let text = STUDY.replace(
        "[[runs]]\nname = \"baseline\"",
        "[[runs]]\nname = \"broken\"\ntask = \"peg-insertion\"\nmodel = \"P-14\"\npolicy = \"zero\"\nset = { robot.urdf = \"no-such.urdf\" }\n[[runs]]\nname = \"baseline\"",
    );
    let text = text.replace("steps = 400", "steps = 150");
    std::fs::write(&place.file, text).unwrap();
    let out = place.run(&[]);
    let said = String::from_utf8_lossy(&out.stdout).into_owned();
    assert_eq!(out.status.code(), Some(1), "{said}");
    assert!(
        said.contains("failed: broken_P-14_Zero_s1") && said.contains("no-such.urdf"),
        "{said}"
    );
    assert!(said.contains("7 runs done, 0 left, 1 failed"), "{said}");
    assert_eq!(place.results(), 7);
}

#[test]
fn what_makes_no_sense_is_refused_in_words() {
    let place = Place::new();
    let said = |out: Output| {
        assert!(!out.status.success());
        String::from_utf8_lossy(&out.stderr).into_owned()
    };
    assert!(said(place.run(&["--index", "7"])).contains("there is no run 7: the study has 7"));
    assert!(said(place.run(&["--shard", "3/2"])).contains("write I/N"));
    let other = STUDY.replace("400", "500");
    std::fs::write(&place.file, other).unwrap();
    let text = said(place.run(&[]));
    assert!(text.contains("was begun with another study file"), "{text}");
    std::fs::write(&place.file, "name = 3").unwrap();
    assert!(said(place.run(&[])).contains("not a study as docs/how-to/studies.md describes it"));
    let missing = place.folder.join("missing.toml");
    let mut command = Command::new(env!("CARGO_BIN_EXE_palpate"));
    let text = said(command.args(["study", "plan"]).arg(missing).output().unwrap());
    assert!(text.contains("built in: paper"), "{text}");
    let mut command = Command::new(env!("CARGO_BIN_EXE_palpate"));
    let text = said(command.args(["study", "report", "learnr"]).output().unwrap());
    assert!(text.contains("did you mean learner?"), "{text}");
}
