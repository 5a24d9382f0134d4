//! The simulated arm as a backend.
#![expect(clippy::unwrap_used, reason = "our own arm loads")]

#[expect(dead_code, reason = "the rig is shared with the contact tests")]
#[path = "contact/rig.rs"]
mod rig;

use palpate_kinematics::SerialChain;
use palpate_robot_io::{JointCommand, RobotBackend, contract};
use palpate_sim::{Holder, ObstacleConfig, SimArm, SimConfig, SimError};
use palpate_spatial::{JointVector, Pose, UnitQuaternion, Vector3};

const HOME: [f64; 6] = [
    0.0,
    -std::f64::consts::FRAC_PI_2,
    std::f64::consts::FRAC_PI_2,
    -std::f64::consts::FRAC_PI_2,
    -std::f64::consts::FRAC_PI_2,
    0.0,
];

fn chain() -> SerialChain<6> {
    let urdf = concat!(env!("CARGO_MANIFEST_DIR"), "/../../assets/robots/ur3e.urdf");
    SerialChain::from_urdf_file(urdf, "base_link", "tool0").unwrap()
}

/// The hole `above` metres below the tip at home.
fn arm(config: &SimConfig, above: f64) -> Result<SimArm, SimError> {
    arm_beside(config, above, 0.0)
}

/// The same with the hole `beside` metres to the side.
fn arm_beside(config: &SimConfig, above: f64, beside: f64) -> Result<SimArm, SimError> {
    let tool0 = chain().forward(&HOME.into());
    let down =
        tool0.rotation * UnitQuaternion::from_axis_angle(&Vector3::x_axis(), std::f64::consts::PI);
    let tip = tool0 * nalgebra::Point3::new(beside, 0.0, 0.150 + above);
    SimArm::new(chain(), Pose::from_parts(tip.coords.into(), down), config, HOME.into(), 1)
}

fn noisy() -> SimConfig {
    let mut config = rig::config(1e-3, 1e-3);
    config.sensor.force_noise = 0.05;
    config.sensor.torque_noise = 0.005;
    config
}

#[test]
fn it_keeps_the_contract() {
    contract::check(&mut arm(&noisy(), 0.010).unwrap()).unwrap();
}

#[test]
fn the_servo_lags_by_its_time_constant_and_dead_time() {
    let mut config = rig::config(1e-3, 0.0);
    config.servo.lag = 0.020;
    config.servo.dead_time = 0.006;
    let mut arm = arm(&config, 0.010).unwrap();
    let mut q: JointVector = HOME.into();
    q[5] += 0.1;
    arm.write(&JointCommand { q }).unwrap();
    for tick in 1..=40 {
        let moved = arm.read().unwrap().q[5] - HOME[5];
        let since = f64::from(tick - 3) * 0.002;
        let expected = if since > 0.0 { 0.1 * (1.0 - (-since / 0.020).exp()) } else { 0.0 };
        assert!((moved - expected).abs() < 1e-12, "tick {tick}: {moved} against {expected}");
    }
}

#[test]
fn after_a_tare_nothing_before_it_matters() {
    let run = |arm: &mut SimArm| {
        arm.tare().unwrap();
        let mut q: JointVector = HOME.into();
        (0..50)
            .map(|_| {
                q[1] += 2e-4;
                arm.write(&JointCommand { q }).unwrap();
                let state = arm.read().unwrap();
                (state.q, state.sensor_wrench)
            })
            .collect::<Vec<_>>()
    };
    let mut fresh = arm(&noisy(), 0.010).unwrap();
    let mut used = arm(&noisy(), 0.010).unwrap();
    let mut q: JointVector = HOME.into();
    q[1] += 0.01;
    for target in [q, HOME.into()] {
        for _ in 0..200 {
            used.write(&JointCommand { q: target }).unwrap();
            used.read().unwrap();
        }
    }
    assert_eq!(run(&mut fresh), run(&mut used));
}

#[test]
fn the_noise_has_the_configured_size_and_the_reading_its_quantum() {
    let mut config = noisy();
    config.sensor.force_quantum = 0.1;
    let mut arm = arm(&config, 0.010).unwrap();
    let readings: Vec<_> = (0..4000).map(|_| arm.read().unwrap().sensor_wrench).collect();
    let std = (readings.iter().map(|w| w.torque.x.powi(2)).sum::<f64>() / 4000.0).sqrt();
    assert!((std / 0.005 - 1.0).abs() < 0.1, "{std}");
    assert!(readings.iter().all(|w| ((w.force.y / 0.1).round() * 0.1 - w.force.y).abs() < 1e-12));
    assert!(readings.iter().any(|w| w.force.y != 0.0));
}

