//! What you learn: write a force-control law of your own, and use it where the project's laws are used.
//! Run: `cargo run --release -p palpate-examples --example 05_your_own_law`
//! You should see: without a zone the sensor's noise makes the arm swing by ±2 mm/s in free air; a zone ends that and presses harder.
#![expect(clippy::print_stdout, reason = "a tutorial speaks")]

use palpate_control::{ControlError, ControlInput, ForceController, Gains};
use palpate_spatial::{Twist, Vector6, Wrench};

/// u = K_p·x_e + K_f·dead(F): force control that does nothing until the contact is stronger than the noise.
struct DeadZone {
    kp_x: Vector6,
    kp_f: Vector6,
    /// Forces below it are noise, N and N·m.
    zone: f64,
}

impl DeadZone {
    fn dead(&self, force: f64) -> f64 {
        // Continuous: the law does not jump where the zone ends.
        force.signum() * (force.abs() - self.zone).max(0.0)
    }
}

impl ForceController for DeadZone {
    fn set_gains(&mut self, gains: &Gains) -> Result<(), ControlError> {
        // The parallel law's gains, without its selection: take what fits and say what does not.
        match gains {
            Gains::Parallel(gains) => {
                (self.kp_x, self.kp_f) = (gains.kp_x, gains.kp_f);
                Ok(())
            }
            Gains::Admittance(_) => {
                Err(ControlError::GainSet("stiffness".into(), "means nothing to a dead-zone law"))
            }
        }
    }

    fn update(&mut self, input: &ControlInput, _dt: f64) -> Twist {
        let force = input.wrench.vector().map(|f| self.dead(f));
        let motion = self.kp_x.component_mul(&input.pose_error);
        Twist::from(motion + self.kp_f.component_mul(&force) + input.action.vector())
    }

    /// Nothing is integrated, so there is nothing to take back.
    fn command_refused(&mut self) {}

    fn reset(&mut self) {}
}

/// Presses on a wall (N/m) at z = 0 for two seconds; the sensor has ±1 N of noise. Swing of the speed from tick to tick in free air, force at the end.
fn press(law: &mut dyn ForceController, wall: f64) -> (f64, f64) {
    let (mut z, mut swing, mut force, mut before) = (-0.002f64, 0.0f64, 0.0, None);
    for tick in 0..1000 {
        let noise = if tick % 2 == 0 { 1.0 } else { -1.0 };
        force = wall * z.max(0.0);
        let mut wrench = Wrench::zero();
        wrench.force.z = noise - force;
        let mut pose_error = Vector6::zeros();
        pose_error[2] = 0.004 - z;
        let input = ControlInput { pose_error, wrench, action: Twist::zero() };
        let v = law.update(&input, 0.002).linear.z;
        if force == 0.0 {
            swing = swing.max(before.map_or(0.0, |before: f64| (v - before).abs()));
        }
        before = Some(v);
        z += v * 0.002;
    }
    (swing, force)
}

fn main() {
    for zone in [0.0, 2.0] {
        let mut law = DeadZone { kp_x: Vector6::repeat(2.0), kp_f: Vector6::repeat(0.002), zone };
        let (swing, force) = press(&mut law, 5e3);
        println!(
            "zone {zone} N: ±{:.2} mm/s of noise in free air, {force:.2} N on the wall",
            1e3 * swing / 2.0
        );
    }
}
