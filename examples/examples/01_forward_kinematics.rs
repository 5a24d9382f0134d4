//! What you learn: load an arm from a URDF and ask where its tool is and how it moves.
//! Run: `cargo run --release -p palpate-examples --example 01_forward_kinematics`
//! You should see: the tool 30 cm in front of a UR3e, and a Jacobian column per joint.
#![expect(clippy::print_stdout, reason = "a tutorial speaks")]

use palpate_kinematics::{Frame, SerialChain};
use palpate_spatial::JointVector;

fn main() -> anyhow::Result<()> {
    let chain = SerialChain::<6>::from_urdf_file("assets/robots/ur3e.urdf", "base_link", "tool0")?;
    let q = JointVector::from([0.0, -90.0, 90.0, -90.0, -90.0, 0.0].map(f64::to_radians));

    let kinematics = chain.kinematics(&q);
    let base_T_tool = kinematics.pose();
    println!("tool0 in base_link: {:.4?} m", base_T_tool.translation.vector.as_slice());
    println!(
        "its z axis points:  {:.3?}",
        (base_T_tool.rotation * nalgebra::Vector3::z()).as_slice()
    );

    // Rows v then ω, base axes: what the tool does when one joint turns at 1 rad/s.
    let J = kinematics.jacobian(Frame::BaseAligned);
    for (joint, column) in chain.joint_names().iter().zip(J.column_iter()) {
        println!("{joint:>20} turns → v = {:.3?} m/s", &column.as_slice()[..3]);
    }
    Ok(())
}
