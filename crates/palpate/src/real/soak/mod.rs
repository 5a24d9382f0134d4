//! Soaks of everything between the trainer and an arm, against the virtual controller: hours in one command.

mod link;
mod packets;
mod stops;
mod timed;

pub(super) use link::Idlers;
pub use link::{Link, Measure, link};
pub use packets::{Packets, packets};
pub use stops::stops;
