//! The commands that move an arm, end to end: the binary here, a virtual controller with contact there.

#![expect(clippy::unwrap_used, reason = "helpers of tests")]

use std::path::Path;
use std::process::{Child, Command, Output, Stdio};
use std::time::{Duration, Instant};

use palpate::config::Choice;
use palpate::virtual_ur::{Setup, controller};
use palpate_ur::proto::SafetyStatus;
use palpate_virtual_ur::{Fault, Handle, LinkFault, Options, Port};

type Outcome = Result<(), Box<dyn std::error::Error>>;

/// Time for anything that a test waits for.
const PATIENCE: Duration = Duration::from_mins(1);

/// A virtual controller on free ports, perhaps changed.
fn robot(change: impl FnOnce(&mut Options)) -> Handle {
    let choice = Choice {
        preset: "palpate".into(),
        task: "peg-insertion".into(),
        model: "P-14".into(),
        ..Choice::default()
    };
    let setup = Setup { address: [127, 0, 0, 1].into(), any_ports: true, faults: Vec::new() };
    let (mut options, plant) = controller(&choice, setup).unwrap();
    change(&mut options);
    Handle::start(options, Box::new(plant)).unwrap()
}

/// `palpate COMMAND` for this robot. Limits of the link are wide: a test machine is busy.
fn palpate(robot: &Handle, command: &[&str]) -> Command {
    let mut palpate = Command::new(env!("CARGO_BIN_EXE_palpate"));
    palpate.args(command).arg("--rtde").arg(robot.address(Port::Rtde).to_string());
    for (key, port) in [("script", Port::Secondary), ("dashboard", Port::Dashboard)] {
        let number = robot.address(port).port();
        palpate.arg("--set").arg(format!("ur.ports.{key}={number}"));
    }
    palpate.args(["--set", "ur.stale_ticks=100", "--set", "ur.stall_ticks=100"]);
    palpate.stdin(Stdio::null()).stdout(Stdio::piped()).stderr(Stdio::piped());
    palpate
}

fn train(robot: &Handle, out: &Path, steps: &str) -> Command {
    let mut command = palpate(robot, &["train-real", "--yes", "--steps", steps]);
    let small =
        ["env.max_steps=40", "run.log_every=20", "sac.hidden=[32, 32]", "sac.start_training=40"];
    command.args(small.iter().flat_map(|key| ["--set", key])).arg("--out").arg(out);
    command
}

fn text(output: &Output) -> String {
    String::from_utf8_lossy(&output.stdout).into_owned() + &String::from_utf8_lossy(&output.stderr)
}

fn json(path: &Path) -> serde_json::Value {
    serde_json::from_str(&std::fs::read_to_string(path).unwrap()).unwrap()
}

/// Largest joint speed now, rad/s.
fn speed(robot: &Handle) -> f64 {
    robot.with(|server| server.controller().actual().dq.amax()).unwrap()
}

fn wait_for(what: &str, mut done: impl FnMut() -> bool) {
    let deadline = Instant::now() + PATIENCE;
    while !done() {
        assert!(Instant::now() < deadline, "waited in vain: {what}");
        std::thread::sleep(Duration::from_millis(5));
    }
}

/// A run whose arm is moving in an episode: the reset is over, commands flow.
fn under_way(robot: &Handle, out: &Path) -> Child {
    let child = train(robot, out, "2000").spawn().unwrap();
    wait_for("rows of metrics.csv", || {
        std::fs::read_to_string(out.join("metrics.csv")).is_ok_and(|csv| csv.lines().count() > 1)
    });
    wait_for("motion", || speed(robot) > 0.01);
    child
}

/// The arm comes to rest where it is and stays there.
fn stays_at_rest(robot: &Handle) {
    wait_for("rest", || speed(robot) < 1e-4);
    let q = || robot.with(|server| server.controller().actual().q).unwrap();
    let before = q();
    std::thread::sleep(Duration::from_millis(300));
    assert!((q() - before).amax() < 1e-6, "the arm moved on");
}

fn checkpoints(out: &Path) -> usize {
    std::fs::read_dir(out.join("checkpoints")).map_or(0, Iterator::count)
}

