//! What the policy sees: o = [x_e, ẋ, F_ext], scaled to order one.

use palpate_safety::Measurement;
use palpate_spatial::{Pose, Vector6, pose_error_vector_part};

/// Scales and options of the observation. Every key must be stated.
#[derive(Clone, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ObservationConfig {
    /// Factor on the position error, 1/m.
    pub position: f64,
    /// Factor on the attitude error sin(θ/2)·n.
    pub rotation: f64,
    /// Factor on the linear velocity, s/m.
    pub linear_velocity: f64,
    /// Factor on the angular velocity, s/rad.
    pub angular_velocity: f64,
    /// Append the last action.
    pub last_action: bool,
    /// Append this many earlier wrenches, one per action, newest first.
    pub wrench_history: usize,
}

/// Builds observations; holds what they remember.
#[derive(Clone, Debug)]
pub(crate) struct Observer {
    config: ObservationConfig,
    wrench_scale: Vector6,
    last_action: Vec<f32>,
    /// Newest first, scaled; 6 × `wrench_history`.
    history: Vec<f32>,
    observation: Vec<f32>,
}

impl Observer {
    /// F_ext is divided by `force_max` (N) and `torque_max` (N·m).
    pub(crate) fn new(
        config: &ObservationConfig,
        force_max: f64,
        torque_max: f64,
        action_dim: usize,
    ) -> Self {
        let (f, t) = (1.0 / force_max, 1.0 / torque_max);
        let mut observer = Self {
            config: config.clone(),
            wrench_scale: Vector6::new(f, f, f, t, t, t),
            last_action: vec![0.0; if config.last_action { action_dim } else { 0 }],
            history: vec![0.0; 6 * config.wrench_history],
            observation: Vec::new(),
        };
        observer.observation = vec![0.0; observer.dim()];
        observer
    }

    pub(crate) fn dim(&self) -> usize {
        18 + self.last_action.len() + self.history.len()
    }

    pub(crate) fn reset(&mut self) {
        self.last_action.fill(0.0);
        self.history.fill(0.0);
    }

    /// Looks at `m` after `action` (empty after a reset).
    pub(crate) fn look(&mut self, m: &Measurement, base_T_believed: &Pose, action: &[f64]) {
        let c = &self.config;
        let wrench = m.wrench.vector().component_mul(&self.wrench_scale);
        let (error, twist) =
            (pose_error_vector_part(base_T_believed, &m.base_T_tool), m.tool_twist.vector());
        let factors = [c.position, c.rotation, c.linear_velocity, c.angular_velocity, 1.0, 1.0];
        for (i, x) in error.iter().chain(&twist).chain(&wrench).enumerate() {
            self.observation[i] = (x * factors[i / 3]) as f32;
        }
        for (last, a) in self.last_action.iter_mut().zip(action) {
            *last = *a as f32;
        }
        let tail = &mut self.observation[18..];
        tail[..self.last_action.len()].copy_from_slice(&self.last_action);
        tail[self.last_action.len()..].copy_from_slice(&self.history);
        if !self.history.is_empty() {
            self.history.rotate_right(6);
            for (slot, x) in self.history.iter_mut().zip(&wrench) {
                *slot = *x as f32;
            }
        }
    }

    pub(crate) fn observation(&self) -> &[f32] {
        &self.observation
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use palpate_robot_io::RobotState;
    use palpate_spatial::{JointVector, Twist, Vector3, Wrench};

    fn config() -> ObservationConfig {
        ObservationConfig {
            position: 50.0,
            rotation: 20.0,
            linear_velocity: 20.0,
            angular_velocity: 5.0,
            last_action: true,
            wrench_history: 2,
        }
    }

    fn measurement(force_z: f64) -> Measurement {
        let wrench = Wrench::new(Vector3::new(0.0, 0.0, force_z), Vector3::new(0.0, 1.0, 0.0));
        let zero = JointVector::zeros();
        Measurement {
            state: RobotState {
                time: 0.0,
                q: zero,
                dq: zero,
                q_target: zero,
                sensor_wrench: wrench,
            },
            base_T_tool: Pose::identity(),
            tool_twist: Twist::new(Vector3::new(0.01, 0.0, 0.0), Vector3::new(0.0, 0.0, 0.2)),
            wrench,
            raw_wrench: wrench,
        }
    }

    #[test]
    fn parts_stand_in_the_documented_order_and_scale() {
        let mut observer = Observer::new(&config(), 25.0, 2.0, 3);
        let goal = Pose::from_parts(
            Vector3::new(0.02, 0.0, -0.01).into(),
            palpate_spatial::UnitQuaternion::from_scaled_axis(Vector3::new(0.1, 0.0, 0.0)),
        );
        observer.look(&measurement(5.0), &goal, &[]);
        observer.look(&measurement(10.0), &goal, &[0.1, -0.2, 0.3]);
        let o = observer.observation();
        assert_eq!(o.len(), 18 + 3 + 12);
        let near = |x: f32, y: f64| assert!((f64::from(x) - y).abs() < 1e-6, "{x} against {y}");
        near(o[0], 1.0);
        near(o[2], -0.5);
        near(o[3], 20.0 * (0.05f64).sin());
        near(o[6], 0.2);
        near(o[11], 1.0);
        near(o[14], 0.4);
        near(o[16], 0.5);
        near(o[19], -0.2);
        // History: the wrench of the look before this one, then nothing older.
        near(o[18 + 3 + 2], 0.2);
        assert!(o[18 + 3 + 6..].iter().all(|&x| x == 0.0));
    }

    #[test]
    fn reset_forgets() {
        let mut observer = Observer::new(&config(), 25.0, 2.0, 3);
        observer.look(&measurement(5.0), &Pose::identity(), &[1.0, 1.0, 1.0]);
        observer.reset();
        observer.look(&measurement(5.0), &Pose::identity(), &[]);
        assert!(observer.observation()[18..].iter().all(|&x| x == 0.0));
    }
}
