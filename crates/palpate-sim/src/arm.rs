//! The simulated arm: a [`RobotBackend`].

use std::collections::VecDeque;
use std::time::Duration;

use palpate_kinematics::SerialChain;
use palpate_robot_io::{BackendError, FaultKind, JointCommand, RobotBackend, RobotState};
use palpate_spatial::{DOF, JointVector, Pose, Vector3, Vector6, Wrench};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};

use crate::config::{ConfigError, SensorConfig, SimConfig};
use crate::contact::ContactWorld;

/// Remaining distance to the set-point at which the arm counts as at rest, rad.
const AT_REST: f64 = 1e-6;

/// Why the simulated arm refused or failed.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum SimError {
    /// A setting makes no sense.
    #[error(transparent)]
    Config(#[from] ConfigError),
    /// The tool starts inside the board.
    #[error("the tool starts {:.1} mm inside the board: raise its start", depth * 1e3)]
    Overlap {
        /// How deep, m.
        depth: f64,
    },
    /// A command that is not finite.
    #[error("joint command is not finite: {0:?}")]
    NotFinite(JointVector),
    /// A command after `stop`.
    #[error("the simulated arm is stopped: call recover first")]
    Stopped,
    /// The physics engine broke down.
    #[error("the physics engine broke down (panic or non-finite state); recover rebuilds the world")]
    Engine,
}

impl BackendError for SimError {
    fn kind(&self) -> FaultKind {
        match self {
            Self::Config(_) | Self::Overlap { .. } => FaultKind::Internal,
            Self::NotFinite(_) => FaultKind::InvalidCommand,
            Self::Stopped => FaultKind::Stopped,
            Self::Engine => FaultKind::Simulation,
        }
    }
}

/// A position-controlled arm with a tool and a board, simulated at 500 Hz.
///
/// Each [`read`](RobotBackend::read) advances its world by 2 ms. The whole state between a tare and the
/// next is a function of the seed, the joints at the tare and the commands since.
#[derive(Debug)]
pub struct SimArm {
    chain: SerialChain<DOF>,
    hole_T_base: Pose,
    config: SimConfig,
    seed: u64,
    world: ContactWorld,
    q_home: JointVector,
    q: JointVector,
    dq: JointVector,
    q_target: JointVector,
    /// Set-points on their way through the dead time, oldest first.
    delayed: VecDeque<JointVector>,
    sensor: Sensor,
    ticks: u64,
    stopped: bool,
    broken: bool,
}

impl SimArm {
    const PERIOD: Duration = Duration::from_millis(2);

    /// An arm at rest at `q_home` (rad): `chain` leads from base to tool0, the board's hole is at `base_T_hole`.
    ///
    /// # Errors
    /// A setting that makes no sense, or a tool that starts inside the board.
    pub fn new(
        chain: SerialChain<DOF>,
        base_T_hole: Pose,
        config: &SimConfig,
        q_home: JointVector,
        seed: u64,
    ) -> Result<Self, SimError> {
        config.validate()?;
        let hole_T_base = base_T_hole.inverse();
        let hole_T_flange = hole_T_base * chain.forward(&q_home);
        let depth = -lowest_point(config, &hole_T_flange);
        if !(depth < 0.0) {
            return Err(SimError::Overlap { depth });
        }
        let dead_ticks = (config.servo.dead_time / Self::PERIOD.as_secs_f64()).round() as usize;
        Ok(Self {
            world: ContactWorld::new(config, &hole_T_flange),
            chain,
            hole_T_base,
            config: config.clone(),
            seed,
            q_home,
            q: q_home,
            dq: JointVector::zeros(),
            q_target: q_home,
            delayed: VecDeque::from(vec![q_home; dead_ticks]),
            sensor: Sensor::new(&config.sensor, seed, &q_home),
            ticks: 0,
            stopped: false,
            broken: false,
        })
    }

    /// True pose of the tool's tip in the hole frame, for diagnostics.
    pub fn hole_T_tip(&self) -> Pose {
        self.world.tip_pose()
    }

    fn flange(&self) -> Pose {
        self.hole_T_base * self.chain.forward(&self.q)
    }

