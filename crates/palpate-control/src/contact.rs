//! How stiff a contact each law stands, in closed form.
//!
//! One axis, a bilateral spring k, an arm that follows its command at once, continuous time: what each
//! parameter does. Sampling and a servo lag lower these limits, by a factor of 2 to 4 at 500 Hz, 50 Hz and
//! 10 ms: [`ForceLoop`](crate::ForceLoop) has the number for a loop as it runs. Contact that opens and
//! closes turns divergence into a limit cycle.

use std::f64::consts::{SQRT_2, TAU};

use crate::config::{AdmittanceConfig, AdmittanceOutput, ParallelConfig};

impl ParallelConfig {
    /// Stiffest contact, N/m (N·m/rad), for the gains of one axis and a Butterworth force filter of
    /// `cutoff` Hz.
    ///
    /// (1−S)·K_p^f·k < √2·ω + 2a + √2·a²/ω with ω = 2π·cutoff, a = S·K_p^x: Routh's criterion on
    /// (s + a)(s² + √2ωs + ω²) + (1−S)·K_p^f·k·ω². K_d and the integral are left out; the former raises
    /// the limit, the latter lowers it, both by little.
    pub fn contact_limit(&self, kp_x: f64, kp_f: f64, selection: f64, cutoff: f64) -> f64 {
        let w = TAU * cutoff;
        let a = selection * kp_x;
        (SQRT_2 * w + 2.0 * a + SQRT_2 * a * a / w) / ((1.0 - selection) * kp_f)
    }
}

impl AdmittanceConfig {
    /// Stiffest contact, N/m (N·m/rad), for the stiffness k_d of one axis and a Butterworth force
    /// filter of `cutoff` Hz. The nominal PD is left out; it raises the limit of the velocity output.
    ///
    /// The loop crosses −180° where the model's phase lag φ₁ and the filter's φ₂ add up to 90°
    /// (velocity output, whose pose is one more integrator) or to 180° (displacement output); the limit is
    /// the k whose loop gain is one there. Without a filter: 2ζω_n·k_d, and none.
    pub fn contact_limit(&self, stiffness: f64, cutoff: f64) -> f64 {
        let filter = Lag { natural: TAU * cutoff, damping_ratio: 0.5 * SQRT_2 };
        let model =
            Lag { natural: (stiffness / self.inertia).sqrt(), damping_ratio: self.damping_ratio };
        // tan φ = 2ζω_n·w / (ω_n² − w²)
        let (n1, n2) = (model.natural, filter.natural);
        let (d1, d2) = (2.0 * model.damping_ratio * n1, 2.0 * filter.damping_ratio * n2);
        match self.output {
            AdmittanceOutput::Velocity => {
                // tan φ₁·tan φ₂ = 1, a quadratic in w²; the smaller root lies below both ω_n.
                let half = 0.5 * (n1 * n1 + n2 * n2 + d1 * d2);
                let w2 = n1 * n1 * n2 * n2 / (half + (half * half - n1 * n1 * n2 * n2).sqrt());
                stiffness * w2.sqrt() / (model.gain(w2) * filter.gain(w2))
            }
            AdmittanceOutput::Displacement => {
                // tan φ₁ = −tan φ₂
                let w2 = (d1 * n2 * n2 + d2 * n1 * n1) / (d1 + d2);
                stiffness / (model.gain(w2) * filter.gain(w2))
            }
        }
    }
}

/// ω_n² / (s² + 2ζω_n·s + ω_n²)
struct Lag {
    natural: f64,
    damping_ratio: f64,
}

impl Lag {
    /// Gain at s = jw.
    fn gain(&self, w2: f64) -> f64 {
        let n2 = self.natural * self.natural;
        n2 / (n2 - w2).hypot(2.0 * self.damping_ratio * self.natural * w2.sqrt())
    }
}
