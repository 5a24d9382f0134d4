//! Contact against closed forms: 20 mm square peg, sensor 100 N/mm, 1000 N·m/rad, friction 0.3.

mod common;

use common::{DT, Rig, config};
use palpate_spatial::Vector3;

const CLEARANCES: [f64; 3] = [1e-3, 2e-4, 5e-5];
/// Bound of the tool's own inertia force when a 10 mm/s ramp starts: the damper's D·v, N.
const INERTIA: f64 = 4.5;

#[test]
fn an_aligned_peg_enters_without_contact() {
    for clearance in CLEARANCES {
        for chamfer in [0.0, 1e-3] {
            let mut rig = Rig::new(&config(clearance, chamfer), [0.0, 0.0, 0.002], 0.0);
            let (mut peak, mut late): (f64, f64) = (0.0, 0.0);
            while rig.tip.z > -0.020 {
                let force = rig.move_by([0.0, 0.0, -0.010]).force.norm();
                peak = peak.max(force);
                if rig.tip.z < 0.001 {
                    late = late.max(force);
                }
            }
            assert!(peak < INERTIA, "clearance {clearance}, chamfer {chamfer}: {peak:.2} N");
            assert!(late < 1e-3, "clearance {clearance}, chamfer {chamfer}: {late:.4} N after the start");
            assert!((rig.world.tip_pose().translation.z + 0.020).abs() < 1e-4);
        }
    }
}

#[test]
fn a_press_has_the_stiffness_of_the_spring_and_no_false_torque() {
    let mut rig = Rig::new(&config(2e-4, 0.0), [0.05, 0.0, 0.001], 0.0);
    rig.push_down(20.0, 1.0);
    let settled = rig.hold(600);
    let stiffness = settled.force.z / -rig.tip.z;
    assert!((stiffness / 1e5 - 1.0).abs() < 0.02, "{stiffness:.0} N/m");
    assert!(settled.torque.norm() < 0.01 && settled.force.xy().norm() < 0.01, "{settled:?}");
    let steady = rig.hold(100);
    assert!((steady.force - settled.force).norm() < 1e-3, "it keeps moving");
    while rig.tip.z < 0.001 {
        rig.move_by([0.0, 0.0, 0.020]);
    }
    assert!(rig.hold(200).force.norm() < 1e-3, "nothing left after the retreat");
}

#[test]
fn sliding_friction_is_coulombs_also_over_a_seam() {
    // From beside the mouth along y: once over plain board, once over the seam of two boxes.
    for x in [0.05, 0.018] {
        let mut rig = Rig::new(&config(2e-4, 1e-3), [x, -0.04, 0.001], 0.0);
        rig.push_down(10.0, 1.0);
        rig.hold(200);
        let mut worst: f64 = 0.0;
        for tick in 0..3000 {
            let wrench = rig.move_by([0.0, 0.010, 0.0]);
            if tick > 500 {
                let ratio = wrench.force.xy().norm() / wrench.force.z;
                worst = worst.max((ratio / 0.3 - 1.0).abs());
            }
        }
        assert!(worst < 0.01, "x = {x}: friction ratio off by {:.1} %", worst * 100.0);
    }
}

/// Depth at which a peg tilted by `tilt` touches both walls: d = (W − w·cos θ)/sin θ.
fn two_point_depth(clearance: f64, tilt: f64) -> f64 {
    (0.020 + clearance - 0.020 * tilt.cos()) / tilt.sin()
}

#[test]
fn a_tilted_peg_jams_at_the_two_point_depth_and_stays_wedged() {
    let tilt = 1f64.to_radians();
    // The rig lets the peg right itself a little before 20 N are reached, more so the tighter the fit.
    for (clearance, tolerance) in [(2e-4, 0.05), (5e-5, 0.20)] {
        let mut rig = Rig::new(&config(clearance, 0.0), [0.0, 0.0, 0.002], tilt);
        rig.push_down(20.0, 0.020);
        let depth = -rig.world.tip_pose().translation.z;
        let expected = two_point_depth(clearance, tilt);
        assert!((depth / expected - 1.0).abs() < tolerance, "{clearance}: {depth:.5} against {expected:.5}");
        let before = rig.to(rig.tip).force.z;
        let after = rig.hold(150).force.z;
        assert!((after / before - 1.0).abs() < 0.10, "wedge force {before:.1} → {after:.1} N in 0.3 s");
    }
    // At 1 mm the jam would lie below the board: the peg passes.
    let mut rig = Rig::new(&config(1e-3, 0.0), [0.0, 0.0, 0.002], tilt);
    assert!(rig.push_down(20.0, 0.020).force.z < 20.0);
}

