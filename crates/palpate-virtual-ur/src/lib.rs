//! A virtual UR e-Series controller: it runs URScript, speaks RTDE and dashboard, and fails on request.
//!
//! A program that drives a real arm can only be trusted after it has met everything that goes wrong between a
//! computer and a robot. This controller is the other end of the wire for that: the same ports, the same bytes,
//! the control program that is uploaded to a real one *run* rather than imitated, an arm that lags, touches
//! and stops as a UR does, and faults as data.
//!
//! ```
//! use std::io::{BufRead, BufReader, Write};
//! use std::net::TcpStream;
//!
//! use palpate_kinematics::UrModel;
//! use palpate_virtual_ur::{ControllerConfig, Handle, LaggedArm, Options, Port};
//!
//! let home = [0.0, -1.57, 1.57, -1.57, -1.57, 0.0].into();
//! let options = Options { any_ports: true, ..Options::new(ControllerConfig::new(UrModel::Ur3e)) };
//! let robot = Handle::start(options, Box::new(LaggedArm::at(home)))?;
//!
//! let mut dashboard = BufReader::new(TcpStream::connect(robot.address(Port::Dashboard))?);
//! dashboard.get_mut().write_all(b"robotmode\n")?;
//! let lines: Vec<String> = dashboard.lines().take(2).collect::<Result<_, _>>()?;
//! assert_eq!(lines[1], "Robotmode: RUNNING");
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! # Modules
//!
//! [`script`] is the URScript interpreter, [`controller`] the modes, motion and protection, [`rtde`] the server's
//! side of the protocol core in `palpate_ur::proto`, [`plant`] what is moved. All of these know no socket and
//! no clock. [`Server`] puts them on TCP ports, [`run`] and [`Handle`] keep them at 500 Hz, [`Stepped`] in a test's time.
//!
//! # What it is not
//!
//! No dynamics, no currents, no temperatures: fields without a model have constant values. Its limits for jumps, its
//! stop and its servo lag are stated in [`ControllerLimits`](controller::ControllerLimits) and
//! [`Motion`](controller::Motion); the maker publishes no law for them. The script ports accept programs and send nothing.

pub mod controller;
mod fault;
pub mod plant;
pub mod rtde;
pub mod script;
mod server;

pub use controller::{Controller, ControllerConfig};
pub use fault::{FAULT_HELP, Fault, FaultError, LinkFault, Port, TimedFault};
pub use plant::{LaggedArm, Plant};
pub use server::{Handle, Options, Pace, RunError, Server, Stepped, open, run};
