//! What a controller is made with.

use std::collections::BTreeMap;

use palpate_kinematics::{DhTable, UrModel};
use palpate_ur::proto::{ControllerVersion, RobotMode};

use super::protection::ControllerLimits;

/// How long things take, s.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Delays {
    /// From `power on` to idle.
    pub power_on: f64,
    /// From `brake release` to running.
    pub brake_release: f64,
    /// From a protective stop to the first moment at which it can be unlocked.
    pub unlock: f64,
}

impl Default for Delays {
    /// 2 s, 1 s, and the 5 s of UR's dashboard server.
    fn default() -> Self {
        Self { power_on: 2.0, brake_release: 1.0, unlock: 5.0 }
    }
}

/// What a controller is made with.
#[derive(Clone, Debug)]
pub struct ControllerConfig {
    /// Which arm.
    pub model: UrModel,
    /// This arm's calibration: differences from the nominal figures.
    pub calibration: DhTable<6>,
    /// What `v` and `PolyscopeVersion` answer.
    pub version: ControllerVersion,
    /// What `get serial number` answers.
    pub serial_number: String,
    /// Limits beyond which it stops the arm.
    pub limits: ControllerLimits,
    /// How long things take.
    pub delays: Delays,
    /// The mode at the start: [`RobotMode::Running`], or [`RobotMode::PowerOff`] as after boot.
    pub start: RobotMode,
    /// Whether the pendant is in remote control.
    pub remote_control: bool,
    /// Programs that `load` finds: name (`peg.urp`) and URScript.
    pub programs: BTreeMap<String, String>,
    /// Tool centre point of the installation: m and rotation vector, flange to TCP.
    pub tcp_offset: [f64; 6],
    /// Payload of the installation, kg.
    pub payload: f64,
    /// What the tool weighs in fact, kg and centre of mass in tool0 axes, m. With it a payload that was set
    /// wrongly reads as a force that turns with the tool; without it gravity is left out.
    pub tool: Option<(f64, [f64; 3])>,
    /// Seed of everything random: noise of faults, `random()`.
    pub seed: u64,
}

impl ControllerConfig {
    /// A nominal, powered arm of this model in remote control.
    pub fn new(model: UrModel) -> Self {
        Self {
            model,
            calibration: DhTable { theta: [0.0; 6], d: [0.0; 6], a: [0.0; 6], alpha: [0.0; 6] },
            version: ControllerVersion { major: 5, minor: 17, bugfix: 0, build: 1_000_000 },
            serial_number: "20265300001".into(),
            limits: ControllerLimits::for_model(model),
            delays: Delays::default(),
            start: RobotMode::Running,
            remote_control: true,
            programs: BTreeMap::new(),
            tcp_offset: [0.0; 6],
            payload: 0.0,
            tool: None,
            seed: 0,
        }
    }
}
