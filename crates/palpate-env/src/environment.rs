//! The environment itself: a 20 Hz step around a 500 Hz loop.

use palpate_control::{
    ActionMap, ControlConfig, ControlInput, Controller, ForceController, PolicyModel,
};
use palpate_robot_io::FaultKind;
use palpate_safety::{Cause, Guarded, Ledger, Measurement, Verdict, shield::Standing};
use palpate_spatial::{Pose, Twist, Vector6, integrate, pose_error_vector_part};

use crate::config::{EnvConfig, Reference};
use crate::episode::{Episode, Outcome, Summary, displacement};
use crate::error::{EnvError, is_stuck};
use crate::observation::Observer;
use crate::reset::{WayBack, drive_to_start};
use crate::reward::{End, Parts, RewardConfig, RewardTerms};
use crate::tape::{Beat, Tape, Tick};
use crate::task::TaskConfig;

/// Tries to get back to the start after a simulator fault before giving up.
const RESET_TRIES: u32 = 3;

/// What one action led to. The observation is [`Env::observation`].
#[derive(Clone, Debug, PartialEq)]
pub struct Step {
    /// The reward, term by term.
    pub reward: RewardTerms,
    /// The task ended here: success or collision. Do not bootstrap.
    pub terminated: bool,
    /// The episode was cut here: time limit or fault. Bootstrap.
    pub truncated: bool,
    /// How the commanded motion that the fail-safe layer let through differed from the one that was asked for: mean
    /// over the step, base axes, m/s and rad/s. Zero where it let all through.
    pub deviation: Twist,
    /// The finished episode, on its last step.
    pub summary: Option<Summary>,
}

/// The paper's environment on any guarded robot.
#[derive(Debug)]
pub struct Env<R: Guarded> {
    robot: R,
    config: EnvConfig,
    task: TaskConfig,
    reward: RewardConfig,
    actions: ActionMap,
    controller: Controller,
    observer: Observer,
    ticks_per_step: u32,
    seed: u64,
    next_episode: u64,
    rebuilt: u64,
    started: f64,
    episode: Option<Episode>,
    /// What goes on, for whoever wants to see it.
    tape: Option<Box<Tape>>,
}

impl<R: Guarded> Env<R> {
    /// Builds an environment whose episodes are drawn from `seed`.
    ///
    /// # Errors
    /// A setting or gain range that makes no sense, by name.
    pub fn new(
        robot: R,
        config: EnvConfig,
        task: TaskConfig,
        reward: RewardConfig,
        control: &ControlConfig,
        model: &PolicyModel,
        seed: u64,
    ) -> Result<Self, EnvError<R::Error>> {
        let ticks_per_step = config.validate(robot.period().as_secs_f64())?;
        task.validate()?;
        let actions = ActionMap::new(model)?;
        let controller = Controller::new(control, model.law)?;
        let limits = robot.limits();
        let observer =
            Observer::new(&config.observation, limits.force_max, limits.torque_max, actions.dim());
        Ok(Self {
            robot,
            config,
            task,
            reward,
            actions,
            controller,
            observer,
            ticks_per_step,
            seed,
            next_episode: 0,
            rebuilt: 0,
            started: 0.0,
            episode: None,
            tape: None,
        })
    }

    /// Length of an observation.
    pub fn observation_dim(&self) -> usize {
        self.observer.dim()
    }

    /// Length of an action; every component lies in [−1, 1].
    pub fn action_dim(&self) -> usize {
        self.actions.dim()
    }

    /// What the policy sees now.
    pub fn observation(&self) -> &[f32] {
        self.observer.observation()
    }

    /// The task.
    pub fn task(&self) -> &TaskConfig {
        &self.task
    }

    /// The robot, to look at.
    pub fn robot(&self) -> &R {
        &self.robot
    }

    /// Worlds rebuilt so far: after a simulator fault, and where a tool was stuck on the way back and a person would
    /// have had to free it. Always 0 on an arm.
    pub fn rebuilt(&self) -> u64 {
        self.rebuilt
    }

    /// Turns an action into the one that was executed, given the [`deviation`](Step::deviation) of its step: the a_x
    /// that would have moved the arm as it was moved. Gains are executed as proposed.
    pub fn executed(&self, action: &mut [f32], deviation: &Twist) {
        self.actions.deviate(action, deviation);
    }

    /// The fail-safe layer's verdicts, to empty them once they are written.
    pub fn ledger_mut(&mut self) -> &mut Ledger {
        self.robot.ledger_mut()
    }

    /// What each component of an action moves: `motion.x`, …, `position`, `selection.rz`.
    pub fn action_labels(&self) -> Vec<String> {
        self.actions.labels()
    }

    /// A tape with room for the longest episode and for coming to rest after it.
    pub fn new_tape(&self) -> Box<Tape> {
        Box::new(Tape::new(self.config.max_steps, self.ticks_per_step, self.actions.dim()))
    }

