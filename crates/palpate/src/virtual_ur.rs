//! `virtual-ur`: a UR controller with the simulator's contact behind it, on a UR's ports.

use std::io::Write as _;
use std::net::IpAddr;

use anyhow::{Context as _, bail};
use palpate_kinematics::UrModel;
use palpate_sim::SimArm;
use palpate_virtual_ur::plant::ContactArm;
use palpate_virtual_ur::{ControllerConfig, Options, TimedFault, run};

use crate::config::{Choice, Config, DRIVE_LAG};
use crate::interrupt;
use crate::stack::chain;

/// Its priority under SCHED_FIFO, where permitted: below a client's.
pub(crate) const PRIORITY: u8 = 70;

/// Standard deviation of the sensor's reading, N and N·m: about that of a flange sensor at rest.
const NOISE: (f64, f64) = (0.1, 0.005);

/// Where it listens and what goes wrong.
#[derive(Clone, Debug)]
pub struct Setup {
    /// Address to listen on.
    pub address: IpAddr,
    /// Any free ports instead of UR's own.
    pub any_ports: bool,
    /// Faults and when they happen.
    pub faults: Vec<TimedFault>,
}

/// Runs it until Ctrl-C.
pub fn command(choice: &Choice, setup: Setup) -> anyhow::Result<()> {
    let (options, plant) = controller(choice, setup)?;
    let mut out = std::io::stdout();
    let mut say = |line: &str| {
        _ = writeln!(out, "{line}");
        _ = out.flush();
    };
    say("a virtual UR: no arm moves. Ctrl-C ends it");
    // A real controller has a processor to itself.
    say(&palpate_ur::realtime(PRIORITY, false).to_string());
    let pace = run(options, Box::new(plant), interrupt::flag(), &mut say)?;
    say(&format!(
        "{} control cycles; {} of them began more than 2 ms late, the latest by {:.1} ms",
        pace.cycles,
        pace.late,
        pace.worst.as_secs_f64() * 1e3
    ));
    Ok(())
}

/// The controller and the arm behind it, for the chosen task.
///
/// # Errors
/// A setting that makes no sense, or an arm that is no UR.
pub fn controller(choice: &Choice, setup: Setup) -> anyhow::Result<(Options, ContactArm)> {
    let mut choice = choice.clone();
    // servoj's lookahead is the controller's; what is left is the drives'. An explicit --set wins.
    choice.set.insert(0, format!("sim.servo.lag={DRIVE_LAG}"));
    // A sensor without noise is a frozen one to whoever reads it.
    choice.set.insert(1, format!("sim.sensor.force_noise={}", NOISE.0));
    choice.set.insert(2, format!("sim.sensor.torque_noise={}", NOISE.1));
    let config = Config::load(&choice)?;
    let model = match config.robot.urdf.as_str() {
        "ur3e" => UrModel::Ur3e,
        "ur5e" => UrModel::Ur5e,
        "ur10e" => UrModel::Ur10e,
        other => bail!("robot.urdf is {other}, but a virtual UR is one of ur3e, ur5e, ur10e"),
    };
    let start = config.task.q_home;
    let arm = SimArm::new(
        chain(&config.robot)?,
        config.task.base_T_hole(),
        &config.sim,
        start,
        config.run.seed,
    )
    .context("the arm behind the virtual controller")?;
    let [x, y, z] = config.robot.tcp;
    let controller = ControllerConfig {
        tcp_offset: [x, y, z, 0.0, 0.0, 0.0],
        payload: config.sim.tool.mass,
        seed: config.run.seed,
        ..ControllerConfig::new(model)
    };
    let options = Options {
        address: setup.address,
        any_ports: setup.any_ports,
        faults: setup.faults,
        ..Options::new(controller)
    };
    Ok((options, ContactArm::new(arm, start)))
}
