//! `doctor`: is this arm ready, and is it the arm that the configuration describes? Reads only.

use std::fmt;
use std::io::Write as _;
use std::net::IpAddr;
use std::time::{Duration, Instant};

use palpate_robot_io::RobotBackend;
use palpate_safety::Mode;
use palpate_safety::shield::Workspace;
use palpate_spatial::{Vector3, Vector6};
use palpate_ur::dashboard::Dashboard;
use palpate_ur::proto::{RobotMode, SafetyStatus};
use palpate_ur::{Sample, UrArm, UrConfig, model_error};

use super::{Address, limits, settings};
use crate::Config;
use crate::config::Choice;
use crate::stack::{Purpose, chain, sim_env};

/// How long the arm is watched, s.
const WATCH: f64 = 2.0;
/// The controller's model of this arm minus ours, m: beyond the first the calibration is missing, beyond the
/// second it is another arm.
const MODEL: (f64, f64) = (0.5e-3, 5e-3);
/// Tool centre point there minus here, m.
const TCP: (f64, f64) = (0.5e-3, 2e-3);
/// Untared reading in free air, N: the sensor's own specification is ±4 N.
const BIAS: f64 = 4.0;
/// Spread of a reading at rest, N.
const NOISE: f64 = 1.0;
/// Joint speed at rest, rad/s.
const REST: f64 = 0.01;

/// Starts that are tried against the workspace.
const STARTS: u64 = 64;

/// How serious a finding is.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Grade {
    /// As it should be.
    Ok,
    /// The arm may move; know this first.
    Warn,
    /// The arm must not move.
    Fail,
}

/// One thing looked at.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
pub struct Finding {
    /// What was looked at.
    pub check: &'static str,
    /// How serious it is.
    pub grade: Grade,
    /// What was found, with units.
    pub found: String,
}

/// Everything looked at.
#[derive(Clone, Debug, Default, PartialEq, serde::Serialize)]
pub struct Report {
    /// In the order of looking.
    pub findings: Vec<Finding>,
}

impl Report {
    /// Whether something forbids motion.
    pub fn failed(&self) -> bool {
        self.findings.iter().any(|f| f.grade == Grade::Fail)
    }

    fn add(&mut self, check: &'static str, grade: Grade, found: impl Into<String>) {
        self.findings.push(Finding { check, grade, found: found.into() });
    }

    /// Graded by size; NaN fails.
    fn grade(&mut self, check: &'static str, x: f64, (warn, fail): (f64, f64), found: String) {
        let grade = if x <= warn {
            Grade::Ok
        } else if x <= fail {
            Grade::Warn
        } else {
            Grade::Fail
        };
        self.add(check, grade, found);
    }
}

impl fmt::Display for Report {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for finding in &self.findings {
            let grade = match finding.grade {
                Grade::Ok => "ok  ",
                Grade::Warn => "WARN",
                Grade::Fail => "FAIL",
            };
            writeln!(f, "{grade} {:<16} {}", finding.check, finding.found)?;
        }
        Ok(())
    }
}

/// The `doctor` command.
///
/// # Errors
/// No connection, or a finding that forbids motion.
pub fn command(address: &Address, choice: &Choice, json: bool) -> anyhow::Result<()> {
    let config = Config::load_for(choice, &address.arm())?;
    let report = examine(&config)?;
    let mut out = std::io::stdout().lock();
    if json {
        let report = serde_json::json!({
            "ready": !report.failed(),
            "findings": report.findings,
            "safety": config.safety,
        });
        writeln!(out, "{}", serde_json::to_string_pretty(&report)?)?;
    } else {
        write!(out, "{report}")?;
        writeln!(out, "{}\nnothing was moved", limits(&config)?)?;
    }
    if report.failed() {
        anyhow::bail!("the arm is not ready: see the lines marked FAIL");
    }
    Ok(())
}

/// Looks at the arm that the configuration names.
///
/// # Errors
/// No RTDE connection, or it ends.
pub fn examine(config: &Config) -> anyhow::Result<Report> {
    let ur = settings(config)?;
    let mut report = Report::default();
    let mut arm = UrArm::observe(ur.clone())?;
    let controller = arm.controller().map_or_else(|| "unknown".into(), |v| v.to_string());
    report.add("controller", Grade::Ok, format!("software {controller} at {}", ur.host));
    dashboard(&mut report, ur);
    let watch = watch(&mut arm, ur)?;
    state(&mut report, ur, &watch);
    model(&mut report, config, &watch.last)?;
    sensor(&mut report, &watch);
    link(&mut report, ur, &watch, &arm);
    silence(&mut report, ur);
    cell(&mut report, config);
    Ok(report)
}

