//! Short trainings, and what they end with.

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Output, Stdio};

use anyhow::{Context as _, bail, ensure};

/// A run that writes something all the time: episodes of 15 steps, a checkpoint after nearly every second one.
const RHYTHM: &[&str] = &[
    "env.max_steps=15",
    "sac.hidden=[16, 16]",
    "sac.batch_size=16",
    "sac.start_training=16",
    "sac.replay_capacity=400",
    "run.log_every=10",
    "run.checkpoint_every=20",
    "run.evaluate_every=100",
    "run.evaluate_episodes=1",
];

/// Files by their path below the run, with what they hold.
pub(super) type Print = BTreeMap<String, Vec<u8>>;

/// Where runs are made, and with what.
pub(super) struct Rig {
    binary: PathBuf,
    root: PathBuf,
}

impl Rig {
    pub(super) fn new(binary: PathBuf) -> anyhow::Result<Self> {
        let root = std::env::temp_dir().join(format!("palpate-torture-{}", std::process::id()));
        fs::create_dir_all(&root).with_context(|| format!("cannot create {}", root.display()))?;
        Ok(Self { binary, root })
    }

    pub(super) fn root(&self) -> &Path {
        &self.root
    }

    pub(super) fn path(&self, name: &str) -> PathBuf {
        self.root.join(name)
    }

    pub(super) fn remove(&self) -> anyhow::Result<()> {
        fs::remove_dir_all(&self.root)
            .with_context(|| format!("cannot remove {}", self.root.display()))
    }

    /// Begins or continues a run, whichever it takes, through `wrapper` if that is not empty.
    pub(super) fn go_on(&self, run: &Path, steps: u64, wrapper: &[String]) -> Command {
        let words = wrapper.iter().map(String::as_str).chain(self.binary.to_str());
        let mut words = words.map(str::to_owned);
        let mut command = Command::new(words.next().unwrap_or_default());
        command.args(words).args(["train-sim", "--steps", &steps.to_string()]);
        if run.join("config.toml").is_file() {
            command.arg("--resume").arg(run);
        } else {
            command.args(RHYTHM.iter().flat_map(|key| ["--set", key])).args(["--seed", "3"]);
            command.arg("--out").arg(run);
        }
        command.current_dir(&self.root).stdin(Stdio::null());
        command.stdout(Stdio::piped()).stderr(Stdio::piped());
        command
    }

    /// Goes on to the end, undisturbed.
    pub(super) fn finish(&self, run: &Path, steps: u64) -> anyhow::Result<Print> {
        let output = self.go_on(run, steps, &[]).output()?;
        let whole = output.status.success() || is_complete(&output);
        ensure!(whole, "{}: {}", output.status, said(&output));
        print(run)
    }

    /// A fresh copy of a run.
    pub(super) fn copy(&self, of: &Path, name: &str) -> anyhow::Result<PathBuf> {
        let to = self.path(name);
        if to.exists() {
            fs::remove_dir_all(&to)?;
        }
        for file in files(of)? {
            let target = to.join(&file);
            fs::create_dir_all(target.parent().unwrap_or(&to))?;
            fs::copy(of.join(&file), target)?;
        }
        Ok(to)
    }
}

/// Whether there was nothing left to do: the run had been stopped after its last checkpoint.
pub(super) fn is_complete(output: &Output) -> bool {
    output.status.code() == Some(1) && said(output).contains("the run is complete")
}

/// What a child wrote.
pub(super) fn said(output: &Output) -> String {
    let text = [&output.stdout[..], &output.stderr[..]].concat();
    crate::style::plain(&String::from_utf8_lossy(&text))
}

/// Whether a run that gave up did so as it should: by itself, with an error that a person can act on.
pub(super) fn refused_well(output: &Output) -> bool {
    let text = said(output);
    output.status.code() == Some(1) && text.contains("error: ") && !text.contains("panicked")
}

/// Every file below `run`, by relative path.
pub(super) fn files(run: &Path) -> anyhow::Result<Vec<String>> {
    fn walk(root: &Path, at: &Path, found: &mut Vec<String>) -> anyhow::Result<()> {
        for entry in fs::read_dir(at).with_context(|| format!("cannot list {}", at.display()))? {
            let path = entry?.path();
            if path.is_dir() {
                walk(root, &path, found)?;
            } else {
                let name = path.strip_prefix(root)?.to_str().context("a name is not UTF-8")?;
                found.push(name.to_owned());
            }
        }
        Ok(())
    }
    let mut found = Vec::new();
    walk(run, run, &mut found)?;
    found.sort();
    Ok(found)
}

/// Name of the newest checkpoint's folder.
pub(super) fn newest(run: &Path) -> anyhow::Result<String> {
    let names = fs::read_dir(run.join("checkpoints"))?
        .map(|entry| Ok(entry?.file_name().to_string_lossy().into_owned()))
        .collect::<anyhow::Result<Vec<_>>>()?;
    let steps = names.into_iter().filter(|name| name.starts_with("step_"));
    steps.filter(|name| !name.contains('.')).max().context("the run has no checkpoint")
}

/// What a run ended with: its tables, its last checkpoint, the policies it kept.
pub(super) fn print(run: &Path) -> anyhow::Result<Print> {
    let last = format!("checkpoints/{}/", newest(run)?);
    let counts = |name: &String| {
        ["metrics.csv", "episodes.csv", "ledger.csv"].contains(&name.as_str())
            || name.starts_with(&last)
            || name.starts_with("checkpoints/best_")
    };
    let names = files(run)?.into_iter().filter(counts);
    names.map(|name| Ok((name.clone(), fs::read(run.join(&name))?))).collect()
}

/// Names the first file that differs.
pub(super) fn same(expected: &Print, found: &Print) -> anyhow::Result<()> {
    for name in expected.keys().chain(found.keys()) {
        if expected.get(name) != found.get(name) {
            bail!("{name} is not as in the undisturbed run");
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_changed_a_missing_and_an_additional_file_are_each_seen() {
        let file = |name: &str, text: &str| (name.to_owned(), text.as_bytes().to_vec());
        let whole = Print::from([file("a", "1"), file("b", "2")]);
        same(&whole, &whole.clone()).unwrap();
        for other in [
            Print::from([file("a", "1"), file("b", "3")]),
            Print::from([file("a", "1")]),
            Print::from([file("a", "1"), file("b", "2"), file("c", "")]),
        ] {
            same(&whole, &other).unwrap_err();
        }
    }

    #[test]
    fn a_print_holds_the_tables_the_last_checkpoint_and_the_kept_policies() {
        let run = std::env::temp_dir().join(format!("xtask-print-{}", std::process::id()));
        for folder in ["step_0000020", "step_0000040", ".step_0000060.tmp", "best_0000020"] {
            fs::create_dir_all(run.join("checkpoints").join(folder)).unwrap();
            fs::write(run.join("checkpoints").join(folder).join("w"), folder).unwrap();
        }
        for name in ["metrics.csv", "episodes.csv", "events.out", "lock"] {
            fs::write(run.join(name), name).unwrap();
        }
        let names: Vec<String> = print(&run).unwrap().into_keys().collect();
        let expected = [
            "checkpoints/best_0000020/w",
            "checkpoints/step_0000040/w",
            "episodes.csv",
            "metrics.csv",
        ];
        assert_eq!(names, expected);
        fs::remove_dir_all(&run).unwrap();
    }
}
