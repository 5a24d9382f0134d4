//! The tests, as the README's command and the CI step both run them.

use std::ffi::OsString;
use std::ops::AddAssign;
use std::process::Command;

use anyhow::ensure;

use crate::process::tee;
use crate::{style, workspace};

/// How many tests did what.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct Tally {
    pub(crate) passed: u64,
    pub(crate) failed: u64,
    pub(crate) skipped: u64,
}

impl std::fmt::Display for Tally {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{} passed, {} failed, {} skipped", self.passed, self.failed, self.skipped)
    }
}

impl AddAssign for Tally {
    fn add_assign(&mut self, other: Self) {
        self.passed += other.passed;
        self.failed += other.failed;
        self.skipped += other.skipped;
    }
}

/// `cargo xtask test [ARGS…]`: everything, or what ARGS select.
pub(crate) fn command(args: &[OsString]) -> anyhow::Result<()> {
    if !args.is_empty() {
        println!("{}", unit(args)?);
        return Ok(());
    }
    let (tests, doctests) = (unit(&[])?, doc()?);
    println!("tests:    {tests}\ndoctests: {doctests}");
    Ok(())
}

/// Whose summary to read: a failed test's output holds one of libtest's even behind nextest.
#[derive(Clone, Copy)]
enum Runner {
    Nextest,
    Libtest,
}

/// Unit and integration tests in release, so that candle and rapier are fast and built once.
pub(crate) fn unit(args: &[OsString]) -> anyhow::Result<Tally> {
    let mut command = workspace::cargo();
    let runner = if workspace::has_subcommand("nextest") {
        command.args(["nextest", "run", "--release"]);
        Runner::Nextest
    } else {
        println!(
            "{}",
            style::yellow("cargo-nextest is not installed: using cargo test, which is slower")
        );
        // As nextest does: no doctests yet, and every failure rather than the first crate's.
        command.args(["test", "--release", "--tests", "--no-fail-fast"]);
        Runner::Libtest
    };
    let package = |arg: &OsString| {
        arg.to_str().is_some_and(|arg| arg.starts_with("-p") || arg.starts_with("--package"))
    };
    if !args.iter().any(package) {
        command.arg("--workspace");
    }
    count(runner, command.args(args))
}

/// The programs in the documentation, `compile_fail` guarantees among them.
pub(crate) fn doc() -> anyhow::Result<Tally> {
    let mut command = workspace::cargo();
    command.args(["test", "--release", "--workspace", "--doc", "--no-fail-fast"]);
    count(Runner::Libtest, &mut command)
}

fn count(runner: Runner, command: &mut Command) -> anyhow::Result<Tally> {
    let said = tee(command)?;
    let tally = read(runner, &style::plain(&said.text));
    ensure!(
        tally.failed == 0,
        "tests failed ({tally}); run one again with `cargo xtask test NAME`"
    );
    ensure!(said.status.success(), "the tests did not build, or none was chosen ({})", said.status);
    // An empty selection must not look like success.
    ensure!(tally.passed > 0, "no test ran");
    Ok(tally)
}

/// Adds up the runner's summary lines: nextest writes one, libtest one per crate.
fn read(runner: Runner, text: &str) -> Tally {
    let mut total = Tally::default();
    for line in text.lines() {
        let counts = match runner {
            Runner::Nextest => line
                .split_once(" run: ")
                .filter(|(head, _)| head.trim_start().starts_with("Summary [")),
            Runner::Libtest => {
                line.strip_prefix("test result: ").and_then(|rest| rest.split_once(". "))
            }
        };
        if let Some((_, counts)) = counts {
            total += counted(counts);
        }
    }
    total
}

/// Reads `3 passed (1 slow), 1 failed, 2 skipped` or `3 passed; 1 failed; 2 ignored; …`.
fn counted(text: &str) -> Tally {
    let mut tally = Tally::default();
    for part in text.split([',', ';']) {
        let mut words = part.split_whitespace();
        let (Some(Ok(n)), Some(what)) = (words.next().map(str::parse::<u64>), words.next()) else {
            continue;
        };
        match what {
            "passed" => tally.passed += n,
            "skipped" | "ignored" => tally.skipped += n,
            "failed" | "timed" | "exec" => tally.failed += n,
            // "measured", "filtered out", and details in parentheses
            _ => {}
        }
    }
    tally
}

#[cfg(test)]
mod tests {
    use super::*;

    fn tally(passed: u64, failed: u64, skipped: u64) -> Tally {
        Tally { passed, failed, skipped }
    }

    #[test]
    fn nextest_summaries_are_read() {
        let text = "     Summary [  12.345s] 5 tests run: 5 passed (1 slow), 0 skipped\n";
        assert_eq!(read(Runner::Nextest, text), tally(5, 0, 0));
        let text = "     Summary [   0.010s] 9/12 tests run: 6 passed (1 leaky), 2 failed, 1 timed out, 4 skipped";
        assert_eq!(read(Runner::Nextest, text), tally(6, 3, 4));
    }

    #[test]
    fn a_failed_test_is_counted_once_behind_nextest() {
        let text = "\
  stdout ───
    test result: FAILED. 0 passed; 1 failed; 0 ignored; 0 measured; 31 filtered out; finished in 0.00s
     Summary [   1.000s] 3 tests run: 2 passed, 1 failed, 0 skipped
test result: FAILED. 0 passed; 1 failed; 0 ignored; 0 measured; 31 filtered out; finished in 0.00s
";
        assert_eq!(read(Runner::Nextest, text), tally(2, 1, 0));
    }

    #[test]
    fn libtest_summaries_of_several_crates_are_added() {
        let text = "\
test result: ok. 12 passed; 0 failed; 1 ignored; 0 measured; 3 filtered out; finished in 0.01s
test result: FAILED. 4 passed; 2 failed; 0 ignored; 0 measured; 0 filtered out; finished in 1.20s
";
        assert_eq!(read(Runner::Libtest, text), tally(16, 2, 1));
    }

    #[test]
    fn what_a_test_prints_is_no_summary() {
        for runner in [Runner::Nextest, Runner::Libtest] {
            assert_eq!(read(runner, "the policy's run: 7 passed, 1 failed"), tally(0, 0, 0));
        }
    }

    #[test]
    fn coloured_summaries_are_read() {
        let text = "\x1b[32;1m     Summary\x1b[0m [   0.010s] \x1b[1m1\x1b[0m test run: \x1b[1m1\x1b[0m \x1b[32;1mpassed\x1b[0m, \x1b[1m0\x1b[0m \x1b[33;1mskipped\x1b[0m";
        assert_eq!(read(Runner::Nextest, &style::plain(text)), tally(1, 0, 0));
    }
}
