//! What you learn: speak a UR's real-time data exchange, here with a controller made of software.
//! Run: `cargo run --release -p palpate-examples --example 11_talk_rtde`
//! You should see: the controller's version and modes, its last joint turning by 0.1 rad/s for half a second, and how
//! the link did. On an arm the same program would move it: replace the address only when you mean it.
#![expect(clippy::print_stdout, reason = "a tutorial speaks")]

use palpate::config::Choice;
use palpate::virtual_ur::{Setup, controller};
use palpate_robot_io::{JointCommand, RobotBackend};
use palpate_ur::{UrArm, UrConfig};
use palpate_virtual_ur::{Handle, Port};

fn main() -> anyhow::Result<()> {
    // A controller with a simulated arm and contact behind it, on free ports of this machine.
    let choice = Choice {
        preset: "palpate".into(),
        task: "peg-insertion".into(),
        model: "P-14".into(),
        ..Choice::default()
    };
    let setup = Setup { address: [127, 0, 0, 1].into(), any_ports: true, faults: Vec::new() };
    let (options, plant) = controller(&choice, setup)?;
    let robot = Handle::start(options, Box::new(plant))?;

    let mut config = UrConfig::at("127.0.0.1");
    config.ports.rtde = robot.address(Port::Rtde).port();
    config.ports.script = robot.address(Port::Secondary).port();
    config.ports.dashboard = robot.address(Port::Dashboard).port();
    // A busy machine is late now and then; on an arm keep the defaults.
    (config.stale_ticks, config.stall_ticks) = (100, 100);

    // Loads the control program; moves nothing.
    let mut arm = UrArm::connect(config)?;
    arm.tare()?;
    let first = arm.read()?;
    if let Some(version) = arm.controller() {
        println!("controller {version}");
    }
    let sample = *arm.sample();
    println!("robot mode {}, safety {}", sample.robot_mode, sample.safety);

    let mut q = first.q;
    for _ in 0..250 {
        q[5] += 0.1 * arm.period().as_secs_f64();
        arm.write(&JointCommand { q })?;
        arm.read()?; // waits for the controller's next cycle
    }
    let last = arm.read()?;
    arm.stop()?;
    println!(
        "{:.3} s on the robot's clock: wrist 3 turned by {:.4} rad of the {:.4} asked for, force {:.2} N",
        last.time - first.time,
        last.q[5] - first.q[5],
        q[5] - first.q[5],
        last.sensor_wrench.force.norm()
    );
    println!("the link: {:?}", arm.stats());
    Ok(())
}
