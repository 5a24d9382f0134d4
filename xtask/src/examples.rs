//! Every tutorial program, run for a moment.

use std::process::Command;
use std::time::Instant;

use anyhow::{Context as _, ensure};

use crate::{palpate, style, workspace};

/// Runs all programs of `examples/` with `--quick` and counts them. Their output is shown only where one fails.
pub(crate) fn command() -> anyhow::Result<usize> {
    let mut programs = palpate::executables(&["-p", "palpate-examples", "--examples"])?;
    programs.sort();
    ensure!(!programs.is_empty(), "examples/ holds no program");
    let mut failed = Vec::new();
    for (name, path) in &programs {
        let started = Instant::now();
        let run = Command::new(path)
            .arg("--quick")
            .current_dir(workspace::root())
            .output()
            .with_context(|| format!("cannot run {}", path.display()))?;
        let seconds = started.elapsed().as_secs_f64();
        if run.status.success() {
            println!("{} {name} {seconds:.1} s", style::green("  ok"));
        } else {
            println!("{} {name} {seconds:.1} s: {}", style::red("FAIL"), run.status);
            print!(
                "{}{}",
                String::from_utf8_lossy(&run.stdout),
                String::from_utf8_lossy(&run.stderr)
            );
            failed.push(name.as_str());
        }
    }
    ensure!(
        failed.is_empty(),
        "{} of {} examples failed: {}; run one with `cargo run --release -p palpate-examples --example NAME`",
        failed.len(),
        programs.len(),
        failed.join(", ")
    );
    Ok(programs.len())
}
