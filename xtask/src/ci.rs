//! Every check that must pass before a merge. The only CI logic there is: hosted runners call this.

use std::ffi::OsString;
use std::process::ExitCode;
use std::time::{Duration, Instant};

use anyhow::{Context as _, bail};
use xshell::cmd;

use crate::{USAGE, examples, smoke, style, test, tidy, torture, workspace};

/// How a step ended, if not in an error.
enum Outcome {
    /// Passed; with what is worth knowing.
    Done(String),
    /// Not run, and why.
    Skipped(String),
}

struct Step {
    name: &'static str,
    what: &'static str,
    run: fn() -> anyhow::Result<Outcome>,
}

/// In the order of what fails soonest.
const STEPS: &[Step] = &[
    Step { name: "fmt", what: "sources are formatted", run: fmt },
    Step { name: "tidy", what: "layering, file size, links, assets, stray paths", run: tidy },
    Step { name: "clippy", what: "no warnings in any target", run: clippy },
    Step { name: "test", what: "unit and integration tests", run: test },
    Step { name: "doctest", what: "programs in the documentation", run: doctest },
    Step { name: "doc", what: "documentation builds without warnings", run: doc },
    Step { name: "examples", what: "every tutorial program runs", run: examples },
    Step {
        name: "smoke",
        what: "train, kill, resume, evaluate, plot with the release binary",
        run: smoke,
    },
    Step {
        name: "torture",
        what: "killed, damaged and starved runs end as others do",
        run: torture,
    },
    Step { name: "package", what: "every crate can be packaged", run: package },
    Step { name: "deny", what: "licences, sources and bans of dependencies", run: deny },
];

/// `cargo xtask ci [--only STEP]…`
pub(crate) fn command(args: &[OsString]) -> ExitCode {
    let steps = match selected(args) {
        Ok(steps) => steps,
        Err(e) => {
            eprintln!("{e}\nusage: cargo xtask ci [--only STEP]…\n");
            for step in STEPS {
                eprintln!("  {:<9} {}", step.name, step.what);
            }
            return ExitCode::from(USAGE);
        }
    };
    let started = Instant::now();
    let mut report = Vec::new();
    for step in steps {
        println!("\n{} {}: {}", style::bold("▸"), style::bold(step.name), step.what);
        let began = Instant::now();
        let result = (step.run)();
        if let Err(e) = &result {
            eprintln!("{} {e:#}", style::red("error:"));
        }
        report.push((step, result, began.elapsed()));
    }
    println!("\n{}", style::bold("▸ summary"));
    for (step, result, took) in &report {
        println!("{}", line(step, result, *took));
    }
    println!("  total {}", clock(started.elapsed()));
    let failed = report.iter().any(|(_, result, _)| result.is_err());
    if failed { ExitCode::FAILURE } else { ExitCode::SUCCESS }
}

fn line(step: &Step, result: &anyhow::Result<Outcome>, took: Duration) -> String {
    let (mark, note) = match result {
        Ok(Outcome::Done(note)) => (style::green("  ok"), note.clone()),
        Ok(Outcome::Skipped(why)) => (style::yellow("skip"), why.clone()),
        // The cause of it all, without the pages that some tools print.
        Err(e) => {
            (style::red("FAIL"), format!("{e:#}").lines().next().unwrap_or_default().to_owned())
        }
    };
    format!("{mark} {:<9} {:>9}  {note}", step.name, clock(took))
}

fn clock(time: Duration) -> String {
    let seconds = time.as_secs();
    if seconds < 60 {
        format!("{:.1} s", time.as_secs_f64())
    } else {
        format!("{} m {:02} s", seconds / 60, seconds % 60)
    }
}

/// The steps that `--only` names, or all.
fn selected(args: &[OsString]) -> anyhow::Result<Vec<&'static Step>> {
    let mut only = Vec::new();
    let mut args = args.iter().map(|a| a.to_string_lossy());
    while let Some(arg) = args.next() {
        match arg.strip_prefix("--only") {
            Some("") => {
                only.push(args.next().context("--only needs the name of a step")?.into_owned());
            }
            Some(name) if name.starts_with('=') => only.push(name[1..].to_owned()),
            _ => bail!("unexpected argument `{arg}`"),
        }
    }
    if let Some(name) = only.iter().find(|name| STEPS.iter().all(|step| step.name != **name)) {
        bail!("there is no step `{name}`");
    }
    Ok(STEPS
        .iter()
        .filter(|step| only.is_empty() || only.iter().any(|name| name == step.name))
        .collect())
}

