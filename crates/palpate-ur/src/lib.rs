//! Universal Robots arms.

mod arm;
mod config;
pub mod dashboard;
mod error;
mod link;
mod model;
pub mod proto;
mod realtime;
pub mod registers;
mod sample;
mod script;

pub use arm::{LinkStats, Operator, UrArm};
pub use config::{ForcePoint, Payload, Ports, UrConfig};
pub use error::UrError;
pub use link::RtdeClient;
pub use model::{ModelError, model_error};
pub use realtime::{Realtime, realtime};
pub use sample::{Report, Sample, pose};
pub use script::{TEMPLATE, Upload, control_program};
