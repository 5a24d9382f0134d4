//! The layer around a backend: Algorithm 1, or the shield.

mod decide;

use std::time::Duration;

use palpate_control::LowPass;
use palpate_kinematics::{IkOptions, SerialChain};
use palpate_robot_io::{BackendError, FaultKind, RobotBackend, RobotState};
use palpate_spatial::{DOF, JointVector, Pose, Twist, Wrench};

use crate::limits::{LimitsError, Mode, SafetyConfig};
use crate::shield::{Decision, Proposal, Shield, Standing};
use crate::{Excess, Ledger, Refusal, Tally, Verdict};

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
    /// Samples were implausible for too long; the arm has been stopped (shield mode).
    #[error("the robot's samples are implausible: {0}; the arm is stopped until recover is called")]
    Blind(crate::shield::Implausible),
    /// The sensor may be zeroed only at rest in free air (shield mode).
    #[error(
        "the sensor cannot be zeroed here: the tool must rest in free air, but the contact force is {force:.2} N, \
         the torque {torque:.3} N m; drive it clear first"
    )]
    NotFree {
        /// Norm of the filtered force, N.
        force: f64,
        /// Norm of the filtered torque, N·m.
        torque: f64,
    },
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
            Self::NonFiniteState(_) | Self::Blind(_) => Some(FaultKind::Sensor),
            Self::NotFree { .. } | Self::NotSensed | Self::Limits(_) => None,
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

