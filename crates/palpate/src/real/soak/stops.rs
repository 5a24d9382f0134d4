//! `soak stops`: protective stops without end, and nobody but a person clears them.

use std::io::Write as _;
use std::time::Duration;

use anyhow::{Context as _, bail, ensure};
use palpate_kinematics::UrModel;
use palpate_robot_io::{JointCommand, RobotBackend as _};
use palpate_spatial::JointVector;
use palpate_ur::proto::SafetyStatus;
use palpate_ur::{Operator, Ports, UrArm, UrConfig, UrError};
use palpate_virtual_ur::{
    ControllerConfig, Fault, LaggedArm, Options, Port, Server, Stepped, open,
};

use crate::interrupt;

/// Joint speed at the stop, rad/s.
const SPEED: f64 = 0.5;
/// Cycles of 2 ms in which the arm comes to rest.
const TO_REST: u32 = 60;
/// Cycles for which nothing may move.
const WATCHED: u32 = 40;

struct Soak {
    robot: Stepped,
    arm: UrArm,
    operator: Operator,
}

/// Stops an arm on the move so often; tries to go on without a person, then lets one clear it.
///
/// # Errors
/// The client unlocked something, something moved, or a stop went unnoticed.
pub fn stops(count: u64) -> anyhow::Result<()> {
    let mut soak = Soak::start()?;
    let mut done = 0;
    while done < count && !interrupt::requested() {
        soak.stop(done).with_context(|| format!("at stop {}", done + 1))?;
        done += 1;
    }
    let (stops, unlocks) = soak.robot.with(|server| server.controller().stop_count());
    ensure!((stops, unlocks) == (done, done), "{stops} stops, {unlocks} unlocks by {done} persons");
    writeln!(
        std::io::stdout(),
        "{done} protective stops of an arm at {SPEED} rad/s: 0 unlocked by the client, 0 cycles of motion before a person had unlocked and acknowledged; all {done} noticed"
    )?;
    Ok(())
}

impl Soak {
    fn start() -> anyhow::Result<Self> {
        let home = JointVector::from([0.0, -1.57, 1.57, -1.57, -1.57, 0.0]);
        let mut controller = ControllerConfig::new(UrModel::Ur3e);
        // The wait for an unlock is the controller's and is tested elsewhere.
        controller.delays.unlock = 0.1;
        let options = Options { any_ports: true, ..Options::new(controller) };
        let server = open(options, Box::new(LaggedArm::at(home)))?;
        let port = |port| server.address(port).map(|at| at.port());
        let config = UrConfig {
            ports: Ports {
                rtde: port(Port::Rtde)?,
                script: port(Port::Secondary)?,
                dashboard: port(Port::Dashboard)?,
            },
            boot_settle: 0.1,
            frozen_ticks: 0,
            ..UrConfig::at("127.0.0.1")
        };
        let robot = Stepped::new(server, Duration::from_micros(200), |_| {});
        let arm = robot.meanwhile(|| UrArm::connect(config))?;
        let operator = arm.operator();
        Ok(Self { robot, arm, operator })
    }

    fn target(&self) -> JointVector {
        self.robot.with(|server| server.controller().target().q)
    }

    /// Cycles in which the set-point moves.
    fn moves(&self, cycles: u32) -> u32 {
        let mut moved = 0;
        for _ in 0..cycles {
            let before = self.target();
            self.robot.tick();
            moved += u32::from(self.target() != before);
        }
        moved
    }

    fn step(&mut self, q: &mut JointVector, speed: f64) -> Result<(), UrError> {
        q[5] += speed * self.arm.period().as_secs_f64();
        self.arm.write(&JointCommand { q: *q })?;
        self.robot.tick();
        self.arm.read().map(|_| ())
    }

    fn recover(&mut self) -> Result<(), UrError> {
        let Self { robot, arm, .. } = self;
        robot.meanwhile(|| arm.recover())
    }

    fn stop(&mut self, number: u64) -> anyhow::Result<()> {
        // To and fro, for another time each time.
        let speed = if number.is_multiple_of(2) { SPEED } else { -SPEED };
        self.robot.tick();
        let mut q = self.arm.read()?.q;
        for _ in 0..60 + number % 23 {
            self.step(&mut q, speed)?;
        }
        self.robot.with(|server| server.inject(Fault::ProtectiveStop));
        let error = (0..5).find_map(|_| self.step(&mut q, speed).err());
        match error {
            Some(UrError::Safety(SafetyStatus::ProtectiveStop)) => {}
            other => bail!("the stop was taken for {other:?}"),
        }
        self.moves(TO_REST);
        let refused = |result: Result<(), UrError>, what: &str| match result {
            Err(_) => Ok(()),
            Ok(()) => bail!("{what} during a protective stop"),
        };
        refused(self.arm.write(&JointCommand { q }), "a command was taken")?;
        refused(self.recover(), "recover succeeded")?;
        ensure!(self.moves(WATCHED) == 0, "the arm moved during a protective stop");
        let unlocks = |server: &mut Server| server.controller().stop_count().1;
        ensure!(self.robot.with(unlocks) == number, "the client unlocked a protective stop");
        // A person at the arm.
        self.robot.with(|server| {
            _ = server.controller_mut().dashboard("close safety popup");
            _ = server.controller_mut().dashboard("unlock protective stop");
        });
        ensure!(self.robot.with(unlocks) == number + 1, "the controller does not unlock");
        // Unlocked is not yet allowed.
        match self.recover() {
            Err(UrError::NeedsOperator(_) | UrError::Safety(_)) => {}
            other => bail!("after the unlock recover gave {other:?}"),
        }
        ensure!(self.moves(WATCHED) == 0, "the arm moved before a person acknowledged the stop");
        self.operator.acknowledge();
        if self.recover().is_err() {
            // The last samples of the stop were still on their way.
            self.operator.acknowledge();
            self.recover()?;
        }
        Ok(())
    }
}
