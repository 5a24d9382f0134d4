//! Contact against closed forms: 20 mm square peg, sensor 100 N/mm and 1000 N·m/rad, friction 0.3.
//!
//! `rig` is the common ground; the numbers are in `docs/results/contact.md`.

mod exploration;
mod insertion;
mod mujoco;
mod penetration;
mod repeat;
mod rig;
mod round;
mod sprung;
mod surface;
