//! The controller without a network: motion, protection, modes, registers, dashboard.

use palpate_kinematics::UrModel;
use palpate_spatial::{JointVector, Wrench};
use palpate_ur::proto::{RobotMode, RuntimeState, SafetyStatus};
use palpate_virtual_ur::controller::{DT, Delays, SensorFault, Severity, StopCause};
use palpate_virtual_ur::plant::{PlantError, PlantState};
use palpate_virtual_ur::{Controller, ControllerConfig, LaggedArm, Plant};

const HOME: [f64; 6] = [0.0, -1.57, 1.57, -1.57, -1.57, 0.0];

fn config() -> ControllerConfig {
    ControllerConfig::new(UrModel::Ur3e)
}

fn robot() -> Controller {
    Controller::new(config(), Box::new(LaggedArm::at(HOME.into()))).unwrap()
}

fn ticks(robot: &mut Controller, n: u32) {
    (0..n).for_each(|_| robot.tick());
}

fn seconds(robot: &mut Controller, s: f64) {
    ticks(robot, (s / DT).round() as u32);
}

fn said(robot: &mut Controller) -> Vec<String> {
    robot.take_events().into_iter().map(|e| e.text).collect()
}

/// Runs a program until it ends, at most ten seconds; everything it said, and what the controller did.
fn run(robot: &mut Controller, text: &str) -> Vec<String> {
    robot.run_script(text);
    for _ in 0..5000 {
        robot.tick();
        if robot.runtime() == RuntimeState::Stopped {
            break;
        }
    }
    said(robot)
}

/// Stands where it is told, with a force that a test chooses by the first joint's angle.
struct Wall {
    q: JointVector,
    /// N per rad beyond zero.
    stiffness: f64,
}

impl Plant for Wall {
    fn start(&self) -> JointVector {
        self.q
    }

    fn step(&mut self, q_target: &JointVector) -> Result<PlantState, PlantError> {
        let dq = (q_target - self.q) / DT;
        self.q = *q_target;
        let force = [0.0, 0.0, self.stiffness * self.q[0].max(0.0)].into();
        Ok(PlantState { q: self.q, dq, wrench: Wrench::new(force, [0.0; 3].into()) })
    }

    fn zero_sensor(&mut self) {}
}

#[test]
fn movej_arrives_at_rest_within_speed_and_acceleration() {
    let mut robot = robot();
    robot.run_script("movej([0.5, -1.57, 1.57, -1.57, -1.2, 0.0], a=2, v=0.8)\n");
    let (mut fastest, mut hardest, mut last, mut moving) = (0.0f64, 0.0f64, 0.0, 0u32);
    for _ in 0..1000 {
        robot.tick();
        let speed = robot.target().dq[0];
        fastest = fastest.max(speed);
        hardest = hardest.max((speed - last).abs() / DT);
        last = speed;
        moving += u32::from(speed > 0.0);
    }
    let q = robot.actual().q;
    assert!((q[0] - 0.5).abs() < 1e-6 && (q[4] + 1.2).abs() < 1e-6, "{q}");
    assert!((fastest - 0.8).abs() < 0.01 && hardest < 2.1, "{fastest} {hardest}");
    assert_eq!(robot.safety(), SafetyStatus::Normal);
    // 0.5 rad at 0.8 rad/s and 2 rad/s² take 0.5/0.8 + 0.8/2 s.
    assert!((f64::from(moving) * DT - 1.025).abs() < 0.005, "{moving} cycles");
}

#[test]
fn movel_keeps_to_its_line_and_its_attitude() {
    let mut robot = robot();
    ticks(&mut robot, 1);
    let start = robot.actual().tcp;
    robot.run_script("def f():\n p0 = get_actual_tcp_pose()\n p0[2] = p0[2] + 0.05\n movel(p0, a=0.5, v=0.1)\nend\n");
    let mut off = 0.0f64;
    for _ in 0..600 {
        robot.tick();
        let now = robot.target().tcp;
        off = off.max((now[0] - start[0]).abs()).max((now[1] - start[1]).abs());
        off = off.max((now[3] - start[3]).abs());
    }
    let end = robot.target().tcp;
    assert!(
        (end[2] - start[2] - 0.05).abs() < 1e-6,
        "{} {:?}",
        end[2] - start[2],
        said(&mut robot)
    );
    assert!(off < 1e-6, "{off}");
}

