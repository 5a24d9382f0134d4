//! How stiff a contact each law stands as it runs: sampled, behind its filter and the arm's servo.

use nalgebra::Complex;

use crate::config::{AdmittanceOutput, ControlConfig};
use crate::law::{AdmittanceGains, Gains, ParallelGains};
use crate::oscillator::Oscillator;

/// What stands between a law and the force it reads.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ForceLoop {
    /// Cut-off of the force filter ([`LowPass`](crate::LowPass)), Hz.
    pub cutoff: f64,
    /// First-order lag of the arm's servo, s; 0 where the arm follows at once.
    pub servo_lag: f64,
    /// Whether every command starts from the measured pose, as the paper's authors do, and not from the last
    /// command. Behind a servo lag the arm then goes only a part of each way, and the loop is as much slower.
    pub rebased: bool,
    /// Period of the control loop, s.
    pub period: f64,
}

/// Angles e^(jθ) between which a crossing is looked for.
const STEPS: u32 = 1500;

impl ForceLoop {
    /// Stiffest contact of one axis, N/m (N·m/rad): a bilateral spring at which the sampled loop, linear,
    /// neither settles nor diverges. NaN where there is no such loop.
    ///
    /// Nothing is left out: the filter as it is sampled, PD, integral and model of the law, commands
    /// integrated to a set-point, a servo that follows it by 1 − e^(−period/lag) of the distance per tick.
    /// The closed forms ([`ParallelConfig::contact_limit`](crate::ParallelConfig::contact_limit)) are
    /// what remains without lag and with a period of zero.
    ///
    /// With P(z) from twist to pose, C_x(z) and C_F(z) from pose and force to twist and H(z) the filter, the
    /// loop is on the edge of stability where 1 + P·C_x + k·P·C_F·H = 0 on the unit circle. That k is real
    /// only at crossings; the least positive one is the limit.
    pub fn contact_limit(&self, control: &ControlConfig, gains: &Gains, axis: usize) -> f64 {
        let Self { cutoff, servo_lag, period, .. } = *self;
        if !(cutoff > 0.0 && cutoff < 0.5 / period && servo_lag >= 0.0 && period > 0.0) {
            return f64::NAN;
        }
        let law = Axis::new(control, gains, axis, period);
        if law.is_deaf() {
            return f64::INFINITY;
        }
        let stiffness = |angle: f64| {
            let z = Complex::from_polar(1.0, angle);
            let pose = self.pose(z);
            -(pose * law.pose_gain(z) + 1.0) / (pose * law.force_gain(z) * self.filter(angle))
        };
        // Logarithmic from far below any loop's bandwidth to just below half the sampling rate.
        let (first, last) = (1e-6f64, std::f64::consts::PI * (1.0 - 1e-9));
        let angle = |step: u32| first * (last / first).powf(f64::from(step) / f64::from(STEPS));
        let mut least = f64::INFINITY;
        for step in 0..STEPS {
            let (mut low, mut high) = (angle(step), angle(step + 1));
            let side = stiffness(low).im > 0.0;
            if side == (stiffness(high).im > 0.0) {
                continue;
            }
            for _ in 0..50 {
                let middle = 0.5 * (low + high);
                if (stiffness(middle).im > 0.0) == side { low = middle } else { high = middle }
            }
            let k = stiffness(low).re;
            if k > 0.0 && k < least {
                least = k;
            }
        }
        least
    }

    /// From twist to pose: the integrated set-point, then the servo; or the servo's part of every way.
    fn pose(&self, z: Complex<f64>) -> Complex<f64> {
        let follow =
            if self.servo_lag > 0.0 { -(-self.period / self.servo_lag).exp_m1() } else { 1.0 };
        let way = (z - 1.0).inv() * (self.period * follow);
        if self.rebased { way } else { way * z / (z - (1.0 - follow)) }
    }

    /// The bilinear transform puts the analog filter's frequency at tan(θ/2).
    fn filter(&self, angle: f64) -> Complex<f64> {
        let ratio = (0.5 * angle).tan() / (std::f64::consts::PI * self.cutoff * self.period).tan();
        Complex::new(1.0 - ratio * ratio, std::f64::consts::SQRT_2 * ratio).inv()
    }
}

/// One axis of a law: how pose and force make its twist.
struct Axis {
    period: f64,
    /// S·K_p^x and S·K_d^x; the latter per second of backward difference.
    kp: f64,
    kd: f64,
    force: Force,
}

enum Force {
    /// (1−S)·K_p^f, and K_i^f/K_p^f.
    Proportional {
        gain: f64,
        integral_ratio: f64,
    },
    Model {
        model: Oscillator,
        output: AdmittanceOutput,
    },
}

impl Axis {
    fn new(control: &ControlConfig, gains: &Gains, axis: usize, period: f64) -> Self {
        let (kp, selection, rule, force) = match gains {
            Gains::Parallel(ParallelGains { kp_x, kp_f, selection }) => {
                let config = &control.parallel;
                let s = selection[axis];
                let gain = (1.0 - s) * kp_f[axis];
                let force = Force::Proportional { gain, integral_ratio: config.integral_ratio };
                (kp_x[axis], s, config.derivative_rule, force)
            }
            Gains::Admittance(AdmittanceGains { kp_x, stiffness }) => {
                let config = &control.admittance;
                let model =
                    Oscillator::new(config.inertia, config.damping_ratio, stiffness[axis], period);
                let force = Force::Model { model, output: config.output };
                (kp_x[axis], 1.0, config.derivative_rule, force)
            }
        };
        // A rotation by θ moves x_e = sin(θ/2) by θ/2.
        let share = selection * if axis < 3 { 1.0 } else { 0.5 };
        let kd = rule.derivative_gain(kp, axis);
        Self { period, kp: share * kp, kd: share * kd / period, force }
    }

    /// No force moves it.
    fn is_deaf(&self) -> bool {
        matches!(self.force, Force::Proportional { gain: 0.0, .. })
    }

    fn pose_gain(&self, z: Complex<f64>) -> Complex<f64> {
        -z.inv() * self.kd + (self.kp + self.kd)
    }

    fn force_gain(&self, z: Complex<f64>) -> Complex<f64> {
        match &self.force {
            Force::Proportional { gain, integral_ratio } => {
                (z / (z - 1.0) * (integral_ratio * self.period) + 1.0) * *gain
            }
            Force::Model { model, output: AdmittanceOutput::Velocity } => model.response(z),
            Force::Model { model, output: AdmittanceOutput::Displacement } => {
                model.response(z) * (-z.inv() + 1.0) / self.period
            }
        }
    }
}
