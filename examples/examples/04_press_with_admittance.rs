//! What you learn: the admittance law on a springy wall, and what its stiffness k_d does.
//! Run: `cargo run --release -p palpate-examples --example 04_press_with_admittance`
//! You should see: a soft k_d gives way and presses lightly, a stiff one presses harder; below the contact limit of
//! the wall's stiffness the press bounces instead of settling.
#![expect(clippy::print_stdout, reason = "a tutorial speaks")]

use palpate_control::{
    AdmittanceConfig, AdmittanceController, AdmittanceGains, AdmittanceOutput, ControlInput,
    DerivativeRule, ForceController, Gains,
};
use palpate_spatial::{Twist, Vector6, Wrench};

/// Stiffness of the wall, N/m; control period, s.
const WALL: f64 = 1e4;
const DT: f64 = 0.002;
/// The goal lies this far behind the wall's surface, m.
const BEHIND: f64 = 0.005;

fn main() -> anyhow::Result<()> {
    let config = AdmittanceConfig {
        inertia: 0.1,
        damping_ratio: 1.0,
        derivative_rule: DerivativeRule::None,
        // x of m·ẍ + b·ẋ + k·x = F is a velocity: the force yields a speed away from the wall.
        output: AdmittanceOutput::Velocity,
    };
    println!("a wall of {WALL} N/m, the goal {} mm behind its surface", 1e3 * BEHIND);
    for stiffness in [20.0, 100.0, 500.0, 2000.0] {
        let mut law = AdmittanceController::new(&config);
        law.set_gains(&Gains::Admittance(AdmittanceGains {
            kp_x: Vector6::repeat(1.0),
            stiffness: Vector6::repeat(stiffness),
        }))?;

        // One axis: z is down into the wall, whose surface is at 0.
        let (mut z, mut least, mut most) = (-0.001f64, f64::INFINITY, f64::NEG_INFINITY);
        for tick in 0..5000 {
            let mut wrench = Wrench::zero();
            wrench.force.z = -WALL * z.max(0.0);
            let mut pose_error = Vector6::zeros();
            pose_error[2] = BEHIND - z;
            let input = ControlInput { pose_error, wrench, action: Twist::zero() };
            z += law.update(&input, DT).linear.z * DT;
            if tick > 4000 {
                least = least.min(WALL * z.max(0.0));
                most = most.max(WALL * z.max(0.0));
            }
        }
        let verdict = if most - least < 0.1 { "settles" } else { "bounces" };
        println!("k_d = {stiffness:>5}: {verdict}, force between {least:.2} and {most:.2} N");
    }
    Ok(())
}