#[test]
fn servoj_lags_as_measured_on_real_arms() {
    let mut robot = robot();
    // A ramp at 0.2 rad/s; behind a lookahead of 0.03 s real arms are about 34 ms late.
    robot.run_script(
        "def f():\n q = get_actual_joint_positions()\n while True:\n  q[0] = q[0] + 0.0004\n  servoj(q, t=0.002, lookahead_time=0.03, gain=2000)\n  write_output_float_register(24, q[0])\n end\nend\n",
    );
    ticks(&mut robot, 500);
    // Two registers' ticks: what was written after the last servoj returned is one cycle old.
    let behind = robot.registers().output.floats[24] + 0.0004 - robot.actual().q[0];
    let lag = behind / 0.2;
    assert!((lag - 0.034).abs() < 0.004, "{lag}");
    assert_eq!(robot.safety(), SafetyStatus::Normal);
}

#[test]
fn a_servo_stream_that_ends_is_a_stop_where_it_is() {
    let mut robot = robot();
    robot.run_script(
        "def f():\n q = get_actual_joint_positions()\n i = 0\n while i < 200:\n  q[5] = q[5] + 0.001\n  servoj(q, t=0.002, lookahead_time=0.03, gain=300)\n  i = i + 1\n end\n while True:\n  sync()\n end\nend\n",
    );
    ticks(&mut robot, 200);
    assert!((robot.target().dq[5] - 0.5).abs() < 0.05, "{}", robot.target().dq[5]);
    ticks(&mut robot, 30);
    let rest = robot.actual().q;
    assert_eq!(robot.target().dq, JointVector::zeros());
    seconds(&mut robot, 1.0);
    assert!((robot.actual().q - rest).amax() < 1e-3 && robot.runtime() == RuntimeState::Playing);
}

#[test]
fn stopj_decelerates_as_told() {
    let mut robot = robot();
    robot.run_script(
        "def f():\n speedj([0,0,0,0,0,1], 5, 0.5)\n stopj(4)\n textmsg(\"rest\")\nend\n",
    );
    seconds(&mut robot, 0.5);
    assert!((robot.target().dq[5] - 1.0).abs() < 1e-9);
    let begin = robot.target().q[5];
    seconds(&mut robot, 0.3);
    // v²/2a = 0.125 rad, and half a cycle's way of discretisation.
    let way = robot.target().q[5] - begin;
    assert!((way - 0.125).abs() < 0.003, "{way}");
    assert!(said(&mut robot).contains(&"rest".to_owned()));
}

#[test]
fn speedl_moves_the_tool_straight() {
    let mut robot = robot();
    ticks(&mut robot, 1);
    let start = robot.actual().tcp;
    robot.run_script("def f():\n speedl([0, 0, 0.05, 0, 0, 0], 1, 0.5)\n stopl(1)\nend\n");
    seconds(&mut robot, 0.9);
    let end = robot.actual().tcp;
    assert!((end[2] - start[2] - 0.05 * 0.5).abs() < 0.003, "{}", end[2] - start[2]);
    assert!((end[0] - start[0]).abs() < 1e-3 && (end[1] - start[1]).abs() < 1e-3);
}

/// A program that jumps, and the joint limits it breaks; each must stop the arm without carrying the jump out.
#[test]
fn wild_set_points_are_protective_stops_and_never_reach_the_arm() {
    let cases = [
        ("servoj([1, -1.57, 1.57, -1.57, -1.57, 0])", "Sudden stop"),
        ("speedj([4, 0, 0, 0, 0, 0], 40)", "rad/s, limit"),
        ("movej([0, -1.57, 1.57, -1.57, -6.6, 0], 5, 3)", "limit 6.283 rad"),
    ];
    for (line, reason) in cases {
        let mut robot = robot();
        robot.run_script(&format!("def f():\n {line}\n while True: sync() end\nend\n"));
        for _ in 0..4000 {
            let before = robot.target().dq;
            robot.tick();
            let jump = (robot.target().dq - before).amax() / DT;
            assert!(jump <= 150.0 && robot.target().dq.amax() <= 3.1416, "{line}: {jump}");
        }
        assert_eq!(robot.safety(), SafetyStatus::ProtectiveStop, "{line}");
        assert_eq!(robot.runtime(), RuntimeState::Stopped);
        assert_eq!(robot.target().dq, JointVector::zeros());
        let said = said(&mut robot);
        assert!(said.iter().any(|t| t.contains(reason)), "{line}: {said:?}");
    }
}

