//! What you learn: train a policy from your own program, measure it, and make a page and recordings of it.
//! Run: `cargo run --release -p palpate-examples --example 10_train_in_a_minute`
//! You should see: training for about a minute, a table with the baselines beside it, and where the page is; open it in
//! a browser, and the recordings with `cargo xtask view target/tutorials/run`.
#![expect(clippy::print_stdout, reason = "a tutorial speaks")]

use std::path::Path;

use palpate::config::Choice;
use palpate::{evaluate, report, train};

fn main() -> anyhow::Result<()> {
    // CI runs every tutorial for a moment only.
    let quick = std::env::args().any(|a| a == "--quick");
    let steps = if quick { 150 } else { 4000 };
    let choice = Choice {
        preset: "palpate".into(),
        task: "peg-insertion".into(),
        // The admittance model with learned gains learns fastest here.
        model: "A-13pd".into(),
        file: None,
        set: vec![
            format!("run.steps={steps}"),
            "run.evaluate_every=1000".into(),
            format!("run.evaluate_episodes={}", if quick { 1 } else { 10 }),
            format!("env.max_steps={}", if quick { 30 } else { 150 }),
        ],
    };
    let run = Path::new("target/tutorials/run");
    if run.exists() {
        std::fs::remove_dir_all(run)?;
    }
    train::start(&choice, Some(run))?;

    let options = evaluate::Options {
        episodes: if quick { 1 } else { 20 },
        seed: evaluate::DEFAULT_SEED,
        set: Vec::new(),
        stochastic: false,
        record: Some(run.join("episodes")),
    };
    let rows = evaluate::run(run, &options, |_, _| {})?;
    print!("{}", evaluate::table(&rows));

    let page = run.join("report.html");
    std::fs::write(&page, report::render(&[run.to_owned()])?)?;
    println!("\nthe run's story: {}", page.display());
    Ok(())
}
