//! Where the hole is, where an episode starts and what the robot believes.

use palpate_spatial::{JointVector, Pose, UnitQuaternion, Vector3};
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;

use crate::config::{ConfigError, require};

/// How episodes differ from each other.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Distribution {
    /// Every episode starts at the nominal start and knows the goal exactly.
    Fixed,
    /// Start and believed goal are drawn anew for each episode.
    Uncertain,
}

/// A uniform spread around a nominal pose: half-widths.
#[derive(Clone, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Spread {
    /// Along the hole's x, y, z, m.
    pub position: [f64; 3],
    /// About the hole's x, y, z, degrees.
    pub rotation_deg: [f64; 3],
}

/// An insertion task. Every key must be stated.
///
/// The hole frame has its origin in the middle of the mouth and z out of the board; the tool's z
/// points into the hole.
#[derive(Clone, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(deny_unknown_fields)]
pub struct TaskConfig {
    /// Name, for run directories and tables.
    pub name: String,
    /// Origin of the hole frame in base_link, m.
    pub hole_position: [f64; 3],
    /// Roll, pitch, yaw of the hole frame in base_link, degrees.
    pub hole_rpy_deg: [f64; 3],
    /// Depth of the goal below the mouth, m.
    pub depth: f64,
    /// The task is done when the tool is this close to the goal, m.
    pub success_distance: f64,
    /// Joints near which the start is solved, rad.
    pub q_home: JointVector,
    /// Nominal start of the tool centre point in the hole frame, m.
    pub start_position: [f64; 3],
    /// Nominal tilt of the tool at the start, about the hole's x, y, z, degrees.
    pub start_rotation_deg: [f64; 3],
    /// How episodes differ.
    pub distribution: Distribution,
    /// Spread of the start (`uncertain` only).
    pub start_spread: Spread,
    /// Spread of the believed goal about the true one, hidden from the policy (`uncertain` only).
    pub goal_spread: Spread,
}

/// The draw of one episode.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct EpisodeStart {
    /// Start of the tool.
    pub base_T_start: Pose,
    /// Where the robot believes the goal to be.
    pub base_T_believed: Pose,
}

impl TaskConfig {
    /// Checks that the numbers describe a task.
    pub fn validate(&self) -> Result<(), ConfigError> {
        let positive = |x: f64| x > 0.0 && x.is_finite();
        require(positive(self.depth), "task.depth", self.depth, "positive")?;
        require(
            positive(self.success_distance) && self.success_distance < self.depth,
            "task.success_distance",
            self.success_distance,
            "positive and less than task.depth, or hovering above the hole would count as inserted",
        )?;
        let lowest = self.start_position[2]
            - if self.distribution == Distribution::Uncertain {
                self.start_spread.position[2]
            } else {
                0.0
            };
        require(lowest > 0.0, "task.start_position[2]", lowest, "above the mouth for every draw")?;
        let numbers = self
            .hole_position
            .iter()
            .chain(&self.hole_rpy_deg)
            .chain(&self.start_position)
            .chain(&self.start_rotation_deg)
            .chain(&self.start_spread.position)
            .chain(&self.start_spread.rotation_deg)
            .chain(&self.goal_spread.position)
            .chain(&self.goal_spread.rotation_deg)
            .chain(&self.q_home);
        for &x in numbers {
            require(x.is_finite(), "task", x, "finite in every number")?;
        }
        Ok(())
    }

    /// The hole frame.
    pub fn base_T_hole(&self) -> Pose {
        let [roll, pitch, yaw] = self.hole_rpy_deg.map(f64::to_radians);
        Pose::from_parts(
            Vector3::from(self.hole_position).into(),
            UnitQuaternion::from_euler_angles(roll, pitch, yaw),
        )
    }

    /// The tool pose that completes the task.
    pub fn base_T_goal(&self) -> Pose {
        self.base_T_hole() * tool_in_hole(Vector3::new(0.0, 0.0, -self.depth), Vector3::zeros())
    }

    /// Draws an episode. The same `seed` and `episode` give the same draw, whatever came before.
    pub fn draw(&self, seed: u64, episode: u64) -> EpisodeStart {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        rng.set_stream(episode);
        let (start_offset, start_tilt) = self.offset(&self.start_spread, &mut rng);
        let (goal_offset, goal_tilt) = self.offset(&self.goal_spread, &mut rng);
        let nominal_tilt = Vector3::from(self.start_rotation_deg.map(f64::to_radians));
        EpisodeStart {
            base_T_start: self.base_T_hole()
                * tool_in_hole(
                    Vector3::from(self.start_position) + start_offset,
                    nominal_tilt + start_tilt,
                ),
            base_T_believed: self.base_T_hole()
                * tool_in_hole(Vector3::new(0.0, 0.0, -self.depth) + goal_offset, goal_tilt),
        }
    }

    /// Position (m) and rotation vector (rad); always six numbers, so that draws stay aligned.
    fn offset(&self, spread: &Spread, rng: &mut ChaCha8Rng) -> (Vector3, Vector3) {
        let width = if self.distribution == Distribution::Uncertain { 1.0 } else { 0.0 };
        let mut draw = |half: f64| width * half * rng.random_range(-1.0..=1.0);
        let position = Vector3::from(spread.position.map(&mut draw));
        let rotation = Vector3::from(spread.rotation_deg.map(|deg| draw(deg.to_radians())));
        (position, rotation)
    }
}

/// hole_T_tool for a tool centre point at `position` (m) with its z axis into the hole, tilted by `rotation` (rad).
fn tool_in_hole(position: Vector3, rotation: Vector3) -> Pose {
    let into_hole = UnitQuaternion::from_axis_angle(&Vector3::x_axis(), std::f64::consts::PI);
    Pose::from_parts(position.into(), UnitQuaternion::from_scaled_axis(rotation) * into_hole)
}
