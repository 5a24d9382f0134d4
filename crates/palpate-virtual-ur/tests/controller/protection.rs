//! When the controller stops the arm, and what it takes to go on.

use palpate_spatial::{JointVector, Wrench};
use palpate_ur::proto::{RobotMode, RuntimeState, SafetyStatus};
use palpate_virtual_ur::controller::{DT, Delays, StopCause};
use palpate_virtual_ur::plant::{PlantError, PlantState};
use palpate_virtual_ur::{Controller, ControllerConfig, LaggedArm, Plant};

use crate::common::{HOME, config, robot, run, said, seconds, ticks};

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
            assert!(jump <= 150.0 && robot.target().dq.amax() <= 3.15, "{line}: {jump}");
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
    /// Works in its first three cycles, and from where it was restarted.
    struct Fragile(u32);
    impl Plant for Fragile {
        fn start(&self) -> JointVector {
            HOME.into()
        }
        fn step(&mut self, q: &JointVector) -> Result<PlantState, PlantError> {
            self.0 += 1;
            if self.0 == 4 {
                return Err(PlantError("no world".into()));
            }
            Ok(PlantState { q: *q, dq: JointVector::zeros(), wrench: Wrench::zero() })
        }
        fn zero_sensor(&mut self) {}
    }
    let mut robot = Controller::new(config(), Box::new(Fragile(0))).unwrap();
    ticks(&mut robot, 3);
    assert_eq!(robot.safety(), SafetyStatus::Normal);
    ticks(&mut robot, 3);
    assert_eq!((robot.safety(), robot.robot_mode()), (SafetyStatus::Fault, RobotMode::PowerOff));
    assert_eq!(robot.dashboard("brake release").text, "Failed to execute: brake release");
    robot.dashboard("restart safety");
    robot.dashboard("brake release");
    seconds(&mut robot, 3.1);
    assert_eq!((robot.safety(), robot.robot_mode()), (SafetyStatus::Normal, RobotMode::Running));
}