    /// Dead time, then q ← q + (q_set − q)·(1 − exp(−dt/lag)).
    fn servo(&mut self, dt: f64) {
        let mut set = self.q_target;
        if !self.delayed.is_empty() {
            self.delayed.push_back(set);
            if let Some(oldest) = self.delayed.pop_front() {
                set = oldest;
            }
        }
        let lag = self.config.servo.lag;
        let follow = if lag > 0.0 { 1.0 - (-dt / lag).exp() } else { 1.0 };
        let step = (set - self.q) * follow;
        self.q += step;
        self.dq = step / dt;
    }

    fn land(&mut self, q: JointVector) {
        self.q = q;
        self.dq.fill(0.0);
        self.q_target = q;
        self.delayed.iter_mut().for_each(|d| *d = q);
        self.world = ContactWorld::new(&self.config, &self.flange());
        self.sensor = Sensor::new(&self.config.sensor, self.seed, &q);
    }
}

impl RobotBackend for SimArm {
    type Error = SimError;

    fn period(&self) -> Duration {
        Self::PERIOD
    }

    fn read(&mut self) -> Result<RobotState, SimError> {
        if self.broken {
            return Err(SimError::Engine);
        }
        let dt = Self::PERIOD.as_secs_f64();
        self.ticks += 1;
        self.servo(dt);
        let flange = self.flange();
        let Some(wrench) = self.world.tick(&flange, dt) else {
            self.broken = true;
            return Err(SimError::Engine);
        };
        Ok(RobotState {
            time: self.ticks as f64 * dt,
            q: self.q,
            dq: self.dq,
            q_target: self.q_target,
            sensor_wrench: self.sensor.measure(&wrench),
        })
    }

    fn write(&mut self, command: &JointCommand) -> Result<(), SimError> {
        if self.stopped {
            return Err(SimError::Stopped);
        }
        if !command.q.iter().all(|x| x.is_finite()) {
            return Err(SimError::NotFinite(command.q));
        }
        self.q_target = command.q;
        Ok(())
    }

    fn stop(&mut self) -> Result<(), SimError> {
        self.q_target = self.q;
        self.delayed.iter_mut().for_each(|d| *d = self.q);
        self.stopped = true;
        Ok(())
    }

    /// After a fault of the engine the arm stands at its home again, in a new world.
    fn recover(&mut self) -> Result<(), SimError> {
        if self.broken {
            self.land(self.q_home);
            self.broken = false;
        }
        self.stopped = false;
        Ok(())
    }

    /// Rebuilds the world around the resting arm, so that nothing before the tare can matter after it.
    fn tare(&mut self) -> Result<(), SimError> {
        let rest = if (self.q_target - self.q).amax() < AT_REST { self.q_target } else { self.q };
        let target = self.q_target;
        self.land(rest);
        self.q_target = target;
        Ok(())
    }
}

/// The sensor's imperfections.
#[derive(Debug)]
struct Sensor {
    config: SensorConfig,
    rng: ChaCha8Rng,
}

impl Sensor {
    /// The noise stream is chosen by the joints at the tare: episodes differ, and none depends on another.
    fn new(config: &SensorConfig, seed: u64, q: &JointVector) -> Self {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        rng.set_stream(q.iter().fold(0u64, |hash, x| hash.rotate_left(9) ^ x.to_bits()));
        Self { config: config.clone(), rng }
    }

    fn measure(&mut self, wrench: &Wrench) -> Wrench {
        let c = &self.config;
        let mut reading = wrench.vector();
        for axis in 0..6 {
            let (noise, quantum) =
                if axis < 3 { (c.force_noise, c.force_quantum) } else { (c.torque_noise, c.torque_quantum) };
            if noise > 0.0 {
                let sample: f64 = StandardNormal.sample(&mut self.rng);
                reading[axis] += noise * sample;
            }
            if quantum > 0.0 {
                reading[axis] = (reading[axis] / quantum).round() * quantum;
            }
        }
        Wrench::from(Vector6::from(reading))
    }
}

/// Height of the peg's lowest corner over the board, m.
fn lowest_point(config: &SimConfig, hole_T_flange: &Pose) -> f64 {
    let half = config.peg.width / 2.0;
    [(-1.0, -1.0), (-1.0, 1.0), (1.0, -1.0), (1.0, 1.0)]
        .iter()
        .map(|(x, y)| {
            let corner = Vector3::new(x * half, y * half, config.tool.length);
            (hole_T_flange * nalgebra::Point3::from(corner)).z
        })
        .fold(f64::INFINITY, f64::min)
}
