//! kill -9 at random moments.

use std::fs;
use std::time::{Duration, Instant};

use anyhow::{Context as _, bail};

use super::rig::{Rig, is_complete, print, said, same};

const STEPS: u64 = 400;

pub(super) fn torture(rig: &Rig, kills: u64, random: &mut fastrand::Rng) -> anyhow::Result<String> {
    let began = Instant::now();
    let straight = rig.finish(&rig.path("straight"), STEPS)?;
    // On any machine a few checkpoints long, so that runs get somewhere between two kills.
    let window = began.elapsed() / 4;
    let run = rig.path("killed");
    let (mut killed, mut runs) = (0, 0);
    while killed < kills {
        if rig.until_killed(&run, window.mul_f64(random.f64()))? {
            killed += 1;
            if killed % 100 == 0 {
                println!("  {killed} kills, {runs} runs brought to their end");
            }
            continue;
        }
        let last = format!("after {killed} kills");
        same(&straight, &print(&run)?).with_context(|| last)?;
        runs += 1;
        fs::remove_dir_all(&run)?;
    }
    if run.exists() {
        same(&straight, &rig.finish(&run, STEPS)?)?;
        runs += 1;
    }
    Ok(format!("{killed} kills in {runs} runs, all equal to the straight one"))
}

impl Rig {
    /// Whether the run was killed before its end.
    fn until_killed(&self, run: &std::path::Path, after: Duration) -> anyhow::Result<bool> {
        let mut child = self.go_on(run, STEPS, &[]).spawn().context("cannot start palpate")?;
        std::thread::sleep(after);
        child.kill().context("cannot kill the run")?;
        let output = child.wait_with_output()?;
        match output.status.code() {
            None => Ok(true),
            Some(0) => Ok(false),
            // Killed between its last checkpoint and its exit, and whole.
            Some(1) if is_complete(&output) => Ok(false),
            Some(code) => bail!("exit code {code} after a kill: {}", said(&output)),
        }
    }
}
