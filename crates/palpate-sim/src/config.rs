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

/// A setting that makes no sense.
#[derive(Debug, thiserror::Error)]
#[error("sim.{key} is {value}, but it must be {must}")]
pub struct ConfigError {
    key: &'static str,
    value: f64,
    must: String,
}

impl SimConfig {
    /// Half the width of the hole, m.
    pub fn hole_half_width(&self) -> f64 {
        f64::midpoint(self.peg.width, self.hole.clearance)
    }

    /// Checks every number.
    ///
    /// # Errors
    /// The first that makes no sense, with what would.
    pub fn validate(&self) -> Result<(), ConfigError> {
        let bad = |key, value, must: &str| Err(ConfigError { key, value, must: must.into() });
        let positive = [
            ("peg.width", self.peg.width),
            ("peg.length", self.peg.length),
            ("hole.clearance", self.hole.clearance),
            ("hole.depth", self.hole.depth),
            ("tool.mass", self.tool.mass),
            ("tool.length", self.tool.length),
            ("tool.inertia[0]", self.tool.inertia[0]),
            ("tool.inertia[1]", self.tool.inertia[1]),
            ("tool.inertia[2]", self.tool.inertia[2]),
            ("compliance.linear_stiffness", self.compliance.linear_stiffness),
            ("compliance.angular_stiffness", self.compliance.angular_stiffness),
            ("compliance.linear_damping", self.compliance.linear_damping),
            ("compliance.angular_damping", self.compliance.angular_damping),
            ("solver.contact_frequency", self.solver.contact_frequency),
            ("solver.contact_damping_ratio", self.solver.contact_damping_ratio),
            ("solver.prediction_distance", self.solver.prediction_distance),
        ];
        for (key, value) in positive {
            if !(value > 0.0 && value.is_finite()) {
                return bad(key, value, "positive and finite");
            }
        }
        let not_negative = [
            ("friction", self.friction),
            ("hole.chamfer", self.hole.chamfer),
            ("tool.centre_of_mass", self.tool.centre_of_mass),
            ("servo.lag", self.servo.lag),
            ("servo.dead_time", self.servo.dead_time),
            ("sensor.force_noise", self.sensor.force_noise),
            ("sensor.torque_noise", self.sensor.torque_noise),
            ("sensor.force_quantum", self.sensor.force_quantum),
            ("sensor.torque_quantum", self.sensor.torque_quantum),
        ];
        for (key, value) in not_negative {
            if !(value >= 0.0 && value.is_finite()) {
                return bad(key, value, "zero or positive");
            }
        }
        let counts = [
            ("solver.steps_per_tick", f64::from(self.solver.steps_per_tick)),
            ("solver.iterations", self.solver.iterations as f64),
            ("solver.pgs_iterations", self.solver.pgs_iterations as f64),
        ];
        for (key, value) in counts {
            if !(value >= 1.0) {
                return bad(key, value, "at least 1");
            }
        }
        let per_side = self.hole.clearance / 2.0;
        if !(self.solver.prediction_distance <= per_side / 2.0) {
            let must = format!("at most {:.1e}, half the clearance per side, or the mouth blocks the peg", per_side / 2.0);
            return Err(ConfigError {
                key: "solver.prediction_distance",
                value: self.solver.prediction_distance,
                must,
            });
        }
        if !(self.hole.chamfer <= self.hole.depth / 2.0) {
            let must = format!("at most {}, half the board's thickness", self.hole.depth / 2.0);
            return Err(ConfigError { key: "hole.chamfer", value: self.hole.chamfer, must });
        }
        let room = self.hole_half_width() + self.hole.chamfer + 2.0 * self.peg.width;
        if !(self.hole.board_half_width >= room) {
            let must = format!("at least {room:.3}, so that a peg beside the hole lands on the board");
            return Err(ConfigError { key: "hole.board_half_width", value: self.hole.board_half_width, must });
        }
        if !(self.peg.length <= self.tool.length) {
            let must = format!("at most sim.tool.length = {}", self.tool.length);
            return Err(ConfigError { key: "peg.length", value: self.peg.length, must });
        }
        Ok(())
    }
}
