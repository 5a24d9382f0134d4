//! Programs, their watchdog, the dashboard.

use palpate_spatial::JointVector;
use palpate_ur::proto::{RobotMode, RuntimeState};
use palpate_virtual_ur::controller::Severity;
use palpate_virtual_ur::{Controller, ControllerConfig, LaggedArm};

use crate::common::{HOME, config, robot, run, said, seconds, ticks};

#[test]
fn the_watchdog_stops_a_program_whose_client_is_silent() {
    let text = |action: &str| {
        format!(
            "def f():\n rtde_set_watchdog(\"input_int_register_24\", 10, \"{action}\")\n while True:\n  sync()\n end\nend\n"
        )
    };
    let mut robot = robot();
    robot.run_script(&text("stop"));
    ticks(&mut robot, 50);
    assert_eq!(robot.runtime(), RuntimeState::Playing);
    ticks(&mut robot, 5);
    assert_eq!(robot.runtime(), RuntimeState::Stopped);
    assert!(said(&mut robot).iter().any(|t| t.contains("input_int_register_24 was not updated")));
    robot.run_script(&text("pause"));
    ticks(&mut robot, 60);
    assert_eq!(robot.runtime(), RuntimeState::Paused);
    let said = run(&mut robot, "def f():\n rtde_set_watchdog(\"no_such_input\", 10)\nend\n");
    assert!(said.iter().any(|t| t.contains("no_such_input is no RTDE input")), "{said:?}");
}

#[test]
fn script_errors_stop_the_program_and_the_arm() {
    let mut robot = robot();
    let said = run(&mut robot, "def f():\n speedj([0,0,0,0,0,1], 5)\n x = [1][3]\nend\n");
    assert!(
        said.iter().any(|t| t == "program f: line 3: index 3 of a list with 1 elements"),
        "{said:?}"
    );
    seconds(&mut robot, 0.2);
    assert_eq!(robot.target().dq, JointVector::zeros());
    let said = run(&mut robot, "def f():\n x = \nend\n");
    assert!(said[0].starts_with("script refused: line 3"), "{said:?}");
}

#[test]
fn a_secondary_program_runs_beside_the_program() {
    let mut robot = robot();
    robot.run_script("def f():\n while True: sync() end\nend\n");
    ticks(&mut robot, 3);
    robot.run_script("sec s():\n write_output_integer_register(25, 7)\nend\n");
    ticks(&mut robot, 1);
    assert_eq!((robot.registers().output.ints[25], robot.runtime()), (7, RuntimeState::Playing));
}

#[test]
fn a_dashboard_conversation_from_power_off_to_a_program() {
    let config = ControllerConfig {
        start: RobotMode::PowerOff,
        programs: [
            ("peg.urp".into(), "def peg():\n while True: sync() end\nend\n".into()),
            ("bad.urp".into(), "def (".into()),
        ]
        .into(),
        ..config()
    };
    let mut robot = Controller::new(config, Box::new(LaggedArm::at(HOME.into()))).unwrap();
    // Command, answer, and how long to wait after it, s.
    let transcript = [
        ("robotmode", "Robotmode: POWER_OFF", 0.0),
        ("safetystatus", "Safetystatus: NORMAL", 0.0),
        ("safetymode", "Safetymode: NORMAL", 0.0),
        ("is in remote control", "true", 0.0),
        ("PolyscopeVersion", "URSoftware 5.17.0.1000000 (Jan 01 2024)", 0.0),
        ("get robot model", "UR3", 0.0),
        ("get serial number", "20265300001", 0.0),
        ("get operational mode", "NONE", 0.0),
        ("play", "Failed to execute: play", 0.0),
        ("power on", "Powering on", 0.0),
        ("robotmode", "Robotmode: BOOTING", 2.1),
        ("robotmode", "Robotmode: IDLE", 0.0),
        ("brake release", "Brake releasing", 0.0),
        ("robotmode", "Robotmode: IDLE", 1.1),
        ("robotmode", "Robotmode: RUNNING", 0.0),
        ("get loaded program", "No program loaded", 0.0),
        ("load nothing.urp", "File not found: nothing.urp", 0.0),
        ("load bad.urp", "Error while loading program: bad.urp", 0.0),
        ("load peg.urp", "Loading program: peg.urp", 0.0),
        ("programState", "STOPPED peg.urp", 0.0),
        ("get loaded program", "Loaded program: /programs/peg.urp", 0.0),
        ("isProgramSaved", "true peg.urp", 0.0),
        ("play", "Starting program", 0.01),
        ("running", "Program running: true", 0.0),
        ("programState", "PLAYING peg", 0.0),
        ("pause", "Pausing program", 0.01),
        ("programState", "PAUSED peg", 0.0),
        ("play", "Starting program", 0.01),
        ("stop", "Stopped", 0.01),
        ("stop", "Failed to execute: stop", 0.0),
        ("running", "Program running: false", 0.0),
        ("popup hello", "showing popup", 0.0),
        ("close popup", "closing popup", 0.0),
        ("close safety popup", "closing safety popup", 0.0),
        ("addToLog note", "Added log message", 0.0),
        ("unlock protective stop", "Failed to execute: unlock protective stop", 0.0),
        ("set operational mode automatic", "Operational mode AUTOMATIC is set", 0.0),
        ("get operational mode", "AUTOMATIC", 0.0),
        ("restart safety", "Restarting safety", 0.01),
        ("robotmode", "Robotmode: POWER_OFF", 0.0),
        // Straight from off to running.
        ("brake release", "Brake releasing", 3.1),
        ("robotmode", "Robotmode: RUNNING", 0.0),
        ("power off", "Powering off", 0.01),
        ("robotmode", "Robotmode: POWER_OFF", 0.0),
        ("make coffee", "could not understand: 'make coffee'", 0.0),
        ("quit", "Disconnected", 0.0),
    ];
    for (n, (command, expected, wait)) in transcript.iter().enumerate() {
        let answer = robot.dashboard(command);
        assert_eq!(answer.text, *expected, "step {n}: {command}");
        assert_eq!(answer.close, *command == "quit");
        seconds(&mut robot, *wait);
    }
    robot.set_remote_control(false);
    assert_eq!(robot.dashboard("power on").text, "Failed to execute: power on");
    assert_eq!(robot.dashboard("robotmode").text, "Robotmode: POWER_OFF");
    robot.run_script("textmsg(1)\n");
    let refused = robot.take_events().pop().unwrap();
    assert!(refused.severity == Severity::Warning && refused.text.contains("local control"));
}