fn fmt() -> anyhow::Result<Outcome> {
    let sh = workspace::shell()?;
    cmd!(sh, "cargo fmt --all --check").run()?;
    Ok(Outcome::Done(String::new()))
}

fn tidy() -> anyhow::Result<Outcome> {
    tidy::command().map(|()| Outcome::Done(String::new()))
}

/// In release, so that build scripts and macros are those of the tests.
fn clippy() -> anyhow::Result<Outcome> {
    let sh = workspace::shell()?;
    cmd!(
        sh,
        "cargo clippy --release --workspace --all-targets --locked --keep-going -- -D warnings"
    )
    .run()?;
    Ok(Outcome::Done(String::new()))
}

fn test() -> anyhow::Result<Outcome> {
    test::unit(&[]).map(|tally| Outcome::Done(tally.to_string()))
}

fn doctest() -> anyhow::Result<Outcome> {
    test::doc().map(|tally| Outcome::Done(tally.to_string()))
}

fn doc() -> anyhow::Result<Outcome> {
    let sh = workspace::shell()?;
    cmd!(sh, "cargo doc --release --no-deps --workspace")
        .env("RUSTDOCFLAGS", "-D warnings")
        .run()?;
    Ok(Outcome::Done(String::new()))
}

fn examples() -> anyhow::Result<Outcome> {
    examples::command().map(|count| Outcome::Done(format!("{count} programs")))
}

fn smoke() -> anyhow::Result<Outcome> {
    smoke::run().map(Outcome::Done)
}

fn torture() -> anyhow::Result<Outcome> {
    torture::short().map(Outcome::Done)
}

/// Without a build: what is packaged is what the other steps built.
fn package() -> anyhow::Result<Outcome> {
    let sh = workspace::shell()?;
    cmd!(
        sh,
        "cargo package --quiet --workspace --exclude palpate-examples --exclude xtask --no-verify --allow-dirty --exclude-lockfile --offline"
    )
    .run()?;
    Ok(Outcome::Done(String::new()))
}

fn deny() -> anyhow::Result<Outcome> {
    if !workspace::has_subcommand("deny") {
        return Ok(Outcome::Skipped(
            "cargo-deny is not installed: cargo install --locked cargo-deny".into(),
        ));
    }
    let sh = workspace::shell()?;
    cmd!(sh, "cargo deny --workspace check --hide-inclusion-graph bans licenses sources").run()?;
    Ok(Outcome::Done("advisories are not checked here: cargo deny check advisories".into()))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn names(args: &[&str]) -> Result<Vec<&'static str>, String> {
        let args: Vec<OsString> = args.iter().map(Into::into).collect();
        selected(&args)
            .map(|steps| steps.iter().map(|s| s.name).collect())
            .map_err(|e| e.to_string())
    }

    #[test]
    fn all_steps_run_unless_some_are_named() {
        assert_eq!(names(&[]).unwrap().len(), STEPS.len());
        assert_eq!(names(&["--only", "test", "--only=fmt"]).unwrap(), ["fmt", "test"]);
    }

    #[test]
    fn a_misspelt_step_never_passes_as_an_empty_list() {
        for (args, problem) in [
            (&["--only", "tset"][..], "no step `tset`"),
            (&["--only"], "needs the name"),
            (&["--only", "fmt", "--only"], "needs the name"),
            (&["test"], "unexpected argument `test`"),
            (&["--onlytest"], "unexpected"),
        ] {
            let e = names(args).unwrap_err();
            assert!(e.contains(problem), "{args:?}: {e}");
        }
    }

    #[test]
    fn times_read_well() {
        assert_eq!(clock(Duration::from_millis(2140)), "2.1 s");
        assert_eq!(clock(Duration::from_secs(754)), "12 m 34 s");
    }

    #[test]
    fn a_failure_shows_in_the_summary() {
        let text =
            style::plain(&line(&STEPS[0], &Err(anyhow::anyhow!("badly indented")), Duration::ZERO));
        assert!(text.starts_with("FAIL fmt") && text.ends_with("badly indented"), "{text}");
    }
}
