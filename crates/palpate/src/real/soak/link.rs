//! `soak link`: the 500 Hz loop for as long as asked, with a learner that never rests.

use std::io::Write as _;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{RecvTimeoutError, channel};
use std::time::{Duration, Instant};

use anyhow::{Context as _, bail};
use palpate_env::Env;
use palpate_sac::Sac;
use palpate_safety::Safe;
use palpate_ur::{LinkStats, Ports, UrArm, UrConfig};
use palpate_virtual_ur::{Handle, Port};

use super::timed::{Account, Timed};
use crate::baselines::Actor;
use crate::config::{Choice, Config};
use crate::real::brake::Brake;
use crate::real::exchange::Exchange;
use crate::real::pilot::Pilot;
use crate::real::thread::{Control, News, Order};
use crate::real::{PRIORITY, settings};
use crate::stack::{self, Purpose};
use crate::{interrupt, virtual_ur};

/// Own cost per tick that a control thread may have, µs: median, and all but one in 10,000.
const COST_MAX: (f64, f64) = (60.0, 500.0);

/// What to run.
#[derive(Clone, Debug)]
pub struct Link {
    /// For how long.
    pub minutes: f64,
    /// Task, model and settings.
    pub choice: Choice,
}

/// Counts what a closure takes from the heap on this thread.
pub type Measure = fn(&mut dyn FnMut()) -> u64;

type SoakEnv = Env<Safe<Brake<Timed>>>;

/// What the control thread leaves behind.
struct Flight {
    allocations: u64,
    costs: Vec<u32>,
    account: Account,
    stats: LinkStats,
    /// The controller's clock from the first to the last sample, s.
    seconds: f64,
    /// Samples before the first.
    before: LinkStats,
}

/// What the learner counted.
#[derive(Debug, Default)]
struct Learned {
    steps: u64,
    episodes: u64,
    updates: u64,
    stops: Vec<String>,
}

/// Runs it and says what it came to.
///
/// # Errors
/// It cannot start, or one of the figures is out of bounds.
pub fn link(what: &Link, measure: Measure) -> anyhow::Result<()> {
    let setup =
        virtual_ur::Setup { address: [127, 0, 0, 1].into(), any_ports: true, faults: Vec::new() };
    let mut its = what.choice.clone();
    // The arm's side is none of the controller's business.
    its.set.retain(|key| !key.starts_with("ur."));
    let (options, plant) = virtual_ur::controller(&its, setup)?;
    let robot = Handle::start(options, Box::new(plant))?;
    let controller = robot
        .with(|_| palpate_ur::realtime(virtual_ur::PRIORITY, false))
        .context("the virtual controller has ended")?;
    let port = |port| robot.address(port).port();
    let ports = Ports {
        rtde: port(Port::Rtde),
        script: port(Port::Secondary),
        dashboard: port(Port::Dashboard),
    };
    let config = Config::load_for(&what.choice, &UrConfig { ports, ..UrConfig::at("127.0.0.1") })?;
    let agent = {
        let env = stack::sim_env(&config, config.run.seed, Purpose::Train)?;
        Sac::new(&config.sac, env.observation_dim(), env.action_dim(), config.run.seed)?
    };
    let exchange = Exchange::default();
    let seed = stack::stream(config.run.seed, Purpose::Explore);
    let actor = Actor::learned(agent.policy(), Some(seed));
    let (landed, flight) = channel();
    let ticks = (what.minutes * 60.0 * 500.0 * 1.1) as usize + 10_000;
    let (card, cards) = channel();
    let settled = config.clone();
    let build = move || -> anyhow::Result<SoakEnv> {
        let realtime = palpate_ur::realtime(PRIORITY, true);
        let arm = UrArm::connect(settings(&settled)?.clone())?;
        _ = card.send((arm.operator(), realtime));
        let arm = Brake::new(Timed::new(arm, ticks), interrupt::flag());
        let chain = stack::chain(&settled.robot)?;
        stack::env(&settled, chain, arm, settled.run.seed, Purpose::Train)
    };
    let fly = move |pilot: &mut Pilot<_>| {
        let arm = |pilot: &Pilot<Safe<Brake<Timed>>>| {
            let arm = pilot.env().robot().backend().arm();
            (arm.clock(), arm.stats())
        };
        let (begin, before) = arm(pilot);
        let allocations = measure(&mut || pilot.serve());
        let (end, stats) = arm(pilot);
        let timed = pilot.env().robot().backend().arm();
        let (costs, account) = (timed.costs(), timed.account());
        let seconds = end - begin;
        _ = landed.send(Flight { allocations, costs, account, stats, seconds, before });
    };
    let control = Control::start(build, actor, exchange.clone(), config.env.max_steps, fly)?;
    match control.news.recv() {
        Ok(News::Ready) => {}
        Ok(News::Fault(fault)) => bail!("{}", fault.text),
        _ => bail!("the control thread ended before the arm was connected"),
    }
    let (operator, realtime) = cards.recv().context("the control thread ended")?;
    let background = palpate_ur::background(&realtime);
    let mut out = std::io::stdout();
    writeln!(
        out,
        "control thread: {realtime}; virtual controller: {controller}; learner: {background}"
    )?;
    let idlers = Idlers::start();
    let learned = learn(what, agent, &control, &exchange, &operator);
    drop(idlers);
    drop(control);
    let flight = flight.recv().context("the control thread has left nothing behind")?;
    let pace = robot.stop();
    let learned = learned?;
    writeln!(
        out,
        "learner: {} updates beside {} steps in {} episodes\ncontroller: {} cycles, {} of them begun more than 2 ms late, the latest by {:.1} ms",
        learned.updates,
        learned.steps,
        learned.episodes,
        pace.cycles,
        pace.late,
        pace.worst.as_secs_f64() * 1e3
    )?;
    for stop in &learned.stops {
        writeln!(out, "stopped and recovered: {stop}")?;
    }
    flight.report(&mut out)
}