    /// Puts in a tape that takes down every control period from the next [`reset`](Self::reset) on; gives back the last.
    pub fn swap_tape(&mut self, tape: Option<Box<Tape>>) -> Option<Box<Tape>> {
        std::mem::replace(&mut self.tape, tape)
    }

    /// The latest sample of the episode under way.
    pub fn measurement(&self) -> Option<&Measurement> {
        self.episode.as_ref().map(|e| &e.measurement)
    }

    /// The robot's clock when the last episode began, s; 0 before the first.
    pub fn started(&self) -> f64 {
        self.started
    }

    /// x_e against the believed goal, base axes, of the episode under way.
    pub fn believed_error(&self) -> Option<Vector6> {
        let e = self.episode.as_ref()?;
        Some(pose_error_vector_part(&e.start.base_T_believed, &e.measurement.base_T_tool))
    }

    /// The episode that the next [`reset`](Self::reset) starts.
    pub fn next_episode(&self) -> u64 {
        self.next_episode
    }

    /// Makes the next reset start this episode: for evaluation on frozen starts and for resuming.
    pub fn set_next_episode(&mut self, episode: u64) {
        self.next_episode = episode;
    }

    /// Brings the arm to rest.
    pub fn stop(&mut self) -> Result<(), EnvError<R::Error>> {
        self.robot.stop().map_err(EnvError::Robot)
    }

    /// Stays where it is for one control period: what an arm in real time does while it waits for an episode.
    pub fn hold(&mut self) -> Result<Measurement, EnvError<R::Error>> {
        self.robot.sense().map_err(EnvError::Robot)
    }

    /// Clears a stop or a fault of the robot and gives the episode up. The next thing is a [`reset`](Self::reset).
    pub fn recover(&mut self) -> Result<(), EnvError<R::Error>> {
        self.episode = None;
        self.robot.recover().map_err(EnvError::Robot)
    }

    /// Drives back to the start of the next episode.
    pub fn reset(&mut self) -> Result<(), EnvError<R::Error>> {
        let number = self.next_episode;
        let start = self.task.draw(self.seed, number);
        let mut tries = 0;
        let measurement = loop {
            tries += 1;
            let way = WayBack {
                config: &self.config.reset,
                base_T_hole: &self.task.base_T_hole(),
                base_T_start: &start.base_T_start,
                q_home: &self.task.q_home,
            };
            match drive_to_start(&mut self.robot, &way) {
                Ok(measurement) => break measurement,
                Err(e) if tries < RESET_TRIES && is_stuck::<R>(&e) && self.robot.rebuild() => {
                    self.rebuilt += 1;
                    tracing::info!(episode = number, error = %e, "the world was rebuilt");
                }
                Err(e) => return Err(e),
            }
        };
        let error = pose_error_vector_part(&start.base_T_believed, &measurement.base_T_tool);
        // The reference starts at the set-point, which the lagging arm is on its way to.
        let reference = self.robot.chain().forward(&measurement.state.q_target);
        if let Some(tape) = &mut self.tape {
            tape.begin(number, &start, &measurement.state);
        }
        self.controller.reset();
        self.observer.reset();
        self.observer.look(&measurement, &start.base_T_believed, &[]);
        self.episode = Some(Episode::new(
            number,
            start,
            reference,
            self.reward.scale(&error),
            &measurement,
            self.robot.tally(),
            self.robot.ledger().counts(),
        ));
        (self.next_episode, self.started) = (number + 1, measurement.state.time);
        Ok(())
    }

