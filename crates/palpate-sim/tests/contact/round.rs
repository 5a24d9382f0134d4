//! Round parts: a peg in a bore, a ring over a bolt. Nothing may depend on the direction.

use palpate_sim::SimConfig;
use palpate_spatial::Vector3;
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;

use crate::rig::{CLEARANCES, DT, Rig, flange, ring, round};

type Make = fn(f64, f64) -> SimConfig;
const BOTH: [(&str, Make); 2] = [("peg", round), ("ring", ring)];
/// Directions about the hole, rad: on and between the sampled ones.
const AZIMUTHS: [f64; 6] = [0.0, 0.3, 0.785, 1.9, 3.3, 5.1];

fn across(azimuth: f64, length: f64) -> [f64; 3] {
    [length * azimuth.cos(), length * azimuth.sin(), 0.0]
}

/// Depth at which a peg tilted by `tilt` touches both walls: d = (W − w·cos θ)/sin θ.
fn two_point_depth(clearance: f64, tilt: f64) -> f64 {
    (0.020 + clearance - 0.020 * tilt.cos()) / tilt.sin()
}

#[test]
fn aligned_round_parts_join_without_contact() {
    for (name, make) in BOTH {
        for clearance in CLEARANCES {
            for chamfer in [0.0, 1e-3] {
                let mut config = make(clearance, chamfer);
                config.peg.chamfer = chamfer;
                let mut rig = Rig::new(&config, [0.0, 0.0, 0.004], [0.0; 3]);
                let mut free = Rig::new(&config, [0.05, 0.0, 0.050], [0.0; 3]);
                while rig.tip.z > -0.020 {
                    let felt = rig.slide([0.0, 0.0, -0.010]).vector();
                    let contact = (felt - free.slide([0.0, 0.0, -0.010]).vector()).amax();
                    assert!(contact < 1e-6, "{name} {clearance} {chamfer}: {contact:.1e} N");
                }
                assert!((rig.depth() - 0.020).abs() < 1e-4);
            }
        }
    }
}

#[test]
fn a_tilted_round_part_jams_at_the_two_point_depth_whatever_the_direction() {
    let nominal = 1f64.to_radians();
    for (name, make) in BOTH {
        for (clearance, tolerance) in [(2e-4, 0.05), (5e-5, 0.10)] {
            let depths = AZIMUTHS.map(|azimuth| {
                let tilt = across(azimuth, nominal);
                let mut rig = Rig::new(&make(clearance, 0.0), [0.0, 0.0, 0.004], tilt);
                rig.push_down(20.0, 0.020);
                let (depth, expected) = (rig.depth(), two_point_depth(clearance, nominal));
                let label = format!("{name} {clearance} at {azimuth}");
                assert!(
                    (depth / expected - 1.0).abs() < tolerance,
                    "{label}: {depth:.5} {expected:.5}"
                );
                // With the true tilt the form is nearly exact: contacts give way by 3 µm.
                let exact = two_point_depth(clearance, rig.true_tilt());
                let give = if clearance < 1e-4 { 0.07 } else { 0.02 };
                assert!((depth / exact - 1.0).abs() < give, "{label}: {depth:.5} {exact:.5}");
                // The sliding tool takes a few hundredths of a second to stop with the flange.
                let before = rig.hold(25).force.z;
                let after = rig.hold(150).force.z;
                assert!(before > 10.0, "{label}: wedged at {before:.1} N");
                assert!((after / before - 1.0).abs() < 0.02, "{label}: {before:.1} → {after:.1} N");
                depth
            });
            let spread =
                depths.map(|d| (d / depths[0] - 1.0).abs()).into_iter().fold(0.0, f64::max);
            assert!(spread < 5e-3, "{name} {clearance}: {depths:.6?}");
        }
    }
}

