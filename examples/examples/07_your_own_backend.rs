//! What you learn: implement `RobotBackend` for your arm and let the contract suite judge it.
//! Run: `cargo run --release -p palpate-examples --example 07_your_own_backend`
//! You should see: a forgetful first version caught by the suite, the mended one passing.
#![expect(clippy::print_stdout, reason = "a tutorial speaks")]

use std::time::Duration;

use palpate_robot_io::{BackendError, FaultKind, JointCommand, RobotBackend, RobotState, contract};
use palpate_spatial::{JointVector, Wrench};

/// An arm that jumps to its set-point at once. `careful` is whether it looks at its commands.
struct MyArm {
    careful: bool,
    tick: u32,
    q: JointVector,
    stopped: bool,
}

#[derive(Debug)]
enum MyError {
    NotFinite,
    Stopped,
}

impl std::fmt::Display for MyError {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(match self {
            Self::NotFinite => "the command is not finite",
            Self::Stopped => "the arm is stopped",
        })
    }
}

impl std::error::Error for MyError {}

impl BackendError for MyError {
    fn kind(&self) -> FaultKind {
        match self {
            Self::NotFinite => FaultKind::InvalidCommand,
            Self::Stopped => FaultKind::Stopped,
        }
    }
}

impl RobotBackend for MyArm {
    type Error = MyError;

    fn period(&self) -> Duration {
        Duration::from_millis(2)
    }

    fn read(&mut self) -> Result<RobotState, MyError> {
        // A real arm blocks here until its next packet.
        self.tick += 1;
        Ok(RobotState {
            time: f64::from(self.tick) * 0.002,
            q: self.q,
            dq: JointVector::zeros(),
            q_target: self.q,
            sensor_wrench: Wrench::zero(),
        })
    }

    fn write(&mut self, command: &JointCommand) -> Result<(), MyError> {
        if self.stopped {
            return Err(MyError::Stopped);
        }
        if self.careful && !command.q.iter().all(|x| x.is_finite()) {
            return Err(MyError::NotFinite);
        }
        self.q = command.q;
        Ok(())
    }

    fn stop(&mut self) -> Result<(), MyError> {
        self.stopped = true;
        Ok(())
    }

    fn recover(&mut self) -> Result<(), MyError> {
        self.stopped = false;
        Ok(())
    }

    fn tare(&mut self) -> Result<(), MyError> {
        Ok(())
    }
}

fn main() {
    for careful in [false, true] {
        let mut arm = MyArm { careful, tick: 0, q: JointVector::zeros(), stopped: false };
        match contract::check(&mut arm) {
            Ok(()) => println!("careful = {careful}: passes the contract"),
            Err(violation) => println!("careful = {careful}: {violation}"),
        }
    }
}