#[test]
fn an_arm_is_trained_resumed_and_run() -> Outcome {
    let (robot, folder) = (robot(|_| {}), tempfile::tempdir()?);
    let out = folder.path().join("run");
    let said = train(&robot, &out, "80").output()?;
    assert!(said.status.success(), "{}", text(&said));
    let summary = json(&out.join("summary.json"));
    assert_eq!(summary["complete"], true);
    let steps = summary["steps"].as_u64().unwrap();
    assert!((80..120).contains(&steps), "{summary}");
    // 25 control ticks per step, and the ways to the starts.
    let samples = summary["link"]["ticks"]["samples"].as_u64().unwrap();
    assert!(samples > 25 * steps, "{summary}");
    let metrics = std::fs::read_to_string(out.join("metrics.csv"))?;
    let column = metrics.lines().next().unwrap().split(',').position(|c| c == "train/n_updates");
    let updates: f64 =
        metrics.lines().last().unwrap().split(',').nth(column.unwrap()).unwrap().parse()?;
    assert!(updates > 0.0, "nothing was learned:\n{metrics}");

    let mut again = palpate(&robot, &["train-real", "--yes", "--steps", "130"]);
    let said = again.arg("--resume").arg(&out).output()?;
    assert!(said.status.success(), "{}", text(&said));
    let resumed = json(&out.join("summary.json"));
    assert!(resumed["episodes"].as_u64() > summary["episodes"].as_u64(), "{resumed}");

    let recordings = folder.path().join("recordings");
    let said = palpate(&robot, &["run-policy", "--yes", "--episodes", "2", "--json"])
        .arg("--record")
        .arg(&recordings)
        .arg(&out)
        .output()?;
    assert!(said.status.success(), "{}", text(&said));
    let stdout = String::from_utf8_lossy(&said.stdout);
    let report = &stdout[stdout.find("\n{").ok_or("no JSON")?..];
    let report: serde_json::Value = serde_json::from_str(report)?;
    assert_eq!(report["policy"]["episodes"], 2);
    let recorded = std::fs::read_dir(&recordings)?.map(|file| Ok(file?.metadata()?.len()));
    let sizes = recorded.collect::<std::io::Result<Vec<_>>>()?;
    // A second at 500 Hz takes 0.7 MB.
    assert!(sizes.len() == 2 && sizes.iter().all(|size| *size > 300_000), "{sizes:?}");
    stays_at_rest(&robot);
    Ok(())
}

#[test]
fn ctrl_c_brakes_and_saves() -> Outcome {
    let (robot, folder) = (robot(|_| {}), tempfile::tempdir()?);
    let out = folder.path().join("run");
    let child = under_way(&robot, &out);
    let sent = Command::new("kill").args(["-INT", &child.id().to_string()]).status();
    assert!(sent.is_ok_and(|s| s.success()));
    let said = child.wait_with_output()?;
    assert!(said.status.success(), "{}", text(&said));
    assert!(text(&said).contains("train-real --rtde ADDRESS --resume"), "{}", text(&said));
    stays_at_rest(&robot);
    assert_eq!(json(&out.join("summary.json"))["complete"], false);
    assert!(checkpoints(&out) > 0);
    Ok(())
}

/// Whole records of the journal, which may be being written.
fn journaled(out: &Path) -> usize {
    palpate_runs::Journal::read(&out.join(palpate_runs::JOURNAL))
        .map_or(0, |held| held.records.len())
}

#[test]
fn a_killed_run_has_every_step_but_the_one_in_flight() -> Outcome {
    let (robot, folder) = (robot(|_| {}), tempfile::tempdir()?);
    let out = folder.path().join("run");
    let mut child = under_way(&robot, &out);
    let (before, began) = (journaled(&out), Instant::now());
    wait_for("ten more steps", || journaled(&out) >= before + 10);
    let (kept, took) = (journaled(&out), began.elapsed());
    let killed = child.kill();
    child.wait()?;
    killed?;
    // 20 steps a second: they are on disk while they happen, not when the learner gets to them.
    assert!(took < Duration::from_secs(10), "{took:?}");
    let after = journaled(&out);
    assert!((kept..=kept + 2).contains(&after), "{kept} {after}");
    stays_at_rest(&robot);

    let mut again = palpate(&robot, &["train-real", "--yes", "--steps", &(after + 20).to_string()]);
    let said = again.arg("--resume").arg(&out).output()?;
    assert!(said.status.success(), "{}", text(&said));
    assert!(text(&said).contains("steps that the arm took after the last checkpoint are back"));
    let to = folder.path().join("all.csv");
    let exported = Command::new(env!("CARGO_BIN_EXE_palpate"))
        .args(["runs", "export"])
        .args([&out, &to])
        .output()?;
    assert!(exported.status.success(), "{}", text(&exported));
    let csv = std::fs::read_to_string(to)?;
    let steps: Vec<usize> =
        csv.lines().skip(1).map(|row| row.split(',').next().unwrap().parse().unwrap()).collect();
    assert_eq!(steps, (1..=steps.len()).collect::<Vec<_>>(), "no step is missing or there twice");
    assert!(steps.len() >= after + 20);
    Ok(())
}

