//! Where the arm goes, and how.

use palpate_spatial::JointVector;
use palpate_ur::proto::{RuntimeState, SafetyStatus};
use palpate_virtual_ur::controller::DT;

use crate::common::{robot, run, said, seconds, ticks};

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