/// Threads that want every processor, at the learner's priority, until they are dropped.
pub(in crate::real) struct Idlers(&'static AtomicBool, Vec<std::thread::JoinHandle<()>>);

impl Idlers {
    /// One per processor.
    pub(in crate::real) fn start() -> Self {
        let end: &'static AtomicBool = Box::leak(Box::default());
        let count = std::thread::available_parallelism().map_or(1, usize::from);
        let spin = move || {
            while !end.load(Ordering::Relaxed) {
                std::hint::spin_loop();
            }
        };
        Self(end, (0..count).map(|_| std::thread::spawn(spin)).collect())
    }
}

impl Drop for Idlers {
    fn drop(&mut self) {
        self.0.store(true, Ordering::Relaxed);
        for thread in self.1.drain(..) {
            _ = thread.join();
        }
    }
}

/// Episodes until the time is up, and updates without a pause.
fn learn(
    what: &Link,
    mut agent: Sac,
    control: &Control,
    exchange: &Exchange,
    operator: &palpate_ur::Operator,
) -> anyhow::Result<Learned> {
    let end = Instant::now() + Duration::from_secs_f64(60.0 * what.minutes);
    let mut learned = Learned::default();
    control.orders.send(Order::Episode(0))?;
    while Instant::now() < end && !interrupt::requested() {
        // Enough to learn from, or nothing to do but wait.
        let patience = if agent.update()?.is_some() { 0 } else { 20 };
        match control.news.recv_timeout(Duration::from_millis(patience)) {
            Ok(News::Step(lesson)) => {
                agent.observe(&lesson.transition())?;
                exchange.offer(agent.policy());
                learned.steps += 1;
                let over = lesson.summary.is_some();
                control.give_back(lesson);
                if over {
                    learned.episodes += 1;
                    control.orders.send(Order::Episode(learned.episodes))?;
                }
            }
            Ok(News::Fault(fault)) => {
                agent.end_episode();
                learned.stops.push(fault.text);
                operator.acknowledge();
                control.orders.send(Order::Recover)?;
                learned.episodes += 1;
                control.orders.send(Order::Episode(learned.episodes))?;
                anyhow::ensure!(
                    learned.stops.len() < 100,
                    "it does not stay up: {:?}",
                    learned.stops
                );
            }
            Ok(News::Ready | News::Measured(_)) | Err(RecvTimeoutError::Timeout) => {}
            Err(RecvTimeoutError::Disconnected) => bail!("the control thread has ended"),
        }
    }
    learned.updates = agent.updates();
    Ok(learned)
}

impl Flight {
    fn at(&self, part: f64) -> f64 {
        let last = self.costs.len().saturating_sub(1) as f64;
        self.costs.get((part * last).round() as usize).map_or(f64::NAN, |ns| f64::from(*ns) / 1e3)
    }

    /// Prints everything; an error names what is out of bounds.
    fn report(&self, out: &mut impl std::io::Write) -> anyhow::Result<()> {
        let (a, s, b) = (&self.account, &self.stats, &self.before);
        let cycles = (self.seconds * 500.0).round() as u64;
        let (samples, missed) = (s.samples - b.samples, s.missed - b.missed);
        let waited = s.skipped - b.skipped - a.own - a.late;
        writeln!(
            out,
            "own cost of {} ticks, µs: p50 {:.1}, p99 {:.1}, p99.9 {:.1}, p99.99 {:.1}, max {:.1}",
            self.costs.len(),
            self.at(0.5),
            self.at(0.99),
            self.at(0.999),
            self.at(0.9999),
            self.at(1.0)
        )?;
        writeln!(out, "taken from the heap by the control thread: {} times", self.allocations)?;
        writeln!(
            out,
            "controller cycles: {cycles} = {samples} samples + {missed} that never arrived\n\
             of the samples {} were overtaken by a newer one: {} while the tick before took longer than 2 ms, {} before the thread woke, {waited} while a tare or a recovery was waited for\n\
             within the loop: {} cycles = {} read + {} + {} overtaken + {} never arrived",
            s.skipped - b.skipped,
            a.own,
            a.late,
            a.cycles,
            a.read,
            a.own,
            a.late,
            a.missed,
        )?;
        writeln!(
            out,
            "commands: {} sent, {} taken, {} replaced by a later one first, {} not taken by the network",
            s.sent - b.sent,
            s.taken - b.taken,
            s.overwritten - b.overwritten,
            s.unsent - b.unsent
        )?;
        let mut wrong = Vec::new();
        if !a.is_balanced() || cycles != samples + missed {
            wrong.push("cycles are not accounted for".to_owned());
        }
        if self.allocations > 0 {
            wrong.push(format!("{} allocations on the control thread", self.allocations));
        }
        for (part, limit) in [(0.5, COST_MAX.0), (0.9999, COST_MAX.1)] {
            let cost = self.at(part);
            if cost.is_nan() || cost > limit {
                wrong
                    .push(format!("own cost {cost:.1} µs at {}, allowed {limit} µs", 100.0 * part));
            }
        }
        anyhow::ensure!(wrong.is_empty(), "{}", wrong.join("; "));
        Ok(())
    }
}
