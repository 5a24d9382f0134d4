//! What you learn: ask for joints near the joints you have, and what happens where the arm loses a direction.
//! Run: `cargo run --release -p palpate-examples --example 02_near_a_singularity`
//! You should see: a 2 mm step solved to 1e-9, then steps towards a straight wrist that need ever faster joints until
//! a gate refuses one with its numbers, and a target out of reach refused at once.
#![expect(clippy::print_stdout, reason = "a tutorial speaks")]

use palpate_kinematics::{IkOptions, SerialChain};
use palpate_spatial::{JointVector, Pose, UnitQuaternion, Vector3};

/// Control period, s.
const DT: f64 = 0.002;

fn main() -> anyhow::Result<()> {
    let chain = SerialChain::<6>::from_urdf_file("assets/robots/ur3e.urdf", "base_link", "tool0")?;
    let home = JointVector::from([0.0, -90.0, 90.0, -90.0, -90.0, 0.0].map(f64::to_radians));

    // A small step, solved in the branch of the seed.
    let mut target = chain.forward(&home);
    target.translation.z -= 0.002;
    let solution = chain.solve_near(&target, &home, &IkOptions::default())?;
    let error = chain.forward(&solution.q).translation.vector - target.translation.vector;
    println!("2 mm down: {} iterations, error {:.1e} m", solution.iterations, error.norm());

    // Wrist 2 nearly straight: wrist 1 and wrist 3 turn about nearly the same axis, and a tilt of the tool about the
    // direction that is lost takes a lot of both.
    let tilt = Pose::from_parts(
        Vector3::zeros().into(),
        UnitQuaternion::from_axis_angle(&Vector3::x_axis(), 0.001),
    );
    // What a controller should ask for: a step the joints can make in time, away from where the Jacobian breaks down.
    let gates = IkOptions { period: Some(DT), min_singular_value: 0.01, ..IkOptions::default() };
    println!("\n1 mrad of tilt within {DT} s, wrist 2 bent by");
    for bend_deg in [90.0, 20.0, 5.0, 2.0, 0.5] {
        let mut q = home;
        q[4] = -f64::to_radians(bend_deg);
        let sigma = chain.kinematics(&q).smallest_singular_value();
        let said = match chain.solve_near(&(chain.forward(&q) * tilt), &q, &gates) {
            Ok(s) => format!("fastest joint {:.2} rad/s", s.max_step / DT),
            Err(reason) => format!("refused: {reason}"),
        };
        println!("{bend_deg:>5}°  σ_min {sigma:.4}  {said}");
    }

    target.translation.x += 5.0;
    match chain.solve_near(&target, &home, &IkOptions::default()) {
        Ok(_) => anyhow::bail!("5 m away was solved"),
        Err(reason) => println!("\n5 m away: {reason}"),
    }
    Ok(())
}
