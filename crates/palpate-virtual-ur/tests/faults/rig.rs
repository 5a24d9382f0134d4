//! A controller that the test ticks, and an arm on the move behind it.

use std::sync::{Arc, Mutex};
use std::time::Duration;

use palpate_kinematics::UrModel;
use palpate_robot_io::{JointCommand, RobotBackend, RobotState};
use palpate_spatial::JointVector;
use palpate_ur::proto::SafetyStatus;
use palpate_ur::{Ports, UrArm, UrConfig, UrError};
use palpate_virtual_ur::controller::DT;
use palpate_virtual_ur::{
    ControllerConfig, Fault, LaggedArm, LinkFault, Options, Port, Stepped, open,
};

/// Joint speed at which things go wrong, rad/s.
pub(crate) const SPEED: f64 = 0.5;
/// Cycles of motion before: the arm has reached its speed.
const RUN_UP: u32 = 150;
/// Cycles after: it has long come to rest.
const AFTER: u32 = 500;
/// What the controller itself calls a jump of the set-points, rad/s².
const JUMP: f64 = 150.0;

pub(crate) fn link(fault: LinkFault) -> Fault {
    Fault::Link(Port::Rtde, fault)
}

pub(crate) struct Rig {
    pub(crate) robot: Stepped,
    /// Set-points of the drives, one per cycle.
    targets: Arc<Mutex<Vec<JointVector>>>,
}

/// How a fault ended.
pub(crate) struct Aftermath {
    pub(crate) error: UrError,
    /// Cycles from the fault to the error.
    pub(crate) ticks: u32,
    /// Way of the joint from the fault to its rest, degrees.
    pub(crate) angle: f64,
    pub(crate) safety: SafetyStatus,
}

impl Rig {
    pub(crate) fn start() -> Self {
        let home = [0.0, -1.57, 1.57, -1.57, -1.57, 0.0].into();
        let options =
            Options { any_ports: true, ..Options::new(ControllerConfig::new(UrModel::Ur3e)) };
        let server = open(options, Box::new(LaggedArm::at(home))).unwrap();
        let targets = Arc::<Mutex<Vec<JointVector>>>::default();
        let (record, mut last) = (Arc::clone(&targets), 0);
        let robot = Stepped::new(server, Duration::from_secs_f64(DT), move |server| {
            // A controller that stalls runs no cycle.
            let cycle = server.controller().ticks();
            if std::mem::replace(&mut last, cycle) != cycle {
                record.lock().unwrap().push(server.controller().target().q);
            }
        });
        Self { robot, targets }
    }

    pub(crate) fn inject(&self, fault: Fault) {
        self.robot.with(|server| server.inject(fault));
    }

    pub(crate) fn log(&self) -> String {
        format!("{:#?}", self.robot.with(|server| server.controller_mut().take_events()))
    }

    pub(crate) fn safety(&self) -> SafetyStatus {
        self.robot.with(|server| server.controller().safety())
    }

    /// The defaults of an arm, but for a sensor without noise.
    pub(crate) fn config(&self) -> UrConfig {
        let port = |port| self.robot.with(|server| server.address(port)).unwrap().port();
        UrConfig {
            ports: Ports {
                rtde: port(Port::Rtde),
                script: port(Port::Secondary),
                dashboard: port(Port::Dashboard),
            },
            boot_settle: 0.1,
            frozen_ticks: 0,
            answer_timeout: 2.0,
            ..UrConfig::at("127.0.0.1")
        }
    }

    pub(crate) fn connect(&self, config: UrConfig) -> UrArm {
        let arm = self.robot.meanwhile(|| UrArm::connect(config));
        let arm = arm.unwrap_or_else(|e| panic!("{e}: {}", self.log()));
        // What has come since would be read in one go.
        self.robot.tick();
        arm
    }

    /// One cycle at [`SPEED`].
    pub(crate) fn step(&self, arm: &mut UrArm, q: &mut JointVector) -> Result<RobotState, UrError> {
        q[5] += SPEED * DT;
        arm.write(&JointCommand { q: *q })?;
        self.robot.tick();
        arm.read()
    }

    /// An arm on the move, and its set-point.
    pub(crate) fn moving(&self, config: UrConfig) -> (UrArm, JointVector) {
        let mut arm = self.connect(config);
        let mut q = arm.read().unwrap_or_else(|e| panic!("{e}: {}", self.log())).q;
        for _ in 0..RUN_UP {
            self.step(&mut arm, &mut q).unwrap_or_else(|e| panic!("{e}: {}", self.log()));
        }
        (arm, q)
    }

    /// Lets something go wrong with an arm on the move and goes on until there is an error; then waits. Commands are
    /// refused from the error on, the set-points do not jump, and what rests stays at rest.
    pub(crate) fn aftermath(&self, fault: &Fault) -> Aftermath {
        let (mut arm, mut q) = self.moving(self.config());
        let joint = || self.robot.with(|server| server.controller().actual().q[5]);
        let before = joint();
        self.inject(fault.clone());
        let mut ticks = 0;
        let error = loop {
            ticks += 1;
            assert!(ticks < 1000, "{fault:?} goes unnoticed: {}", self.log());
            if let Err(error) = self.step(&mut arm, &mut q) {
                break error;
            }
        };
        let refused = arm.write(&JointCommand { q });
        assert!(matches!(refused, Err(UrError::Stopped)), "{fault:?}: {refused:?}");
        for _ in 0..AFTER {
            self.robot.tick();
        }
        self.assert_continuous(fault);
        let targets = self.targets.lock().unwrap();
        let rest = &targets[targets.len() - 100..];
        assert!(rest.iter().all(|q| *q == rest[0]), "{fault:?}: it moves: {}", self.log());
        let angle = (joint() - before).to_degrees();
        Aftermath { error, ticks, angle, safety: self.safety() }
    }

    /// No set-point so far was a jump in place or speed.
    pub(crate) fn assert_continuous(&self, fault: &Fault) {
        let targets = self.targets.lock().unwrap();
        let steps: Vec<_> = targets.windows(2).map(|w| (w[1] - w[0]) / DT).collect();
        let speed = steps.iter().map(JointVector::amax).fold(0.0, f64::max);
        let jump = steps.windows(2).map(|s| (s[1] - s[0]).amax() / DT).fold(0.0, f64::max);
        assert!(speed < 1.5 * SPEED && speed > 0.9 * SPEED, "{fault:?}: {speed} rad/s");
        assert!(jump < JUMP, "{fault:?}: {jump} rad/s²");
    }
}
