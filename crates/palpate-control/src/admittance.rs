//! Admittance control (Sect. III-D.2, eqs. 2–4).

use palpate_spatial::{Twist, Vector6};

use crate::config::{AdmittanceConfig, AdmittanceOutput};
use crate::derivative::Derivative;
use crate::law::{AdmittanceGains, ControlError, ControlInput, ForceController, Gains, Law};

/// F_ext = m_d·ẍ + b_d·ẋ + k_d·x with b_d = 2ζ√(k_d·m_d), beside a PD nominal trajectory:
/// u = K_p^x·x_e + K_d^x·ẋ_e + a_x + (ẋ or x).
///
/// # Discretisation
/// Backward Euler: v⁺ = (m·v + dt·(F − k·x)) / (m + b·dt + k·dt²), x⁺ = x + dt·v⁺. Stable for every
/// m, b, k > 0 and every dt, which the paper's values need: √(k_d/m_d) = 55 rad/s at k_d = 300 and
/// m_d = 0.1. (The printed transfer function has ω_n where ω_n² is meant; the differential equation rules.)
///
/// A change of k_d keeps x and ẋ, so nothing jumps; the model then relaxes to its new equilibrium.
#[derive(Clone, Debug)]
pub struct AdmittanceController {
    config: AdmittanceConfig,
    gains: AdmittanceGains,
    state: Model,
    state_before: Model,
    derivative: Derivative,
}

/// x and ẋ of the mass-spring-damper.
#[derive(Clone, Copy, Debug, Default)]
struct Model {
    x: Vector6,
    v: Vector6,
}

impl AdmittanceController {
    /// A law at rest. Unit stiffness until gains are set.
    pub fn new(config: &AdmittanceConfig) -> Self {
        Self {
            config: config.clone(),
            gains: AdmittanceGains { kp_x: Vector6::zeros(), stiffness: Vector6::repeat(1.0) },
            state: Model::default(),
            state_before: Model::default(),
            derivative: Derivative::default(),
        }
    }

    fn step(&mut self, force: &Vector6, dt: f64) {
        let m = self.config.inertia;
        for axis in 0..6 {
            let k = self.gains.stiffness[axis];
            let b = 2.0 * self.config.damping_ratio * (k * m).sqrt();
            let (x, v) = (self.state.x[axis], self.state.v[axis]);
            let v = (m * v + dt * (force[axis] - k * x)) / (m + b * dt + k * dt * dt);
            self.state.v[axis] = v;
            self.state.x[axis] = x + dt * v;
        }
    }
}

impl ForceController for AdmittanceController {
    fn set_gains(&mut self, gains: &Gains) -> Result<(), ControlError> {
        match gains {
            Gains::Admittance(gains) => self.gains = *gains,
            Gains::Parallel(_) => return Err(ControlError::WrongLaw(Law::Admittance)),
        }
        Ok(())
    }

    fn update(&mut self, input: &ControlInput, dt: f64) -> Twist {
        let kp_x = self.gains.kp_x;
        let rate = self.derivative.update(&input.pose_error, dt);
        let kd_x = kp_x.map(|kp| self.config.derivative_rule.derivative_gain(kp));
        self.state_before = self.state;
        self.step(&input.wrench.vector(), dt);
        let compliance = match self.config.output {
            AdmittanceOutput::Displacement => self.state.v,
            AdmittanceOutput::Velocity => self.state.x,
        };
        let nominal = kp_x.component_mul(&input.pose_error) + kd_x.component_mul(&rate) + input.action.vector();
        Twist::from(nominal + compliance)
    }

    fn command_refused(&mut self) {
        self.state = self.state_before;
        self.derivative.undo();
    }

    fn reset(&mut self) {
        self.state = Model::default();
        self.state_before = Model::default();
        self.derivative = Derivative::default();
    }
}
