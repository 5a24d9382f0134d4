//! What you learn: train in simulation, then go on learning on an arm, here a virtual one.
//! Run: `cargo run --release -p palpate-examples --example 12_from_simulation_to_an_arm`
//! You should see: a short simulated training; then what `doctor` finds at the arm, the limits in force, and the same
//! learner going on in real time. On a real arm: read SAFETY.md first, and use `cargo xtask train-real`, which asks.
#![expect(clippy::print_stdout, reason = "a tutorial speaks")]

use std::path::Path;

use palpate::config::Choice;
use palpate::real::{TrainReal, train_real};
use palpate::train;
use palpate::virtual_ur::{Setup, controller};
use palpate_virtual_ur::{Handle, Port};

fn main() -> anyhow::Result<()> {
    let quick = std::env::args().any(|a| a == "--quick");
    let (simulated, real) = if quick { (150, 20) } else { (2000, 400) };
    let folder = Path::new("target/tutorials/sim-to-real");
    if folder.exists() {
        std::fs::remove_dir_all(folder)?;
    }
    let choice = Choice {
        preset: "palpate".into(),
        task: "peg-insertion".into(),
        model: "A-13pd".into(),
        file: None,
        set: vec![
            format!("run.steps={simulated}"),
            format!("env.max_steps={}", if quick { 20 } else { 150 }),
            "run.evaluate_episodes=2".into(),
        ],
    };
    train::start(&choice, Some(&folder.join("sim")))?;

    let setup = Setup { address: [127, 0, 0, 1].into(), any_ports: true, faults: Vec::new() };
    let (options, plant) = controller(&choice, setup)?;
    let robot = Handle::start(options, Box::new(plant))?;
    println!("\na virtual arm listens on {}", robot.address(Port::Rtde));
    let port = |port| robot.address(port).port();
    train_real(&TrainReal {
        address: robot.address(Port::Rtde).to_string().parse().map_err(anyhow::Error::msg)?,
        choice: Choice {
            set: vec![
                format!("run.steps={real}"),
                format!("ur.ports.script={}", port(Port::Secondary)),
                format!("ur.ports.dashboard={}", port(Port::Dashboard)),
                // A busy machine is late now and then; on an arm keep the defaults.
                "ur.stale_ticks=100".into(),
                "ur.stall_ticks=100".into(),
            ],
            ..choice
        },
        from: Some(folder.join("sim")),
        resume: None,
        demonstrations: None,
        out: Some(folder.join("real")),
        dry_run: false,
        // Nobody stands beside a virtual arm.
        yes: true,
    })
}
