//! What you learn: the parallel position/force law on a springy wall, and where it stops being stable.
//! Run: `cargo run --release -p palpate-examples --example 03_press_a_wall`
//! You should see: a calm press at low force gain, a limit cycle above (1−S)·K_f·k = √2·2π·f_c.
#![expect(clippy::print_stdout, reason = "a tutorial speaks")]

use palpate_control::{
    ActionPlacement, ControlInput, DerivativeRule, ForceController, Gains, LowPass, ParallelConfig,
    ParallelController, ParallelGains,
};
use palpate_spatial::{Twist, Vector6, Wrench};

/// Stiffness of the wall, N/m; cut-off of the force filter, Hz; control period, s.
const WALL: f64 = 3e4;
const CUTOFF: f64 = 10.0;
const DT: f64 = 0.002;
/// The goal lies this far behind the wall's surface, m.
const BEHIND: f64 = 0.005;

fn main() -> anyhow::Result<()> {
    let bound = 2f64.sqrt() * 2.0 * std::f64::consts::PI * CUTOFF;
    println!("stable while (1−S)·K_f·k < {bound:.0} 1/s");
    for kp_f in [1e-3, 4e-3, 1.2e-2] {
        let mut law = ParallelController::new(&ParallelConfig {
            action_placement: ActionPlacement::OutsideSelection,
            derivative_rule: DerivativeRule::None,
            integral_ratio: 0.01,
            integral_limit: 0.05,
        });
        law.set_gains(&Gains::Parallel(ParallelGains {
            kp_x: Vector6::repeat(1.0),
            kp_f: Vector6::repeat(kp_f),
            selection: Vector6::repeat(0.5),
        }))?;
        let mut filter = LowPass::new(CUTOFF, 1.0 / DT);

        // One axis: z is down into the wall, whose surface is at 0.
        let (mut z, mut late_min, mut late_max) = (-0.001f64, f64::INFINITY, f64::NEG_INFINITY);
        for tick in 0..5000 {
            let force = -WALL * z.max(0.0);
            let mut wrench = Wrench::zero();
            wrench.force.z = force;
            let mut pose_error = Vector6::zeros();
            pose_error[2] = BEHIND - z;
            let input =
                ControlInput { pose_error, wrench: filter.update(&wrench), action: Twist::zero() };
            z += law.update(&input, DT).linear.z * DT;
            if tick > 4000 {
                late_min = late_min.min(-force);
                late_max = late_max.max(-force);
            }
        }
        println!(
            "K_f = {kp_f:.1e}: (1−S)·K_f·k = {:>3.0} 1/s → force between {late_min:.1} and {late_max:.1} N",
            0.5 * kp_f * WALL
        );
    }
    Ok(())
}