#[test]
fn a_peg_beside_the_hole_lands_on_the_rim() {
    let mut rig = Rig::new(&config(2e-4, 0.0), [0.3e-3, 0.0, 0.002], 0.0);
    rig.push_down(20.0, 0.020);
    let wrench = rig.hold(300);
    assert!(rig.tip.z.abs() < 1e-3, "it landed {:.2} mm deep", -rig.tip.z * 1e3);
    // Three sides of the mouth carry; converged solvers agree on a small pull towards the hole.
    assert!(wrench.force.x > -1.1 && wrench.force.x < -0.6, "{:.2} N", wrench.force.x);
}

#[test]
fn lateral_play_and_stiffness_are_those_of_the_fit() {
    // At the mouth with the tip 10 mm deep: 1/(1/K + 0.14²/K_r).
    let stiffness = 1.0 / (1.0 / 1e5 + 0.14f64.powi(2) / 1000.0);
    for clearance in CLEARANCES {
        let mut rig = Rig::new(&config(clearance, 0.0), [0.0, 0.0, 0.002], 0.0);
        rig.push_down(20.0, 0.010);
        let centre = rig.tip;
        let mut peak: f64 = 0.0;
        for tick in 0..2000 {
            let phase = std::f64::consts::TAU * 2.0 * f64::from(tick) * DT;
            let wrench = rig.to(centre + Vector3::new(0.15e-3 * phase.sin(), 0.0, 0.0));
            if tick > 100 {
                peak = peak.max(wrench.force.x.abs());
            }
        }
        let expected = (stiffness * (0.15e-3 - clearance / 2.0)).max(0.0);
        assert!((peak - expected).abs() < 0.02 * expected + 0.3, "{clearance}: {peak:.2} N against {expected:.2}");
    }
}

#[test]
fn a_chamfer_guides_a_peg_that_a_sharp_mouth_stops() {
    let soft = |chamfer| {
        let mut c = config(1e-3, chamfer);
        c.friction = 0.1;
        c.compliance = palpate_sim::ComplianceConfig {
            linear_stiffness: 1e4,
            angular_stiffness: 100.0,
            linear_damping: 140.0,
            angular_damping: 1.2,
        };
        let mut rig = Rig::new(&c, [1.0e-3, 0.0, 0.002], 0.0);
        rig.push_down(15.0, 0.010);
        (-rig.tip.z, rig.hold(100))
    };
    let (sharp_depth, _) = soft(0.0);
    assert!(sharp_depth < 0.002, "a sharp mouth let it in by {:.1} mm", sharp_depth * 1e3);
    let (depth, wrench) = soft(1e-3);
    assert!(depth > 0.009, "the chamfer stopped it at {:.1} mm", depth * 1e3);
    assert!(wrench.force.x < -0.5, "the wall pushes it back: {:.2} N", wrench.force.x);
}

#[test]
fn random_exploration_stays_bounded_and_repeats_bit_for_bit() {
    let run = |ticks: usize| {
        let mut rig = Rig::new(&config(5e-5, 1e-3), [0.0, 0.0, 0.002], 0.0);
        let mut state = 1u64;
        let mut random = || {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (state >> 33) as f64 / f64::from(1u32 << 31) * 2.0 - 1.0
        };
        let (mut goal, mut last) = (rig.tip, 0.0f64);
        let (mut peak, mut jump, mut deepest, mut sum) = (0.0f64, 0.0f64, 0.0f64, 0u64);
        for tick in 0..ticks {
            if tick % 25 == 0 {
                goal = Vector3::new(0.6e-3 * random(), 0.6e-3 * random(), -0.0055 + 0.0065 * random());
            }
            if last > 30.0 {
                goal.z = rig.tip.z + 0.001;
            }
            let way = goal - rig.tip;
            let step = way * (0.020 * DT / way.norm().max(0.020 * DT));
            let force = rig.to(rig.tip + step).force;
            jump = jump.max((force.norm() - last).abs());
            last = force.norm();
            peak = peak.max(last);
            sum = sum.rotate_left(1) ^ force.x.to_bits() ^ force.z.to_bits();
            // Depth of the tip's corners below the top where there is no hole.
            let tip = rig.world.tip_pose();
            for (x, y) in [(-1.0, -1.0), (-1.0, 1.0), (1.0, -1.0), (1.0, 1.0)] {
                let corner = (tip * nalgebra::Point3::new(0.01 * x, 0.01 * y, 0.0)).coords;
                let across = corner.x.abs().max(corner.y.abs());
                // Board material: |x| or |y| beyond the hole, which widens along the chamfer.
                let width = 0.010_025 + (corner.z + 1e-3).clamp(0.0, 1e-3);
                deepest = deepest.max((across - width).min(-corner.z));
            }
        }
        (peak, jump, deepest, sum)
    };
    let (peak, jump, deepest, sum) = run(20_000);
    assert!(peak < 60.0, "peak {peak:.1} N");
    assert!(jump < 35.0, "jump {jump:.1} N in a tick");
    assert!(deepest < 60e-6, "penetration {:.1} µm", deepest * 1e6);
    assert_eq!(run(20_000).3, sum, "the same motion gives the same bits");
}
