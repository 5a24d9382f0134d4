//! A stiff rig (100 N/mm) driven straight at the contact world.

use palpate_sim::*;
use palpate_spatial::{Pose, UnitQuaternion, Vector3, Wrench};

pub(crate) const DT: f64 = 0.002;
const LENGTH: f64 = 0.150;

pub(crate) fn config(clearance: f64, chamfer: f64) -> SimConfig {
    SimConfig {
        friction: 0.3,
        peg: PegConfig { width: 0.020, length: 0.050 },
        hole: HoleConfig { clearance, depth: 0.025, chamfer, board_half_width: 0.1 },
        tool: ToolConfig { mass: 1.0, length: LENGTH, centre_of_mass: 0.075, inertia: [2e-3, 2e-3, 6e-4] },
        compliance: ComplianceConfig {
            linear_stiffness: 1e5,
            angular_stiffness: 1000.0,
            linear_damping: 450.0,
            angular_damping: 4.0,
        },
        servo: ServoConfig { lag: 0.010, dead_time: 0.0 },
        sensor: SensorConfig { force_noise: 0.0, torque_noise: 0.0, force_quantum: 0.0, torque_quantum: 0.0 },
        solver: SolverConfig {
            steps_per_tick: 1,
            iterations: 4,
            pgs_iterations: 8,
            contact_frequency: 500.0,
            contact_damping_ratio: 1.0,
            prediction_distance: 5e-6,
        },
    }
}

/// Moves the flange so that the (unloaded) tip goes where it is told, in the hole frame.
pub(crate) struct Rig {
    pub(crate) world: ContactWorld,
    pub(crate) tip: Vector3,
    tilt: UnitQuaternion,
    last: Wrench,
}

impl Rig {
    /// `tilt` about the hole's y axis, rad.
    pub(crate) fn new(config: &SimConfig, tip: [f64; 3], tilt: f64) -> Self {
        let tilt = UnitQuaternion::from_axis_angle(&Vector3::y_axis(), tilt);
        let tip = Vector3::from(tip);
        Self { world: ContactWorld::new(config, &flange(&tip, &tilt)), tip, tilt, last: Wrench::zero() }
    }

    /// One tick; returns the wrench in hole axes about the sensor origin.
    pub(crate) fn to(&mut self, tip: Vector3) -> Wrench {
        self.tip = tip;
        let pose = flange(&tip, &self.tilt);
        self.last = self.world.tick(&pose, DT).expect("a finite wrench").rotated(&pose.rotation);
        self.last
    }

    pub(crate) fn move_by(&mut self, velocity: [f64; 3]) -> Wrench {
        self.to(self.tip + Vector3::from(velocity) * DT)
    }

    pub(crate) fn hold(&mut self, ticks: usize) -> Wrench {
        for _ in 0..ticks {
            self.to(self.tip);
        }
        self.last
    }

    /// Down at 10 mm/s until `force` (N) or `depth` (m).
    pub(crate) fn push_down(&mut self, force: f64, depth: f64) -> Wrench {
        while self.last.force.z < force && self.tip.z > -depth {
            self.move_by([0.0, 0.0, -0.010]);
        }
        self.last
    }
}

fn flange(tip: &Vector3, tilt: &UnitQuaternion) -> Pose {
    let into = UnitQuaternion::from_axis_angle(&Vector3::x_axis(), std::f64::consts::PI);
    let rotation = tilt * into;
    Pose::from_parts((tip - rotation * Vector3::new(0.0, 0.0, LENGTH)).into(), rotation)
}
