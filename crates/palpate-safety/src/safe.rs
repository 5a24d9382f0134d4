//! Algorithm 1 around a backend.

use std::time::Duration;

use palpate_control::LowPass;
use palpate_kinematics::{IkOptions, SerialChain};
use palpate_robot_io::{BackendError, FaultKind, JointCommand, RobotBackend, RobotState};
use palpate_spatial::{DOF, JointVector, Pose, Twist, Wrench};

use crate::limits::{LimitsError, Mode, SafetyConfig, SpeedReference, check_speed, check_wrench};
use crate::{Excess, Refusal, Tally, Verdict};

/// Everything the layers above need to know about one sample.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Measurement {
    /// The backend's sample.
    pub state: RobotState,
    /// Pose of the tool centre point by the measured joints.
    pub base_T_tool: Pose,
    /// Twist of the tool centre point, base axes.
    pub tool_twist: Twist,
    /// F_ext: environment on tool, base axes, about the tool centre point, low-pass filtered.
    pub wrench: Wrench,
    /// The same before the filter.
    pub raw_wrench: Wrench,
}

/// An error of the layer.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum SafeError<E: BackendError> {
    /// The backend failed; it has been asked to stop.
    #[error(transparent)]
    Backend(E),
    /// A sample had a component that is not finite; the arm has been stopped.
    #[error("the robot's state is not finite: {0:?}")]
    NonFiniteState(Box<RobotState>),
    /// A command came before the first sample.
    #[error("command before the first sample: call sense first")]
    NotSensed,
    /// The limits make no sense.
    #[error(transparent)]
    Limits(#[from] LimitsError),
}

impl<E: BackendError> SafeError<E> {
    /// The kind of backend fault behind this error, if it is one.
    pub fn fault(&self) -> Option<FaultKind> {
        match self {
            Self::Backend(e) => Some(e.kind()),
            Self::NonFiniteState(_) => Some(FaultKind::Sensor),
            Self::NotSensed | Self::Limits(_) => None,
        }
    }
}

/// Which set of force limits holds.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Phase {
    /// Driving back to the start.
    Reset,
    /// An episode.
    Episode,
    /// The force limit was exceeded: nothing moves until the next reset.
    Latched(Excess),
}

/// A backend that can be reached only through Algorithm 1.
///
/// Lend it nothing: there is no way to get the backend back out while it can move.
#[derive(Debug)]
pub struct Safe<B: RobotBackend> {
    backend: B,
    /// base_link to tool centre point.
    chain: SerialChain<DOF>,
    tool0_T_tool: Pose,
    limits: SafetyConfig,
    filter: LowPass,
    phase: Phase,
    last: Option<Measurement>,
    /// Last accepted set-point.
    q_commanded: Option<JointVector>,
    tally: Tally,
}

impl<B: RobotBackend> Safe<B> {
    /// Wraps `backend`, whose joints move `chain` (base to tool0); the tool centre point sits at
    /// `tool0_T_tool`.
    ///
    /// # Errors
    /// [`SafeError::Limits`] for a limit that is not positive or looser than the arm's own.
    pub fn new(
        backend: B,
        chain: SerialChain<DOF>,
        tool0_T_tool: Pose,
        limits: SafetyConfig,
    ) -> Result<Self, SafeError<B::Error>> {
        let sample_rate = 1.0 / backend.period().as_secs_f64();
        limits.validate(&chain.limits().velocity, sample_rate)?;
        let filter = LowPass::new(limits.force_filter_cutoff, sample_rate);
        Ok(Self {
            backend,
            chain: chain.with_tool(tool0_T_tool),
            tool0_T_tool,
            limits,
            filter,
            phase: Phase::Reset,
            last: None,
            q_commanded: None,
            tally: Tally::default(),
        })
    }

    /// Waits for the next sample, maps it to the tool centre point and filters the wrench.
    ///
    /// # Errors
    /// A backend error, or [`SafeError::NonFiniteState`]; the arm is stopped either way.
    pub fn sense(&mut self) -> Result<Measurement, SafeError<B::Error>> {
        let state = match self.backend.read() {
            Ok(state) => state,
            Err(e) => return Err(self.stopped_by(e)),
        };
        if !state.is_finite() {
            self.stop()?;
            return Err(SafeError::NonFiniteState(Box::new(state)));
        }
        let kinematics = self.chain.kinematics(&state.q);
        let base_T_tool = kinematics.pose();
        let jacobian = kinematics.jacobian(palpate_kinematics::Frame::BaseAligned);
        // Sensor axes at the tool0 origin → base axes at the tool centre point.
        let base_R_tool0 = base_T_tool.rotation * self.tool0_T_tool.rotation.inverse();
        let raw_wrench =
            state.sensor_wrench.about(&self.tool0_T_tool.translation.vector).rotated(&base_R_tool0);
        let measurement = Measurement {
            state,
            base_T_tool,
            tool_twist: Twist::from(jacobian * state.dq),
            wrench: self.filter.update(&raw_wrench),
            raw_wrench,
        };
        self.last = Some(measurement);
        Ok(measurement)
    }

    /// Algorithm 1 for one commanded tool pose x_c (lines 12–19): solve IK, check speed and force, actuate.
    ///
    /// A refused command leaves the arm at its last set-point for this period.
    pub fn command(&mut self, base_T_tool: &Pose) -> Result<Verdict, SafeError<B::Error>> {
        let last = self.last.ok_or(SafeError::NotSensed)?;
        let seed = self.q_commanded.unwrap_or(last.state.q_target);
        self.decide(&last, |safe| {
            if !base_T_tool.to_homogeneous().iter().all(|x| x.is_finite()) {
                return Err(Refusal::NonFinite);
            }
            let solution = safe
                .chain
                .solve_near(base_T_tool, &seed, &IkOptions::default())
                .map_err(Refusal::NoIk)?;
            Ok(solution.q)
        })
    }

