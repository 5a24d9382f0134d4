//! The low-pass filter of the force/torque signal.

use std::f64::consts::{PI, SQRT_2};

use palpate_spatial::{Vector6, Wrench};

/// Second-order Butterworth low-pass on six components.
///
/// y = b₀x + b₁x₁ + b₂x₂ − a₁y₁ − a₂y₂, by the bilinear transform of ω²/(s² + √2ωs + ω²), pre-warped so
/// that the gain at the cut-off is exactly −3 dB: |H(f)|² = 1 / (1 + (tan(πf/f_s) / tan(πf_c/f_s))⁴).
/// The paper names "a simple low-pass filter"; the authors' code uses this one at 2.5 Hz.
///
/// A sample that is not finite stays in the filter until [`reset_to`](Self::reset_to): drop it before.
#[derive(Clone, Debug)]
pub struct LowPass {
    b: [f64; 3],
    a: [f64; 2],
    /// Transposed direct form II.
    state: [Vector6; 2],
}

impl LowPass {
    /// A filter at rest. `cutoff` and `sample_rate` in Hz, 0 < cutoff < sample_rate/2.
    ///
    /// Any other cut-off has no such filter; its output is NaN then, which every check downstream
    /// refuses.
    pub fn new(cutoff: f64, sample_rate: f64) -> Self {
        let possible = cutoff > 0.0 && cutoff < 0.5 * sample_rate;
        let k = if possible { (PI * cutoff / sample_rate).tan() } else { f64::NAN };
        let norm = 1.0 / (1.0 + SQRT_2 * k + k * k);
        let b0 = k * k * norm;
        Self {
            b: [b0, 2.0 * b0, b0],
            a: [2.0 * (k * k - 1.0) * norm, (1.0 - SQRT_2 * k + k * k) * norm],
            state: [Vector6::zeros(); 2],
        }
    }

    /// Takes in a sample, gives the filtered one.
    pub fn update(&mut self, sample: &Wrench) -> Wrench {
        let x = sample.vector();
        let y = x * self.b[0] + self.state[0];
        self.state[0] = x * self.b[1] - y * self.a[0] + self.state[1];
        self.state[1] = x * self.b[2] - y * self.a[1];
        Wrench::from(y)
    }

    /// Settles the filter as if `value` had been there for ever.
    pub fn reset_to(&mut self, value: &Wrench) {
        let v = value.vector();
        self.state[1] = v * (self.b[2] - self.a[1]);
        self.state[0] = v * (self.b[1] - self.a[0]) + self.state[1];
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use approx::assert_abs_diff_eq;
    use palpate_spatial::Vector3;

    fn along_x(x: f64) -> Wrench {
        Wrench::new(Vector3::new(x, 0.0, 0.0), Vector3::zeros())
    }

    #[test]
    fn coefficients_are_butterworths() {
        // scipy.signal.butter(2, 2.5, fs=500)
        let f = LowPass::new(2.5, 500.0);
        assert_abs_diff_eq!(f.b[0], 2.4136e-4, epsilon = 1e-8);
        assert_abs_diff_eq!(f.b[1], 4.8272e-4, epsilon = 1e-8);
        assert_abs_diff_eq!(f.b[2], 2.4136e-4, epsilon = 1e-8);
        assert_abs_diff_eq!(f.a[0], -1.955_578, epsilon = 1e-6);
        assert_abs_diff_eq!(f.a[1], 0.956_544, epsilon = 1e-6);
    }

    #[test]
    fn gain_follows_the_closed_form_and_is_minus_3_db_at_the_cutoff() {
        // The amplitude by correlation with sine and cosine over whole periods.
        let gain = |cutoff: f64, hz: f64| {
            let mut f = LowPass::new(cutoff, 500.0);
            let (mut re, mut im) = (0.0, 0.0);
            for n in 0..20_000 {
                let phase = std::f64::consts::TAU * hz * f64::from(n) / 500.0;
                let y = f.update(&along_x(phase.cos())).force.x;
                if n >= 10_000 {
                    re += y * phase.cos() / 5000.0;
                    im += y * phase.sin() / 5000.0;
                }
            }
            re.hypot(im)
        };
        assert_abs_diff_eq!(gain(2.5, 2.5), 0.5f64.sqrt(), epsilon = 1e-9);
        assert_abs_diff_eq!(gain(50.0, 50.0), 0.5f64.sqrt(), epsilon = 1e-9);
        for hz in [1.0, 10.0, 30.0, 80.0, 150.0, 240.0] {
            let ratio = (PI * hz / 500.0).tan() / (PI * 50.0 / 500.0).tan();
            assert_abs_diff_eq!(gain(50.0, hz), 1.0 / (1.0 + ratio.powi(4)).sqrt(), epsilon = 1e-9);
        }
    }

    #[test]
    fn a_step_overshoots_by_4_3_percent() {
        // e^(−π·ζ/√(1−ζ²)) = e^(−π) at ζ = √½.
        let mut f = LowPass::new(2.5, 500.0);
        let y: Vec<f64> = (0..1000).map(|_| f.update(&along_x(1.0)).force.x).collect();
        let peak = y.iter().copied().fold(0.0, f64::max);
        assert_abs_diff_eq!(peak - 1.0, (-PI).exp(), epsilon = 1e-4);
        assert_abs_diff_eq!(y[999], 1.0, epsilon = 1e-6);
        // The delay that stiff contact suffers from: half of the step after 92 ms.
        let half = y.iter().position(|&y| y > 0.5).unwrap();
        assert!((45..=47).contains(&half), "{half}");
    }

    #[test]
    fn six_components_stay_apart_and_a_settled_filter_stays_settled() {
        let value = Wrench::new(Vector3::new(3.0, -2.0, 7.0), Vector3::new(0.1, 0.2, -0.3));
        let mut f = LowPass::new(10.0, 500.0);
        f.reset_to(&value);
        for _ in 0..100 {
            assert!((f.update(&value).vector() - value.vector()).norm() < 1e-12);
        }
    }

    #[test]
    fn a_cutoff_without_a_filter_gives_no_number() {
        for cutoff in [0.0, -1.0, 250.0, 300.0, f64::NAN, f64::INFINITY] {
            assert!(!LowPass::new(cutoff, 500.0).update(&along_x(1.0)).is_finite(), "{cutoff}");
        }
    }
}
