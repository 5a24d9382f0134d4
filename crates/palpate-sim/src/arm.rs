//! The simulated arm: a [`RobotBackend`].

use std::time::Duration;

use palpate_kinematics::SerialChain;
use palpate_robot_io::{JointCommand, RobotBackend, RobotState};
use palpate_spatial::{DOF, JointVector, Pose, Wrench};

use crate::config::SimConfig;
use crate::contact::ContactWorld;
use crate::sensor::Sensor;
use crate::servo::Servo;
use crate::{EngineFault, SimError};

/// Loads up to these (N and N·m) at a tare are the last of the tool's ringing; more is contact or motion.
const AT_REST: (f64, f64) = (1.0, 0.1);

/// A position-controlled arm with a tool and a board, simulated at 500 Hz.
///
/// Each [`read`](RobotBackend::read) advances its world by 2 ms. What follows a tare in free air is a function
/// of the seed, the joints at the tare and the commands since.
#[derive(Debug)]
pub struct SimArm {
    chain: SerialChain<DOF>,
    base_T_hole: Pose,
    hole_T_base: Pose,
    config: SimConfig,
    /// The settings of this episode.
    drawn: SimConfig,
    seed: u64,
    world: ContactWorld,
    q_start: JointVector,
    servo: Servo,
    sensor: Sensor,
    /// True load on the sensor in the last tick.
    load: Wrench,
    ticks: u64,
    stopped: bool,
    fault: Option<EngineFault>,
    faults: u64,
}

impl SimArm {
    /// Time between samples.
    pub const PERIOD: Duration = Duration::from_millis(2);

    /// An arm at rest at `q_start` (rad): `chain` leads from base to tool0, the board's hole is at `base_T_hole`.
    ///
    /// # Errors
    /// A setting that makes no sense, or a peg that starts inside the board.
    pub fn new(
        chain: SerialChain<DOF>,
        base_T_hole: Pose,
        config: &SimConfig,
        q_start: JointVector,
        seed: u64,
    ) -> Result<Self, SimError> {
        let hole_T_base = base_T_hole.inverse();
        let world = ContactWorld::new(config, &(hole_T_base * chain.forward(&q_start)))?;
        Ok(Self {
            world,
            chain,
            base_T_hole,
            hole_T_base,
            config: config.clone(),
            drawn: config.clone(),
            seed,
            q_start,
            servo: Servo::new(&config.servo, Self::PERIOD.as_secs_f64(), q_start),
            sensor: Sensor::new(&config.sensor, seed),
            load: Wrench::zero(),
            ticks: 0,
            stopped: false,
            fault: None,
            faults: 0,
        })
    }

    /// True pose of the tool's tip in the base frame, for diagnostics: behind the sensor's spring, so not
    /// quite where the joints say.
    pub fn base_T_tip(&self) -> Pose {
        self.base_T_hole * self.hole_T_tip()
    }

    /// True pose of the tool's tip in the hole frame, for diagnostics.
    pub fn hole_T_tip(&self) -> Pose {
        self.world.tip_pose()
    }

    /// How often the physics engine broke down since construction.
    pub fn fault_count(&self) -> u64 {
        self.faults
    }

    fn rebuild_world(&mut self) {
        self.world = ContactWorld::build(&self.drawn, &self.flange());
        self.load = Wrench::zero();
    }

    /// A servo on its way somewhere keeps its lag and dead time: what it has been told is not lost.
    fn draw(&mut self) {
        self.drawn = self.config.drawn(self.seed, &self.servo.q);
        if self.drawn.servo != self.config.servo && self.servo.q == self.servo.q_target {
            let dt = Self::PERIOD.as_secs_f64();
            self.servo = Servo::new(&self.drawn.servo, dt, self.servo.q);
        }
    }

    fn flange(&self) -> Pose {
        self.hole_T_base * self.chain.forward(&self.servo.q)
    }
}

impl RobotBackend for SimArm {
    type Error = SimError;

    fn period(&self) -> Duration {
        Self::PERIOD
    }