    /// Holds `action` for one policy period.
    ///
    /// # Errors
    /// A refused action, a failed robot, or no episode under way. A simulator fault is not an error: it
    /// truncates the episode, rebuilds the world and is counted.
    pub fn step(&mut self, action: &[f64]) -> Result<Step, EnvError<R::Error>> {
        let decoded = self.actions.decode(action)?;
        self.controller.set_gains(&decoded.gains)?;
        let mut episode = self.episode.take().filter(|e| !e.over).ok_or(EnvError::NoEpisode)?;
        episode.steps += 1;
        if let Some(tape) = &mut self.tape {
            let time = episode.measurement.state.time;
            tape.act(action, Beat { time, decoded, reward: RewardTerms::default() });
        }
        let dt = self.robot.period().as_secs_f64();
        let verdicts_before = self.robot.ledger().counts();
        let (mut end, mut withheld, mut ticks) = (None, Vector6::zeros(), 0.0);
        for _ in 0..self.ticks_per_step {
            let m = episode.measurement;
            let input = ControlInput {
                pose_error: pose_error_vector_part(&episode.start.base_T_believed, &m.base_T_tool),
                wrench: m.wrench,
                action: decoded.motion,
            };
            let twist = self.controller.update(&input, dt);
            let from = match self.config.reference {
                Reference::Integrated => episode.reference,
                Reference::Measured => m.base_T_tool,
            };
            let x_c = integrate(&from, &twist, dt);
            let verdict = self.robot.command(&x_c).map_err(EnvError::Robot)?;
            // A shield may have slowed or braked: what follows starts from where that led.
            let decision = self.robot.decision();
            let governed = decision.and_then(|decision| decision.governed);
            if let Some(tape) = &mut self.tape {
                let cause = decision.map_or_else(|| verdict.cause(), |decision| decision.cause);
                tape.tick(&Tick { measurement: m, base_T_command: x_c, cause });
            }
            let led_to = match verdict {
                Verdict::Accepted => governed.unwrap_or(x_c),
                _ => governed.unwrap_or(from),
            };
            ticks += 1.0;
            if led_to != x_c {
                withheld += displacement(&led_to, &x_c);
            }
            match verdict {
                Verdict::Accepted => episode.reference = led_to,
                Verdict::Refused(_) => {
                    self.controller.command_refused();
                    episode.reference = governed.unwrap_or(episode.reference);
                }
                Verdict::ForceExceeded(_) => {
                    end = Some(End::Violation);
                    break;
                }
            }
            match self.robot.sense() {
                Ok(sample) => episode.observe(&sample),
                Err(e) if R::fault(&e) == Some(FaultKind::Simulation) => {
                    return self.faulted(episode, &e);
                }
                Err(e) => return Err(EnvError::Robot(e)),
            }
        }
        let distance = self.true_distance(&episode.measurement.base_T_tool);
        if end.is_none() && distance < self.task.success_distance {
            end = Some(End::Success);
        }
        self.observer.look(&episode.measurement, &episode.start.base_T_believed, action);
        let limits = self.robot.limits();
        let reward = self.reward.terms(&Parts {
            error: pose_error_vector_part(
                &episode.start.base_T_believed,
                &episode.measurement.base_T_tool,
            ),
            scale: episode.error_scale,
            action,
            wrench: episode.measurement.wrench,
            force_max: limits.force_max,
            torque_max: limits.torque_max,
            end,
            verdicts: self.robot.ledger().counts() - verdicts_before,
        });
        let deviation = Twist::from(-withheld / (ticks * dt));
        let truncated = end.is_none() && episode.steps >= self.config.max_steps;
        let outcome = match end {
            Some(End::Success) => Some(Outcome::Success),
            Some(End::Violation) => Some(Outcome::Collision),
            None if truncated => Some(Outcome::TimeLimit),
            None => None,
        };
        if outcome.is_some() {
            self.come_to_rest(&mut episode)?;
        }
        Ok(self.finish(episode, reward, outcome, truncated, deviation))
    }

    /// Nobody commands between episodes: brakes, and after a force stop lets the arm back out. The force on the
    /// way counts towards the episode's peak. Only a shield has anything to do here.
    fn come_to_rest(&mut self, episode: &mut Episode) -> Result<(), EnvError<R::Error>> {
        while self.robot.standing() != Standing::AtRest {
            let sample = self.robot.brake().and_then(|_| self.robot.sense());
            match sample {
                Ok(sample) => {
                    episode.observe_peak(&sample);
                    if let Some(tape) = &mut self.tape {
                        tape.tick(&Tick::at_rest(&sample, Some(Cause::Stopped)));
                    }
                }
                Err(e) if R::fault(&e) == Some(FaultKind::Simulation) => {
                    self.rebuilt += 1;
                    tracing::warn!(episode = episode.number, error = %e, "simulator fault at rest; rebuilding");
                    return self.robot.recover().map_err(EnvError::Robot);
                }
                Err(e) => return Err(EnvError::Robot(e)),
            }
        }
        Ok(())
    }

    fn finish(
        &mut self,
        mut episode: Episode,
        reward: RewardTerms,
        outcome: Option<Outcome>,
        truncated: bool,
        deviation: Twist,
    ) -> Step {
        episode.total_reward += reward.total();
        let distance = self.true_distance(&episode.measurement.base_T_tool);
        let summary = outcome.map(|o| {
            let verdicts = self.robot.ledger().counts();
            let period = self.robot.period().as_secs_f64();
            episode.summary(o, period, distance, self.robot.tally(), verdicts)
        });
        if let Some(tape) = &mut self.tape {
            tape.reward(reward);
            if let Some(summary) = &summary {
                tape.end(summary, &episode.measurement);
            }
        }
        episode.over = outcome.is_some();
        let terminated = outcome.is_some() && !truncated;
        self.episode = Some(episode);
        Step { reward, terminated, truncated, deviation, summary }
    }

    /// Ends the episode where the simulator broke down; the observation stays the last good one.
    fn faulted(&mut self, episode: Episode, error: &R::Error) -> Result<Step, EnvError<R::Error>> {
        self.rebuilt += 1;
        tracing::warn!(episode = episode.number, %error, "simulator fault; episode truncated, world rebuilt");
        self.robot.recover().map_err(EnvError::Robot)?;
        let (reward, deviation) = (RewardTerms::default(), Twist::zero());
        Ok(self.finish(episode, reward, Some(Outcome::Fault), true, deviation))
    }

    fn true_distance(&self, base_T_tool: &Pose) -> f64 {
        (self.task.base_T_goal().translation.vector - base_T_tool.translation.vector).norm()
    }
}
