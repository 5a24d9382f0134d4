//! A study as a Slurm array: one task per run that is not done.

use std::io::Write as _;
use std::path::Path;
use std::process::Command;

use anyhow::{Context as _, bail, ensure};
use clap::Args;

use super::Which;
use super::folder::Folder;

/// `study submit`.
#[derive(Debug, Args)]
pub struct Submit {
    #[command(flatten)]
    which: Which,
    /// To Slurm, by sbatch.
    #[arg(long, required = true)]
    slurm: bool,
    /// Cores of each run: 1 or 2; one is more work per core.
    #[arg(long, default_value_t = 1, value_parser = clap::value_parser!(u8).range(1..=2))]
    cpus: u8,
    /// Time limit of a task, HH:MM:SS. A run that is not done by then is put back into the queue and goes on.
    #[arg(long, default_value = "01:00:00")]
    time: String,
    /// Most tasks at a time.
    #[arg(long, value_name = "N")]
    at_once: Option<usize>,
    /// Write the script, submit nothing.
    #[arg(long)]
    dry_run: bool,
    /// More options for sbatch, after `--`.
    #[arg(last = true, value_name = "SBATCH OPTIONS")]
    more: Vec<String>,
}

/// Seconds before the time limit at which a task is told.
const NOTICE: u32 = 120;

impl Submit {
    pub(super) fn run(&self) -> anyhow::Result<()> {
        let folder = self.which.open()?;
        let left: Vec<usize> = folder
            .plan
            .iter()
            .enumerate()
            .filter_map(|(index, run)| (!folder.is_done(run)).then_some(index))
            .collect();
        if left.is_empty() {
            bail!(
                "all {} runs are done; see `cargo xtask study report {}`",
                folder.plan.len(),
                folder.path.display()
            );
        }
        let path = std::path::absolute(&folder.path)?;
        let program = std::env::current_exe().context("cannot find this program")?;
        let script = self.script(&folder, &path, &program, &left);
        let file = path.join("slurm.sh");
        palpate_runs::write_whole(&file, script.as_bytes())?;
        std::fs::create_dir_all(path.join("slurm")).context("cannot make the folder of logs")?;
        let mut out = std::io::stdout();
        writeln!(out, "{}: {} tasks", file.display(), left.len())?;
        if self.dry_run {
            return Ok(());
        }
        let said = Command::new("sbatch").arg("--parsable").args(&self.more).arg(&file).output();
        let said = said.context(
            "cannot run sbatch: is this a machine of the cluster? --dry-run only writes the script",
        )?;
        ensure!(
            said.status.success(),
            "sbatch refused: {}",
            String::from_utf8_lossy(&said.stderr).trim()
        );
        let job = String::from_utf8_lossy(&said.stdout).trim().to_owned();
        writeln!(
            out,
            "job {job}\nwatch: cargo xtask study status {0}\nthen:  cargo xtask study report {0}",
            folder.path.display()
        )?;
        Ok(())
    }

    /// The batch script. The array's numbers are the runs' indices.
    fn script(&self, folder: &Folder, path: &Path, program: &Path, left: &[usize]) -> String {
        let most = self.at_once.map_or_else(String::new, |n| format!("%{n}"));
        format!(
            r#"#!/bin/bash
#SBATCH --job-name=palpate-{name}
#SBATCH --array={array}{most}
#SBATCH --cpus-per-task={cpus}
#SBATCH --time={time}
#SBATCH --signal=B:USR1@{NOTICE}
#SBATCH --requeue
#SBATCH --open-mode=append
#SBATCH --output={path}/slurm/%a.log
# Time that runs out and pre-emption are announced by a signal: the run writes a checkpoint and ends with 75. Then the
# task goes back into the queue, and goes on from there.
{program} study run {path} --index "$SLURM_ARRAY_TASK_ID" &
run=$!
trap 'kill -USR1 $run' USR1 TERM
wait $run; code=$?
# A trapped signal ends `wait`, not the run.
while kill -0 $run 2> /dev/null; do wait $run; code=$?; done
if [ $code -eq 75 ]; then
    scontrol requeue "${{SLURM_ARRAY_JOB_ID}}_$SLURM_ARRAY_TASK_ID"
fi
exit $code
"#,
            name = folder.study.name,
            array = ranges(left),
            cpus = self.cpus,
            time = self.time,
            path = quoted(path),
            program = quoted(program),
        )
    }
}

/// A path for a shell; as it is where nothing in it is special.
fn quoted(path: &Path) -> String {
    let text = path.display().to_string();
    let plain = |c: char| c.is_ascii_alphanumeric() || "/-_.+".contains(c);
    if text.chars().all(plain) { text } else { format!("'{}'", text.replace('\'', r"'\''")) }
}

/// Numbers as Slurm writes them: 0-3,7.
fn ranges(numbers: &[usize]) -> String {
    let mut parts: Vec<(usize, usize)> = Vec::new();
    for &n in numbers {
        match parts.last_mut() {
            Some((_, last)) if *last + 1 == n => *last = n,
            _ => parts.push((n, n)),
        }
    }
    let part = |&(from, to): &(usize, usize)| {
        if from == to { from.to_string() } else { format!("{from}-{to}") }
    };
    parts.iter().map(part).collect::<Vec<_>>().join(",")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn neighbours_are_ranges() {
        assert_eq!(ranges(&[0, 1, 2, 5, 7, 8]), "0-2,5,7-8");
        assert_eq!(ranges(&[]), "");
    }

    #[test]
    fn a_path_with_a_space_is_quoted() {
        assert_eq!(quoted(Path::new("/a/b-1.x")), "/a/b-1.x");
        assert_eq!(quoted(Path::new("/a b/it's")), r"'/a b/it'\''s'");
    }
}
