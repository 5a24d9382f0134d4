//! What you learn: ask for joints that reach a pose, near the joints you have; read why there are none.
//! Run: `cargo run --release -p palpate-examples --example 02_inverse_kinematics`
//! You should see: a 2 mm step solved to 1e-9, and a target out of reach refused with numbers.
#![expect(clippy::print_stdout, reason = "a tutorial speaks")]

use palpate_kinematics::{IkOptions, SerialChain};
use palpate_spatial::JointVector;

fn main() -> anyhow::Result<()> {
    let chain = SerialChain::<6>::from_urdf_file("assets/robots/ur3e.urdf", "base_link", "tool0")?;
    let q = JointVector::from([0.0, -90.0, 90.0, -90.0, -90.0, 0.0].map(f64::to_radians));
    let base_T_tool = chain.forward(&q);

    let mut target = base_T_tool;
    target.translation.z -= 0.002;
    let solution = chain.solve_near(&target, &q, &IkOptions::default())?;
    println!("2 mm down: joints move by {:.5} rad", (solution.q - q).transpose());
    let error = chain.forward(&solution.q).translation.vector - target.translation.vector;
    println!("error: {:.1e} m", error.norm());

    target.translation.x += 5.0;
    match chain.solve_near(&target, &q, &IkOptions::default()) {
        Ok(_) => println!("5 m away: solved?!"),
        Err(reason) => println!("5 m away: {reason}"),
    }
    Ok(())
}
