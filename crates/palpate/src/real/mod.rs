//! A real arm: `doctor`, `train-real` and `run-policy`.
//!
//! Nothing here has moved one: everything was run against the virtual controller.

pub mod brake;
pub mod doctor;
mod exchange;
mod journal;
mod keys;
#[cfg(test)]
mod pause_tests;
mod pilot;
mod policy;
mod probe;
pub mod soak;
mod thread;
mod train;
mod world;

use std::io::{BufRead as _, IsTerminal as _, Write as _};
use std::str::FromStr;
use std::sync::mpsc::{Receiver, channel};

use anyhow::{Context as _, bail};
use palpate_env::Env;
use palpate_safety::{Mode, Safe};
use palpate_ur::{LinkStats, Operator, Realtime, UrArm, UrConfig};

pub use policy::{PolicyRun, run_policy};
pub use probe::{Probe, probe};
pub use train::{TrainReal, train_real};

use crate::baselines::Actor;
use crate::stack::{self, Purpose};
use crate::{Config, interrupt};
use brake::Brake;
use exchange::Exchange;
use pilot::Pilot;
use thread::{Control, Fault, News};

/// Priority of the control thread under SCHED_FIFO, where permitted: above everything but the kernel's own.
const PRIORITY: u8 = 80;

/// A controller's address: a host name or an IPv4 address, with the RTDE port if it is not 30004.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Address {
    host: String,
    port: Option<u16>,
}

impl FromStr for Address {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let (host, port) = match text.rsplit_once(':') {
            Some((host, port)) => {
                (host, Some(port.parse().map_err(|e| format!("port {port:?}: {e}"))?))
            }
            None => (text, None),
        };
        if host.is_empty() || host.contains(char::is_whitespace) {
            return Err(format!("{text:?} is no HOST or HOST:PORT"));
        }
        Ok(Self { host: host.to_owned(), port })
    }
}

impl Address {
    /// The default settings of an arm there.
    pub fn arm(&self) -> UrConfig {
        let mut arm = UrConfig::at(self.host.clone());
        arm.ports.rtde = self.port.unwrap_or(arm.ports.rtde);
        arm
    }
}

/// The environment on an arm.
type ArmEnv = Env<Safe<Brake<UrArm>>>;

/// A connected arm under its control thread.
struct Arm {
    control: Control,
    operator: Operator,
    /// What the operating system granted the control thread.
    realtime: Realtime,
    farewell: Receiver<LinkStats>,
}

/// Connects, on the control thread. The arm does not move before the first order.
fn connect(config: &Config, actor: Actor, exchange: Exchange) -> anyhow::Result<Arm> {
    let (card, cards) = channel();
    let (bye, farewell) = channel();
    let steps = config.env.max_steps;
    let config = config.clone();
    let build = move || -> anyhow::Result<ArmEnv> {
        let realtime = palpate_ur::realtime(PRIORITY, true);
        let arm = UrArm::connect(settings(&config)?.clone())?;
        _ = card.send((arm.operator(), realtime));
        let arm = Brake::new(arm, interrupt::flag());
        let chain = stack::chain(&config.robot)?;
        stack::env(&config, chain, arm, config.run.seed, Purpose::Train)
    };
    let fly = move |pilot: &mut Pilot<Safe<Brake<UrArm>>>| {
        // What was taken since the first time, too.
        _ = palpate_ur::lock_memory();
        pilot.serve();
        _ = bye.send(pilot.env().robot().backend().arm().stats());
    };
    let control = Control::start(build, actor, exchange, steps, fly)?;
    match control.news.recv() {
        Ok(News::Ready) => {}
        Ok(News::Fault(fault)) => bail!("{}", fault.text),
        _ => bail!("the control thread ended before the arm was connected"),
    }
    let (operator, realtime) = cards.recv().context("the control thread ended")?;
    Ok(Arm { control, operator, realtime, farewell })
}

impl Arm {
    /// Stops the arm, lets go of it and says what its link has done.
    fn release(self) -> Option<LinkStats> {
        drop(self.control);
        self.farewell.recv().ok()
    }
}

/// The arm's settings, which every configuration made for an arm has.
fn settings(config: &Config) -> anyhow::Result<&UrConfig> {
    config.ur.as_ref().context("the configuration names no arm")
}

/// What a person has to know before the arm moves.
fn limits(config: &Config) -> anyhow::Result<String> {
    let ur = settings(config)?;
    let task = &config.task;
    let mut safety = toml::Table::try_from(&config.safety)?;
    if config.safety.mode != Mode::Shield {
        safety.remove("shield");
    }
    let safety = toml::to_string(&safety)?;
    let indented = safety.trim_end().replace('\n', "\n  ");
    Ok(format!(
        "limits of the fail-safe layer ([safety]):\n  {}\nway back to the start: {} m/s, {} rad/s, tool lifted to {} m above the mouth\n\
         arm {}: a stalled link brakes it after {} cycles at {} rad/s²\n\
         task {}: hole at {:?} m in base_link, start near joints {:.3?} rad",
        indented,
        config.env.reset.linear_speed,
        config.env.reset.joint_speed,
        config.env.reset.clearance,
        ur.host,
        ur.stall_ticks,
        ur.brake,
        task.name,
        task.hole_position,
        task.q_home.as_slice(),
    ))
}

/// Examines the arm, shows the limits and asks a person. Whether the arm may move.
fn permitted(config: &Config, yes: bool, dry_run: bool) -> anyhow::Result<bool> {
    let report = doctor::examine(config)?;
    let mut out = std::io::stdout();
    write!(out, "{report}")?;
    writeln!(out, "{}", limits(config)?)?;
    if report.failed() {
        bail!("the arm is not ready: nothing was moved; see the lines marked FAIL");
    }
    if dry_run {
        writeln!(out, "dry run: nothing was moved")?;
        return Ok(false);
    }
    if yes {
        return Ok(true);
    }
    if !std::io::stdin().is_terminal() {
        bail!("nobody can be asked here: give --yes if the arm may move");
    }
    write!(
        out,
        "The arm will move. Nobody within its reach, a hand at the emergency stop?\nType yes to go on: "
    )?;
    out.flush()?;
    let mut answer = String::new();
    std::io::stdin().lock().read_line(&mut answer)?;
    Ok(answer.trim() == "yes")
}

/// The error that ends a run.
fn ended(fault: &Fault) -> anyhow::Error {
    let kind = fault.kind.map_or_else(String::new, |kind| format!(" ({kind:?})"));
    anyhow::anyhow!("the arm has stopped{kind}: {}", fault.text)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_address_is_a_host_and_perhaps_a_port() {
        let arm = |text: &str| text.parse::<Address>().map(|a| a.arm());
        let ports = |text| arm(text).map(|a| (a.host.clone(), a.ports.rtde, a.ports.dashboard));
        assert_eq!(ports("10.0.0.2"), Ok(("10.0.0.2".into(), 30_004, 29_999)));
        assert_eq!(ports("robot.local:7"), Ok(("robot.local".into(), 7, 29_999)));
        for wrong in ["", ":3", "robot:rtde", "two words"] {
            arm(wrong).unwrap_err();
        }
    }
}