#[test]
fn a_lost_link_stops_the_arm_and_says_so() -> Outcome {
    let (robot, folder) = (robot(|_| {}), tempfile::tempdir()?);
    let out = folder.path().join("run");
    let child = under_way(&robot, &out);
    robot.inject(Fault::Link(Port::Rtde, LinkFault::HalfOpen(30.0)));
    stays_at_rest(&robot);
    let said = child.wait_with_output()?;
    assert!(!said.status.success());
    let said = text(&said);
    assert!(said.contains("the arm has stopped (Link)") && said.contains("no sample"), "{said}");
    assert!(said.contains("a checkpoint is saved") && checkpoints(&out) > 0, "{said}");
    Ok(())
}

#[test]
fn a_protective_stop_ends_an_unattended_run_and_stays() -> Outcome {
    let (robot, folder) = (robot(|_| {}), tempfile::tempdir()?);
    let out = folder.path().join("run");
    let child = under_way(&robot, &out);
    robot.inject(Fault::ProtectiveStop);
    let said = child.wait_with_output()?;
    assert!(!said.status.success());
    assert!(text(&said).contains("PROTECTIVE_STOP"), "{}", text(&said));
    stays_at_rest(&robot);
    let safety = robot.with(|server| server.controller().safety());
    assert_eq!(safety, Some(SafetyStatus::ProtectiveStop), "nobody may clear it but a person");
    // Nor does the next run.
    let again = train(&robot, &folder.path().join("again"), "40").output()?;
    assert!(!again.status.success() && text(&again).contains("FAIL safety status"));
    assert!(!folder.path().join("again").exists());
    assert_eq!(robot.with(|s| s.controller().safety()), Some(SafetyStatus::ProtectiveStop));
    Ok(())
}

#[test]
fn the_doctor_finds_what_is_wrong_and_moves_nothing() -> Outcome {
    let healthy = robot(|_| {});
    let q = healthy.with(|server| server.controller().actual().q).unwrap();
    let said = palpate(&healthy, &["doctor"]).output()?;
    assert!(said.status.success(), "{}", text(&said));
    for line in [
        "ok   remote control   on",
        "ok   robot mode       RUNNING",
        "ok   kinematics",
        "force_max = 25.0",
    ] {
        assert!(text(&said).contains(line), "no {line:?} in\n{}", text(&said));
    }
    let dry = palpate(&healthy, &["train-real", "--dry-run"]).output()?;
    assert!(dry.status.success() && text(&dry).contains("nothing was moved"), "{}", text(&dry));
    assert_eq!(healthy.with(|server| server.controller().actual().q).unwrap(), q);

    let ill = robot(|options| {
        options.controller.remote_control = false;
        options.controller.payload = 0.0;
        options.controller.tcp_offset = [0.0, 0.0, 0.12, 0.0, 0.0, 0.0];
        // 1 cm in the forearm: another arm.
        options.controller.calibration.a[2] = 0.01;
    });
    ill.inject(Fault::Slider(0.5));
    let said = palpate(&ill, &["doctor", "--json"]).output()?;
    assert!(!said.status.success(), "{}", text(&said));
    let report: serde_json::Value = serde_json::from_slice(&said.stdout)?;
    assert_eq!(report["ready"], false);
    let grade = |check: &str| {
        let findings = report["findings"].as_array().unwrap();
        let finding = findings.iter().find(|f| f["check"] == check).unwrap();
        finding["grade"].as_str().unwrap().to_owned()
    };
    for (check, expected) in [
        ("robot mode", "ok"),
        ("remote control", "fail"),
        ("speed slider", "fail"),
        ("payload", "warn"),
        ("kinematics", "fail"),
        ("tool centre", "warn"),
    ] {
        assert_eq!(grade(check), expected, "{check}: {report}");
    }
    Ok(())
}

#[test]
fn nobody_to_ask_means_no_motion() -> Outcome {
    let robot = robot(|_| {});
    let said = palpate(&robot, &["train-real", "--steps", "20"]).output()?;
    assert!(!said.status.success() && text(&said).contains("--yes"), "{}", text(&said));
    assert!(speed(&robot) < 1e-9);
    Ok(())
}