#[test]
fn nan_never_leaves_the_program() {
    for line in [
        "x = sqrt(0) * pow(10, 400)\n servoj([x, 0, 0, 0, 0, 0])",
        "x = pow(-1, 0.5)\n movej([x, 0, 0, 0, 0, 0])",
        "x = pow(-1, 0.5)\n write_output_float_register(24, x)",
    ] {
        let mut robot = robot();
        let said = run(&mut robot, &format!("def f():\n {line}\nend\n"));
        assert!(said.iter().any(|t| t.contains("line 3")), "{said:?}");
        assert_eq!(robot.actual().q, JointVector::from(HOME));
    }
}

#[test]
fn too_much_force_is_a_protective_stop() {
    let plant =
        Wall { q: JointVector::from([-0.1, -1.57, 1.57, -1.57, -1.57, 0.0]), stiffness: 10_000.0 };
    let mut robot = Controller::new(config(), Box::new(plant)).unwrap();
    robot.run_script("def f():\n speedj([0.1, 0, 0, 0, 0, 0], 1)\n while True:\n  write_output_float_register(24, norm(get_tcp_force()))\n  sync()\n end\nend\n");
    seconds(&mut robot, 2.0);
    assert_eq!(robot.safety(), SafetyStatus::ProtectiveStop);
    let Some(StopCause::Force { force, limit }) = robot.last_stop() else {
        panic!("{:?}", robot.last_stop())
    };
    // 0.1 rad/s into 10 kN/rad is 2 N per cycle: found in the first cycle beyond the limit.
    assert!(*limit == 150.0 && *force > 150.0 && *force < 152.5, "{force}");
    assert!(robot.registers().output.floats[24] > 145.0, "the program saw it come");
    let rest = robot.actual().q;
    seconds(&mut robot, 1.0);
    assert_eq!(robot.actual().q, rest);
}

#[test]
fn ten_thousand_protective_stops_unlock_nothing_and_move_nothing() {
    // 50 cycles instead of 5 s, so that there is time for so many; the next test waits in full.
    let delays = Delays { unlock: 0.1, ..Delays::default() };
    let config = ControllerConfig { delays, ..config() };
    let mut robot = Controller::new(config, Box::new(LaggedArm::at(HOME.into()))).unwrap();
    let stream = "def f():\n q = get_actual_joint_positions()\n while True:\n  q[5] = q[5] + 0.0001\n  servoj(q, t=0.002, lookahead_time=0.03, gain=300)\n end\nend\n";
    let mut moved = 0;
    for n in 0..10_000u32 {
        robot.run_script(stream);
        ticks(&mut robot, 3 + n % 7);
        moved += u32::from(robot.target().dq[5] > 0.0);
        robot.protective_stop(StopCause::Requested);
        // At 0.05 rad/s the arm stands after one cycle, and its lag behind the set-point after 20.
        ticks(&mut robot, 20);
        let (rest, target) = (robot.actual().q, robot.target().q);
        // Whatever is tried without an unlock moves nothing.
        robot.run_script(stream);
        let answers: Vec<String> =
            ["play", "power on", "brake release", "close safety popup", "unlock protective stop"]
                .iter()
                .map(|command| robot.dashboard(command).text)
                .collect();
        assert!(answers[4].starts_with("Cannot unlock protective stop until 0.1s"), "{answers:?}");
        ticks(&mut robot, 10);
        assert_eq!(robot.target().q, target);
        assert!((robot.actual().q - rest).amax() < 1e-6);
        assert_eq!(robot.safety(), SafetyStatus::ProtectiveStop);
        // A person comes: the only way on, and it is not counted as the controller's own.
        assert_eq!(robot.stop_count(), (u64::from(n) + 1, u64::from(n)));
        ticks(&mut robot, 50 - 30 - 1);
        assert!(robot.dashboard("unlock protective stop").text.starts_with("Cannot"));
        assert_eq!(robot.safety(), SafetyStatus::ProtectiveStop);
        ticks(&mut robot, 1);
        assert_eq!(robot.dashboard("unlock protective stop").text, "Protective stop releasing");
        ticks(&mut robot, 1);
        assert_eq!(
            (robot.safety(), robot.runtime()),
            (SafetyStatus::Normal, RuntimeState::Stopped)
        );
        assert_eq!(robot.target().q, target, "unlocking moves nothing either");
    }
    assert_eq!(moved, 10_000, "the arm was moving before each stop");
}

