//! The contact world behind the controller: what a program feels is the simulator's contact.

#![expect(clippy::unwrap_used, reason = "a helper that cannot go on fails its test")]

use palpate_kinematics::{SerialChain, UrModel};
use palpate_sim::{SimArm, SimConfig};
use palpate_spatial::{JointVector, Pose, UnitQuaternion, Vector3};
use palpate_ur::proto::{RuntimeState, SafetyStatus};
use palpate_virtual_ur::controller::StopCause;
use palpate_virtual_ur::plant::ContactArm;
use palpate_virtual_ur::{Controller, ControllerConfig};

/// The peg 10 mm above the board, 30 mm beside the hole.
fn robot() -> Controller {
    let config: SimConfig =
        toml::from_str(include_str!("../../palpate-sim/tests/contact/stiff.toml")).unwrap();
    let urdf = include_str!("../../../assets/robots/ur3e.urdf");
    let chain = SerialChain::from_urdf_str(urdf, "base_link", "tool0").unwrap();
    let right = std::f64::consts::FRAC_PI_2;
    let q = JointVector::from([0.0, -right, right, -right, -right, 0.0]);
    let into = UnitQuaternion::from_axis_angle(&Vector3::x_axis(), std::f64::consts::PI);
    let tip = chain.forward(&q) * Pose::translation(0.0, 0.0, config.tool.length + 0.010);
    let beside = tip.translation.vector + Vector3::new(0.03, 0.0, 0.0);
    let base_T_hole = Pose::from_parts(beside.into(), tip.rotation * into);
    let arm = SimArm::new(chain, base_T_hole, &config, q, 1).unwrap();
    let controller = ControllerConfig::new(UrModel::Ur3e);
    Controller::new(controller, Box::new(ContactArm::new(arm, q))).unwrap()
}

fn finish(robot: &mut Controller, text: &str) {
    robot.run_script(text);
    for _ in 0..10_000 {
        robot.tick();
        if robot.runtime() == RuntimeState::Stopped {
            return;
        }
    }
    panic!("still running");
}

#[test]
fn a_program_finds_the_board_by_force() {
    let mut robot = robot();
    let above = robot.actual().tcp[2];
    finish(
        &mut robot,
        "def touch():
  zero_ftsensor()
  thread down():
    speedl([0, 0, -0.01, 0, 0, 0], 0.5, 10)
  end
  h = run down()
  while get_tcp_force()[2] < 5:
    sync()
  end
  kill h
  stopl(5)
end
",
    );
    assert_eq!(robot.safety(), SafetyStatus::Normal, "{:?}", robot.take_events());
    let way = above - robot.actual().tcp[2];
    assert!((0.0095..0.0125).contains(&way), "touched after {way} m");
    let force = robot.tcp_force();
    assert!(force[2] > 3.0 && force[2] < 60.0, "the board pushes up: {force:?}");
}

#[test]
fn pressing_on_is_a_protective_stop() {
    let mut robot = robot();
    finish(&mut robot, "def press():\n speedl([0, 0, -0.02, 0, 0, 0], 0.5, 5)\nend\n");
    assert!(matches!(robot.last_stop(), Some(StopCause::Force { .. })), "{:?}", robot.last_stop());
    let rest = robot.actual().q;
    (0..500).for_each(|_| robot.tick());
    assert!(
        (robot.actual().q - rest).amax() < 0.01 && robot.safety() == SafetyStatus::ProtectiveStop
    );
}
