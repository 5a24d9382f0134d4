//! A virtual UR3e in free air on UR's own ports, until Ctrl-C: something for any RTDE client to talk to.
//!
//! Run: `cargo run --release -p palpate-virtual-ur --example virtual_ur -- [SECONDS:FAULT …]`
//! You should see: the five ports, then what the controller does.

use std::sync::atomic::AtomicBool;

use palpate_kinematics::UrModel;
use palpate_virtual_ur::{ControllerConfig, FAULT_HELP, LaggedArm, Options, run};

#[expect(clippy::print_stdout, reason = "an example")]
fn main() -> Result<(), Box<dyn std::error::Error>> {
    let faults: Result<Vec<_>, _> = std::env::args().skip(1).map(|text| text.parse()).collect();
    let faults = faults.map_err(|e| format!("{e}\n{FAULT_HELP}"))?;
    let options = Options { faults, ..Options::new(ControllerConfig::new(UrModel::Ur3e)) };
    let home = [0.0, -1.57, 1.57, -1.57, -1.57, 0.0].into();
    let never = AtomicBool::new(false);
    run(options, Box::new(LaggedArm::at(home)), &never, &mut |line| println!("{line}"))?;
    Ok(())
}
