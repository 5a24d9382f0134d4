//! The force/torque sensor's imperfections, and its tare.

use palpate_spatial::{JointVector, Vector6, Wrench};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};

use crate::config::SensorConfig;

/// Readings whose mean becomes the zero: a tenth of a second at 500 Hz.
const TARE_READINGS: u32 = 50;

/// reading = quantised(load + offset + drift·t + noise) − zero.
#[derive(Debug)]
pub(crate) struct Sensor {
    config: SensorConfig,
    seed: u64,
    rng: ChaCha8Rng,
    /// Set at power-up; N and N·m.
    offset: Vector6,
    /// N/s and N·m/s.
    drift: Vector6,
    /// Since power-up or the last tare, s.
    age: f64,
    zero: Vector6,
}

impl Sensor {
    /// A sensor that has just been switched on, not yet tared.
    pub(crate) fn new(config: &SensorConfig, seed: u64) -> Self {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let offset = draw(&mut rng, config.force_bias, config.torque_bias);
        let drift = draw(&mut rng, config.force_drift, config.torque_drift);
        Self { config: config.clone(), seed, rng, offset, drift, age: 0.0, zero: Vector6::zeros() }
    }

    /// The next reading under `load`, `dt` seconds after the last.
    pub(crate) fn measure(&mut self, load: &Wrench, dt: f64) -> Wrench {
        self.age += dt;
        (self.raw(load) - self.zero).into()
    }

    /// Makes the mean of the next readings under `load` the zero.
    ///
    /// Noise and drift start anew from a stream that the joints `q` choose: what follows a tare depends on
    /// the seed and the place of the tare, and not on the readings before it.
    pub(crate) fn tare(&mut self, load: &Wrench, q: &JointVector) {
        self.rng = ChaCha8Rng::seed_from_u64(self.seed);
        self.rng.set_stream(q.iter().fold(1, |hash: u64, x| hash.rotate_left(9) ^ x.to_bits()));
        self.drift = draw(&mut self.rng, self.config.force_drift, self.config.torque_drift);
        self.age = 0.0;
        let sum = (0..TARE_READINGS).fold(Vector6::zeros(), |sum, _| sum + self.raw(load));
        self.zero = sum / f64::from(TARE_READINGS);
    }

    fn raw(&mut self, load: &Wrench) -> Vector6 {
        let c = &self.config;
        let noise = draw(&mut self.rng, c.force_noise, c.torque_noise);
        let mut reading = load.vector() + self.offset + self.drift * self.age + noise;
        for (axis, value) in reading.iter_mut().enumerate() {
            let quantum = if axis < 3 { c.force_quantum } else { c.torque_quantum };
            if quantum > 0.0 {
                *value = (*value / quantum).round() * quantum;
            }
        }
        reading
    }
}

/// Normal samples of the given standard deviations; none is drawn where both are zero.
fn draw(rng: &mut ChaCha8Rng, force: f64, torque: f64) -> Vector6 {
    if force == 0.0 && torque == 0.0 {
        return Vector6::zeros();
    }
    Vector6::from_fn(|axis, _| {
        let sample: f64 = StandardNormal.sample(rng);
        sample * if axis < 3 { force } else { torque }
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    const DT: f64 = 0.002;

    fn perfect() -> SensorConfig {
        SensorConfig {
            force_noise: 0.0,
            torque_noise: 0.0,
            force_bias: 0.0,
            torque_bias: 0.0,
            force_drift: 0.0,
            torque_drift: 0.0,
            force_quantum: 0.0,
            torque_quantum: 0.0,
        }
    }

    fn load() -> Wrench {
        Vector6::new(1.0, -2.0, 3.0, 0.1, 0.2, -0.3).into()
    }

    /// Mean and standard deviation.
    fn spread(values: impl Iterator<Item = f64> + Clone) -> (f64, f64) {
        let n = values.clone().count() as f64;
        let mean = values.clone().sum::<f64>() / n;
        (mean, (values.map(|x| (x - mean).powi(2)).sum::<f64>() / n).sqrt())
    }

    #[test]
    fn a_perfect_sensor_reads_the_load_and_a_tare_removes_it() {
        let mut sensor = Sensor::new(&perfect(), 1);
        assert_eq!(sensor.measure(&load(), DT), load());
        sensor.tare(&load(), &JointVector::zeros());
        assert!(sensor.measure(&load(), DT).vector().amax() < 1e-15);
        assert!((sensor.measure(&Wrench::zero(), DT) + load()).vector().amax() < 1e-15);
    }

    #[test]
    fn noise_has_the_configured_size() {
        let config = SensorConfig { force_noise: 0.5, torque_noise: 0.02, ..perfect() };
        let mut sensor = Sensor::new(&config, 1);
        let readings: Vec<_> = (0..4000).map(|_| sensor.measure(&load(), DT).vector()).collect();
        for axis in 0..6 {
            let (mean, std) = spread(readings.iter().map(|r| r[axis]));
            let expected = if axis < 3 { 0.5 } else { 0.02 };
            assert!((std / expected - 1.0).abs() < 0.05, "axis {axis}: {std}");
            assert!((mean - load().vector()[axis]).abs() < 4.0 * expected / 4000f64.sqrt());
        }
    }

    #[test]
    fn bias_and_drift_have_the_configured_spread_over_seeds() {
        let config = SensorConfig { force_bias: 4.0, torque_drift: 0.1, ..perfect() };
        let after =
            |seed, seconds: f64| Sensor::new(&config, seed).measure(&Wrench::zero(), seconds);
        let (mean, bias) = spread((0..4000).map(|seed| after(seed, 0.0).force.y));
        assert!((bias / 4.0 - 1.0).abs() < 0.05 && mean.abs() < 0.3, "{mean} ± {bias}");
        let (_, drift) = spread((0..4000).map(|seed| after(seed, 5.0).torque.z));
        assert!((drift / 0.5 - 1.0).abs() < 0.05, "{drift}");
    }

    #[test]
    fn a_tare_leaves_the_error_of_a_mean_and_restarts_the_drift() {
        let config =
            SensorConfig { force_noise: 0.5, force_bias: 4.0, force_drift: 0.2, ..perfect() };
        let zeros = (0..2000u32).map(|i| {
            let mut sensor = Sensor::new(&config, 7);
            sensor.measure(&Wrench::zero(), 100.0);
            sensor.tare(&Wrench::zero(), &JointVector::from_element(f64::from(i)));
            sensor.zero[2] - sensor.offset[2]
        });
        let (_, std) = spread(zeros);
        assert!((std / (0.5 / f64::from(TARE_READINGS).sqrt()) - 1.0).abs() < 0.1, "{std}");
    }

    #[test]
    fn readings_are_multiples_of_the_quantum() {
        let config = SensorConfig { force_noise: 0.5, force_quantum: 0.1, ..perfect() };
        let mut sensor = Sensor::new(&config, 1);
        for _ in 0..100 {
            let counts = sensor.measure(&load(), DT).force.y / 0.1;
            assert!((counts - counts.round()).abs() < 1e-9, "{counts}");
        }
    }
}
