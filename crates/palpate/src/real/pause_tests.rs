//! The Enter key: pause, resume, and a person's word after a stop. On a paced arm whose calls are recorded.

use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::sync::mpsc::channel;
use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant};

use palpate_robot_io::{IdealArm, IdealArmError, JointCommand, RobotBackend, RobotState};
use palpate_sac::Sac;
use palpate_ur::{Operator, Realtime};

use super::Arm;
use super::exchange::Exchange;
use super::keys::Keys;
use super::pilot::Pilot;
use super::thread::{Control, News};
use super::world::RealTime;
use crate::Config;
use crate::baselines::Actor;
use crate::config::Choice;
use crate::progress::Progress;
use crate::stack::{self, Purpose};
use crate::train::create;
use crate::train::pupil::Pupil;
use crate::train::world::World as _;

/// What was asked of the arm, by name.
type Calls = Arc<Mutex<Vec<&'static str>>>;

/// An ideal arm in real time that writes down its calls and fails on request.
struct Watched {
    arm: IdealArm,
    calls: Calls,
    fails: Arc<AtomicBool>,
    next: Instant,
}

impl Watched {
    fn call(&self, name: &'static str) {
        self.calls.lock().unwrap().push(name);
    }
}

impl RobotBackend for Watched {
    type Error = IdealArmError;
    fn period(&self) -> Duration {
        self.arm.period()
    }
    fn read(&mut self) -> Result<RobotState, IdealArmError> {
        // Faster than an arm: nobody waits for the way back in a test.
        std::thread::sleep(self.next.saturating_duration_since(Instant::now()));
        self.next = Instant::now() + self.period() / 8;
        self.call("read");
        if self.fails.load(Ordering::SeqCst) {
            return Err(IdealArmError::Stopped);
        }
        self.arm.read()
    }
    fn write(&mut self, command: &JointCommand) -> Result<(), IdealArmError> {
        self.call("write");
        self.arm.write(command)
    }
    fn stop(&mut self) -> Result<(), IdealArmError> {
        self.call("stop");
        self.arm.stop()
    }
    fn recover(&mut self) -> Result<(), IdealArmError> {
        self.call("recover");
        self.arm.recover()
    }
    fn tare(&mut self) -> Result<(), IdealArmError> {
        self.arm.tare()
    }
}

struct Rig {
    world: RealTime,
    pupil: Pupil,
    enter: Arc<AtomicUsize>,
    calls: Calls,
    fails: Arc<AtomicBool>,
    _folder: tempfile::TempDir,
}

fn rig() -> Rig {
    let set = ["sac.hidden=[8]", "env.max_steps=10", "run.evaluate_episodes=2"];
    let set = set.map(String::from).to_vec();
    let (preset, task, model) = ("palpate".into(), "peg-insertion".into(), "P-14".into());
    let config = Config::load(&Choice { preset, task, model, file: None, set }).unwrap();
    let agent = Sac::new(&config.sac, 18, 14, 1).unwrap();
    let (calls, fails) = (Calls::default(), Arc::<AtomicBool>::default());
    let arm = Watched {
        arm: IdealArm::at(config.task.q_home),
        calls: Arc::clone(&calls),
        fails: Arc::clone(&fails),
        next: Instant::now(),
    };
    let settled = config.clone();
    let build = move || stack::env(&settled, stack::chain(&settled.robot)?, arm, 1, Purpose::Train);
    let exchange = Exchange::default();
    let actor = Actor::learned(agent.policy(), Some(1));
    let control = Control::start(build, actor, exchange.clone(), 10, Pilot::serve).unwrap();
    assert!(matches!(control.news.recv().unwrap(), News::Ready));
    let folder = tempfile::tempdir().unwrap();
    let dir = create(&config, None, Some(&folder.path().join("run"))).unwrap();
    let pupil = Pupil::new(config, dir, agent, Progress::default(), "train-real").unwrap();
    let realtime = Realtime { fifo: Err(String::new()), locked: Err(String::new()) };
    let farewell = channel().1;
    let arm = Arm { control, operator: Operator::default(), realtime, farewell };
    let enter = Arc::<AtomicUsize>::default();
    let world = RealTime::attended(arm, exchange, Keys::pressed_by(&enter));
    Rig { world, pupil, enter, calls, fails, _folder: folder }
}

