//! What you learn: what the fail-safe layer does with good and bad commands.
//! Run: `cargo run --release -p palpate-examples --example 06_safety_layer`
//! You should see: one command accepted and three refused, each with its reason, and the count of them.
#![expect(clippy::print_stdout, reason = "a tutorial speaks")]

use palpate_kinematics::SerialChain;
use palpate_robot_io::IdealArm;
use palpate_safety::{Mode, ResetLimits, Safe, SafetyConfig, SpeedReference};
use palpate_spatial::{JointVector, Pose, Vector3};

fn main() -> anyhow::Result<()> {
    let chain = SerialChain::from_urdf_file("assets/robots/ur3e.urdf", "base_link", "tool0")?;
    let home = JointVector::from([0.0, -90.0, 90.0, -90.0, -90.0, 0.0].map(f64::to_radians));
    // Limits have no defaults: state every one.
    let limits = SafetyConfig {
        mode: Mode::ForceFirst,
        force_max: 25.0,
        torque_max: 2.0,
        joint_velocity_max: JointVector::from_element(1.0),
        speed_reference: SpeedReference::Commanded,
        force_filter_cutoff: 50.0,
        ledger_entries: 100,
        reset: ResetLimits { force_max: 60.0, torque_max: 6.0 },
        shield: None, // only for mode = shield
    };
    let mut arm = IdealArm::at(home);
    arm.load.force.z = 3.0;
    let mut robot = Safe::new(arm, chain, Pose::identity(), limits)?;
    robot.begin_episode()?; // tares: the 3 N are gone
    let here = robot.sense()?.base_T_tool;

    let moved =
        |by: Vector3| Pose::from_parts((here.translation.vector + by).into(), here.rotation);
    for (what, pose) in [
        ("0.1 mm up", moved(Vector3::new(0.0, 0.0, 1e-4))),
        ("20 mm at once", moved(Vector3::new(0.02, 0.0, 0.0))),
        ("5 m away", moved(Vector3::new(5.0, 0.0, 0.0))),
        ("nowhere", moved(Vector3::new(f64::NAN, 0.0, 0.0))),
    ] {
        println!("{what:>14}: {:?}", robot.command(&pose)?);
        robot.sense()?;
    }
    println!("counted: {:?}", robot.tally());
    Ok(())
}
