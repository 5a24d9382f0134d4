//! The controller's state and its control cycle.

use std::collections::VecDeque;

use palpate_kinematics::ModelError;
use palpate_spatial::{JointVector, Vector3, Vector6};
use palpate_ur::proto::{RobotMode, RuntimeState, SafetyStatus};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;

use super::DT;
use super::arm::{ArmModel, Sample};
use super::config::ControllerConfig;
use super::motion::{Motion, Next, SetPoint};
use super::program::Event;
use super::protection::StopCause;
use super::registers::Registers;
use super::sensor::{Sensor, SensorFault, weight};
use super::watchdog::{Watchdog, WatchdogAction};
use crate::plant::{Plant, PlantState};
use crate::script::Machine;

/// A UR controller with its arm.
pub struct Controller {
    pub(crate) config: ControllerConfig,
    pub(crate) arm: ArmModel,
    plant: Box<dyn Plant>,
    /// Cycles since the start.
    pub(crate) tick: u64,
    /// What the RTDE time stamp is ahead of the cycles, s: faults move it.
    pub(crate) clock_offset: f64,
    pub(crate) robot_mode: RobotMode,
    pub(crate) safety: SafetyStatus,
    pub(crate) runtime: RuntimeState,
    pub(crate) remote_control: bool,
    /// When a power sequence ends, and in which mode.
    pub(crate) powering: Option<(u64, RobotMode)>,
    pub(crate) stopped_at: u64,
    pub(crate) plant_failed: bool,
    pub(crate) last_stop: Option<StopCause>,
    pub(crate) protective_stops: u64,
    pub(crate) unlocks: u64,
    pub(crate) loaded: Option<String>,
    pub(crate) operational_mode: Option<&'static str>,
    pub(crate) machine: Option<Machine>,
    pub(crate) secondary: Vec<Machine>,
    pub(crate) control_line: u32,
    pub(crate) watchdogs: Vec<Watchdog>,
    pub(crate) events: VecDeque<Event>,
    pub(crate) popup: Option<String>,
    pub(crate) registers: Registers,
    pub(crate) digital_outputs: u64,
    pub(crate) analog_outputs: [f64; 2],
    /// Where the slider stands, and the scaling that follows it.
    pub(crate) slider: f64,
    pub(crate) scaling: f64,
    pub(crate) payload: f64,
    pub(crate) payload_cog: [f64; 3],
    pub(crate) gravity: [f64; 3],
    pub(crate) motion: Motion,
    /// A motion that a pause interrupted.
    pub(crate) interrupted: Option<Motion>,
    pub(crate) set_point: SetPoint,
    pub(crate) ddq_target: JointVector,
    measured: PlantState,
    pub(crate) sensor: Sensor,
    pub(crate) actual: Sample,
    pub(crate) target: Sample,
    pub(crate) rng: ChaCha8Rng,
}

impl std::fmt::Debug for Controller {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Controller")
            .field("tick", &self.tick)
            .field("robot_mode", &self.robot_mode)
            .field("safety", &self.safety)
            .field("runtime", &self.runtime)
            .finish_non_exhaustive()
    }
}

