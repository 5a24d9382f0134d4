//! What the control thread does with the arm.
//!
//! Between connecting and letting go it takes nothing from the heap, unless it has to say why the arm has stopped:
//! lessons are lent to the learner and come back.

use std::sync::mpsc::TryRecvError;
use std::time::Duration;

use palpate_env::{Env, EnvError};
use palpate_safety::{Entry, Guarded};

use super::exchange::Exchange;
use super::thread::{Ends, Fault, News, Order, room};
use crate::baselines::Actor;
use crate::record::OnArm;
use crate::train::lesson::Lesson;

/// Pause between two looks at an arm that has stopped.
const REST: Duration = Duration::from_millis(1);

/// Joints slower than this stand, rad/s.
const AT_REST: f64 = 0.01;
/// Control periods that braking may take: 1 s; from 2π rad/s at 10 rad/s² it takes 0.63 s.
const TICKS_TO_REST: u32 = 500;

/// Numbers of evaluation episodes start here: no training comes this far, so that its starts are not these.
const EVALUATIONS: u64 = 1 << 48;

/// The control thread's work.
#[derive(Debug)]
pub(super) struct Pilot<R: Guarded> {
    env: Env<R>,
    actor: Actor,
    exchange: Exchange,
    ends: Ends,
    /// Lessons to write into, in the boxes in which they travel.
    #[expect(clippy::vec_box, reason = "a box more or less would be an allocation")]
    spare: Vec<Box<Lesson>>,
    observation: Vec<f32>,
    action: Vec<f32>,
    recorder: Option<Box<OnArm>>,
    /// The episode under way is an evaluation.
    measured: bool,
}

impl<R: Guarded> Pilot<R> {
    /// All memory is taken here. An episode has at most `steps` actions.
    pub(super) fn new(
        env: Env<R>,
        actor: Actor,
        exchange: Exchange,
        ends: Ends,
        steps: u32,
    ) -> Self {
        let (observation, action) = (vec![0.0; env.observation_dim()], vec![0.0; env.action_dim()]);
        let spare = (0..room(steps))
            .map(|_| Box::new(Lesson::blank(observation.len(), action.len())))
            .collect();
        Self {
            env,
            actor,
            exchange,
            ends,
            spare,
            observation,
            action,
            recorder: None,
            measured: false,
        }
    }

    /// The environment, to look at.
    pub(super) fn env(&self) -> &Env<R> {
        &self.env
    }

    /// Does what it is asked for and holds the arm in between, until it is told to end.
    pub(super) fn serve(&mut self) {
        self.say(News::Ready);
        let mut stopped = false;
        loop {
            let order = self.ends.orders.try_recv();
            let done = match order {
                Ok(Order::Episode(number)) if !stopped => self.episode(number, None),
                Ok(Order::Evaluate { episode, step }) if !stopped => {
                    self.episode(EVALUATIONS + episode, Some((step, episode)))
                }
                Ok(Order::Episode(_) | Order::Evaluate { .. }) => continue,
                Ok(Order::Record(mut recorder)) => {
                    recorder.load(&mut self.env);
                    // Its tapes are new.
                    _ = palpate_ur::lock_memory();
                    self.recorder = Some(recorder);
                    continue;
                }
                Ok(Order::Recover) => self.env.recover().map(|()| self.say(News::Ready)),
                Err(TryRecvError::Empty) if stopped => {
                    // Goes on reading, so that nothing old waits in the link; what it reads is known.
                    _ = self.env.hold();
                    std::thread::sleep(REST);
                    continue;
                }
                Err(TryRecvError::Empty) => self.env.hold().map(|_| ()),
                Ok(Order::End) | Err(TryRecvError::Disconnected) => return self.rest(),
            };
            stopped = done.is_err();
            if let Err(error) = done {
                // Also where the arm is whole and only the way was blocked.
                _ = self.env.stop();
                self.empty_ledger();
                self.say(News::Fault(Fault::of::<R>(&error)));
            }
        }
    }

    /// Lets go of the arm, then waits for the recordings.
    pub(super) fn finish(self) {
        let Self { env, recorder, .. } = self;
        drop(env);
        if let Some(recorder) = recorder {
            recorder.finish();
        }
    }

    /// Stops the arm and watches until it stands.
    fn rest(&mut self) {
        _ = self.env.stop();
        for _ in 0..TICKS_TO_REST {
            match self.env.hold() {
                Ok(m) if m.state.dq.amax() < AT_REST => return,
                Ok(_) => {}
                // Nothing can be seen any more; the arm's own program stops it.
                Err(_) => return,
            }
        }
    }

