//! Parameters drawn anew for every episode (domain randomisation).

use palpate_spatial::JointVector;
use rand::{Rng as _, SeedableRng as _};
use rand_chacha::ChaCha8Rng;

use crate::SimError;
use crate::config::{ComplianceConfig, SimConfig};

/// Sets the stream of these draws apart from the sensor's.
const SALT: u64 = 0x5EED_0F57_4C1D_0001;

/// Half-widths of uniform draws about the configured values, relative: 0.2 draws from 80 to 120 %. Drawn at every
/// tare in free air, which is at the start of every episode.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SpreadConfig {
    /// Of `friction`.
    pub friction: f64,
    /// Of `hole.clearance`.
    pub clearance: f64,
    /// Of both stiffnesses of `compliance`, by one factor; its damping ratio is kept.
    pub stiffness: f64,
    /// The same of `receptacle.compliance`.
    pub receptacle_stiffness: f64,
    /// Of `servo.lag`.
    pub lag: f64,
    /// Of `servo.dead_time`, which is rounded to control periods.
    pub dead_time: f64,
}

impl SpreadConfig {
    fn all(&self) -> [(&'static str, f64); 6] {
        [
            ("spread.friction", self.friction),
            ("spread.clearance", self.clearance),
            ("spread.stiffness", self.stiffness),
            ("spread.receptacle_stiffness", self.receptacle_stiffness),
            ("spread.lag", self.lag),
            ("spread.dead_time", self.dead_time),
        ]
    }
}

impl SimConfig {
    /// Checks the spreads, and the settings at the corners of what can be drawn.
    pub(crate) fn check_spread(
        &self,
        check: impl Fn(&Self) -> Result<(), SimError>,
    ) -> Result<(), SimError> {
        for (key, value) in self.spread.all() {
            if !(0.0..1.0).contains(&value) {
                let must = "at least 0 and below 1: a part of the configured value".into();
                return Err(SimError::Setting { key, value, must });
            }
        }
        // Only clearance and stiffness have bounds that a draw can break, and they break them apart.
        for end in [-1.0, 1.0] {
            check(&self.scaled(|spread| 1.0 + end * spread))?;
        }
        Ok(())
    }

    /// The settings after a tare at `q`: a function of the seed and of the place, as the sensor's noise is.
    pub(crate) fn drawn(&self, seed: u64, q: &JointVector) -> Self {
        if self.spread.all().iter().all(|(_, spread)| *spread == 0.0) {
            return self.clone();
        }
        let mut rng = ChaCha8Rng::seed_from_u64(seed ^ SALT);
        rng.set_stream(q.iter().fold(1, |hash: u64, x| hash.rotate_left(9) ^ x.to_bits()));
        self.scaled(|spread| 1.0 + spread * rng.random_range(-1.0..=1.0))
    }

    /// Every value times a factor made from its spread.
    fn scaled(&self, mut factor: impl FnMut(f64) -> f64) -> Self {
        let (mut c, s) = (self.clone(), &self.spread);
        c.friction *= factor(s.friction);
        c.hole.clearance *= factor(s.clearance);
        stiffen(&mut c.compliance, factor(s.stiffness));
        let stiffer = factor(s.receptacle_stiffness);
        if let Some(receptacle) = &mut c.receptacle {
            stiffen(&mut receptacle.compliance, stiffer);
        }
        c.servo.lag *= factor(s.lag);
        c.servo.dead_time *= factor(s.dead_time);
        c
    }
}

/// At the same damping ratio.
fn stiffen(compliance: &mut ComplianceConfig, by: f64) {
    compliance.linear_stiffness *= by;
    compliance.angular_stiffness *= by;
    compliance.linear_damping *= by.sqrt();
    compliance.angular_damping *= by.sqrt();
}

#[cfg(test)]
mod tests {
    use super::*;

    fn config(change: impl FnOnce(&mut SpreadConfig)) -> SimConfig {
        let mut config: SimConfig =
            toml::from_str(include_str!("../tests/contact/stiff.toml")).unwrap();
        change(&mut config.spread);
        config
    }

    #[test]
    fn draws_fill_their_range_and_depend_on_seed_and_place_alone() {
        let config = config(|s| (s.friction, s.stiffness) = (0.5, 0.2));
        let at = |i: u32| JointVector::from_element(f64::from(i) * 1e-3);
        let drawn: Vec<_> = (0..2000).map(|i| config.drawn(7, &at(i))).collect();
        assert_eq!(drawn[5], config.drawn(7, &at(5)));
        assert_ne!(drawn[5], config.drawn(8, &at(5)));
        let range = |f: fn(&SimConfig) -> f64| {
            let values = drawn.iter().map(f);
            let of = f(&config);
            (values.clone().fold(f64::MAX, f64::min) / of, values.fold(0.0, f64::max) / of)
        };
        let (low, high) = range(|c| c.friction);
        assert!((0.5..0.51).contains(&low) && (1.49..1.5).contains(&high), "{low} {high}");
        let (low, high) = range(|c| c.compliance.angular_stiffness);
        assert!((0.8..0.81).contains(&low) && (1.19..1.2).contains(&high), "{low} {high}");
        let ratio =
            |c: &SimConfig| c.compliance.linear_damping / c.compliance.linear_stiffness.sqrt();
        assert!((ratio(&drawn[1]) / ratio(&config) - 1.0).abs() < 1e-12);
        assert!(drawn.iter().all(|c| c.hole == config.hole && c.servo == config.servo));
    }

    #[test]
    fn without_spread_nothing_changes() {
        let config = config(|_| {});
        assert_eq!(config.drawn(7, &JointVector::zeros()), config);
    }

    #[test]
    fn what_could_be_drawn_and_does_not_work_is_refused() {
        let refused =
            |change: fn(&mut SpreadConfig)| config(change).validate().unwrap_err().to_string();
        assert!(refused(|s| s.lag = 1.0).contains("spread.lag"));
        assert!(refused(|s| s.friction = -0.1).contains("spread.friction"));
        assert!(refused(|s| s.friction = f64::NAN).contains("spread.friction"));
        let mut stiff = config(|_| {});
        stiff.solver.pgs_iterations = 4;
        stiff.validate().unwrap();
        stiff.spread.stiffness = 0.5;
        assert!(stiff.validate().unwrap_err().to_string().contains("linear_stiffness"));
        assert!(refused(|s| s.clearance = 0.9999).contains("clearance"));
        config(|s| s.friction = 0.99).validate().unwrap();
    }
}
