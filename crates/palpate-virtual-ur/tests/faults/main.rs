//! What the user of an arm gets at each fault: the table of docs/virtual-ur.md, row by row.
//!
//! The sensor's rows are tested behind the fail-safe layer, in `palpate`'s `sensor_faults`.
#![expect(clippy::unwrap_used, reason = "a helper that cannot go on fails its test")]

mod link;
mod rig;
mod robot;
