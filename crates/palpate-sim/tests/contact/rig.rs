//! A stiff rig (100 N/mm, 1000 N·m/rad) driven straight at the contact world, without an arm.

#![expect(clippy::unwrap_used, reason = "our own settings load")]

use palpate_sim::{ComplianceConfig, ContactWorld, Holder, PegShape, ReceptacleConfig, SimConfig};
use palpate_spatial::{Pose, UnitQuaternion, Vector3, Wrench};

/// Control period, s.
pub(crate) const DT: f64 = 0.002;
/// Diametral clearances of the closed forms, m.
pub(crate) const CLEARANCES: [f64; 3] = [1e-3, 2e-4, 5e-5];

/// The rig's settings for a clearance and a chamfer, m.
pub(crate) fn config(clearance: f64, chamfer: f64) -> SimConfig {
    let mut config: SimConfig = toml::from_str(include_str!("stiff.toml")).unwrap();
    config.hole.clearance = clearance;
    config.hole.chamfer = chamfer;
    config
}

/// A round peg of the same width.
pub(crate) fn round(clearance: f64, chamfer: f64) -> SimConfig {
    let mut config = config(clearance, chamfer);
    config.peg.shape = PegShape::Round;
    config
}

/// A 25 mm thick ring, 40 mm across, over a bolt of the same width.
pub(crate) fn ring(clearance: f64, chamfer: f64) -> SimConfig {
    let mut config = round(clearance, chamfer);
    config.peg.holder = Holder::Fixture;
    config.hole.board_half_width = 0.020;
    config
}

/// The round peg and a hole in a body of 0.3 kg on a spring of 50 N/mm and 500 N·m/rad.
pub(crate) fn sprung(clearance: f64, chamfer: f64) -> SimConfig {
    let mut config = round(clearance, chamfer);
    // A light body on a stiff spring takes more passes.
    config.solver.pgs_iterations = 8;
    config.receptacle = Some(ReceptacleConfig {
        mass: 0.3,
        inertia: [2e-4, 2e-4, 2e-4],
        compliance: ComplianceConfig {
            linear_stiffness: 5e4,
            angular_stiffness: 500.0,
            linear_damping: 150.0,
            angular_damping: 0.6,
        },
    });
    config
}

/// The same on the ten times softer sensor that the default preset trains with.
pub(crate) fn soft(clearance: f64, chamfer: f64) -> SimConfig {
    let compliance = ComplianceConfig {
        linear_stiffness: 1e4,
        angular_stiffness: 100.0,
        linear_damping: 140.0,
        angular_damping: 1.2,
    };
    SimConfig { compliance, ..config(clearance, chamfer) }
}

/// Moves the flange so that the tip of a rigid tool would be where it is told, in the hole frame.
pub(crate) struct Rig {
    pub(crate) world: ContactWorld,
    /// Commanded tip, m.
    pub(crate) tip: Vector3,
    /// Commanded attitude: a rotation of the upright tool, rotation vector in hole axes.
    pub(crate) tilt: Vector3,
    length: f64,
    last: Wrench,
}

impl Rig {
    /// The tip at `tip` (m), turned by the rotation vector `tilt` (rad).
    pub(crate) fn new(config: &SimConfig, tip: [f64; 3], tilt: [f64; 3]) -> Self {
        let (tip, tilt, length) = (Vector3::from(tip), Vector3::from(tilt), config.tool.length);
        let world = ContactWorld::new(config, &flange(&tip, &tilt, length)).unwrap();
        Self { world, tip, tilt, length, last: Wrench::zero() }
    }

    /// One tick; returns the wrench in hole axes about the sensor origin.
    pub(crate) fn to(&mut self, tip: Vector3, tilt: Vector3) -> Wrench {
        (self.tip, self.tilt) = (tip, tilt);
        let pose = flange(&tip, &tilt, self.length);
        self.last = self.world.tick(&pose, DT).unwrap().rotated(&pose.rotation);
        self.last
    }

    /// One tick at a velocity, m/s.
    pub(crate) fn slide(&mut self, velocity: [f64; 3]) -> Wrench {
        self.to(self.tip + Vector3::from(velocity) * DT, self.tilt)
    }

    pub(crate) fn hold(&mut self, ticks: usize) -> Wrench {
        for _ in 0..ticks {
            self.to(self.tip, self.tilt);
        }
        self.last
    }

    /// Down at 10 mm/s until `force` (N) or `depth` (m).
    pub(crate) fn push_down(&mut self, force: f64, depth: f64) -> Wrench {
        while self.last.force.z < force && self.tip.z > -depth {
            self.slide([0.0, 0.0, -0.010]);
        }
        self.last
    }

    /// True depth of the tip's middle, m.
    pub(crate) fn depth(&self) -> f64 {
        -self.world.tip_pose().translation.z
    }

    /// True angle between peg and hole, rad.
    pub(crate) fn true_tilt(&self) -> f64 {
        let axis = self.world.tip_pose().rotation * Vector3::z();
        axis.x.hypot(axis.y).atan2(-axis.z)
    }
}

/// hole_T_flange of an upright tool with its tip at `tip`, turned about the tip by `tilt`.
pub(crate) fn flange(tip: &Vector3, tilt: &Vector3, length: f64) -> Pose {
    let into = UnitQuaternion::from_axis_angle(&Vector3::x_axis(), std::f64::consts::PI);
    let rotation = UnitQuaternion::from_scaled_axis(*tilt) * into;
    Pose::from_parts((tip - rotation * Vector3::new(0.0, 0.0, length)).into(), rotation)
}
