//! Where the arm is and how it is driven.

use serde::{Deserialize, Serialize};

use crate::UrError;

/// Settings of a [`UrArm`](crate::UrArm). Start from [`UrConfig::at`].
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct UrConfig {
    /// Host name or address of the controller.
    pub host: String,
    /// TCP ports; change them for a virtual controller or a tunnel.
    pub ports: Ports,
    /// Samples and commands per second: 500 on an e-Series.
    pub frequency: f64,
    /// Missing samples, unsent or unheard commands in a row that count as a lost link. So do commands that the
    /// control program takes more than twice as many cycles late.
    pub stale_ticks: u32,
    /// Cycles without a packet after which the control program brakes the arm.
    pub stall_ticks: u32,
    /// Deceleration of the control program's brake, rad/s².
    pub brake: f64,
    /// servoj's look-ahead, s: 0.03 to 0.2. Smaller follows sooner.
    pub lookahead: f64,
    /// servoj's gain: 100 to 2000. Larger follows more tightly.
    pub gain: f64,
    /// Joint speeds beyond which a set-point is refused here and by the control program, rad/s. They must
    /// not exceed the arm's own (UR3e: 180 °/s, wrists 360 °/s).
    pub joint_speed_max: [f64; 6],
    /// How far from the measured joints a first set-point may be, rad.
    pub first_step_max: f64,
    /// Packets per second below which the controller itself stops the program, whatever the program does:
    /// the second line behind `stall_ticks`. It also counts at rest, so 1 means that reads may pause for
    /// up to a second. `None` leaves the controller's watchdog off.
    pub watchdog: Option<f64>,
    /// About which point the controller reports forces.
    pub force_point: ForcePoint,
    /// Samples in a row with the same force/torque reading that count as a frozen sensor; 0 does not look, for an
    /// arm whose sensor has no noise.
    #[serde(default = "frozen_ticks")]
    pub frozen_ticks: u32,
    /// What hangs on the flange; `None` leaves it as set in the installation.
    pub payload: Option<Payload>,
    /// Tool centre point seen from the flange: m and a rotation vector in rad. `None` leaves it as set in
    /// the installation. It does not move the wrench, which is always reported at the flange.
    pub tcp: Option<[f64; 6]>,
    /// Time to accept a connection and to answer a request, s.
    pub answer_timeout: f64,
    /// Time from upload to the control program's first report, s.
    pub program_timeout: f64,
    /// A controller that has run for less than 40 s may restart its RTDE server: wait for this much data
    /// first, s.
    pub boot_settle: f64,
    /// Connection attempts of one `connect` or `recover`.
    pub attempts: u32,
}

/// TCP ports of a controller.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Ports {
    /// Real-time data exchange.
    pub rtde: u16,
    /// Where URScript is accepted: the secondary interface, or the primary (30001).
    pub script: u16,
    /// Dashboard server.
    pub dashboard: u16,
}

impl Default for Ports {
    fn default() -> Self {
        Self { rtde: 30_004, script: 30_002, dashboard: 29_999 }
    }
}

/// The point that `actual_TCP_force` refers to. Its axes are the base's on every generation.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum ForcePoint {
    /// The flange: e-Series with its own sensor.
    #[default]
    Flange,
    /// The tool centre point: CB3, and an external sensor fed through `ft_rtde_input_enable`.
    Tcp,
}

/// Mass on the flange.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Payload {
    /// kg.
    pub mass: f64,
    /// Centre of gravity seen from the flange, m.
    pub cog: [f64; 3],
}

/// 0.2 s. A sensor at rest changes by its noise in every sample.
fn frozen_ticks() -> u32 {
    100
}

impl UrConfig {
    /// An e-Series arm at this host.
    pub fn at(host: impl Into<String>) -> Self {
        use std::f64::consts::{PI, TAU};
        Self {
            host: host.into(),
            ports: Ports::default(),
            frequency: 500.0,
            stale_ticks: 5,
            stall_ticks: 10,
            brake: 10.0,
            lookahead: 0.03,
            gain: 2000.0,
            joint_speed_max: [PI, PI, PI, TAU, TAU, TAU],
            first_step_max: 0.02,
            watchdog: Some(1.0),
            force_point: ForcePoint::Flange,
            frozen_ticks: frozen_ticks(),
            payload: None,
            tcp: None,
            answer_timeout: 3.0,
            program_timeout: 5.0,
            boot_settle: 1.0,
            attempts: 5,
        }
    }

    /// Refuses settings that the controller would refuse, or misunderstand.
    pub fn validate(&self) -> Result<(), UrError> {
        let within = |name: &'static str, value: f64, low: f64, high: f64| {
            if value >= low && value <= high {
                return Ok(());
            }
            Err(UrError::Config { name, value, low, high })
        };
        within("frequency", self.frequency, 1.0, 500.0)?;
        within("stale_ticks", self.stale_ticks.into(), 1.0, 500.0)?;
        within("stall_ticks", self.stall_ticks.into(), 2.0, 100.0)?;
        within("brake", self.brake, 1.0, 40.0)?;
        within("lookahead", self.lookahead, 0.03, 0.2)?;
        within("gain", self.gain, 100.0, 2000.0)?;
        for speed in self.joint_speed_max {
            within("joint_speed_max", speed, 1e-3, std::f64::consts::TAU)?;
        }
        within("first_step_max", self.first_step_max, 1e-6, 0.1)?;
        if let Some(rate) = self.watchdog {
            within("watchdog", rate, 0.1, 100.0)?;
        }
        if let Some(payload) = self.payload {
            within("payload.mass", payload.mass, 0.0, 50.0)?;
            for x in payload.cog {
                within("payload.cog", x, -1.0, 1.0)?;
            }
        }
        for x in self.tcp.iter().flatten() {
            within("tcp", *x, -10.0, 10.0)?;
        }
        within("answer_timeout", self.answer_timeout, 0.01, 60.0)?;
        within("program_timeout", self.program_timeout, 0.01, 60.0)?;
        within("boot_settle", self.boot_settle, 0.0, 60.0)?;
        within("attempts", self.attempts.into(), 1.0, 100.0)
    }

    /// How long a sample may be missing.
    pub(crate) fn stale(&self) -> std::time::Duration {
        std::time::Duration::from_secs_f64(f64::from(self.stale_ticks) / self.frequency)
    }

    /// Joint steps of one period, rad, with room for rounding.
    pub(crate) fn step_max(&self) -> [f64; 6] {
        self.joint_speed_max.map(|speed| speed / self.frequency * 1.05)
    }
}
