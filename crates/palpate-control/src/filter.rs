//! The low-pass filter of the force/torque signal.

use palpate_spatial::{Vector6, Wrench};

/// Second-order Butterworth low-pass on six components (bilinear transform, pre-warped).
#[derive(Clone, Debug)]
pub struct LowPass {
    b: [f64; 3],
    a: [f64; 2],
    /// Transposed direct form II.
    state: [Vector6; 2],
}

impl LowPass {
    /// A filter at rest. `cutoff` and `sample_rate` in Hz, 0 < cutoff < sample_rate/2.
    pub fn new(cutoff: f64, sample_rate: f64) -> Self {
        let k = (std::f64::consts::PI * cutoff / sample_rate).tan();
        let norm = 1.0 / (1.0 + std::f64::consts::SQRT_2 * k + k * k);
        let b0 = k * k * norm;
        Self {
            b: [b0, 2.0 * b0, b0],
            a: [2.0 * (k * k - 1.0) * norm, (1.0 - std::f64::consts::SQRT_2 * k + k * k) * norm],
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

    #[test]
    fn coefficients_are_butterworths() {
        // scipy.signal.butter(2, 2.5, fs=500)
        let f = LowPass::new(2.5, 500.0);
        assert_abs_diff_eq!(f.b[0], 2.4136e-4, epsilon = 1e-8);
        assert_abs_diff_eq!(f.b[1], 4.8272e-4, epsilon = 1e-8);
        assert_abs_diff_eq!(f.a[0], -1.955_578, epsilon = 1e-6);
        assert_abs_diff_eq!(f.a[1], 0.956_544, epsilon = 1e-6);
    }

    #[test]
    fn passes_dc_and_halves_the_power_at_the_cutoff() {
        let gain = |hz: f64| {
            let mut f = LowPass::new(50.0, 500.0);
            let mut peak: f64 = 0.0;
            for n in 0..5000 {
                let x = (std::f64::consts::TAU * hz * f64::from(n) / 500.0).cos();
                let y = f.update(&Wrench::new(Vector3::new(x, 0.0, 0.0), Vector3::zeros()));
                if n > 2500 {
                    peak = peak.max(y.force.x.abs());
                }
            }
            peak
        };
        assert_abs_diff_eq!(gain(0.0), 1.0, epsilon = 1e-9);
        // 49.9 Hz so that the samples sweep over the peaks.
        assert_abs_diff_eq!(gain(49.9), std::f64::consts::FRAC_1_SQRT_2, epsilon = 2e-3);
        assert!(gain(200.0) < 0.02);
    }

    #[test]
    fn a_settled_filter_stays_settled() {
        let value = Wrench::new(Vector3::new(3.0, -2.0, 7.0), Vector3::new(0.1, 0.2, -0.3));
        let mut f = LowPass::new(10.0, 500.0);
        f.reset_to(&value);
        for _ in 0..100 {
            assert!((f.update(&value).vector() - value.vector()).norm() < 1e-12);
        }
    }
}