/// Limits of the link that were widened for a rehearsal, on an address that may be an arm's.
fn silence(report: &mut Report, ur: &UrConfig) {
    let usual = UrConfig::at("");
    let widest = ur.stale_ticks.max(ur.stall_ticks / 2);
    let grade = if ur.stale_ticks <= usual.stale_ticks && ur.stall_ticks <= usual.stall_ticks {
        Grade::Ok
    } else if widest <= super::probe::HOPELESS || is_here(&ur.host) {
        Grade::Warn
    } else {
        Grade::Fail
    };
    let advice = match grade {
        Grade::Ok => "",
        _ => {
            "; more than usual: what a rehearsal needed follows a run to the arm. Set what rt-probe says"
        }
    };
    let found = format!(
        "a command may be {} cycles old, the arm brakes after {} without one (usual: {} and {}){advice}",
        ur.stale_ticks, ur.stall_ticks, usual.stale_ticks, usual.stall_ticks
    );
    report.add("silence", grade, found);
}

/// Whether a host is this computer, where only a virtual controller can be.
fn is_here(host: &str) -> bool {
    host == "localhost" || host.parse::<IpAddr>().is_ok_and(|address| address.is_loopback())
}

/// Whether limits, task and geometry go together: what the fail-safe layer would refuse later.
fn cell(report: &mut Report, config: &Config) {
    if let Err(e) = sim_env(config, config.run.seed, Purpose::Train) {
        return report.add("limits", Grade::Fail, format!("{e:#}"));
    }
    let (task, safety) = (&config.task, &config.safety);
    let inside = |p: &Vector3| match (&safety.shield, safety.mode) {
        (Some(shield), Mode::Shield) => {
            let Workspace { min, max } = shield.workspace;
            (0..3).all(|i| p[i] >= min[i] && p[i] <= max[i])
        }
        _ => true,
    };
    let starts = (0..STARTS).map(|n| task.draw(config.run.seed, n));
    let mut places = starts.flat_map(|s| [s.base_T_start, s.base_T_believed]);
    let outside = std::iter::once(task.base_T_goal())
        .chain(&mut places)
        .map(|pose| pose.translation.vector)
        .find(|p| !inside(p));
    match outside {
        None => report.add("limits", Grade::Ok, "consistent; starts and goals lie in the workspace"),
        Some(p) => report.add(
            "limits",
            Grade::Fail,
            format!(
                "a start or goal at {:.3?} m lies outside [safety.shield.workspace]: describe the box around your hole",
                p.as_slice()
            ),
        ),
    }
}

fn dashboard(report: &mut Report, ur: &UrConfig) {
    let timeout = Duration::from_secs_f64(ur.answer_timeout);
    let mut dashboard = match Dashboard::connect(&ur.host, ur.ports.dashboard, timeout) {
        Ok(dashboard) => dashboard,
        Err(e) => {
            return report.add(
                "dashboard",
                Grade::Warn,
                format!("{e}; remote control is not known"),
            );
        }
    };
    let who = match dashboard.identity() {
        Ok((model, serial)) => format!("{model}, serial number {serial}"),
        Err(e) => e.to_string(),
    };
    report.add("dashboard", Grade::Ok, format!("PolyScope {}, {who}", dashboard.version()));
    match dashboard.is_in_remote_control() {
        Ok(true) => report.add("remote control", Grade::Ok, "on"),
        Ok(false) => report.add(
            "remote control",
            Grade::Fail,
            "off: no program can be loaded. Switch it on at the top right of the pendant",
        ),
        Err(e) => report.add("remote control", Grade::Warn, e.to_string()),
    }
}

/// What the arm said while it was watched.
struct Watch {
    last: Sample,
    /// Tool0 axes, N and N·m.
    wrenches: Vec<Vector6>,
    speed: f64,
    /// Time between arrivals, sorted, s.
    gaps: Vec<f64>,
}

fn watch(arm: &mut UrArm, ur: &UrConfig) -> anyhow::Result<Watch> {
    let ticks = (WATCH * ur.frequency) as usize;
    let (mut wrenches, mut gaps, mut speed) = (Vec::new(), Vec::new(), 0.0f64);
    arm.read()?;
    let mut before = Instant::now();
    for _ in 0..ticks {
        let state = arm.read()?;
        let now = Instant::now();
        gaps.push((now - before).as_secs_f64());
        before = now;
        wrenches.push(state.sensor_wrench.vector());
        speed = speed.max(state.dq.amax());
    }
    gaps.sort_by(f64::total_cmp);
    Ok(Watch { last: *arm.sample(), wrenches, speed, gaps })
}

