//! `rt-probe`: how late this computer wakes a thread at 500 Hz, and what that means for an arm.

use std::fmt::Write as _;
use std::io::Write as _;
use std::sync::mpsc::channel;
use std::time::{Duration, Instant};

use anyhow::{Context as _, bail};
use palpate_ur::{Background, Realtime, UrConfig};

use super::PRIORITY;
use super::soak::Idlers;
use crate::interrupt;

/// What to measure.
#[derive(Clone, Copy, Debug)]
pub struct Probe {
    /// For how long, half of it beside a learner.
    pub seconds: f64,
}

const PERIOD: Duration = Duration::from_millis(2);
/// How far a joint may turn after the last command, degrees: what the defaults allow at 0.5 rad/s.
const STOP_ANGLE: f64 = 1.3;
/// Wake-ups were watched for minutes, an arm works for hours: the latest one is taken twice.
const MARGIN: f64 = 2.0;
/// More silent ticks than this, and the link is no real-time link: 100 ms.
pub(super) const HOPELESS: u32 = 50;

/// Measures, and says what follows.
///
/// # Errors
/// A thread cannot be started.
pub fn probe(what: &Probe) -> anyhow::Result<()> {
    let half = Duration::from_secs_f64(what.seconds / 2.0);
    let mut out = std::io::stdout();
    writeln!(out, "{}", computer())?;
    let (realtime, quiet) = watch(half)?;
    writeln!(out, "control thread: {realtime}")?;
    let (background, busy) = beside_a_learner(&realtime, half)?;
    writeln!(
        out,
        "learner: {background}\n\nlate by, µs, at 500 Hz      p50      p99    p99.9   p99.99      max"
    )?;
    for (name, late) in [("nothing else runs", &quiet), ("beside a busy learner", &busy)] {
        writeln!(out, "{}", row(name, late))?;
    }
    let worst = quiet.last().max(busy.last()).copied().unwrap_or_default();
    writeln!(out, "\n{}", advice(worst))?;
    Ok(())
}

/// Processors and kernel.
fn computer() -> String {
    let processors = std::thread::available_parallelism().map_or(0, usize::from);
    let read = |path: &str| std::fs::read_to_string(path).map(|t| t.trim().to_owned()).ok();
    let kernel = read("/proc/sys/kernel/osrelease").unwrap_or_else(|| "unknown".into());
    let preempts = read("/sys/kernel/realtime").as_deref() == Some("1");
    let kind = if preempts { "PREEMPT_RT" } else { "no PREEMPT_RT" };
    let mut text = format!("this computer: {processors} processors, kernel {kernel} ({kind})");
    if let Some(governor) = read("/sys/devices/system/cpu/cpu0/cpufreq/scaling_governor") {
        _ = write!(text, ", frequency governor {governor}");
    }
    text
}

/// Wake-ups beside threads that want every processor, at a learner's priority.
fn beside_a_learner(
    realtime: &Realtime,
    time: Duration,
) -> anyhow::Result<(Background, Vec<Duration>)> {
    let (end, ended) = channel::<()>();
    let (told, tell) = channel();
    let realtime = realtime.clone();
    // A thread of its own: there is no way back from the background.
    let learner = std::thread::spawn(move || {
        _ = told.send(palpate_ur::background(&realtime));
        let idlers = Idlers::start();
        _ = ended.recv();
        drop(idlers);
    });
    let background = tell.recv().context("the busy thread has ended")?;
    let late = watch(time).map(|(_, late)| late);
    drop(end);
    _ = learner.join();
    Ok((background, late?))
}

/// What a control thread is granted, and how late it wakes: one duration per period, sorted.
fn watch(time: Duration) -> anyhow::Result<(Realtime, Vec<Duration>)> {
    let thread = std::thread::spawn(move || {
        let realtime = palpate_ur::realtime(PRIORITY, true);
        let periods = (time.as_secs_f64() / PERIOD.as_secs_f64()) as usize;
        let mut late = Vec::with_capacity(periods);
        let mut next = Instant::now();
        while late.len() < periods && !interrupt::requested() {
            next += PERIOD;
            std::thread::sleep(next.saturating_duration_since(Instant::now()));
            let now = Instant::now();
            late.push(now.saturating_duration_since(next));
            // Whoever slept through several periods missed them once, not again and again.
            while next + PERIOD < now {
                next += PERIOD;
            }
        }
        late.sort_unstable();
        (realtime, late)
    });
    thread.join().or_else(|_| bail!("the measurement panicked"))
}

