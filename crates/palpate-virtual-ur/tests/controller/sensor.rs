//! Force and torque, their defects and the tare.

use palpate_virtual_ur::controller::SensorFault;
use palpate_virtual_ur::{Controller, ControllerConfig, LaggedArm};

use crate::common::{HOME, config, robot, run, seconds, ticks};

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