impl Controller {
    /// A controller of an arm that stands where `plant` starts.
    ///
    /// # Errors
    /// A calibration or tool that is no arm of this model.
    pub fn new(config: ControllerConfig, plant: Box<dyn Plant>) -> Result<Self, ModelError> {
        let arm = ArmModel::new(&config)?;
        let (q, rest) = (plant.start(), JointVector::zeros());
        let sample = arm.sample(&q, &rest);
        Ok(Self {
            tick: 0,
            clock_offset: 0.0,
            robot_mode: config.start,
            safety: SafetyStatus::Normal,
            runtime: RuntimeState::Stopped,
            remote_control: config.remote_control,
            powering: None,
            stopped_at: 0,
            plant_failed: false,
            last_stop: None,
            protective_stops: 0,
            unlocks: 0,
            loaded: None,
            operational_mode: None,
            machine: None,
            secondary: Vec::new(),
            control_line: 0,
            watchdogs: Vec::new(),
            events: VecDeque::new(),
            popup: None,
            registers: Registers::default(),
            digital_outputs: 0,
            analog_outputs: [0.0; 2],
            slider: 1.0,
            scaling: 1.0,
            payload: config.payload,
            payload_cog: [0.0; 3],
            gravity: [0.0, 0.0, 9.82],
            motion: Motion::Hold,
            interrupted: None,
            set_point: SetPoint { q, dq: rest },
            ddq_target: rest,
            measured: PlantState { q, dq: rest, wrench: palpate_spatial::Wrench::zero() },
            sensor: Sensor::default(),
            actual: sample,
            target: sample,
            rng: ChaCha8Rng::seed_from_u64(config.seed),
            arm,
            plant,
            config,
        })
    }

    /// One control cycle: program, set-point, arm, checks.
    pub fn tick(&mut self) {
        self.tick += 1;
        self.tick_power();
        self.check_watchdogs();
        self.run_programs();
        self.advance_set_point();
        self.move_arm();
        self.target = self.arm.sample(&self.set_point.q, &self.set_point.dq);
        self.actual = self.arm.sample(&self.measured.q, &self.measured.dq);
    }

    fn check_watchdogs(&mut self) {
        if self.runtime != RuntimeState::Playing {
            return;
        }
        let mut due = None;
        for dog in &mut self.watchdogs {
            if let Some(action) = dog.check(&self.registers, self.tick) {
                due = Some((action, dog.variable().to_owned()));
            }
        }
        match due {
            Some((WatchdogAction::Stop, name)) => {
                self.stop_program(&format!("RTDE watchdog: {name} was not updated"));
            }
            Some((WatchdogAction::Pause, _)) => _ = self.pause_program(),
            _ => {}
        }
    }

    fn advance_set_point(&mut self) {
        /// Of the scaling behind the slider, 1/s.
        const SLIDE: f64 = 2.0;
        self.scaling += (self.slider - self.scaling).clamp(-SLIDE * DT, SLIDE * DT);
        let now = self.set_point;
        // The slider slows programs down, not stops.
        let scale = if self.runtime == RuntimeState::Playing { self.scaling } else { 1.0 };
        let (next, over) = match self.motion.next(&now, &self.arm, scale) {
            Next::Go(next) => (next, false),
            Next::Done(next) => (next, true),
            Next::Impossible(problem) => {
                self.protective_stop(StopCause::Path(problem));
                return self.advance_stop(&now);
            }
        };
        if over {
            // A servo stream that dries up ends in a stop, everything else where it was going.
            match self.motion {
                Motion::Servo { .. } => {
                    self.brake();
                    return self.advance_stop(&now);
                }
                _ => self.motion = Motion::Hold,
            }
        }
        let stopping = self.safety == SafetyStatus::ProtectiveStop;
        match self.config.limits.check_set_point(&now, &next) {
            Err(cause) if !stopping => {
                self.protective_stop(cause);
                self.advance_stop(&now);
            }
            _ => self.accept(&now, next),
        }
    }

    /// The first cycle of a stop that was decided in this cycle.
    fn advance_stop(&mut self, now: &SetPoint) {
        if let Next::Go(next) | Next::Done(next) = self.motion.next(now, &self.arm, 1.0) {
            self.accept(now, next);
        }
    }

    fn accept(&mut self, now: &SetPoint, next: SetPoint) {
        self.ddq_target = (next.dq - now.dq) / DT;
        self.set_point = next;
    }