fn row(name: &str, late: &[Duration]) -> String {
    let last = late.len().saturating_sub(1) as f64;
    let at = |part: f64| {
        let late = late.get((part * last).round() as usize);
        late.map_or(f64::NAN, |late| 1e6 * late.as_secs_f64())
    };
    let parts = [0.5, 0.99, 0.999, 0.9999, 1.0].map(|part| format!("{:>9.0}", at(part)));
    format!("{name:<24}{}", parts.concat())
}

/// Joint speed at which an arm still stops within [`STOP_ANGLE`] of the last command, rad/s: v·T + v²/2a is the way
/// through a silence of T, braked at a.
fn speed_limit(stall_ticks: u32, brake: f64) -> f64 {
    let silence = f64::from(stall_ticks) * PERIOD.as_secs_f64();
    let lost = brake * silence;
    -lost + (lost * lost + 2.0 * brake * STOP_ANGLE.to_radians()).sqrt()
}

/// What follows from the latest wake-up.
fn advice(worst: Duration) -> String {
    let defaults = UrConfig::at("");
    let periods = MARGIN * worst.as_secs_f64() / PERIOD.as_secs_f64();
    let stale = (periods.ceil() as u32 + 1).max(defaults.stale_ticks);
    let stall = (2 * stale).max(defaults.stall_ticks);
    let ms = |ticks: u32| f64::from(ticks) * PERIOD.as_secs_f64() * 1e3;
    let speed = speed_limit(stall, defaults.brake);
    if stale > HOPELESS {
        return format!(
            "the latest wake-up was {:.1} ms late: this computer does not hold 500 Hz, do not drive an arm from it.\n\
             Close other programs, take a computer that is not virtual, permit SCHED_FIFO, or install a PREEMPT_RT kernel",
            1e3 * worst.as_secs_f64()
        );
    }
    if stale == defaults.stale_ticks {
        return format!(
            "the defaults hold: the link may be silent for {stale} ticks ({:.0} ms), the arm brakes by itself after {stall} ({:.0} ms)\n\
             and stops within {STOP_ANGLE}° of the last command up to {speed:.2} rad/s",
            ms(stale),
            ms(stall)
        );
    }
    format!(
        "the latest wake-up was {:.1} ms late: the default limits of the link would stop the arm now and then. What holds here, for your cell's file:\n\n\
         [ur]\nstale_ticks = {stale}\nstall_ticks = {}\n\n\
         The arm then brakes by itself after {:.0} ms, and stops within {STOP_ANGLE}° of the last command only up to {speed:.2} rad/s:\n\n\
         [safety]\njoint_velocity_max = {:.2?}",
        1e3 * worst.as_secs_f64(),
        stall.min(100),
        ms(stall.min(100)),
        [speed; 6]
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_quick_computer_keeps_the_defaults_and_a_slow_one_gets_limits() {
        let said = advice(Duration::from_micros(300));
        assert!(said.contains("the defaults hold") && said.contains("up to 0.50 rad/s"), "{said}");
        let said = advice(Duration::from_millis(12));
        assert!(said.contains("stale_ticks = 13\nstall_ticks = 26"), "{said}");
        assert!(said.contains("up to 0.33 rad/s"), "{said}");
        let said = advice(Duration::from_millis(60));
        assert!(said.contains("does not hold 500 Hz"), "{said}");
    }

    /// The way through the silence and the brake is the angle that was allowed.
    #[test]
    fn the_speed_limit_stops_in_time() {
        for ticks in [10, 26, 100] {
            let v = speed_limit(ticks, 10.0);
            let way = v * f64::from(ticks) * 0.002 + v * v / 20.0;
            assert!((way.to_degrees() - STOP_ANGLE).abs() < 1e-9, "{ticks}: {v}");
        }
    }

    #[test]
    fn wake_ups_are_counted() {
        let (_, late) = watch(Duration::from_millis(100)).unwrap();
        assert_eq!(late.len(), 50);
        assert!(late.is_sorted());
        let row = row("x", &late);
        assert_eq!(row.split_whitespace().count(), 6, "{row}");
    }
}
