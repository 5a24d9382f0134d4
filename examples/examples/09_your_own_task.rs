//! What you learn: describe a task of your own as TOML, check it, and see whether a script can do it.
//! Run: `cargo run --release -p palpate-examples --example 09_your_own_task`
//! You should see: a misspelt key refused with the right one named, then a hexagonal pin inserted; its recording
//! opens with `cargo xtask view target/tutorials`.
#![expect(clippy::print_stdout, reason = "a tutorial speaks")]

use std::path::Path;

use palpate::baselines::Actor;
use palpate::config::{Choice, Config};
use palpate::evaluate::rollouts;
use palpate::stack::{Purpose, sim_env};

/// What differs from the built-in peg insertion; `assets/tasks/` lists every key. The same file serves
/// `cargo xtask train-sim --config FILE`.
const MY_TASK: &str = r#"
[task]
name = "hexagonal-pin"
depth = 0.015                     # m
success_distance = 0.003
start_position = [0.004, 0.003, 0.006]

[sim]
friction = 0.2

[sim.peg]
shape = "hexagonal"
width = 0.016                     # m, between opposite sides

[sim.hole]
clearance = 0.0008                # m, diametral
"#;

fn choice(file: &Path) -> Choice {
    Choice {
        preset: "palpate".into(),
        task: "peg-insertion".into(),
        model: "P-14".into(),
        file: Some(file.to_owned()),
        set: Vec::new(),
    }
}

fn main() -> anyhow::Result<()> {
    let folder = Path::new("target/tutorials");
    std::fs::create_dir_all(folder)?;
    let file = folder.join("my-task.toml");

    std::fs::write(&file, MY_TASK.replace("clearance", "clearence"))?;
    match Config::load(&choice(&file)) {
        Ok(_) => anyhow::bail!("a misspelt key was taken"),
        Err(e) => println!("misspelt: {e:#}\n"),
    }

    std::fs::write(&file, MY_TASK)?;
    let config = Config::load(&choice(&file))?;
    let mut env = sim_env(&config, 7, Purpose::Evaluate)?;
    let mut recorder = palpate::record::Recorder::new(&config, folder)?;
    recorder.load(&mut env);
    let mut script = Actor::scripted(&config, env.action_dim());
    rollouts(&mut env, &mut script, 3, |env, s| {
        println!(
            "{}, episode {}: {:?} after {:.2} s, peak force {:.1} N",
            config.task.name, s.episode, s.outcome, s.seconds, s.peak_force
        );
        recorder.keep_as(env, "hexagonal-pin");
    })?;
    anyhow::ensure!(recorder.finish().is_empty(), "the recordings could not be written");
    Ok(())
}