    /// The same for joints (rad), for paths planned in joint space: finite, in range, slow enough, force in range.
    pub fn command_joints(&mut self, q: &JointVector) -> Result<Verdict, SafeError<B::Error>> {
        let last = self.last.ok_or(SafeError::NotSensed)?;
        self.decide(&last, |safe| {
            let limits = safe.chain.limits();
            for joint in 0..DOF {
                let (value, lower, upper) = (q[joint], limits.lower[joint], limits.upper[joint]);
                if !value.is_finite() {
                    return Err(Refusal::NonFinite);
                }
                if !(value >= lower && value <= upper) {
                    return Err(Refusal::JointRange { joint, value, lower, upper });
                }
            }
            Ok(*q)
        })
    }

    /// Drives back under the reset limits from now on; clears a latched force stop.
    pub fn begin_reset(&mut self) {
        self.phase = Phase::Reset;
    }

    /// Zeroes the sensor and the filter and arms the episode's limits. Call at rest in free air.
    pub fn begin_episode(&mut self) -> Result<(), SafeError<B::Error>> {
        if let Err(e) = self.backend.tare() {
            return Err(self.stopped_by(e));
        }
        self.filter.reset_to(&Wrench::zero());
        self.phase = Phase::Episode;
        Ok(())
    }

    /// Brings the arm to rest; it takes no commands until [`recover`](Self::recover).
    pub fn stop(&mut self) -> Result<(), SafeError<B::Error>> {
        self.backend.stop().map_err(SafeError::Backend)
    }

    /// Clears a stop or fault of the backend. The next set-point starts from where the arm then is.
    pub fn recover(&mut self) -> Result<(), SafeError<B::Error>> {
        self.backend.recover().map_err(SafeError::Backend)?;
        self.q_commanded = None;
        self.phase = Phase::Reset;
        Ok(())
    }

    /// Time between samples.
    pub fn period(&self) -> Duration {
        self.backend.period()
    }

    /// Refusals and force stops so far, by cause.
    pub fn tally(&self) -> Tally {
        self.tally
    }

    /// Kinematics from the base to the tool centre point.
    pub fn chain(&self) -> &SerialChain<DOF> {
        &self.chain
    }

    /// The limits in force.
    pub fn limits(&self) -> &SafetyConfig {
        &self.limits
    }

    /// The backend, to look at.
    pub fn backend(&self) -> &B {
        &self.backend
    }

    /// The checks in the configured order, then the actuation.
    fn decide(
        &mut self,
        last: &Measurement,
        solve: impl FnOnce(&Self) -> Result<JointVector, Refusal>,
    ) -> Result<Verdict, SafeError<B::Error>> {
        if let Phase::Latched(excess) = self.phase {
            self.hold(last)?;
            return Ok(Verdict::ForceExceeded(excess));
        }
        if self.limits.mode == Mode::ForceFirst
            && let Err(excess) = self.force_in_range(last)
        {
            return self.latch(last, excess);
        }
        let from = match self.limits.speed_reference {
            SpeedReference::Measured => last.state.q,
            SpeedReference::Commanded => self.q_commanded.unwrap_or(last.state.q_target),
        };
        let dt = self.period().as_secs_f64();
        let accepted = solve(self)
            .and_then(|q| check_speed(&from, &q, dt, &self.limits.joint_velocity_max).map(|()| q));
        let q = match accepted {
            Ok(q) => q,
            Err(refusal) => {
                self.tally.add(&refusal);
                self.hold(last)?;
                return Ok(Verdict::Refused(refusal));
            }
        };
        // In force-first mode this repeats a check that has passed.
        if let Err(excess) = self.force_in_range(last) {
            return self.latch(last, excess);
        }
        self.write(&q)?;
        Ok(Verdict::Accepted)
    }

    fn force_in_range(&self, last: &Measurement) -> Result<(), Excess> {
        match self.phase {
            Phase::Reset => check_wrench(
                &last.wrench,
                self.limits.reset.force_max,
                self.limits.reset.torque_max,
            ),
            _ => check_wrench(&last.wrench, self.limits.force_max, self.limits.torque_max),
        }
    }

    fn latch(
        &mut self,
        last: &Measurement,
        excess: Excess,
    ) -> Result<Verdict, SafeError<B::Error>> {
        self.tally.force += 1;
        self.phase = Phase::Latched(excess);
        self.hold(last)?;
        Ok(Verdict::ForceExceeded(excess))
    }

    fn hold(&mut self, last: &Measurement) -> Result<(), SafeError<B::Error>> {
        let q = self.q_commanded.unwrap_or(last.state.q_target);
        self.write(&q)
    }

    fn write(&mut self, q: &JointVector) -> Result<(), SafeError<B::Error>> {
        match self.backend.write(&JointCommand { q: *q }) {
            Ok(()) => {
                self.q_commanded = Some(*q);
                Ok(())
            }
            Err(e) => Err(self.stopped_by(e)),
        }
    }

    /// Any backend error stops the arm; the first error is the one to report.
    fn stopped_by(&mut self, error: B::Error) -> SafeError<B::Error> {
        let _ = self.backend.stop();
        SafeError::Backend(error)
    }
}
