//! Either law behind one type, its output bounded.

use palpate_spatial::Twist;

use crate::admittance::AdmittanceController;
use crate::config::ControlConfig;
use crate::error::ControlError;
use crate::law::{ControlInput, ForceController, Gains, Law};
use crate::parallel::ParallelController;

/// The configured law, with the speed bounds of [`ControlConfig`].
///
/// A twist beyond a bound keeps its direction. The bound is no refusal: what the law integrated in
/// that tick stays, and [`ParallelConfig::integral_limit`](crate::ParallelConfig) keeps it small.
#[derive(Clone, Debug)]
pub struct Controller {
    law: Either,
    max_linear: f64,
    max_angular: f64,
}

#[derive(Clone, Debug)]
#[expect(clippy::large_enum_variant, reason = "one per arm, and no heap beneath the control loop")]
enum Either {
    Parallel(ParallelController),
    Admittance(AdmittanceController),
}

impl Controller {
    /// Builds the law of a family.
    ///
    /// # Errors
    /// A setting that makes no sense, by name.
    pub fn new(config: &ControlConfig, law: Law) -> Result<Self, ControlError> {
        config.validate()?;
        let law = match law {
            Law::Parallel => Either::Parallel(ParallelController::new(&config.parallel)),
            Law::Admittance => Either::Admittance(AdmittanceController::new(&config.admittance)),
        };
        Ok(Self { law, max_linear: config.max_linear_speed, max_angular: config.max_angular_speed })
    }
}

impl ForceController for Controller {
    fn set_gains(&mut self, gains: &Gains) -> Result<(), ControlError> {
        match &mut self.law {
            Either::Parallel(law) => law.set_gains(gains),
            Either::Admittance(law) => law.set_gains(gains),
        }
    }

    fn update(&mut self, input: &ControlInput, dt: f64) -> Twist {
        let twist = match &mut self.law {
            Either::Parallel(law) => law.update(input, dt),
            Either::Admittance(law) => law.update(input, dt),
        };
        twist.limited(self.max_linear, self.max_angular)
    }

    fn command_refused(&mut self) {
        match &mut self.law {
            Either::Parallel(law) => law.command_refused(),
            Either::Admittance(law) => law.command_refused(),
        }
    }

    fn reset(&mut self) {
        match &mut self.law {
            Either::Parallel(law) => law.reset(),
            Either::Admittance(law) => law.reset(),
        }
    }
}
