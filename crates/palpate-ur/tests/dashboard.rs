//! The dashboard client against a scripted server.
#![expect(clippy::unwrap_used, reason = "a helper that cannot go on fails its test")]

use std::io::{BufRead, BufReader, Write};
use std::net::TcpListener;
use std::thread::JoinHandle;
use std::time::Duration;

use palpate_robot_io::{BackendError, FaultKind};
use palpate_ur::UrError;
use palpate_ur::dashboard::{Command, Confirmation, Dashboard, PolyScope};
use palpate_ur::proto::{RobotMode, SafetyStatus};

const TIMEOUT: Duration = Duration::from_secs(5);

/// Answers each line with the next reply of the script and returns what was asked.
fn server(replies: &[(&str, &str)]) -> (u16, JoinHandle<Vec<String>>) {
    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    let port = listener.local_addr().unwrap().port();
    let replies: Vec<(String, String)> =
        replies.iter().map(|(a, b)| ((*a).to_owned(), (*b).to_owned())).collect();
    let thread = std::thread::spawn(move || {
        let (mut stream, _) = listener.accept().unwrap();
        let mut lines = BufReader::new(stream.try_clone().unwrap()).lines();
        writeln!(stream, "Connected: Universal Robots Dashboard Server").unwrap();
        let mut asked = Vec::new();
        for (command, reply) in replies {
            let Some(Ok(line)) = lines.next() else { break };
            assert_eq!(line, command);
            asked.push(line);
            // In two pieces, as TCP may.
            let (a, b) = reply.split_at(reply.len() / 2);
            stream.write_all(a.as_bytes()).unwrap();
            stream.flush().unwrap();
            writeln!(stream, "{b}").unwrap();
        }
        asked
    });
    (port, thread)
}

const VERSION: (&str, &str) = ("PolyscopeVersion", "URSoftware 5.12.4.1101661 (Oct 13 2022)");

#[test]
fn power_on_polls_until_the_arm_runs() -> Result<(), UrError> {
    let (port, thread) = server(&[
        VERSION,
        ("robotmode", "Robotmode: POWER_OFF"),
        ("power on", "Powering on"),
        ("robotmode", "Robotmode: POWER_OFF"),
        ("robotmode", "Robotmode: BOOTING"),
        ("robotmode", "Robotmode: IDLE"),
        ("brake release", "Brake releasing"),
        ("robotmode", "Robotmode: IDLE"),
        ("robotmode", "Robotmode: RUNNING"),
        ("safetystatus", "Safetystatus: NORMAL"),
        ("is in remote control", "true"),
        ("get robot model", "UR3"),
        ("get serial number", "20195300123"),
    ]);
    let mut dashboard = Dashboard::connect("127.0.0.1", port, TIMEOUT)?;
    assert_eq!(dashboard.version(), PolyScope(5, 12, 4));
    dashboard.power_on(TIMEOUT)?;
    assert_eq!(dashboard.safety_status()?, SafetyStatus::Normal);
    assert!(dashboard.is_in_remote_control()?);
    assert_eq!(dashboard.identity()?, ("UR3".into(), "20195300123".into()));
    drop(dashboard);
    assert_eq!(thread.join().unwrap().len(), 13);
    Ok(())
}

#[test]
fn an_unlock_needs_a_person_and_time() -> Result<(), UrError> {
    let refusal = "Cannot unlock protective stop until 5s after occurrence. Always inspect cause of protective stop before unlocking";
    let (port, _thread) = server(&[
        VERSION,
        ("close safety popup", "closing safety popup"),
        ("unlock protective stop", refusal),
        ("close safety popup", "closing safety popup"),
        ("unlock protective stop", "Protective stop releasing"),
        ("safetystatus", "Safetystatus: PROTECTIVE_STOP"),
        ("safetystatus", "Safetystatus: NORMAL"),
        ("robotmode", "Robotmode: RUNNING"),
    ]);
    let mut dashboard = Dashboard::connect("127.0.0.1", port, TIMEOUT)?;
    let error = dashboard.unlock(Confirmation::by_a_person_at_the_arm(), TIMEOUT).unwrap_err();
    assert!(error.to_string().contains("until 5s"), "{error}");
    assert_eq!(error.kind(), FaultKind::RobotState);
    dashboard.unlock(Confirmation::by_a_person_at_the_arm(), TIMEOUT)
}

#[test]
fn a_state_that_is_not_reached_is_named() -> Result<(), UrError> {
    let (port, _thread) = server(&[
        VERSION,
        ("power off", "Powering off"),
        ("robotmode", "Robotmode: RUNNING"),
        ("robotmode", "Robotmode: SOMETHING_NEW"),
    ]);
    let mut dashboard = Dashboard::connect("127.0.0.1", port, TIMEOUT)?;
    let error = dashboard.power_off(Duration::ZERO).unwrap_err().to_string();
    assert!(
        error.contains("robot mode did not become POWER_OFF within 0ns, it is RUNNING"),
        "{error}"
    );
    let error = dashboard.robot_mode().unwrap_err().to_string();
    assert!(error.contains("SOMETHING_NEW"), "{error}");
    assert_eq!(RobotMode::Running.to_string(), "RUNNING");
    Ok(())
}

#[test]
fn commands_that_the_controller_is_too_old_for_are_not_sent() -> Result<(), UrError> {
    let (port, thread) = server(&[("PolyscopeVersion", "URSoftware 5.3.0.1 (May 01 2019)")]);
    let mut dashboard = Dashboard::connect("127.0.0.1", port, TIMEOUT)?;
    let error = dashboard.ask(&Command::IsInRemoteControl).unwrap_err().to_string();
    assert!(error.contains("needs PolyScope 5.6.0, this is 5.3.0"), "{error}");
    drop(dashboard);
    assert_eq!(thread.join().unwrap().len(), 1);
    Ok(())
}

#[test]
fn another_service_is_not_mistaken_for_it() {
    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    let port = listener.local_addr().unwrap().port();
    let thread = std::thread::spawn(move || {
        let (mut stream, _) = listener.accept().unwrap();
        writeln!(stream, "220 mail ready").unwrap();
        // And one that says nothing more, and closes.
    });
    let error = Dashboard::connect("127.0.0.1", port, TIMEOUT).unwrap_err();
    assert!(error.to_string().contains("220 mail ready"), "{error}");
    thread.join().unwrap();
}