    fn read(&mut self) -> Result<RobotState, SimError> {
        if let Some(what) = self.fault {
            return Err(SimError::Engine { what });
        }
        let dt = Self::PERIOD.as_secs_f64();
        self.ticks += 1;
        self.servo.tick();
        self.load = match self.world.tick(&self.flange(), dt) {
            Ok(load) => load,
            Err(e) => {
                if let SimError::Engine { what } = e {
                    self.fault = Some(what);
                    self.faults += 1;
                }
                self.stopped = true;
                return Err(e);
            }
        };
        Ok(RobotState {
            time: self.ticks as f64 * dt,
            q: self.servo.q,
            dq: self.servo.dq,
            q_target: self.servo.q_target,
            sensor_wrench: self.sensor.measure(&self.load, dt),
        })
    }

    fn write(&mut self, command: &JointCommand) -> Result<(), SimError> {
        if self.stopped {
            return Err(SimError::Stopped);
        }
        if !command.q.iter().all(|x| x.is_finite()) {
            return Err(SimError::NotFinite(command.q));
        }
        self.servo.q_target = command.q;
        Ok(())
    }

    fn stop(&mut self) -> Result<(), SimError> {
        self.servo.halt();
        self.stopped = true;
        Ok(())
    }

    /// After a fault of the engine the arm stands at its start again, in a new world: where it broke down
    /// may be inside the board.
    fn recover(&mut self) -> Result<(), SimError> {
        if self.fault.take().is_some() {
            self.servo.place(self.q_start);
            self.rebuild_world();
        }
        self.stopped = false;
        Ok(())
    }

    /// In free air at rest, also draws what `spread` says anew and rebuilds the world around the arm, so that nothing
    /// before the tare can matter after it. Under load it only zeroes the reading, as a real sensor does.
    fn tare(&mut self) -> Result<(), SimError> {
        if self.load.force.norm() <= AT_REST.0 && self.load.torque.norm() <= AT_REST.1 {
            self.servo.settle();
            self.draw();
            self.rebuild_world();
        }
        self.sensor.tare(&self.load, &self.servo.q);
        Ok(())
    }

    fn rebuild(&mut self) -> bool {
        self.fault = None;
        self.stopped = false;
        self.servo.place(self.q_start);
        self.rebuild_world();
        true
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use palpate_robot_io::{BackendError, FaultKind};
    use palpate_spatial::{UnitQuaternion, Vector3};

    fn arm() -> SimArm {
        let config = toml::from_str(include_str!("../tests/contact/stiff.toml")).unwrap();
        let urdf = include_str!("../../../assets/robots/ur3e.urdf");
        let chain = SerialChain::from_urdf_str(urdf, "base_link", "tool0").unwrap();
        let right = std::f64::consts::FRAC_PI_2;
        let q = JointVector::from([0.0, -right, right, -right, -right, 0.0]);
        let into = UnitQuaternion::from_axis_angle(&Vector3::x_axis(), std::f64::consts::PI);
        let tip = chain.forward(&q) * Pose::translation(0.0, 0.0, 0.160);
        let base_T_hole = Pose::from_parts(tip.translation, tip.rotation * into);
        SimArm::new(chain, base_T_hole, &config, q, 1).unwrap()
    }

    #[test]
    fn a_broken_engine_is_reported_counted_and_rebuilt() {
        let mut arm = arm();
        type Sabotage = fn(&mut ContactWorld);
        for (sabotage, expected) in [
            (ContactWorld::sabotage as Sabotage, EngineFault::Panic),
            (ContactWorld::poison, EngineFault::NotFinite),
        ] {
            let before = (arm.read().unwrap(), arm.fault_count());
            sabotage(&mut arm.world);
            for _ in 0..2 {
                let error = arm.read().unwrap_err();
                assert!(matches!(error, SimError::Engine { what } if what == expected), "{error}");
                assert_eq!(error.kind(), FaultKind::Simulation);
            }
            assert_eq!(arm.fault_count(), before.1 + 1, "one fault, however often it is read");
            let refused = arm.write(&JointCommand { q: before.0.q }).unwrap_err();
            assert_eq!(refused.kind(), FaultKind::Stopped);
            arm.recover().unwrap();
            arm.write(&JointCommand { q: before.0.q }).unwrap();
            let after = arm.read().unwrap();
            assert!(after.is_finite() && after.time > before.0.time);
            assert_eq!(after.q, arm.q_start);
        }
    }
}
