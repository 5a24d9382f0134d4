//! `cargo xtask torture`: simulated trainings are killed, their files damaged, their system calls made to fail, and
//! every one of them must end as the undisturbed run does, byte for byte, or refuse with a message that says why.

mod damage;
mod errors;
mod kills;
mod rig;

use std::ffi::OsString;
use std::time::Instant;

use anyhow::{Context as _, bail};

use crate::palpate;
use rig::Rig;

const HELP: &str = "\
Usage: cargo xtask torture [WHAT] [--kills N] [--damages N] [--errors N] [--seed S]

Ill-treats short simulated trainings and compares what they end with (metrics.csv, episodes.csv, every file of the
last checkpoint and of the kept policies) with an undisturbed run's, byte for byte. Without WHAT, all three:

  kills    kill -9 at N random moments, resume, until the run is complete [1000]
  damage   cuts the newest manifest at every byte, flips a bit of every byte of it, and does N random things to
           the other files [1000]; a run may then recover or refuse, but never go on wrongly
  errors   makes one system call, or several in a row, fail with ENOSPC or EIO, N times [300]; limits the size of
           files, so that writes come back short [N/10]. Needs strace and prlimit

A seed repeats the places and kinds of damage; moments are only as repeatable as a scheduler.
";

/// How much of each.
#[derive(Clone, Copy, Debug)]
struct Plan {
    kills: u64,
    /// Every how manieth byte of the manifest is cut at and flipped.
    stride: usize,
    damages: u64,
    errors: u64,
}

pub(crate) fn command(args: &[OsString]) -> anyhow::Result<()> {
    let mut plan = Plan { kills: 1000, stride: 1, damages: 1000, errors: 300 };
    let (mut seed, mut only) = (1, None);
    let mut args = args.iter().map(|arg| arg.to_string_lossy());
    while let Some(arg) = args.next() {
        let mut number = || -> anyhow::Result<u64> {
            let text = args.next().with_context(|| format!("{arg} needs a number"))?;
            text.parse().with_context(|| format!("{arg} {text} is no number"))
        };
        match &*arg {
            "--kills" => plan.kills = number()?,
            "--damages" => plan.damages = number()?,
            "--errors" => plan.errors = number()?,
            "--seed" => seed = number()?,
            "kills" | "damage" | "errors" => only = Some(arg.into_owned()),
            "--help" | "-h" => {
                print!("{HELP}");
                return Ok(());
            }
            _ => bail!("unexpected `{arg}`\n\n{HELP}"),
        }
    }
    println!("{}", story(plan, seed, only.as_deref())?);
    Ok(())
}

/// The short form for every merge.
pub(crate) fn short() -> anyhow::Result<String> {
    story(Plan { kills: 25, stride: 40, damages: 60, errors: 20 }, 1, None)
}

fn story(plan: Plan, seed: u64, only: Option<&str>) -> anyhow::Result<String> {
    let rig = Rig::new(palpate::binary()?)?;
    let mut random = fastrand::Rng::with_seed(seed);
    let wanted = |what: &str| only.is_none_or(|only| only == what);
    let mut seen = Vec::new();
    let mut part = |what: &str, run: &mut dyn FnMut() -> anyhow::Result<String>| {
        if !wanted(what) {
            return anyhow::Ok(());
        }
        let began = Instant::now();
        let said = run()
            .with_context(|| format!("the runs of this are kept in {}", rig.root().display()))?;
        println!("{said} ({:.0} s)", began.elapsed().as_secs_f64());
        seen.push(said);
        Ok(())
    };
    part("kills", &mut || kills::torture(&rig, plan.kills, &mut random))?;
    part("damage", &mut || damage::torture(&rig, plan.stride, plan.damages, &mut random))?;
    part("errors", &mut || errors::torture(&rig, plan.errors, &mut random))?;
    rig.remove()?;
    Ok(seen.join("; "))
}
