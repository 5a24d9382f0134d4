//! Parallel position/force control with a selection matrix (Sect. III-D.1, eq. 1).

use palpate_spatial::{Twist, Vector6};

use crate::config::{ActionPlacement, ParallelConfig};
use crate::derivative::Derivative;
use crate::law::{ControlError, ControlInput, ForceController, Gains, Law, ParallelGains};

/// u = S·(K_p^x·x_e + K_d^x·ẋ_e) + a_x + (I−S)·(K_p^f·F_ext + K_i^f·∫F_ext dt)
///
/// K_d^x follows from K_p^x by a [`DerivativeRule`](crate::DerivativeRule), K_i^f is a fixed part of K_p^f.
#[derive(Clone, Debug)]
pub struct ParallelController {
    config: ParallelConfig,
    gains: ParallelGains,
    /// K_i^f·∫F_ext dt in output units, so that a change of K_p^f does not make it jump.
    integral: Vector6,
    integral_before: Vector6,
    derivative: Derivative,
}

impl ParallelController {
    /// A law at rest with zero gains.
    pub fn new(config: &ParallelConfig) -> Self {
        let zero = Vector6::zeros();
        Self {
            config: config.clone(),
            gains: ParallelGains { kp_x: zero, kp_f: zero, selection: zero },
            integral: zero,
            integral_before: zero,
            derivative: Derivative::default(),
        }
    }
}

impl ForceController for ParallelController {
    fn set_gains(&mut self, gains: &Gains) -> Result<(), ControlError> {
        match gains {
            Gains::Parallel(gains) => self.gains = *gains,
            Gains::Admittance(_) => return Err(ControlError::WrongLaw(Law::Parallel)),
        }
        Ok(())
    }

    fn update(&mut self, input: &ControlInput, dt: f64) -> Twist {
        let ParallelGains { kp_x, kp_f, selection } = self.gains;
        let rate = self.derivative.update(&input.pose_error, dt);
        let kd_x = kp_x.map(|kp| self.config.derivative_rule.derivative_gain(kp));
        let position = kp_x.component_mul(&input.pose_error) + kd_x.component_mul(&rate);

        let wrench = input.wrench.vector();
        let limit = self.config.integral_limit;
        self.integral_before = self.integral;
        self.integral += kp_f.component_mul(&wrench) * (self.config.integral_ratio * dt);
        self.integral = self.integral.map(|x| x.clamp(-limit, limit));
        let force = kp_f.component_mul(&wrench) + self.integral;

        let action = input.action.vector();
        let (inside, outside) = match self.config.action_placement {
            ActionPlacement::OutsideSelection => (Vector6::zeros(), action),
            ActionPlacement::InsideSelection => (action, Vector6::zeros()),
        };
        let opposite = selection.map(|s| 1.0 - s);
        Twist::from(selection.component_mul(&(position + inside)) + outside + opposite.component_mul(&force))
    }

    fn command_refused(&mut self) {
        self.integral = self.integral_before;
        self.derivative.undo();
    }

    fn reset(&mut self) {
        self.integral.fill(0.0);
        self.integral_before.fill(0.0);
        self.derivative = Derivative::default();
    }
}
