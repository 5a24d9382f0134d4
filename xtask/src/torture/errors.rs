//! System calls that fail.

use std::fs;
use std::path::Path;
use std::process::Command;
use std::time::{Duration, Instant};

use anyhow::{Context as _, ensure};

use super::rig::{Print, Rig, print, refused_well, said, same};

const STEPS: u64 = 120;
const CALLS: &[&str] =
    &["write", "fsync", "fdatasync", "openat", "rename", "mkdir", "ftruncate", "unlink", "read"];
/// A run that still waits for the disk is then ended by its user.
const PATIENCE: Duration = Duration::from_secs(10);

pub(super) fn torture(
    rig: &Rig,
    errors: u64,
    random: &mut fastrand::Rng,
) -> anyhow::Result<String> {
    if let Some(missing) = ["strace", "prlimit"].into_iter().find(|tool| !exists(tool)) {
        return Ok(format!("errors: not injected, for want of {missing}"));
    }
    let straight = rig.finish(&rig.path("unharmed"), STEPS)?;
    let made = count_calls(rig)?;
    let (mut unharmed, mut resumed) = (0, 0);
    for n in 0..errors {
        let (call, times) = &made[random.usize(..made.len())];
        let error = if random.bool() { "ENOSPC" } else { "EIO" };
        let (first, run) = (random.u64(1..=*times), random.u64(0..3));
        let inject = format!("inject={call}:error={error}:when={first}..{}", first + run);
        let wrapper = strace(&["-o", "/dev/null", "-e", &format!("trace={call}"), "-e", &inject]);
        // Where nothing can be written, nor can the reason.
        let heard = *call != "write";
        if ordeal(rig, &straight, &wrapper, heard).context(inject)? {
            unharmed += 1;
        } else {
            resumed += 1;
        }
        if n % 100 == 99 {
            println!("  {} of {errors} errors", n + 1);
        }
    }
    let limits = errors.div_ceil(10);
    let largest = straight.values().map(Vec::len).max().unwrap_or(1);
    for _ in 0..limits {
        let limit = format!("--fsize={}", random.usize(1..=largest));
        ordeal(rig, &straight, &["prlimit".into(), limit.clone()], true).context(limit)?;
    }
    let calls = made.len();
    Ok(format!(
        "{errors} errors in {calls} system calls ({unharmed} runs went on to the right end, {resumed} gave up and were resumed to it), \
         {limits} limits on file sizes"
    ))
}

fn exists(tool: &str) -> bool {
    Command::new(tool).arg("--version").output().is_ok_and(|output| output.status.success())
}

fn strace(more: &[&str]) -> Vec<String> {
    let words = ["strace", "-f", "-qq", "--seccomp-bpf"];
    words.iter().chain(more).map(|word| (*word).to_owned()).collect()
}

/// How often an undisturbed run makes each of the calls.
fn count_calls(rig: &Rig) -> anyhow::Result<Vec<(&'static str, u64)>> {
    let (run, log) = (rig.path("counted"), rig.path("calls"));
    let trace = format!("trace={}", CALLS.join(","));
    let wrapper = strace(&["-o", &log.to_string_lossy(), "-e", &trace]);
    let output = rig.go_on(&run, STEPS, &wrapper).output()?;
    ensure!(output.status.success(), "strace: {}: {}", output.status, said(&output));
    let log = fs::read_to_string(log)?;
    // A line is `PID call(…`.
    let named = |line: &str, call: &str| {
        line.split_once(' ').is_some_and(|(_, rest)| {
            rest.trim_start().strip_prefix(call).is_some_and(|rest| rest.starts_with('('))
        })
    };
    let count = |call: &&str| log.lines().filter(|line| named(line, call)).count() as u64;
    let made: Vec<_> = CALLS.iter().map(|call| (*call, count(call))).collect();
    let made: Vec<_> = made.into_iter().filter(|(_, count)| *count > 0).collect();
    ensure!(made.len() > 4, "strace saw only {made:?}");
    Ok(made)
}

/// A run under `wrapper`, resumed without it if it gave up. Whether it did not have to be.
fn ordeal(rig: &Rig, straight: &Print, wrapper: &[String], heard: bool) -> anyhow::Result<bool> {
    let run = rig.path("erring");
    if run.exists() {
        fs::remove_dir_all(&run)?;
    }
    let unharmed = under(rig, &run, wrapper, heard)?;
    let print = if unharmed { print(&run)? } else { rig.finish(&run, STEPS)? };
    same(straight, &print)?;
    Ok(unharmed)
}

/// Whether the run came to its end.
fn under(rig: &Rig, run: &Path, wrapper: &[String], heard: bool) -> anyhow::Result<bool> {
    let mut child = rig.go_on(run, STEPS, wrapper).spawn().context("cannot start a run")?;
    let began = Instant::now();
    while child.try_wait()?.is_none() {
        if began.elapsed() > PATIENCE {
            // To the run itself, which is the child or a child of strace.
            let pid = fs::read_to_string(run.join("lock"))?;
            Command::new("kill").args(["-TERM", pid.trim()]).status()?;
            break;
        }
        std::thread::sleep(Duration::from_millis(10));
    }
    let output = child.wait_with_output()?;
    if output.status.success() {
        return Ok(said(&output).contains("done in"));
    }
    // The loader of programs has its own way to say it.
    let loader = output.status.code() == Some(127);
    let silent = !heard && output.status.code() == Some(1);
    ensure!(loader || silent || refused_well(&output), "{}: {}", output.status, said(&output));
    Ok(false)
}
