//! What the shield's tests, its soak and its benchmark share: limits, an arm behind a lag, adversaries, and a
//! judge that shares no code with the shield.
#![allow(
    dead_code,
    clippy::unwrap_used,
    clippy::allow_attributes,
    reason = "each user takes its part"
)]

pub(crate) mod adversary;
pub(crate) mod judge;
pub(crate) mod soak;

use std::sync::LazyLock;

use palpate_kinematics::SerialChain;
use palpate_robot_io::RobotState;
use palpate_safety::{Measurement, Mode, SafetyConfig};
use palpate_spatial::{DOF, JointVector, Pose, Twist, UnitQuaternion, Vector3, Wrench};

pub(crate) const DT: f64 = 0.002;
pub(crate) const TCP: f64 = 0.150;
pub(crate) const HOME: [f64; 6] = [0.0, -90.0, 90.0, -90.0, -90.0, 0.0];

pub(crate) fn home() -> JointVector {
    HOME.map(f64::to_radians).into()
}

pub(crate) fn urdf() -> String {
    std::fs::read_to_string(concat!(env!("CARGO_MANIFEST_DIR"), "/../../assets/robots/ur3e.urdf"))
        .unwrap()
}

/// base_link to tool0.
pub(crate) fn arm() -> SerialChain<DOF> {
    SerialChain::from_urdf_str(&urdf(), "base_link", "tool0").unwrap()
}

pub(crate) fn tool0_T_tool() -> Pose {
    Pose::from_parts(Vector3::new(0.0, 0.0, TCP).into(), UnitQuaternion::identity())
}

/// base_link to tool centre point.
pub(crate) fn chain() -> SerialChain<DOF> {
    static CHAIN: LazyLock<SerialChain<DOF>> = LazyLock::new(|| arm().with_tool(tool0_T_tool()));
    CHAIN.clone()
}

/// The limits of the default preset: a peg task on a UR3e.
pub(crate) fn preset() -> SafetyConfig {
    let text = include_str!("../../../../assets/presets/palpate.toml");
    let mut table: toml::Table = toml::from_str(text).unwrap();
    let mut safety: SafetyConfig = table.remove("safety").unwrap().try_into().unwrap();
    safety.mode = Mode::Shield;
    safety
}

/// The same with room to reach singularities, the joint limits and itself, and with contacts too soft to slow it.
pub(crate) fn wide() -> SafetyConfig {
    let mut safety = preset();
    let shield = safety.shield.as_mut().unwrap();
    shield.workspace.min = Vector3::new(-0.45, -0.45, 0.05);
    shield.workspace.max = Vector3::new(0.45, 0.45, 0.70);
    shield.planes.retain(|plane| plane.name == "table");
    shield.force.stiffness = 100.0;
    safety
}

/// A sample of an arm at `q` that is sent `q_target`.
pub(crate) fn sample(
    chain: &SerialChain<DOF>,
    time: f64,
    q: &JointVector,
    q_target: &JointVector,
    wrench: Wrench,
) -> Measurement {
    let state = RobotState {
        time,
        q: *q,
        dq: JointVector::zeros(),
        q_target: *q_target,
        sensor_wrench: wrench,
    };
    Measurement {
        state,
        base_T_tool: chain.forward(q),
        tool_twist: Twist::zero(),
        wrench,
        raw_wrench: wrench,
    }
}