#[test]
fn a_protective_stop_can_be_unlocked_after_five_seconds_and_no_earlier() {
    let mut robot = robot();
    robot.protective_stop(StopCause::Requested);
    for _ in 0..2499 {
        robot.tick();
        assert!(robot.dashboard("unlock protective stop").text.starts_with("Cannot"));
    }
    robot.tick();
    assert_eq!(robot.dashboard("unlock protective stop").text, "Protective stop releasing");
    assert_eq!(robot.safety(), SafetyStatus::Normal);
}

#[test]
fn safeguard_pauses_and_play_goes_on_to_the_goal() {
    let mut robot = robot();
    robot.run_script("movej([0.5, -1.57, 1.57, -1.57, -1.57, 0.0])\n");
    seconds(&mut robot, 0.4);
    assert!(robot.target().dq[0] > 0.3);
    robot.safeguard_stop();
    seconds(&mut robot, 0.5);
    let rest = robot.actual().q;
    assert_eq!((robot.runtime(), robot.target().dq), (RuntimeState::Paused, JointVector::zeros()));
    assert_eq!(robot.dashboard("play").text, "Failed to execute: play");
    robot.release_safeguard();
    seconds(&mut robot, 0.5);
    assert!((robot.actual().q - rest).amax() < 1e-6, "nothing moves before play");
    assert_eq!(robot.dashboard("play").text, "Starting program");
    seconds(&mut robot, 2.0);
    assert!((robot.actual().q[0] - 0.5).abs() < 1e-6, "{}", robot.actual().q);
}

#[test]
fn the_speed_slider_slows_a_program_down_without_a_jerk() {
    let mut robot = robot();
    robot.run_script("def f():\n speedj([0,0,0,0,0,1], 5)\n while True: sync() end\nend\n");
    seconds(&mut robot, 0.5);
    robot.set_slider(0.25);
    seconds(&mut robot, 1.0);
    assert!((robot.target().dq[5] - 0.25).abs() < 1e-9);
    robot.set_slider(0.0);
    seconds(&mut robot, 1.0);
    assert_eq!((robot.target().dq[5], robot.safety()), (0.0, SafetyStatus::Normal));
}

#[test]
fn sensor_defects_and_the_tare() {
    let mut robot = robot();
    let read = |robot: &mut Controller| {
        robot.tick();
        robot.tcp_force()
    };
    assert_eq!(read(&mut robot), [0.0; 6]);
    robot.inject_sensor(&SensorFault::Bias([0.0, 0.0, 5.0, 0.0, 0.0, 0.0]));
    let force = read(&mut robot);
    let size = force[..3].iter().map(|x| x * x).sum::<f64>().sqrt();
    assert!((size - 5.0).abs() < 1e-12, "{force:?}");
    // The tool points down: its z is the base's −z.
    assert!((force[2] + 5.0).abs() < 0.02, "{force:?}");
    run(&mut robot, "zero_ftsensor()\n");
    assert!(read(&mut robot).iter().all(|x| x.abs() < 1e-12));
    robot.inject_sensor(&SensorFault::Drift([1.0, 0.0, 0.0, 0.0, 0.0, 0.0]));
    seconds(&mut robot, 2.0);
    let drifted = robot.tcp_force();
    assert!((drifted[..3].iter().map(|x| x * x).sum::<f64>().sqrt() - 2.0).abs() < 0.01);
    robot.inject_sensor(&SensorFault::Stuck);
    let stuck = read(&mut robot);
    assert_eq!(read(&mut robot), stuck);
    robot.inject_sensor(&SensorFault::NotANumber);
    assert!(read(&mut robot)[0].is_nan());
}

