//! On the board: stiffness, friction, seams, levers, the rim.

use palpate_spatial::{UnitQuaternion, Vector3};

use crate::rig::{DT, Rig, config, flange, soft};

#[test]
fn a_press_has_the_stiffness_of_the_spring_and_nothing_sideways() {
    for (config, stiffness) in [(config(2e-4, 0.0), 1e5), (soft(2e-4, 0.0), 1e4)] {
        let mut rig = Rig::new(&config, [0.05, 0.0, 0.001], [0.0; 3]);
        rig.push_down(20.0, 1.0);
        let settled = rig.hold(600);
        let measured = settled.force.z / -rig.tip.z;
        assert!((measured / stiffness - 1.0).abs() < 0.02, "{measured:.0} N/m");
        assert!(settled.torque.norm() < 0.01, "false torque {:?}", settled.torque);
        assert!(settled.force.xy().norm() < 0.01, "false lateral force {:?}", settled.force);
        for _ in 0..300 {
            assert!((rig.hold(1).force - settled.force).norm() < 1e-3, "it keeps moving");
        }
        while rig.tip.z < 0.001 {
            rig.slide([0.0, 0.0, 0.020]);
        }
        assert!(rig.hold(300).force.norm() < 1e-3, "nothing left after the retreat");
    }
}

#[test]
fn sliding_friction_is_coulombs_also_over_seams() {
    // Beside the mouth along y: over plain board, over the seam of two boxes, over the corner of the mouth.
    for (x, chamfer) in [(0.05, 0.0), (0.018, 0.0), (0.018, 1e-3), (0.0215, 1e-3)] {
        for friction in [0.1, 0.3, 0.6] {
            let mut config = config(2e-4, chamfer);
            config.friction = friction;
            let mut rig = Rig::new(&config, [x, -0.04, 0.001], [0.0; 3]);
            rig.push_down(10.0, 1.0);
            rig.hold(200);
            let (mut ratios, mut spike): (Vec<f64>, f64) = (Vec::new(), 0.0);
            for tick in 0..4000 {
                let wrench = rig.slide([0.0, 0.010, 0.0]);
                if tick > 500 {
                    ratios.push(wrench.force.xy().norm() / wrench.force.z / friction - 1.0);
                    spike = spike.max(wrench.force.x.abs());
                }
            }
            let mean = ratios.iter().sum::<f64>() / ratios.len() as f64;
            let worst = ratios.iter().fold(0.0, |worst: f64, r| worst.max(r.abs()));
            assert!(mean.abs() < 0.002, "x {x}, μ {friction}: off by {:.2} %", mean * 100.0);
            assert!(worst < 0.01, "x {x}, μ {friction}: a tick is off by {:.2} %", worst * 100.0);
            assert!(spike < 0.1, "x {x}, μ {friction}: {spike:.2} N across");
        }
    }
}

#[test]
fn inside_the_friction_cone_it_sticks() {
    let mut rig = Rig::new(&config(2e-4, 0.0), [0.05, 0.0, 0.001], [0.0; 3]);
    rig.push_down(20.0, 1.0);
    rig.hold(200);
    let before = rig.world.tip_pose().translation.vector;
    for _ in 0..50 {
        rig.slide([1e-3, 0.0, 0.0]);
    }
    let (early, late) = (rig.hold(100), rig.hold(500));
    // At the tip the rig is 1/(1/K + 0.15²/K_r) = 30.8 N/mm soft. The peg tips over its trailing edge, and the
    // moment F_z·w/2 that this takes stiffens it: 3.8 N of the 4.9 N that friction holds.
    let moment = late.force.z * 0.010;
    let expected = -(1e-4 + 0.15 * moment / 1000.0) / (1.0 / 1e5 + 0.15f64.powi(2) / 1000.0);
    assert!(
        (late.force.x / expected - 1.0).abs() < 0.05,
        "{:.3} against {expected:.3} N",
        late.force.x
    );
    assert!((late.force - early.force).norm() < 0.01, "it creeps");
    // Friction is solved in velocities: while the load changes a few micrometres slip by.
    let slip = (rig.world.tip_pose().translation.vector - before).xy().norm();
    assert!(slip < 5e-6, "slipped by {:.1} µm", slip * 1e6);
}

