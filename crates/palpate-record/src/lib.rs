//! Recordings of a robot in [MCAP](https://mcap.dev), which Foxglove and Rerun open without conversion.
//!
//! A [`Recording`] collects messages in memory and gives the file's bytes: it does no I/O, so that a disk that is full
//! or slow is the caller's to deal with, away from any control thread. Everything is encoded as protobuf with its
//! description in the file; frames, poses, joints, shapes and texts by Foxglove's schemas, the rest as
//! [named numbers](Recording::numbers).
//!
//! ```
//! use palpate_record::{Body, Form, Recording};
//! use palpate_spatial::Pose;
//!
//! # fn main() -> Result<(), palpate_record::RecordError> {
//! let mut recording = Recording::new(std::time::Duration::ZERO)?;
//! let peg = Body::new("peg", "tool", [0.9, 0.5, 0.1, 1.0])
//!     .with(Pose::identity(), Form::Cylinder { radius: 0.01, length: 0.05 });
//! recording.describe("demo", "base_link", &[peg])?;
//! let frames = recording.frames("/tf")?;
//! let force = recording.numbers("/force", "demo.Force", &["x", "y", "z"])?;
//! for tick in 0..500 {
//!     let t = f64::from(tick) * 0.002;
//!     frames.put(t, "base_link", [("tool", &Pose::translation(0.0, 0.0, 0.1 * t))]);
//!     force.put(t, &[0.0, 0.0, 3.0 * t])?;
//! }
//! let file: Vec<u8> = recording.finish()?;
//! assert!(file.starts_with(b"\x89MCAP0\r\n"));
//! # Ok(())
//! # }
//! ```
//!
//! Poses are `parent_T_child`, times are seconds since the recording's beginning, lengths are in m.

mod body;
mod channels;
mod numbers;
mod recording;

pub use body::{Body, Form, urdf};
pub use channels::{Frames, Joints, Level, Points, Poses, Scene, Texts};
pub use numbers::Numbers;
pub use recording::{RecordError, Recording};
