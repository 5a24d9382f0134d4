//! The controller without a network: motion, protection, modes, registers, dashboard.

#![expect(clippy::unwrap_used, reason = "a helper that cannot go on fails its test")]

mod common;
mod motion;
mod programs;
mod protection;
mod sensor;
