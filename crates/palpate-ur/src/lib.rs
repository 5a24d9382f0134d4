//! Universal Robots e-Series arms as a [`RobotBackend`](palpate_robot_io::RobotBackend).
//!
//! A learner needs an arm that says at once when something is wrong and never moves again by itself. This
//! crate speaks the controller's real-time data exchange (RTDE) with a protocol core of its own, and runs a
//! program of its own on the controller that follows joint set-points 500 times a second and brakes the arm
//! when they stop coming. **It has not been used on a real arm yet.**
//!
//! ```no_run
//! use palpate_robot_io::{JointCommand, RobotBackend};
//! use palpate_ur::{UrArm, UrConfig};
//!
//! let mut arm = UrArm::connect(UrConfig::at("192.168.0.10"))?; // loads the control program, moves nothing
//! arm.tare()?;
//! let mut q = arm.read()?.q;
//! for _ in 0..500 {
//!     q[5] += 0.0002; // 0.1 rad/s
//!     arm.write(&JointCommand { q })?;
//!     let state = arm.read()?; // waits for the controller's next cycle
//!     println!("{:.3} s: {:.1} N", state.time, state.sensor_wrench.force.norm());
//! }
//! arm.stop()?;
//! # Ok::<(), palpate_ur::UrError>(())
//! ```
//!
//! # Modules
//!
//! - [`proto`]: RTDE without I/O, client and server side, and the client's session.
//! - [`RtdeClient`]: a session over a socket, for any recipes.
//! - [`UrArm`]: the arm, its configuration [`UrConfig`], its errors [`UrError`].
//! - [`registers`] and [`control_program`]: what the computer and the program on the controller agree on.
//! - [`dashboard`]: power, brakes and queries.
//! - [`realtime`] and [`background`]: SCHED_FIFO and locked memory for the arm's thread and a lower priority for the
//!   others, where this computer permits them.
//! - [`model_error`]: whether the model here is the arm there.
//!
//! # Conventions
//!
//! SI units. Joints in the controller's order, base first. Wrenches are what the environment does to the
//! tool, in tool0 axes about the tool0 origin. Poses of the controller are in its own base frame, which is
//! the URDF's `base_link` turned by π about z.

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
pub use realtime::{Background, Realtime, background, lock_memory, realtime};
pub use sample::{Report, Sample, pose};
pub use script::{TEMPLATE, Upload, control_program};