fn state(report: &mut Report, ur: &UrConfig, watch: &Watch) {
    let s = &watch.last;
    let ok = |good: bool| if good { Grade::Ok } else { Grade::Fail };
    report.add("robot mode", ok(s.robot_mode == RobotMode::Running), s.robot_mode.to_string());
    report.add("safety status", ok(s.safety == SafetyStatus::Normal), s.safety.to_string());
    let full = s.speed_slider > 0.999;
    report.add("speed slider", ok(full), format!("{:.0} %, must be 100 %", 100.0 * s.speed_slider));
    report.add("program", Grade::Ok, s.runtime.to_string());
    report.grade(
        "at rest",
        watch.speed,
        (REST, REST),
        format!("fastest joint {:.4} rad/s", watch.speed),
    );
    let weighed = s.payload > 0.0 || ur.payload.is_some();
    let found = match &ur.payload {
        Some(payload) => format!("{} kg now; the control program sets {payload:?}", s.payload),
        None if weighed => format!("{} kg", s.payload),
        None => "0 kg: the tool's weight will read as a contact force. Set it in the installation, or ur.payload".into(),
    };
    report.add("payload", if weighed { Grade::Ok } else { Grade::Warn }, found);
}

fn model(report: &mut Report, config: &Config, s: &Sample) -> anyhow::Result<()> {
    let chain = chain(&config.robot)?;
    let gap = model_error(&chain, s);
    report.grade(
        "kinematics",
        gap.position,
        MODEL,
        format!(
            "flange by robot.urdf = {} and by the controller: {:.3} mm and {:.3}° apart",
            config.robot.urdf,
            1e3 * gap.position,
            gap.rotation.to_degrees()
        ),
    );
    let theirs = Vector3::new(s.tcp_offset[0], s.tcp_offset[1], s.tcp_offset[2]);
    let apart = (theirs - Vector3::from(config.robot.tcp)).norm();
    // Only a warning: the wrench is reported at the flange and the pose is computed here.
    report.grade(
        "tool centre",
        apart,
        (TCP.0, f64::INFINITY),
        format!(
            "robot.tcp {:?} m, in the installation {:.4?} m: {:.1} mm apart",
            config.robot.tcp,
            theirs.as_slice(),
            1e3 * apart
        ),
    );
    let away = s.q() - config.task.q_home;
    let joint = away.iamax();
    report.grade(
        "way to start",
        away.amax(),
        (std::f64::consts::FRAC_PI_2, f64::INFINITY),
        format!(
            "joint {joint} will turn by {:+.2} rad to task.q_home, the others by less",
            -away[joint]
        ),
    );
    Ok(())
}

fn sensor(report: &mut Report, watch: &Watch) {
    let n = watch.wrenches.len().max(1) as f64;
    let mean = watch.wrenches.iter().sum::<Vector6>() / n;
    let variance =
        watch.wrenches.iter().map(|w| (w - mean).component_mul(&(w - mean))).sum::<Vector6>() / n;
    let spread = variance.map(f64::sqrt);
    report.grade(
        "F/T bias",
        mean.fixed_rows::<3>(0).amax(),
        (BIAS, f64::INFINITY),
        format!(
            "{:.2?} N, {:.3?} N·m, tool0 axes; tared before every episode",
            &mean.as_slice()[..3],
            &mean.as_slice()[3..]
        ),
    );
    let noise = spread.fixed_rows::<3>(0).amax();
    let found = format!(
        "{:.3?} N, {:.4?} N·m (standard deviation, {WATCH} s)",
        &spread.as_slice()[..3],
        &spread.as_slice()[3..]
    );
    if noise == 0.0 {
        report.add(
            "F/T noise",
            Grade::Warn,
            format!("{found}: a reading that never changes is simulated or stuck"),
        );
    } else {
        report.grade("F/T noise", noise, (NOISE, f64::INFINITY), found);
    }
}

fn link(report: &mut Report, ur: &UrConfig, watch: &Watch, arm: &UrArm) {
    let at = |part: f64| {
        let last = watch.gaps.len().saturating_sub(1);
        1e3 * watch.gaps.get((part * last as f64) as usize).copied().unwrap_or(f64::NAN)
    };
    let stale = 1e3 * f64::from(ur.stale_ticks) / ur.frequency;
    let stats = arm.stats();
    report.grade(
        "link",
        at(1.0),
        (2e3 / ur.frequency, stale),
        format!(
            "a packet every {:.2} ms (median), {:.2} ms (99 %), {:.2} ms (longest; {stale} ms stops the arm); {} cycles missed",
            at(0.5), at(0.99), at(1.0), stats.missed
        ),
    );
    // On a thread that ends at once, so that nothing stays changed.
    let granted = std::thread::spawn(|| palpate_ur::realtime(super::PRIORITY, false)).join();
    if let Ok(granted) = granted {
        let grade = if granted.fifo.is_ok() { Grade::Ok } else { Grade::Warn };
        report.add("this computer", grade, granted.to_string());
    }
}

#[cfg(test)]
#[path = "doctor_tests.rs"]
mod tests;