#[test]
fn a_round_part_that_fits_is_not_stopped() {
    // 0.1° of tilt in 0.05 mm: both walls would touch 28 mm deep. 1.5 mm per second for contact to act.
    let tilt = 0.1f64.to_radians();
    assert!(two_point_depth(5e-5, tilt) > 0.025);
    for (name, make) in BOTH {
        for azimuth in AZIMUTHS {
            let mut config = make(5e-5, 1e-3);
            config.friction = 0.1;
            let mut rig = Rig::new(&config, [0.0, 0.0, 0.002], across(azimuth, tilt));
            let felt = rig.push_down(20.0, 0.020);
            assert!((rig.depth() - 0.020).abs() < 2e-4, "{name} at {azimuth}: {:.5}", rig.depth());
            assert!(felt.force.z < 6.0, "{name} at {azimuth}: {:.1} N", felt.force.z);
        }
    }
}

#[test]
fn lateral_stiffness_is_the_springs_in_every_direction() {
    // With the tip 10 mm deep a peg touches at the mouth, 0.14 m from the sensor, and a ring at the bolt's top.
    let stiffness = 1.0 / (1.0 / 1e5 + 0.14f64.powi(2) / 1000.0);
    for (name, make) in BOTH {
        for clearance in CLEARANCES {
            for azimuth in AZIMUTHS {
                let mut rig = Rig::new(&make(clearance, 0.0), [0.0, 0.0, 0.002], [0.0; 3]);
                rig.push_down(20.0, 0.010);
                let (centre, mut peak, mut aside) = (rig.tip, 0.0f64, 0.0f64);
                let way = Vector3::from(across(azimuth, 1.0));
                for tick in 0..500 {
                    let phase = std::f64::consts::TAU * 2.0 * f64::from(tick) * DT;
                    let force = rig.to(centre + way * (0.15e-3 * phase.sin()), rig.tilt).force;
                    if tick > 100 {
                        peak = peak.max(force.dot(&way).abs());
                        aside = aside.max(force.cross(&way).z.abs());
                    }
                }
                let expected = (stiffness * (0.15e-3 - clearance / 2.0)).max(0.0);
                let error = (peak - expected).abs();
                let label = format!("{name} {clearance} at {azimuth}");
                assert!(
                    error < 0.02 * expected + 0.25,
                    "{label}: {peak:.2} against {expected:.2} N"
                );
                assert!(aside < 0.02 * expected + 0.05, "{label}: {aside:.2} N aside");
            }
        }
    }
}

#[test]
fn a_round_peg_presses_flat_and_slides_with_its_friction() {
    for azimuth in AZIMUTHS {
        let mut rig = Rig::new(&round(2e-4, 0.0), [0.05, 0.0, 0.001], [0.0; 3]);
        rig.push_down(20.0, 1.0);
        let pressed = rig.hold(600);
        let measured = pressed.force.z / -rig.tip.z;
        assert!((measured / 1e5 - 1.0).abs() < 0.02, "{measured:.0} N/m");
        assert!(pressed.torque.norm() < 0.01 && pressed.force.xy().norm() < 0.01, "{pressed:?}");
        let velocity = across(azimuth, 0.010);
        for tick in 0..1000 {
            let wrench = rig.slide(velocity);
            if tick > 250 {
                let ratio = wrench.force.xy().norm() / wrench.force.z;
                assert!(
                    (ratio / 0.3 - 1.0).abs() < 0.01,
                    "at {azimuth}: {ratio:.4} in tick {tick}"
                );
            }
        }
    }
}

#[test]
fn round_parts_beside_each_other_land_on_the_rim_and_stay() {
    for (name, make) in BOTH {
        for azimuth in AZIMUTHS {
            let aside = across(azimuth, 0.3e-3);
            let mut rig = Rig::new(&make(2e-4, 0.0), [aside[0], aside[1], 0.002], [0.0; 3]);
            rig.push_down(20.0, 0.020);
            let early = rig.hold(300).force;
            let label = format!("{name} at {azimuth}");
            assert!(rig.depth().abs() < 1e-4, "{label}: {:.2} mm deep", rig.depth() * 1e3);
            assert!(early.z > 14.0, "{label}: {:.1} N", early.z);
            let late = rig.hold(600).force;
            assert!((late - early).norm() < 0.05, "{label}: {early:?} → {late:?}");
        }
    }
}