    fn move_arm(&mut self) {
        if self.plant_failed {
            return;
        }
        match self.plant.step(&self.set_point.q) {
            Ok(state) => self.measured = state,
            Err(error) => {
                self.plant_failed = true;
                return self.safety_fault(&error.to_string());
            }
        }
        let base_T_flange = self.arm.flange(&self.measured.q);
        let excess = self.unaccounted_weight(&base_T_flange.rotation);
        self.sensor.measure(&self.measured.wrench, &excess, &base_T_flange.rotation, DT);
        let force = self.measured.wrench.force.norm();
        if self.robot_mode == RobotMode::Running
            && let Err(cause) =
                self.config.limits.check_measured(&self.set_point.q, &self.measured.q, force)
        {
            self.protective_stop(cause);
        }
    }

    /// After the arm broke down: it stands wherever it is whole again.
    pub(crate) fn restart_plant(&mut self) {
        if std::mem::take(&mut self.plant_failed) {
            let rest = JointVector::zeros();
            self.set_point = SetPoint { q: self.plant.restart(), dq: rest };
            self.measured.q = self.set_point.q;
            self.measured.dq = rest;
            self.motion = Motion::Hold;
        }
    }

    /// What the payload setting gets wrong, tool axes.
    fn unaccounted_weight(&self, base_R_tool: &palpate_spatial::UnitQuaternion) -> Vector6 {
        let Some((mass, centre)) = &self.config.tool else { return Vector6::zeros() };
        let down = base_R_tool.inverse() * -Vector3::z();
        weight(*mass, centre, &down) - weight(self.payload, &self.payload_cog, &down)
    }

    pub(crate) fn zero_sensor(&mut self) {
        self.plant.zero_sensor();
        // What the sensor would still read, by defects and weight, goes as well.
        let base_T_flange = self.arm.flange(&self.measured.q);
        let excess = self.unaccounted_weight(&base_T_flange.rotation);
        let tared = palpate_spatial::Wrench::zero();
        self.sensor.measure(&tared, &excess, &base_T_flange.rotation, 0.0);
        self.sensor.tare();
    }

    /// Spoils the force/torque sensor.
    pub fn inject_sensor(&mut self, fault: &SensorFault) {
        let reading = self.sensor.raw;
        self.sensor.faults.inject(fault, &reading);
    }

    /// The RTDE time stamp, s.
    pub fn time(&self) -> f64 {
        self.tick as f64 * DT + self.clock_offset
    }

    /// Cycles since the start.
    pub fn ticks(&self) -> u64 {
        self.tick
    }

    /// Power and brakes.
    pub fn robot_mode(&self) -> RobotMode {
        self.robot_mode
    }

    /// The safety system.
    pub fn safety(&self) -> SafetyStatus {
        self.safety
    }

    /// The program.
    pub fn runtime(&self) -> RuntimeState {
        self.runtime
    }

    /// Measured joints and tool.
    pub fn actual(&self) -> &Sample {
        &self.actual
    }

    /// Set-points.
    pub fn target(&self) -> &Sample {
        &self.target
    }

    /// Force and torque at the tool, base axes, payload-compensated and tared; N and N·m.
    pub fn tcp_force(&self) -> [f64; 6] {
        self.sensor.base.into()
    }

    /// The registers.
    pub fn registers(&self) -> &Registers {
        &self.registers
    }

    /// The registers, to write inputs without a client.
    pub fn registers_mut(&mut self) -> &mut Registers {
        &mut self.registers
    }

    /// Protective stops so far, and unlocks.
    pub fn stop_count(&self) -> (u64, u64) {
        (self.protective_stops, self.unlocks)
    }

    /// Why it stopped last.
    pub fn last_stop(&self) -> Option<&StopCause> {
        self.last_stop.as_ref()
    }

    /// The speed slider, 0 to 1.
    pub fn set_slider(&mut self, fraction: f64) {
        self.slider = fraction.clamp(0.0, 1.0);
    }

    /// Remote or local control, as switched on the pendant.
    pub fn set_remote_control(&mut self, remote: bool) {
        self.remote_control = remote;
    }

    /// What happened since the last call.
    pub fn take_events(&mut self) -> Vec<Event> {
        self.events.drain(..).collect()
    }
}