#[test]
fn a_wrong_payload_reads_as_a_force_that_turns_with_the_tool() {
    let config = ControllerConfig { tool: Some((1.0, [0.0, 0.0, 0.05])), ..config() };
    let mut robot = Controller::new(config, Box::new(LaggedArm::at(HOME.into()))).unwrap();
    robot.tick();
    assert!((robot.tcp_force()[2] + 9.82).abs() < 1e-9, "{:?}", robot.tcp_force());
    run(&mut robot, "zero_ftsensor()\n");
    assert!(robot.tcp_force()[2].abs() < 1e-9);
    run(&mut robot, "movej([0, -1.57, 1.57, -1.57, 0, 0])\n");
    let force = robot.tcp_force();
    assert!(
        force[..3].iter().map(|x| x * x).sum::<f64>().sqrt() > 5.0,
        "a tare does not hide it: {force:?}"
    );
    run(&mut robot, "set_payload(1.0, [0, 0, 0.05])\n");
    ticks(&mut robot, 2);
    // What is left is the old tare, which was taken with the wrong payload.
    run(&mut robot, "zero_ftsensor()\n");
    run(&mut robot, "movej([0, -1.57, 1.57, -1.57, -1.57, 0])\n");
    assert!(robot.tcp_force().iter().all(|x| x.abs() < 1e-9), "{:?}", robot.tcp_force());
}

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
fn kinematics_in_scripts_agree_with_the_arm() {
    let mut robot = robot();
    let said = run(
        &mut robot,
        "def f():
  set_tcp(p[0, 0, 0.16, 0, 0, 0])
  sync()
  here = get_actual_tcp_pose()
  textmsg(\"fk \", norm(pose_trans(pose_inv(here), get_forward_kin())) < 0.000000001)
  q = get_inverse_kin(here)
  textmsg(\"ik \", norm(q - get_actual_joint_positions()) < 0.000001)
  textmsg(\"flange \", point_dist(here, get_forward_kin(get_actual_joint_positions(), p[0,0,0,0,0,0])))
  textmsg(\"far \", get_inverse_kin_has_solution(p[2, 0, 0, 0, 0, 0]))
  textmsg(\"safe \", [is_within_safety_limits([0, 0, 0, 0, 0, 0]), is_within_safety_limits([7, 0, 0, 0, 0, 0])])
end
",
    );
    for line in ["fk True", "ik True", "flange 0.16", "far False", "safe [True, False]"] {
        assert!(said.contains(&line.to_owned()), "{line}: {said:?}");
    }
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

#[test]
fn an_emergency_stop_takes_the_power_and_needs_every_step_back() {
    let mut robot = robot();
    robot.run_script("def f():\n speedj([0,0,0,0,0,0.5], 5)\n while True: sync() end\nend\n");
    seconds(&mut robot, 0.3);
    let before = robot.target().q;
    robot.emergency_stop();
    seconds(&mut robot, 0.5);
    // 0.5 rad/s at 30 rad/s² stops within 4.2 mrad, one cycle's way more.
    assert!((robot.target().q - before).amax() < 0.0055);
    assert_eq!(
        (robot.robot_mode(), robot.safety()),
        (RobotMode::PowerOff, SafetyStatus::RobotEmergencyStop)
    );
    assert_eq!(robot.dashboard("power on").text, "Failed to execute: power on");
    robot.release_emergency_stop();
    assert_eq!(robot.dashboard("robotmode").text, "Robotmode: POWER_OFF");
    robot.dashboard("brake release");
    seconds(&mut robot, 3.1);
    assert_eq!(robot.robot_mode(), RobotMode::Running);
    assert_eq!(robot.runtime(), RuntimeState::Stopped);
}

#[test]
fn a_plant_that_breaks_down_is_a_safety_fault() {
    struct Broken;
    impl Plant for Broken {
        fn start(&self) -> JointVector {
            HOME.into()
        }
        fn step(&mut self, _: &JointVector) -> Result<PlantState, PlantError> {
            Err(PlantError("no world".into()))
        }
        fn zero_sensor(&mut self) {}
    }
    let mut robot = Controller::new(config(), Box::new(Broken)).unwrap();
    ticks(&mut robot, 3);
    assert_eq!((robot.safety(), robot.robot_mode()), (SafetyStatus::Fault, RobotMode::PowerOff));
}