/// Depth of the deepest of many points on the peg's edges, and on those of the hole, by the definition of the
/// solids.
fn sampled_depths(config: &SimConfig, hole_T_tip: &palpate_spatial::Pose) -> [f64; 2] {
    let hole_T_peg = if config.ring_on_tool() { hole_T_tip.inverse() } else { *hole_T_tip };
    let (r, e) = (config.peg.width / 2.0, config.peg.chamfer);
    let (hole, c) = (config.hole_half_width(), config.hole.chamfer);
    let in_hole_body = |p: &nalgebra::Point3<f64>| {
        let rho = p.x.hypot(p.y);
        let outside =
            if config.ring_on_tool() { config.hole.board_half_width - rho } else { f64::INFINITY };
        let ramp = (rho - hole - c - p.z) / 2f64.sqrt();
        (rho - hole).min(ramp).min(-p.z).min(p.z + config.hole.depth).min(outside)
    };
    let in_peg = |p: &nalgebra::Point3<f64>| {
        let rho = p.x.hypot(p.y);
        let ramp = (r - e - rho - p.z) / 2f64.sqrt();
        (r - rho).min(ramp).min(-p.z).min(p.z + config.peg.length)
    };
    let [mut of_peg, mut of_hole] = [0.0f64; 2];
    for i in 0..20_000 {
        let angle = std::f64::consts::TAU * f64::from(i) / 20_000.0;
        let on = |rho: f64, z: f64| nalgebra::Point3::new(rho * angle.cos(), rho * angle.sin(), z);
        for (rho, z) in [(r, -e), (r - e, 0.0)] {
            of_peg = of_peg.max(in_hole_body(&(hole_T_peg * on(rho, z))));
        }
        for (rho, z) in [(hole + c, 0.0), (hole, -c), (hole, -config.hole.depth)] {
            of_hole = of_hole.max(in_peg(&(hole_T_peg.inverse() * on(rho, z))));
        }
        if config.ring_on_tool() {
            for z in [0.0, -config.hole.depth] {
                let edge = on(config.hole.board_half_width, z);
                of_hole = of_hole.max(in_peg(&(hole_T_peg.inverse() * edge)));
            }
        }
    }
    [of_peg, of_hole]
}

#[test]
fn the_closed_form_of_round_parts_agrees_with_points_on_their_edges() {
    let mut rng = ChaCha8Rng::seed_from_u64(3);
    let mut overlapping = 0;
    for i in 0..1000 {
        let mut within = |half: f64| rng.random_range(-half..half);
        let make = BOTH[i % 2].1;
        let mut config = make(2e-4, if within(1.0) > 0.0 { 1e-3 } else { 0.0 });
        config.peg.chamfer = if within(1.0) > 0.0 { 5e-4 } else { 0.0 };
        let tip = [within(1e-3), within(1e-3), within(0.030)].into();
        let tilt = [within(0.03), within(0.03), within(0.03)].into();
        let hole_T_tip = flange(&tip, &tilt, 0.0);
        let exact = config.overlap(&hole_T_tip);
        let [of_peg, of_hole] = sampled_depths(&config, &hole_T_tip);
        overlapping += u32::from(exact > 0.0);
        // Edge in edge counts once, as a point of the peg; the hole's edge can be a little deeper there.
        let label =
            format!("{exact:.7}, points {of_peg:.7} {of_hole:.7}: {tip:?} {tilt:?} {config:?}");
        assert!(exact > of_peg - 2e-6 && exact < of_peg.max(of_hole) + 2e-6, "{label}");
        assert!(exact > 0.0 || of_hole < 2e-6, "{label}");
    }
    assert!(overlapping > 300 && overlapping < 990, "{overlapping} of 1000 overlap");
}
