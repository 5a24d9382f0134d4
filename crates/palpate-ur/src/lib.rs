//! Universal Robots arms.

mod config;
mod error;
mod link;
pub mod proto;
pub mod registers;
mod sample;
mod script;

pub use config::{ForcePoint, Payload, Ports, UrConfig};
pub use error::UrError;
pub use link::RtdeClient;
pub use sample::{Report, Sample, pose};
pub use script::{TEMPLATE, Upload, control_program};
