//! The policy an engineer would write by hand: the baseline to beat.

use palpate_spatial::{Pose, UnitQuaternion, Vector3, Vector6, Wrench};

/// Align above the hole, descend, spiral on contact.
///
/// It moves only a_x and leaves every gain at its base value, so it works with any policy model.
#[derive(Clone, Debug)]
pub struct ScriptedPolicy {
    hole_R_base: UnitQuaternion,
    depth: f64,
    linear_max: f64,
    angular_max: f64,
    searching: u32,
    action: Vec<f64>,
}

/// Speed of convergence of the alignment, 1/s.
const ALIGN_RATE: f64 = 4.0;
/// Lateral error below which it descends, m.
const ALIGNED: f64 = 0.6e-3;
/// Force along the hole's axis that counts as contact, N.
const CONTACT: f64 = 1.0;
/// Growth of the spiral's radius per action, m, and its largest radius.
const SPIRAL_GROWTH: f64 = 0.06e-3;
const SPIRAL_RADIUS: f64 = 2.5e-3;
/// Angle between two actions on the spiral, rad.
const SPIRAL_STEP: f64 = 0.7;

impl ScriptedPolicy {
    /// For a hole at `base_T_hole`, a goal `depth` (m) below its mouth and motion bounds of the model
    /// (m/s, rad/s); `action_dim` is the model's.
    pub fn new(
        base_T_hole: &Pose,
        depth: f64,
        linear_max: f64,
        angular_max: f64,
        action_dim: usize,
    ) -> Self {
        Self {
            hole_R_base: base_T_hole.rotation.inverse(),
            depth,
            linear_max,
            angular_max,
            searching: 0,
            action: vec![0.0; action_dim],
        }
    }

    /// Forgets the last episode.
    pub fn reset(&mut self) {
        self.searching = 0;
    }

    /// The action for x_e against the believed goal and the filtered wrench, both in base axes.
    pub fn act(&mut self, error: &Vector6, wrench: &Wrench) -> &[f64] {
        let linear_error = self.hole_R_base * error.fixed_rows::<3>(0);
        let angular_error = 2.0 * error.fixed_rows::<3>(3);
        let contact = (self.hole_R_base * wrench.force).z > CONTACT;
        let above = -linear_error.z > self.depth - 1e-3;
        let lateral = Vector3::new(linear_error.x, linear_error.y, 0.0);
        let mut velocity = lateral * ALIGN_RATE;
        if above && !contact && self.searching == 0 && lateral.norm() > ALIGNED {
            // Stay up while moving over: hold against the position law's pull.
            velocity.z = self.linear_max;
        } else {
            velocity.z = -self.linear_max;
            if above && (contact || self.searching > 0) {
                self.searching += 1;
                let turn = f64::from(self.searching);
                let radius = (turn * SPIRAL_GROWTH).min(SPIRAL_RADIUS);
                let (sin, cos) = (turn * SPIRAL_STEP).sin_cos();
                velocity += Vector3::new(cos, sin, 0.0) * (radius * ALIGN_RATE);
            }
        }
        let velocity = self.hole_R_base.inverse() * velocity;
        for axis in 0..3 {
            self.action[axis] = (velocity[axis] / self.linear_max).clamp(-1.0, 1.0);
            self.action[axis + 3] =
                (angular_error[axis] * ALIGN_RATE / self.angular_max).clamp(-1.0, 1.0);
        }
        &self.action
    }
}
