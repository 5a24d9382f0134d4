//! Parallel position/force control with a selection matrix (Sect. III-D.1, eq. 1).

use palpate_spatial::{Twist, Vector6};

use crate::config::{ActionPlacement, ParallelConfig};
use crate::error::ControlError;
use crate::law::{ControlInput, ForceController, Gains, Law, ParallelGains};
use crate::pd::PositionPd;

/// u = S·(K_p^x·x_e + K_d^x·ẋ_e) + a_x + (I−S)·(K_p^f·F_ext + K_i^f·∫F_ext dt)
///
/// K_d^x follows from K_p^x by a [`DerivativeRule`](crate::DerivativeRule); K_i^f is a fixed part of
/// K_p^f. u is a twist: the paper's "driving generalised forces" of a position-controlled arm.
///
/// # Contact
/// Against a spring k the force loop is stable while (1−S)·K_p^f·k stays below a bound that the force
/// filter sets: [`ParallelConfig::contact_limit`].
#[derive(Clone, Debug)]
pub struct ParallelController {
    config: ParallelConfig,
    kp_f: Vector6,
    selection: Vector6,
    position: PositionPd,
    /// K_i^f·∫F_ext dt in output units, so that a change of K_p^f does not make it jump.
    integral: Vector6,
    integral_before: Vector6,
}

impl ParallelController {
    /// A law at rest, with zero gains.
    pub fn new(config: &ParallelConfig) -> Self {
        let ParallelGains { kp_f, selection, .. } = ParallelGains::ZERO;
        Self {
            config: config.clone(),
            kp_f,
            selection,
            position: PositionPd::new(config.derivative_rule),
            integral: Vector6::zeros(),
            integral_before: Vector6::zeros(),
        }
    }
}

impl ForceController for ParallelController {
    fn set_gains(&mut self, gains: &Gains) -> Result<(), ControlError> {
        let Gains::Parallel(gains) = gains else {
            return Err(ControlError::WrongLaw(Law::Parallel));
        };
        gains.check()?;
        self.position.set(&gains.kp_x);
        self.kp_f = gains.kp_f;
        self.selection = gains.selection;
        Ok(())
    }

    fn update(&mut self, input: &ControlInput, dt: f64) -> Twist {
        let position = self.position.update(&input.pose_error, dt);

        // PI on force. The rectangle rule integrates K_i·F, not F: see `integral`.
        let proportional = self.kp_f.component_mul(&input.wrench.vector());
        let limit = self.config.integral_limit;
        self.integral_before = self.integral;
        self.integral += proportional * (self.config.integral_ratio * dt);
        self.integral = self.integral.map(|x| x.clamp(-limit, limit));
        let force = proportional + self.integral;

        let action = input.action.vector();
        let (inside, outside) = match self.config.action_placement {
            ActionPlacement::OutsideSelection => (Vector6::zeros(), action),
            ActionPlacement::InsideSelection => (action, Vector6::zeros()),
        };
        let (s, opposite) = (self.selection, self.selection.map(|s| 1.0 - s));
        Twist::from(
            s.component_mul(&(position + inside)) + outside + opposite.component_mul(&force),
        )
    }

    fn command_refused(&mut self) {
        self.integral = self.integral_before;
        self.position.undo();
    }

    fn reset(&mut self) {
        self.integral.fill(0.0);
        self.integral_before.fill(0.0);
        self.position.reset();
    }
}
