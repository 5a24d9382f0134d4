//! One axis of an arm that presses a tool against a surface.

use palpate_control::{
    ControlConfig, ControlError, ControlInput, Controller, ForceController, ForceLoop, Gains, Law,
    LowPass,
};
use palpate_spatial::{Twist, Vector6, Wrench};

/// The goal lies this far behind the surface, the start this far before it, m.
pub(crate) const GOAL: f64 = 0.010;
const START: f64 = -0.002;

/// The surface, and what stands between law and force.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Press {
    /// Of tool, sensor and surface in series, N/m.
    pub(crate) stiffness: f64,
    /// N s/m.
    pub(crate) damping: f64,
    pub(crate) force_loop: ForceLoop,
}

/// The last second of a press.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Outcome {
    /// Greatest less least contact force, by the mean: 0 at rest, about 2 and more where contact opens,
    /// infinite where the tool flies all the time.
    pub(crate) swing: f64,
    /// Whether the tool leaves the surface.
    pub(crate) opens: bool,
    /// Greatest contact force, N.
    pub(crate) peak: f64,
}

impl Outcome {
    /// A press at rest drifts by a few per cent a second while the integral winds.
    pub(crate) fn is_limit_cycle(&self) -> bool {
        self.swing.is_nan() || self.swing >= 0.1
    }
}

impl Press {
    /// Runs for `seconds`; `action` m/s is the policy's motion towards the surface.
    pub(crate) fn run(
        &self,
        control: &ControlConfig,
        gains: &Gains,
        action: f64,
        seconds: f64,
    ) -> Result<Outcome, ControlError> {
        let law = match gains {
            Gains::Parallel(_) => Law::Parallel,
            Gains::Admittance(_) => Law::Admittance,
        };
        let mut law = Controller::new(control, law)?;
        law.set_gains(gains)?;
        let ForceLoop { cutoff, servo_lag, rebased, period } = self.force_loop;
        let mut filter = LowPass::new(cutoff, 1.0 / period);
        let follow = if servo_lag > 0.0 { -(-period / servo_lag).exp_m1() } else { 1.0 };
        // Along z: the tool moves towards the surface, the surface pushes back.
        let along = |x: f64| Vector6::new(0.0, 0.0, x, 0.0, 0.0, 0.0);

        let (mut set_point, mut depth, mut rate) = (START, START, 0.0);
        let (mut least, mut greatest, mut sum) = (f64::INFINITY, 0.0f64, 0.0);
        let ticks = (seconds / period).round() as usize;
        let last = (1.0 / period).round() as usize;
        for tick in 0..ticks {
            // A damper does not pull: the tool lets go.
            let contact = self.stiffness * depth + self.damping * rate;
            let force = if depth > 0.0 { contact.max(0.0) } else { 0.0 };
            if tick + last >= ticks {
                (least, greatest, sum) = (least.min(force), greatest.max(force), sum + force);
            }
            let wrench = filter.update(&Wrench::from(along(-force)));
            let pose_error = along(GOAL - depth);
            let input = ControlInput { pose_error, wrench, action: Twist::from(along(action)) };
            if rebased {
                set_point = depth;
            }
            set_point += law.update(&input, period).linear.z * period;
            let step = (set_point - depth) * follow;
            (depth, rate) = (depth + step, step / period);
        }
        let mean = sum / last as f64;
        let swing = if mean > 0.0 { (greatest - least) / mean } else { f64::INFINITY };
        Ok(Outcome { swing, opens: least == 0.0, peak: greatest })
    }

    /// Stiffest surface, N/m, on which the press comes to rest: by bisection between 10² and 10⁷.
    pub(crate) fn measured_limit(
        &self,
        control: &ControlConfig,
        gains: &Gains,
    ) -> Result<f64, ControlError> {
        bisect(2.0, 7.0, |exponent| {
            let press = Self { stiffness: 10f64.powf(exponent), ..*self };
            Ok(!press.run(control, gains, 0.0, 20.0)?.is_limit_cycle())
        })
        .map(|exponent| 10f64.powf(exponent))
    }
}

/// Where `holds` ends between `yes` and `no`.
pub(crate) fn bisect(
    mut yes: f64,
    mut no: f64,
    holds: impl Fn(f64) -> Result<bool, ControlError>,
) -> Result<f64, ControlError> {
    for _ in 0..16 {
        let middle = 0.5 * (yes + no);
        if holds(middle)? { yes = middle } else { no = middle }
    }
    Ok(yes)
}
