//! What you learn: use one crate of this project without the others, here the kinematics.
//! Run: `cargo run --release -p palpate-examples --example 13_one_crate_alone`
//! You should see: where around its base a UR3e can work with the tool pointing down, as a map of digits.
//!
//! In a project of your own this is all it takes; no learner, no physics engine, no async runtime is built:
//!
//! ```toml
//! [dependencies]
//! palpate-kinematics = { path = "…/palpate/crates/palpate-kinematics" }
//! palpate-spatial = { path = "…/palpate/crates/palpate-spatial" }
//! ```
#![expect(clippy::print_stdout, reason = "a tutorial speaks")]

use palpate_kinematics::{IkOptions, SerialChain};
use palpate_spatial::{JointVector, Pose, UnitQuaternion, Vector3};

/// Height of the tool above the base, m; side of a cell, m.
const HEIGHT: f64 = 0.1;
const CELL: f64 = 0.05;

fn main() -> anyhow::Result<()> {
    let chain = SerialChain::<6>::from_urdf_file("assets/robots/ur3e.urdf", "base_link", "tool0")?;
    let home = JointVector::from([0.0, -90.0, 90.0, -90.0, -90.0, 0.0].map(f64::to_radians));
    let down = UnitQuaternion::from_axis_angle(&Vector3::x_axis(), std::f64::consts::PI);

    println!("tool down, {HEIGHT} m above the base; rows x, columns y, {CELL} m apart");
    println!("digits: manipulability, 9 the best; · out of reach, o the base");
    // The arm starts where it is and searches from the last place it reached: that is what a program on a robot does.
    let mut best = 0.0f64;
    let mut rows = Vec::new();
    for i in -9i32..=9 {
        let mut row = Vec::new();
        for j in -9i32..=9 {
            let (x, y) = (f64::from(i) * CELL, f64::from(j) * CELL);
            let target = Pose::from_parts(Vector3::new(x, y, HEIGHT).into(), down);
            // A seed that faces the target: the shoulder's pan angle follows it.
            let mut seed = home;
            seed[0] = y.atan2(x);
            let here = chain.solve_near(&target, &seed, &IkOptions::default()).ok();
            let m = here.map(|s| chain.kinematics(&s.q).manipulability());
            best = best.max(m.unwrap_or(0.0));
            row.push(m);
        }
        rows.push(row);
    }
    let mut reached = 0;
    for (i, row) in rows.iter().enumerate() {
        let mut line = String::new();
        for (j, m) in row.iter().enumerate() {
            line.push(match m {
                _ if i == 9 && j == 9 => 'o',
                None => '·',
                Some(m) => {
                    reached += 1;
                    char::from_digit((9.0 * m / best).round() as u32, 10).unwrap_or('?')
                }
            });
            line.push(' ');
        }
        println!("{line}");
    }
    println!("{reached} of {} places reached", rows.len() * rows.len());
    Ok(())
}
