//! Geometry and physics of the simulation. Every key must be stated.

/// Everything the simulator needs to know but the arm and the pose of the hole.
#[derive(Clone, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SimConfig {
    /// Coulomb friction coefficient between peg and board.
    pub friction: f64,
    /// The peg.
    pub peg: PegConfig,
    /// The hole.
    pub hole: HoleConfig,
    /// Gripper and peg as one rigid body.
    pub tool: ToolConfig,
    /// The spring between flange and tool: sensor, gripper and arm in series.
    pub compliance: ComplianceConfig,
    /// The arm's position servo.
    pub servo: ServoConfig,
    /// The force/torque sensor.
    pub sensor: SensorConfig,
    /// Numerical settings of the physics engine.
    pub solver: SolverConfig,
}

/// A square peg along the tool's z axis, its faces across the tool's x and y axes.
#[derive(Clone, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PegConfig {
    /// Side, m.
    pub width: f64,
    /// Length of the part that can touch, m.
    pub length: f64,
}

/// A square hole through a board.
#[derive(Clone, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(deny_unknown_fields)]
pub struct HoleConfig {
    /// Hole width minus peg width, m.
    pub clearance: f64,
    /// Thickness of the board, m.
    pub depth: f64,
    /// Width of the 45° lead-in, m; 0 for a sharp mouth.
    pub chamfer: f64,
    /// Half the board's side, m.
    pub board_half_width: f64,
}

/// Gripper and peg as one rigid body; distances from the sensor along the tool's z axis.
#[derive(Clone, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ToolConfig {
    /// Mass, kg.
    pub mass: f64,
    /// Sensor to tip, m.
    pub length: f64,
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
}
