//! What you learn: the whole simulated stack behind one environment, driven by a scripted policy.
//! Run: `cargo run --release -p palpate-examples --example 08_insert_by_script`
//! You should see: five insertions in a second or two of robot time each, with their peak forces.
#![expect(clippy::print_stdout, reason = "a tutorial speaks")]

use palpate::baselines::Actor;
use palpate::config::{Choice, Config};
use palpate::stack::{Purpose, sim_env};

fn main() -> anyhow::Result<()> {
    let config = Config::load(&Choice {
        preset: "palpate".into(),
        task: "peg-insertion".into(),
        model: "P-14".into(),
        file: None,
        set: vec!["sim.friction=0.2".into()],
    })?;
    let mut env = sim_env(&config, 7, Purpose::Evaluate)?;
    let mut script = Actor::scripted(&config, env.action_dim());
    for episode in 0..5 {
        env.reset()?;
        script.reset(episode);
        let summary = loop {
            let action = script.act(&env).to_vec();
            if let Some(summary) = env.step(&action)?.summary {
                break summary;
            }
        };
        println!(
            "episode {episode}: {:?} after {:.2} s, peak force {:.1} N",
            summary.outcome, summary.seconds, summary.peak_force
        );
    }
    Ok(())
}
