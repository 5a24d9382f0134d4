//! `cargo xtask`: one front door to the release binary, the tests and the CI steps.
//!
//! A small debug binary that shells out. It links neither candle nor rapier, so it builds in seconds and
//! everything that computes runs in release.
#![expect(clippy::print_stdout, clippy::print_stderr, reason = "a command line tool speaks")]

mod bench;
mod ci;
mod examples;
mod palpate;
mod process;
mod smoke;
mod soak;
mod style;
mod test;
mod tidy;
mod torture;
mod view;
mod workspace;

use std::ffi::OsString;
use std::process::ExitCode;

use xshell::cmd;

const HELP: &str = "\
Usage: cargo xtask COMMAND [ARGS…]

Robot learning (builds the release binary if needed, then runs `palpate COMMAND ARGS…`):
  train-sim        train a policy in simulation
  demonstrate --out FILE  record a script or a policy; train-sim --demonstrations FILE learns from it
  evaluate RUN     measure a trained policy beside three baselines
  plot RUN…        draw learning curves
  report RUN…      the story of one or more runs on one page of HTML; --live while they train
  study WHAT       many runs from one file: plan, run, status, report, submit to Slurm
  view RUN         list a run's recordings and open them in Rerun or Foxglove
  ledger RUN       what the fail-safe layer refused, slowed and stopped, by cause
  runs WHAT        look after runs: list, verify, repair, copy, export
  virtual-ur       a UR controller with simulated contact behind it, on a UR's ports
  doctor --rtde ADDRESS      examine an arm, virtual or not; moves nothing
  train-real --rtde ADDRESS  train on it; --from RUN starts from a simulated run
  run-policy RUN --rtde ADDRESS  run a trained policy on it
  rt-probe         what this computer holds at 500 Hz, and which limits follow for an arm
  ANY OTHER        is handed to palpate as it is
  COMMAND --help   explains one of them; `cargo xtask --help-palpate` lists all

Repository:
  test [ARGS…]     all tests, then doctests; ARGS (a name, -p CRATE) go to the runner, then no doctests
  ci [--only STEP]…  every check that must pass before a merge, or only some
  tidy             layering, file size, links, assets, stray paths
  bench [ARGS…]    an update beside this machine's limit and beside PyTorch and JAX, then criterion benchmarks
  soak shield [ACTIONS [SEED]]  adversaries against the fail-safe layer, 10⁷ actions
  soak link --minutes M   the 500 Hz loop against the virtual controller, beside a learner that never rests
  soak packets     10⁷ damaged packets through the protocol cores of client and server
  soak stops       10,000 protective stops: nothing unlocks or moves without a person
  torture [WHAT]   kills, damages and starves simulated trainings; all must end alike. --help says more
  examples         every tutorial program, with --quick
  stability        which contacts make the force loop oscillate: docs/results/stability.md and its pictures
  help             this text
";

/// Exit code for a command line that makes no sense.
const USAGE: u8 = 2;

fn main() -> ExitCode {
    match run() {
        Ok(code) => code,
        Err(e) => {
            eprintln!("{} {e:#}", style::red("error:"));
            ExitCode::FAILURE
        }
    }
}

fn run() -> anyhow::Result<ExitCode> {
    let mut args = std::env::args_os().skip(1);
    let command = args.next().unwrap_or_else(|| "help".into());
    let rest: Vec<OsString> = args.collect();
    match command.to_str() {
        Some(name) if explained_here(name, &rest) => print!("{HELP}"),
        Some("--help-palpate") => return palpate::exec(&["--help".into()]),
        Some("test") => test::command(&rest)?,
        Some("ci") => return Ok(ci::command(&rest)),
        Some("tidy") => tidy::command()?,
        Some("bench") => bench::command(&rest)?,
        Some("stability") => {
            let sh = workspace::shell()?;
            cmd!(sh, "cargo run --release -p palpate-control --example stability_map -- {rest...}")
                .run()?;
        }
        Some("torture") => torture::command(&rest)?,
        Some("view") => return view::command(&rest),
        Some("soak") => return soak::command(&rest),
        Some("examples") => println!("{} programs ran", examples::command()?),
        _ => {
            let all: Vec<OsString> = std::iter::once(command).chain(rest).collect();
            return palpate::exec(&all);
        }
    }
    Ok(ExitCode::SUCCESS)
}

/// Whether to explain all commands: on request, and for those that do not explain themselves.
fn explained_here(command: &str, rest: &[OsString]) -> bool {
    let asked = rest.iter().any(|arg| arg == "-h" || arg == "--help");
    match command {
        "help" | "-h" | "--help" => true,
        "test" | "ci" | "tidy" | "bench" | "stability" | "view" | "examples" => asked,
        _ => false,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn asking_for_help_starts_nothing() {
        let help = |command| explained_here(command, &["--fast".into(), "--help".into()]);
        assert!(help("bench") && help("ci") && explained_here("help", &[]));
        // The binary explains these.
        assert!(!help("train-sim") && !help("torture"));
        assert!(!explained_here("bench", &[]));
    }
}
