//! Admittance control (Sect. III-D.2, eqs. 2–4).

use palpate_spatial::{Twist, Vector6};

use crate::config::{AdmittanceConfig, AdmittanceOutput};
use crate::error::ControlError;
use crate::law::{ControlInput, ForceController, Gains, Law};
use crate::oscillator::{Oscillator, State};
use crate::pd::PositionPd;

/// F_ext = m_d·ẍ + b_d·ẋ + k_d·x with b_d = 2ζ√(k_d·m_d), on top of the nominal trajectory:
/// u = K_p^x·x_e + K_d^x·ẋ_e + a_x + (Δx/dt or x), by [`AdmittanceOutput`].
///
/// # Discretisation
/// Exact for a force that is held over the tick (zero-order hold): stable for every m_d, b_d, k_d > 0
/// and every dt, and the sampled step response is the analytic one. The printed transfer function
/// X/F = (1/m_d) / (s² + 2ζω_n·s + ω_n) has ω_n where ω_n² is meant; the differential equation rules.
///
/// # Gain changes
/// A change of k_d keeps x and ẋ. The velocity output therefore does not jump at all, the displacement
/// output only in acceleration; the model then relaxes to its new equilibrium F/k_d. Raising k_d by
/// Δk while x ≠ 0 adds ½·Δk·x² to the model's energy, as any variable admittance does.
///
/// # Contact
/// With the velocity output a spring k is stable while k < 2ζω_n·k_d, less what the force filter
/// takes: [`AdmittanceConfig::contact_limit`].
#[derive(Clone, Debug)]
pub struct AdmittanceController {
    config: AdmittanceConfig,
    stiffness: Vector6,
    position: PositionPd,
    /// One per axis, for the dt beside them; rebuilt when k_d or dt changes.
    models: [Oscillator; 6],
    models_dt: Option<f64>,
    state: [State; 6],
    state_before: [State; 6],
}

impl AdmittanceController {
    /// A law at rest. Unit stiffness and no position control until gains are set.
    pub fn new(config: &AdmittanceConfig) -> Self {
        Self {
            config: config.clone(),
            stiffness: Vector6::repeat(1.0),
            position: PositionPd::new(config.derivative_rule),
            models: [Oscillator::default(); 6],
            models_dt: None,
            state: [State::default(); 6],
            state_before: [State::default(); 6],
        }
    }

    /// Exponentials only where something changed: a policy moves k_d at 20 Hz, ticks come at 500 Hz.
    fn prepare(&mut self, dt: f64) {
        if self.models_dt != Some(dt) {
            let AdmittanceConfig { inertia, damping_ratio, .. } = self.config;
            self.models = std::array::from_fn(|axis| {
                Oscillator::new(inertia, damping_ratio, self.stiffness[axis], dt)
            });
            self.models_dt = Some(dt);
        }
    }
}

impl ForceController for AdmittanceController {
    fn set_gains(&mut self, gains: &Gains) -> Result<(), ControlError> {
        let Gains::Admittance(gains) = gains else {
            return Err(ControlError::WrongLaw(Law::Admittance));
        };
        gains.check()?;
        self.position.set(&gains.kp_x);
        self.stiffness = gains.stiffness;
        self.models_dt = None;
        Ok(())
    }

    fn update(&mut self, input: &ControlInput, dt: f64) -> Twist {
        self.prepare(dt);
        let nominal = self.position.update(&input.pose_error, dt) + input.action.vector();
        let force = input.wrench.vector();
        self.state_before = self.state;
        let compliance = Vector6::from_fn(|axis, _| {
            let before = self.state[axis];
            let after = self.models[axis].step(before, force[axis]);
            self.state[axis] = after;
            match self.config.output {
                // The mean velocity of the tick, not its last: the integrated pose then carries exactly x.
                AdmittanceOutput::Displacement => (after.x - before.x) / dt,
                AdmittanceOutput::Velocity => after.x,
            }
        });
        Twist::from(nominal + compliance)
    }

    fn command_refused(&mut self) {
        self.state = self.state_before;
        self.position.undo();
    }

    fn reset(&mut self) {
        self.state = [State::default(); 6];
        self.state_before = self.state;
        self.position.reset();
    }
}