#[test]
fn the_torque_is_the_lever_of_the_touching_edge() {
    let tilt = 2f64.to_radians();
    for (axis, sign) in [(0, 1.0), (0, -1.0), (1, 1.0), (1, -1.0)] {
        let mut turn = [0.0; 3];
        turn[axis] = sign * tilt;
        let mut rig = Rig::new(&config(2e-4, 0.0), [0.05, 0.0, 0.001], turn);
        rig.push_down(10.0, 1.0);
        let wrench = rig.hold(300);
        let tip = rig.world.tip_pose();
        // The lowest tip edge and the sensor, from geometry alone.
        let edge = [(1.0, 0.0), (-1.0, 0.0), (0.0, 1.0), (0.0, -1.0)]
            .map(|(x, y)| (tip * nalgebra::Point3::new(0.01 * x, 0.01 * y, 0.0)).coords)
            .into_iter()
            .min_by(|a, b| a.z.total_cmp(&b.z))
            .unwrap();
        let sensor = (tip * nalgebra::Point3::new(0.0, 0.0, -0.150)).coords;
        let expected = (edge - sensor).cross(&wrench.force);
        assert!(expected.norm() > 0.005, "{expected:?}");
        // About the vertical the two ends of the edge can lock friction in: no lever says how much.
        assert!(wrench.torque.z.abs() < 0.02, "{:?}", wrench.torque);
        let error = (wrench.torque - expected).xy().norm();
        assert!(error < 1e-3, "{:?} against {expected:?}", wrench.torque);
    }
}

#[test]
fn a_peg_beside_the_hole_lands_on_the_rim_and_stays() {
    for (x, y) in [(0.3e-3, 0.0), (-0.3e-3, 0.0), (0.0, 0.3e-3), (0.3e-3, 0.3e-3)] {
        let mut rig = Rig::new(&config(2e-4, 0.0), [x, y, 0.002], [0.0; 3]);
        rig.push_down(20.0, 0.020);
        let early = rig.hold(300);
        assert!(rig.depth().abs() < 1e-4, "it landed {:.2} mm deep", rig.depth() * 1e3);
        assert!(early.force.z > 14.0, "{:.1} N", early.force.z);
        // Material on one side carries: the peg leans, friction holds its edge, and the tilted sensor pulls.
        // Over a corner the middle of the peg is still supported and it hardly leans.
        let pull = -early.force.xy().dot(&Vector3::new(x, y, 0.0).normalize().xy());
        let expected = if x * y == 0.0 { 0.5..1.1 } else { -0.05..0.2 };
        assert!(expected.contains(&pull), "{pull:.2} N towards the hole");
        let late = rig.hold(600);
        assert!((late.force - early.force).norm() < 0.05, "{:?} → {:?}", early.force, late.force);
    }
}

#[test]
fn a_flange_attitude_may_come_as_q_or_minus_q() {
    let mut world = Rig::new(&config(1e-3, 0.0), [0.05, 0.0, 0.001], [0.0; 3]).world;
    let mut worst: f64 = 0.0;
    for tick in 0..200 {
        // A slow tilt through a half turn from the hole's axes, where a quaternion's sign is a toss-up.
        let tilt = Vector3::new(1e-4 * f64::from(tick - 100), 0.0, 0.0);
        let mut pose = flange(&Vector3::new(0.05, 0.0, 0.003), &tilt, 0.150);
        if tick % 2 == 1 {
            pose.rotation = UnitQuaternion::new_unchecked(-pose.rotation.into_inner());
        }
        let felt = world.tick(&pose, DT).unwrap();
        if tick > 100 {
            worst = worst.max(felt.force.norm());
        }
    }
    assert!(worst < 0.5, "{worst:.1} N in free air");
}