    /// Drives to the start and acts until the episode's end: by samples of the policy to learn from, or by its mean
    /// as start so-and-so of the evaluation after so many steps.
    fn episode(
        &mut self,
        number: u64,
        evaluation: Option<(u64, u64)>,
    ) -> Result<(), EnvError<R::Error>> {
        let measured = evaluation.is_some();
        self.measured = measured;
        self.env.set_next_episode(number);
        self.env.reset()?;
        self.actor.explore(!measured);
        self.actor.reset(number);
        self.observation.copy_from_slice(self.env.observation());
        loop {
            if let Some(policy) = self.actor.policy_mut() {
                self.exchange.take(policy);
            }
            let action = self.actor.act(&self.env);
            for (narrow, wide) in self.action.iter_mut().zip(action) {
                *narrow = *wide as f32;
            }
            let step = self.env.step(action)?;
            let over = step.summary.as_ref().map(|summary| summary.outcome);
            let mut lesson = self.lesson();
            lesson.write(&self.env, &self.observation, &self.action, step);
            self.observation.copy_from_slice(&lesson.next);
            if let Some(outcome) = over {
                self.empty_ledger();
                if let Some(recorder) = &mut self.recorder {
                    recorder.keep(&mut self.env, outcome, evaluation);
                }
            }
            self.say(if measured { News::Measured(lesson) } else { News::Step(lesson) });
            if over.is_some() {
                return Ok(());
            }
        }
    }

    /// A lesson to write into. There are as many as there is room for in an episode, and all of them are back before
    /// the next is ordered; a learner that keeps one costs an allocation.
    fn lesson(&mut self) -> Box<Lesson> {
        while self.spare.len() < self.spare.capacity()
            && let Ok(lesson) = self.ends.learned.try_recv()
        {
            self.spare.push(lesson);
        }
        self.spare.pop().unwrap_or_default()
    }

    /// Hands over what the fail-safe layer said, but for evaluations; what there is no room for is still counted in
    /// the summary.
    fn empty_ledger(&mut self) {
        let start = self.env.started();
        let ledger = self.env.ledger_mut();
        for entry in ledger.entries().filter(|_| !self.measured) {
            _ = self.ends.verdicts.try_send(Entry { time: entry.time - start, ..*entry });
        }
        ledger.clear_entries();
    }