impl Rig {
    fn count(calls: &Calls, name: &str) -> usize {
        calls.lock().unwrap().iter().filter(|c| **c == name).count()
    }
}

/// Looks at the calls for a while, then presses Enter; the commands and reads in between.
fn press_later(rig: &Rig) -> std::thread::JoinHandle<(usize, usize)> {
    let (enter, calls) = (Arc::clone(&rig.enter), Arc::clone(&rig.calls));
    std::thread::spawn(move || {
        std::thread::sleep(Duration::from_millis(100));
        let count = || (Rig::count(&calls, "write"), Rig::count(&calls, "read"));
        let before = count();
        std::thread::sleep(Duration::from_millis(300));
        let after = count();
        enter.fetch_add(1, Ordering::SeqCst);
        (after.0 - before.0, after.1 - before.1)
    })
}

#[test]
fn enter_pauses_before_the_next_episode_and_enter_goes_on() {
    let mut rig = rig();
    rig.world.episode(&mut rig.pupil).unwrap();
    assert_eq!((rig.pupil.progress.episodes, rig.pupil.progress.step), (1, 10));
    rig.enter.fetch_add(1, Ordering::SeqCst);
    let later = press_later(&rig);
    rig.world.episode(&mut rig.pupil).unwrap();
    let (commands, reads) = later.join().unwrap();
    assert_eq!(commands, 0, "the arm is commanded during a pause");
    assert!(reads > 50, "the arm is not read during a pause: {reads}");
    assert_eq!((rig.pupil.progress.episodes, rig.pupil.progress.step), (2, 20));
    // No press, no pause.
    let begin = Rig::count(&rig.calls, "write");
    rig.world.episode(&mut rig.pupil).unwrap();
    assert!(Rig::count(&rig.calls, "write") > begin);
}

#[test]
fn a_stop_waits_for_a_person_and_recovers_once() {
    let mut rig = rig();
    rig.world.episode(&mut rig.pupil).unwrap();
    rig.fails.store(true, Ordering::SeqCst);
    let later = {
        let (enter, calls, fails) =
            (Arc::clone(&rig.enter), Arc::clone(&rig.calls), Arc::clone(&rig.fails));
        std::thread::spawn(move || {
            std::thread::sleep(Duration::from_millis(400));
            let early = Rig::count(&calls, "recover");
            // The cause is removed, then the person says so.
            fails.store(false, Ordering::SeqCst);
            std::thread::sleep(Duration::from_millis(200));
            let still = Rig::count(&calls, "recover");
            enter.fetch_add(1, Ordering::SeqCst);
            (early, still)
        })
    };
    rig.world.episode(&mut rig.pupil).unwrap();
    assert_eq!(later.join().unwrap(), (0, 0), "it recovered without a person");
    assert_eq!(Rig::count(&rig.calls, "recover"), 1);
    assert_eq!(rig.pupil.progress.aborted, 1, "its start is used up");
    rig.world.episode(&mut rig.pupil).unwrap();
    assert_eq!(rig.pupil.progress.episodes, 2, "training goes on");
}

#[test]
fn an_evaluation_is_measured_paused_and_not_learned_from() {
    let mut rig = rig();
    rig.world.episode(&mut rig.pupil).unwrap();
    let (steps, held) = (rig.pupil.agent.steps(), rig.pupil.agent.replay_len());
    let first = rig.world.evaluate(&mut rig.pupil).unwrap().unwrap();
    rig.enter.fetch_add(1, Ordering::SeqCst);
    let later = press_later(&rig);
    let second = rig.world.evaluate(&mut rig.pupil).unwrap().unwrap();
    assert_eq!(later.join().unwrap().0, 0, "the arm is commanded during a pause");
    assert_eq!((first.mean_return, first.mean_steps), (second.mean_return, second.mean_steps));
    assert_eq!(first.step, 10);
    assert_eq!((rig.pupil.agent.steps(), rig.pupil.agent.replay_len()), (steps, held));
    assert_eq!((rig.pupil.progress.episodes, rig.pupil.progress.step), (1, 10));
}
