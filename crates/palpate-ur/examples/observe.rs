//! What an arm says about itself, without touching it.
//!
//! Run: `cargo run --release -p palpate-ur --example observe -- ADDRESS[:RTDE_PORT] [SECONDS]`
//! You should see: versions, modes, tool and payload in force, how well the model of a UR3e fits, and the
//! mean, noise and timing of SECONDS (5) of samples. No program is loaded, nothing moves.
#![expect(clippy::print_stdout, reason = "it is the example's purpose")]

use anyhow::Context;
use palpate_kinematics::{SerialChain, UrModel};
use palpate_robot_io::RobotBackend;
use palpate_spatial::Vector6;
use palpate_ur::{UrArm, UrConfig, model_error};

fn main() -> anyhow::Result<()> {
    let mut args = std::env::args().skip(1);
    let address = args.next().context("say where the arm is: ADDRESS[:RTDE_PORT]")?;
    let seconds: f64 = args.next().map_or(Ok(5.0), |s| s.parse())?;
    let (host, port) = address.split_once(':').unwrap_or((&address, "30004"));
    let mut config = UrConfig::at(host);
    config.ports.rtde = port.parse().context("the port is not a number")?;
    config.stale_ticks = 50;

    let mut arm = UrArm::observe(config)?;
    arm.read()?;
    let sample = *arm.sample();
    if let Some(version) = arm.controller() {
        println!("controller {version}, up for {:.0} s", sample.timestamp);
    }
    println!(
        "robot mode {}, safety {}, program {}",
        sample.robot_mode, sample.safety, sample.runtime
    );
    println!("speed slider {:.0} %, payload {} kg", sample.speed_slider * 100.0, sample.payload);
    println!("tool centre point from the flange {:?}", sample.tcp_offset);
    let chain = ur3e()?;
    let error = model_error(&chain, &sample);
    println!(
        "flange off the nominal UR3e by {:.2} mm, {:.3} rad",
        error.position * 1e3,
        error.rotation
    );

    let (mut n, mut sum, mut squares) = (0.0, Vector6::zeros(), Vector6::zeros());
    let end = sample.timestamp + seconds;
    while arm.sample().timestamp < end {
        let wrench = arm.read()?.sensor_wrench.vector();
        n += 1.0;
        sum += wrench;
        squares += wrench.component_mul(&wrench);
    }
    let mean = sum / n;
    let deviation = (squares / n - mean.component_mul(&mean)).map(|x| x.max(0.0).sqrt());
    println!("wrench at the flange, N and N·m: mean {:.2?}", mean.as_slice());
    println!("                                 deviation {:.3?}", deviation.as_slice());
    println!("{:?}", arm.stats());
    Ok(())
}

/// The nominal arm; a real one has a calibration of its own on top.
fn ur3e() -> anyhow::Result<SerialChain<6>> {
    let zero =
        palpate_kinematics::DhTable { theta: [0.0; 6], d: [0.0; 6], a: [0.0; 6], alpha: [0.0; 6] };
    Ok(UrModel::Ur3e.calibrated_chain(&zero)?)
}