    fn say(&self, news: News) {
        // There is room by construction; and without a listener the order to end is near.
        _ = self.ends.news.try_send(news);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::path::Path;
    use std::sync::Arc;
    use std::sync::atomic::{AtomicU64, Ordering};
    use std::time::Instant;

    use palpate_robot_io::{IdealArm, IdealArmError, JointCommand, RobotBackend, RobotState};

    use super::super::exchange::tests::policy;
    use super::super::thread::Control;
    use crate::Config;
    use crate::config::Choice;
    use crate::record::Recorder;
    use crate::stack::{self, Purpose};

    fn config(set: &[&str]) -> Config {
        let set = set.iter().map(ToString::to_string).collect();
        let (preset, task, model) = ("palpate".into(), "peg-insertion".into(), "P-14".into());
        Config::load(&Choice { preset, task, model, file: None, set }).unwrap()
    }

    /// An ideal arm in real time that counts its reads.
    struct Paced {
        arm: IdealArm,
        next: Instant,
        reads: Arc<AtomicU64>,
    }

    impl RobotBackend for Paced {
        type Error = IdealArmError;
        fn period(&self) -> Duration {
            self.arm.period()
        }
        fn read(&mut self) -> Result<RobotState, IdealArmError> {
            std::thread::sleep(self.next.saturating_duration_since(Instant::now()));
            self.next = Instant::now() + self.period();
            self.reads.fetch_add(1, Ordering::Relaxed);
            self.arm.read()
        }
        fn write(&mut self, command: &JointCommand) -> Result<(), IdealArmError> {
            self.arm.write(command)
        }
        fn stop(&mut self) -> Result<(), IdealArmError> {
            self.arm.stop()
        }
        fn recover(&mut self) -> Result<(), IdealArmError> {
            self.arm.recover()
        }
        fn tare(&mut self) -> Result<(), IdealArmError> {
            self.arm.tare()
        }
    }

    const STEPS: u32 = 12;

    #[test]
    fn an_episode_needs_no_learner_and_the_arm_is_held_after_it() {
        let reads = Arc::new(AtomicU64::new(0));
        let count = Arc::clone(&reads);
        let build = move || {
            let config = config(&["env.max_steps=12"]);
            let arm =
                Paced { arm: IdealArm::at(config.task.q_home), next: Instant::now(), reads: count };
            stack::env(&config, stack::chain(&config.robot)?, arm, 1, Purpose::Train)
        };
        let actor = Actor::learned(policy(1), Some(1));
        let exchange = Exchange::default();
        // A learner that died with its hand on the slot.
        let _hand = exchange.hand();
        let control = Control::start(build, actor, exchange.clone(), STEPS, Pilot::serve).unwrap();
        assert!(matches!(control.news.recv().unwrap(), News::Ready));
        control.orders.send(Order::Episode(0)).unwrap();
        // Nobody listens for longer than the way and the episode take.
        std::thread::sleep(Duration::from_secs(4));
        let before = reads.load(Ordering::Relaxed);
        std::thread::sleep(Duration::from_millis(500));
        assert!(reads.load(Ordering::Relaxed) > before + 50, "the arm is not read any more");
        let steps: Vec<_> = control.news.try_iter().collect();
        assert_eq!(steps.len(), 12, "{steps:?}");
        let over = |news: &News| matches!(news, News::Step(x) if x.summary.is_some());
        assert!(over(&steps[11]) && !steps[..11].iter().any(over), "{steps:?}");
    }

    fn evaluate(episode: u64) -> Order {
        Order::Evaluate { episode, step: 100 }
    }

    /// Orders what is given, then the end, and lets the pilot serve on this thread.
    fn flown(set: &[&str], orders: [Order; 3], record: &Path) -> (Vec<News>, u64) {
        let config = config(set);
        let arm = IdealArm::at(config.task.q_home);
        let chain = stack::chain(&config.robot).unwrap();
        let env = stack::env(&config, chain, arm, 1, Purpose::Train).unwrap();
        let exchange = Exchange::default();
        let (control, ends) = Control::pair(3 * STEPS);
        for order in orders.into_iter().chain([Order::End]) {
            control.orders.send(order).unwrap();
        }
        let actor = Actor::learned(policy(1), Some(1));
        let mut pilot = Pilot::new(env, actor, exchange.clone(), ends, 3 * STEPS);
        exchange.offer(policy(2));
        let recorder = Recorder::new(&config, record).unwrap();
        let mut recorder = OnArm::training(recorder, &config.record);
        recorder.load(&mut pilot.env);
        pilot.recorder = Some(Box::new(recorder));
        let taken = allocation_counter::measure(|| pilot.serve());
        pilot.finish();
        (control.news.try_iter().collect(), taken.count_total)
    }

    #[test]
    fn nothing_is_taken_from_the_heap() {
        for set in [&["env.max_steps=12"][..], &["env.max_steps=12", "safety.mode=\"shield\""]] {
            let dir = tempfile::tempdir().unwrap();
            let (news, allocations) =
                flown(set, [Order::Episode(0), evaluate(0), Order::Episode(1)], dir.path());
            assert_eq!(news.len(), 1 + 3 * STEPS as usize, "{news:?}");
            assert_eq!(allocations, 0, "{set:?}");
            let recorded: Vec<_> =
                std::fs::read_dir(dir.path()).unwrap().map(|f| f.unwrap().file_name()).collect();
            assert_eq!(recorded, ["eval_0000100_000.mcap"], "and it was recorded");
        }
    }

    #[test]
    fn an_evaluation_repeats_itself_and_is_no_experience() {
        let dir = tempfile::tempdir().unwrap();
        let orders = [evaluate(3), Order::Episode(3), evaluate(3)];
        let (news, _) = flown(&["env.max_steps=12"], orders, dir.path());
        let lessons = |news: &[News], measured: bool| -> Vec<Lesson> {
            let lesson = |n: &News| match n {
                News::Measured(lesson) if measured => Some((**lesson).clone()),
                News::Step(lesson) if !measured => Some((**lesson).clone()),
                _ => None,
            };
            news.iter().filter_map(lesson).collect()
        };
        let evaluated = lessons(&news, true);
        let (first, second) = evaluated.split_at(12);
        assert_eq!(second.len(), 12);
        for (a, b) in first.iter().zip(second) {
            assert_eq!((&a.observation, &a.action), (&b.observation, &b.action));
        }
        let explored = lessons(&news, false);
        assert_ne!(explored[0].observation, first[0].observation, "a start of its own");
        let mut mean = vec![0.0; 14];
        policy(2).mean(&first[0].observation, &mut mean);
        assert_eq!(first[0].action, mean);
        policy(2).mean(&explored[0].observation, &mut mean);
        assert_ne!(explored[0].action, mean, "training explores");
    }
}