/// A backend that can be reached only through the layer.
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
    /// Unused in shield mode: the shield has its own.
    ledger: Ledger,
    /// In shield mode: it decides, and the phase above is unused.
    shield: Option<Box<Shield>>,
    decision: Option<Decision>,
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
        let chain = chain.with_tool(tool0_T_tool);
        let dt = backend.period().as_secs_f64();
        let ledger = Ledger::new(limits.ledger_entries, dt);
        let shield = match limits.mode {
            Mode::Shield => Some(Box::new(Shield::new(&limits, chain.clone(), &tool0_T_tool, dt)?)),
            Mode::Paper | Mode::ForceFirst => None,
        };
        Ok(Self {
            backend,
            chain,
            tool0_T_tool,
            limits,
            filter,
            phase: Phase::Reset,
            last: None,
            q_commanded: None,
            tally: Tally::default(),
            ledger,
            shield,
            decision: None,
        })
    }

    /// Waits for the next sample, maps it to the tool centre point and filters the wrench.
    ///
    /// In shield mode an implausible sample is answered by the last good one, while every command becomes a
    /// brake; only too many in a row are an error.
    ///
    /// # Errors
    /// A backend error, [`SafeError::NonFiniteState`] or [`SafeError::Blind`]; the arm is stopped either way.
    pub fn sense(&mut self) -> Result<Measurement, SafeError<B::Error>> {
        let state = match self.backend.read() {
            Ok(state) => state,
            Err(e) => return Err(self.stopped_by(e)),
        };
        if let Some(shield) = &mut self.shield
            && let Err(implausible) = shield.watch(&state)
        {
            let blind = shield.is_blind();
            match self.last {
                Some(last) if !blind => return Ok(last),
                _ => {
                    self.stop()?;
                    return Err(SafeError::Blind(implausible));
                }
            }
        }
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
    /// A refused command leaves the arm at its last set-point for this period; in shield mode it brakes.
    pub fn command(&mut self, base_T_tool: &Pose) -> Result<Verdict, SafeError<B::Error>> {
        let last = self.last.ok_or(SafeError::NotSensed)?;
        if self.shield.is_some() {
            return self.shielded(&last, &Proposal::Pose(*base_T_tool));
        }
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
        if self.shield.is_some() {
            return self.shielded(&last, &Proposal::Joints(*q));
        }
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
        if let Some(shield) = &mut self.shield {
            shield.begin_reset();
        }
    }

    /// Zeroes the sensor and the filter and arms the episode's limits. Call at rest in free air.
    ///
    /// # Errors
    /// A backend error; in shield mode [`SafeError::NotFree`] where the tool moves or touches something.
    pub fn begin_episode(&mut self) -> Result<(), SafeError<B::Error>> {
        self.tare()?;
        self.phase = Phase::Episode;
        if let Some(shield) = &mut self.shield {
            shield.begin_episode();
        }
        Ok(())
    }

    /// Zeroes the sensor and the filter, as [`begin_episode`](Self::begin_episode) does, and changes no limit.
    pub fn tare(&mut self) -> Result<(), SafeError<B::Error>> {
        if let (Some(shield), Some(last)) = (&self.shield, &self.last)
            && !shield.may_tare(&last.wrench)
        {
            let (force, torque) = (last.wrench.force.norm(), last.wrench.torque.norm());
            return Err(SafeError::NotFree { force, torque });
        }
        if let Err(e) = self.backend.tare() {
            return Err(self.stopped_by(e));
        }
        self.filter.reset_to(&Wrench::zero());
        if let Some(shield) = &mut self.shield {
            shield.tared();
        }
        Ok(())
    }

    /// In shield mode, one period of the brake; after a force stop, of the brake, the retreat and the rest that
    /// follow it. In the other modes the arm holds its last set-point.
    ///
    /// Whoever stops sending commands must call this until [`standing`](Self::standing) is at rest: silence is
    /// a sudden stop.
    pub fn brake(&mut self) -> Result<Verdict, SafeError<B::Error>> {
        let last = self.last.ok_or(SafeError::NotSensed)?;
        if self.shield.is_some() {
            return self.shielded(&last, &Proposal::Rest);
        }
        self.hold(&last)?;
        Ok(match self.phase {
            Phase::Latched(excess) => Verdict::ForceExceeded(excess),
            Phase::Reset | Phase::Episode => Verdict::Accepted,
        })
    }

    /// Whether the set-point still moves. Always at rest outside shield mode, which knows no brake.
    pub fn standing(&self) -> Standing {
        self.shield.as_ref().map_or(Standing::AtRest, |shield| shield.standing())
    }

    /// Whether the contact force has been below its re-arm level for long enough: without it the sensor is not
    /// zeroed and no episode begins. Always so outside shield mode.
    pub fn is_armed(&self) -> bool {
        self.shield.as_ref().is_none_or(|shield| shield.is_armed())
    }

    /// The last verdict with the proposed and the executed joints; none outside shield mode.
    pub fn decision(&self) -> Option<&Decision> {
        self.decision.as_ref()
    }

    /// Every verdict other than a pass.
    pub fn ledger(&self) -> &Ledger {
        self.shield.as_ref().map_or(&self.ledger, |shield| shield.ledger())
    }

    /// The same, to empty it once it is written.
    pub fn ledger_mut(&mut self) -> &mut Ledger {
        match &mut self.shield {
            Some(shield) => shield.ledger_mut(),
            None => &mut self.ledger,
        }
    }

    /// The shield, to look at.
    pub fn shield(&self) -> Option<&Shield> {
        self.shield.as_deref()
    }

    /// Brings the arm to rest; it takes no commands until [`recover`](Self::recover).
    pub fn stop(&mut self) -> Result<(), SafeError<B::Error>> {
        self.backend.stop().map_err(SafeError::Backend)
    }

    /// Clears a stop or fault of the backend. The next set-point starts from where the arm then is.
    pub fn recover(&mut self) -> Result<(), SafeError<B::Error>> {
        self.backend.recover().map_err(SafeError::Backend)?;
        self.forget();
        Ok(())
    }

    /// Puts the arm back to its start in a fresh world, if this is a simulation: then everything known about the
    /// old one is forgotten. `false`, and nothing done, on an arm.
    pub fn rebuild(&mut self) -> bool {
        let rebuilt = self.backend.rebuild();
        if rebuilt {
            self.filter.reset_to(&Wrench::zero());
            self.forget();
        }
        rebuilt
    }

    fn forget(&mut self) {
        self.q_commanded = None;
        self.phase = Phase::Reset;
        if let Some(shield) = &mut self.shield {
            shield.restart();
            shield.begin_reset();
            // The last sample may be from before the stop.
            self.last = None;
        }
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
}