#[test]
fn settings_that_cannot_work_are_refused_with_what_would() {
    let message = |change: fn(&mut SimConfig)| {
        let mut config = rig::config(5e-5, 0.0);
        change(&mut config);
        arm(&config, 0.010).unwrap_err().to_string()
    };
    assert!(
        message(|c| c.hole.clearance = 0.0)
            .contains("sim.hole.clearance is 0, but it must be at least 1.000e-5")
    );
    assert!(message(|c| c.hole.clearance = -1e-3).contains("at least 1.000e-5"));
    assert!(message(|c| c.hole.clearance = f64::NAN).contains("at least 1.000e-5"));
    assert!(
        message(|c| c.solver.prediction_distance = 1e-4)
            .contains("at most 1.250e-5: half the clearance per side")
    );
    assert!(message(|c| c.tool.mass = f64::NAN).contains("sim.tool.mass"));
    assert!(message(|c| c.peg.chamfer = 1e-3).contains("at most 0.000e0"));
    assert!(message(|c| c.peg.holder = Holder::Fixture).contains("round peg"));
    let at = |config: &SimConfig, above, beside| {
        arm_beside(config, above, beside).unwrap_err().to_string()
    };
    let inside = at(&rig::config(1e-3, 0.0), -0.003, 0.005);
    assert!(inside.contains("3.000 mm inside the board"), "{inside}");
    let bolt = at(&rig::ring(1e-3, 0.0), -0.002, 0.005);
    assert!(bolt.contains("2.000 mm inside the board or bolt"), "{bolt}");
    let mut table = rig::config(1e-3, 0.0);
    table.obstacles.push(ObstacleConfig { centre: [0.0, 0.0, 0.030], half: [0.2, 0.2, 0.025] });
    let table = at(&table, 0.050, 0.0);
    assert!(table.contains("5.000 mm inside obstacle 0"), "{table}");
}

#[test]
fn a_stiffness_that_the_solver_cannot_settle_is_refused_with_one_that_it_can() {
    let mut config = rig::config(5e-5, 0.0);
    config.compliance.linear_stiffness = 1e7;
    config.compliance.angular_stiffness = 1e5;
    config.compliance.linear_damping = 4500.0;
    config.compliance.angular_damping = 40.0;
    config.solver.contact_frequency = 3000.0;
    let refused = config.validate().unwrap_err().to_string();
    let numbers: Vec<f64> = refused
        .split_whitespace()
        .filter_map(|word| word.trim_end_matches(',').parse().ok())
        .collect();
    // "… is 1e7, but it must be at most k N/m …, angular_stiffness at most k N·m/rad, dampings at most d and d".
    let [_, linear, angular, slide, turn, ..] = numbers[..] else { panic!("{refused}") };
    config.compliance.linear_stiffness = linear * 0.99;
    config.compliance.angular_stiffness = angular * 0.99;
    config.compliance.linear_damping = slide * 0.99;
    config.compliance.angular_damping = turn * 0.99;
    config.validate().unwrap();
    let mut sprung = rig::sprung(5e-5, 0.0);
    sprung.receptacle.as_mut().unwrap().compliance.angular_stiffness *= 100.0;
    let refused = sprung.validate().unwrap_err().to_string();
    assert!(refused.contains("sim.receptacle.compliance.linear_stiffness"), "{refused}");
}

#[test]
fn obstacles_stop_the_tool() {
    // A box under the tip's corner, beside the hole: down the last joint's axis goes nowhere.
    let mut config = rig::config(1e-3, 0.0);
    config
        .obstacles
        .push(ObstacleConfig { centre: [0.0, 0.0, 0.0075], half: [0.005, 0.1, 0.0025] });
    let mut arm = arm(&config, 0.012).unwrap();
    arm.tare().unwrap();
    let chain = chain();
    let mut q: JointVector = HOME.into();
    let mut felt = 0.0f64;
    // 4 mm down by the shoulder and the elbow; the tip meets the box after 2 mm.
    for _ in 0..400 {
        let below = chain.forward(&q);
        let mut next = q;
        next[1] += 1e-5;
        let step = chain.forward(&next).translation.z - below.translation.z;
        q[1] += 1e-5 * (-1e-5 / step.abs()).abs() * -step.signum();
        arm.write(&JointCommand { q }).unwrap();
        felt = felt.max(arm.read().unwrap().sensor_wrench.force.norm());
    }
    assert!(felt > 20.0, "{felt:.1} N");
    let tip = arm.hole_T_tip().translation.z;
    assert!(tip > 0.0095, "the tip is {:.2} mm above the mouth, in the box", tip * 1e3);
}
