//! Geometry and physics of the simulation. Every key must be stated.

use crate::spread::SpreadConfig;

/// Everything the simulator needs to know but the arm and the pose of the hole.
#[derive(Clone, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SimConfig {
    /// Coulomb friction coefficient of all contacts.
    pub friction: f64,
    /// What the tool must not hit, besides the parts.
    pub obstacles: Vec<ObstacleConfig>,
    /// The peg.
    pub peg: PegConfig,
    /// The hole.
    pub hole: HoleConfig,
    /// What gives way under the part that the tool does not hold; rigid if absent.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub receptacle: Option<ReceptacleConfig>,
    /// Gripper and peg as one rigid body.
    pub tool: ToolConfig,
    /// The spring between flange and tool: sensor, gripper and arm in series.
    pub compliance: ComplianceConfig,
    /// The arm's position servo.
    pub servo: ServoConfig,
    /// The force/torque sensor.
    pub sensor: SensorConfig,
    /// What of the above is drawn anew for every episode.
    pub spread: SpreadConfig,
    /// Numerical settings of the physics engine.
    pub solver: SolverConfig,
}

/// A peg: a pin or a prism, its axis along the axis of whoever holds it.
#[derive(Clone, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PegConfig {
    /// Its outline, and with it the hole's.
    pub shape: PegShape,
    /// Diameter, or distance between opposite sides, m.
    pub width: f64,
    /// Length of the part that can touch, m.
    pub length: f64,
    /// Width of the 45° chamfer at the tip, m; 0 for a sharp edge. Round pegs only.
    pub chamfer: f64,
    /// Who holds it; the other one holds the hole.
    pub holder: Holder,
}

/// The outline of peg and hole. A prism's sides lie across its frame's x axis.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum PegShape {
    /// A pin in a bore.
    Round,
    /// Four sides.
    Square,
    /// Six sides.
    Hexagonal,
}

/// Who holds the peg.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Holder {
    /// The tool: a peg goes into a hole.
    Tool,
    /// The fixture: the peg is a bolt and the tool puts a ring over it.
    Fixture,
}

/// The body with the hole: a board, or the ring in the tool.
#[derive(Clone, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(deny_unknown_fields)]
pub struct HoleConfig {
    /// Hole width minus peg width, m.
    pub clearance: f64,
    /// Thickness of the board or ring, m.
    pub depth: f64,
    /// Width of the 45° lead-in, m; 0 for a sharp mouth.
    pub chamfer: f64,
    /// Half the board's side, or the ring's outer radius, m.
    pub board_half_width: f64,
}

/// A body on a six-axis spring that carries the board or the bolt: a second arm, a compliant clamp.
#[derive(Clone, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ReceptacleConfig {
    /// Mass, kg. Its centre lies half the part's depth behind the hole frame's origin.
    pub mass: f64,
    /// Principal moments of inertia about that centre, kg·m².
    pub inertia: [f64; 3],
    /// The spring, at the hole frame's origin.
    pub compliance: ComplianceConfig,
}

/// A box that stands still, its sides along the hole frame's axes.
#[derive(Clone, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ObstacleConfig {
    /// Its middle in the hole frame, m.
    pub centre: [f64; 3],
    /// Half its sides, m.
    pub half: [f64; 3],
}

/// Gripper and peg as one rigid body; distances from the sensor along the tool's z axis.
#[derive(Clone, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ToolConfig {
    /// Mass, kg.
    pub mass: f64,
    /// Sensor to tip, m.
    pub length: f64,
    /// Half the side of the square body between sensor and held part that obstacles stop, m.
    pub half_width: f64,
    /// Sensor to centre of mass, m.
    pub centre_of_mass: f64,
    /// Principal moments of inertia about the centre of mass, kg·m².
    pub inertia: [f64; 3],
}

/// A six-axis spring and damper at the sensor.
#[derive(Clone, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ComplianceConfig {
    /// N/m.
    pub linear_stiffness: f64,
    /// N·m/rad.
    pub angular_stiffness: f64,
    /// N·s/m.
    pub linear_damping: f64,
    /// N·m·s/rad.
    pub angular_damping: f64,
}

/// First-order lag behind a dead time, per joint.
#[derive(Clone, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ServoConfig {
    /// Time constant, s; 0 for an ideal servo.
    pub lag: f64,
    /// Dead time, s, rounded to control periods.
    pub dead_time: f64,
}

/// Imperfections of the force/torque sensor.
#[derive(Clone, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SensorConfig {
    /// Standard deviation of white noise on each force axis, N.
    pub force_noise: f64,
    /// Standard deviation of white noise on each torque axis, N·m.
    pub torque_noise: f64,
    /// Standard deviation of each force axis' offset at power-up, N. A tare removes it.
    pub force_bias: f64,
    /// Standard deviation of each torque axis' offset at power-up, N·m. A tare removes it.
    pub torque_bias: f64,
    /// Standard deviation of each force axis' drift rate, N/s, drawn at each tare.
    pub force_drift: f64,
    /// Standard deviation of each torque axis' drift rate, N·m/s, drawn at each tare.
    pub torque_drift: f64,
    /// Resolution of the force axes, N; 0 for none.
    pub force_quantum: f64,
    /// Resolution of the torque axes, N·m; 0 for none.
    pub torque_quantum: f64,
}

/// Numerical settings of rapier.
#[derive(Clone, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SolverConfig {
    /// World steps per 2 ms tick.
    pub steps_per_tick: u32,
    /// Solver substeps per world step.
    pub iterations: usize,
    /// Gauss-Seidel passes per substep. One is not converged for a stiff joint in contact.
    pub pgs_iterations: usize,
    /// Natural frequency of the contacts, Hz: higher is stiffer.
    pub contact_frequency: f64,
    /// Damping ratio of the contacts.
    pub contact_damping_ratio: f64,
    /// Contacts are predicted this far ahead, m: far below the clearance per side.
    pub prediction_distance: f64,
}

impl SimConfig {
    /// Half the width of the hole, m.
    pub fn hole_half_width(&self) -> f64 {
        f64::midpoint(self.peg.width, self.hole.clearance)
    }

    /// Half the width of the hole's mouth, m.
    pub fn mouth_half_width(&self) -> f64 {
        self.hole_half_width() + self.hole.chamfer
    }

    /// Whether the tool holds the hole.
    pub fn ring_on_tool(&self) -> bool {
        self.peg.holder == Holder::Fixture
    }

    /// Length along the tool's axis of what the tool holds, m.
    pub(crate) fn held_length(&self) -> f64 {
        if self.ring_on_tool() { self.hole.depth } else { self.peg.length }
    }
}
