//! Into the hole: free entry, jam, wedge, play, chamfer.

use palpate_spatial::Vector3;

use crate::rig::{CLEARANCES, DT, Rig, config, soft};

/// Depth at which a peg tilted by `tilt` touches both walls: d = (W − w·cos θ)/sin θ.
fn two_point_depth(clearance: f64, tilt: f64) -> f64 {
    (0.020 + clearance - 0.020 * tilt.cos()) / tilt.sin()
}

#[test]
fn an_aligned_peg_enters_without_contact() {
    for clearance in CLEARANCES {
        for chamfer in [0.0, 1e-3] {
            for config in [config(clearance, chamfer), soft(clearance, chamfer)] {
                let mut rig = Rig::new(&config, [0.0, 0.0, 0.004], [0.0; 3]);
                let mut free = Rig::new(&config, [0.05, 0.0, 0.050], [0.0; 3]);
                while rig.tip.z > -0.020 {
                    // The tool's inertia is felt by both; only contact could tell them apart.
                    let felt = rig.slide([0.0, 0.0, -0.010]).vector();
                    let inertia = free.slide([0.0, 0.0, -0.010]).vector();
                    let contact = (felt - inertia).amax();
                    assert!(
                        contact < 1e-6,
                        "clearance {clearance}, chamfer {chamfer}, {:.2} mm deep: {contact:.1e} N",
                        -rig.tip.z * 1e3
                    );
                }
                assert!((rig.depth() - 0.020).abs() < 1e-4);
            }
        }
    }
}

#[test]
fn a_tilted_peg_jams_at_the_two_point_depth_and_stays_wedged() {
    let nominal = 1f64.to_radians();
    for (clearance, tolerance) in [(2e-4, 0.05), (5e-5, 0.10)] {
        let mut rig = Rig::new(&config(clearance, 0.0), [0.0, 0.0, 0.002], [0.0, nominal, 0.0]);
        rig.push_down(20.0, 0.020);
        let (depth, expected) = (rig.depth(), two_point_depth(clearance, nominal));
        assert!((depth / expected - 1.0).abs() < tolerance, "{depth:.5} against {expected:.5}");
        // The sensor lets the peg tilt by 2 % more; with the true angle the form is all but exact.
        let exact = two_point_depth(clearance, rig.true_tilt());
        assert!((depth / exact - 1.0).abs() < 0.02, "{depth:.5} against {exact:.5}");
        let before = rig.hold(25).force.z;
        let after = rig.hold(150).force.z;
        assert!((after / before - 1.0).abs() < 0.02, "wedge {before:.1} → {after:.1} N in 0.3 s");
        assert!(before > 15.0, "it is wedged at {before:.1} N");
    }
}

#[test]
fn a_soft_sensor_jams_at_the_two_point_depth_of_its_true_tilt() {
    for clearance in [2e-4, 5e-5] {
        let tilt = [0.0, 1f64.to_radians(), 0.0];
        let mut rig = Rig::new(&soft(clearance, 0.0), [0.0, 0.0, 0.002], tilt);
        rig.push_down(10.0, 0.020);
        let (depth, exact) = (rig.depth(), two_point_depth(clearance, rig.true_tilt()));
        assert!((depth / exact - 1.0).abs() < 0.05, "{depth:.5} against {exact:.5}");
    }
}

#[test]
fn with_a_millimetre_of_play_a_degree_of_tilt_does_not_jam() {
    // The form puts the jam 58 mm deep, below the board.
    assert!(two_point_depth(1e-3, 1f64.to_radians()) > 0.025);
    let tilt = [0.0, 1f64.to_radians(), 0.0];
    let mut rig = Rig::new(&config(1e-3, 0.0), [0.0, 0.0, 0.002], tilt);
    assert!(rig.push_down(20.0, 0.020).force.z < 20.0);
    assert!((rig.depth() - 0.020).abs() < 2e-4);
}

#[test]
fn lateral_play_and_stiffness_are_those_of_the_fit() {
    // At the mouth with the tip 10 mm deep the lever is 0.14 m: 1/(1/K + 0.14²/K_r).
    for (soft_sensor, stiffness) in [(false, [1e5, 1000.0]), (true, [1e4, 100.0])] {
        let stiffness = 1.0 / (1.0 / stiffness[0] + 0.14f64.powi(2) / stiffness[1]);
        for clearance in CLEARANCES {
            let config = if soft_sensor { soft(clearance, 0.0) } else { config(clearance, 0.0) };
            let mut rig = Rig::new(&config, [0.0, 0.0, 0.002], [0.0; 3]);
            rig.push_down(20.0, 0.010);
            let (centre, mut peak) = (rig.tip, 0.0f64);
            for tick in 0..2000 {
                let phase = std::f64::consts::TAU * 2.0 * f64::from(tick) * DT;
                let aside = Vector3::new(0.15e-3 * phase.sin(), 0.0, 0.0);
                let wrench = rig.to(centre + aside, rig.tilt);
                if tick > 100 {
                    peak = peak.max(wrench.force.x.abs());
                }
            }
            let expected = (stiffness * (0.15e-3 - clearance / 2.0)).max(0.0);
            // The damper adds D·v, 0.1 N at most, in front of the wall.
            let error = (peak - expected).abs();
            assert!(
                error < 0.02 * expected + 0.25,
                "{clearance}: {peak:.2} against {expected:.2} N"
            );
        }
    }
}

#[test]
fn a_chamfer_guides_a_peg_that_a_sharp_mouth_stops() {
    // On 45° the peg slides while μ < 1; 1 mm beside a fit with half a millimetre per side.
    let push = |chamfer| {
        let mut config = soft(1e-3, chamfer);
        config.friction = 0.1;
        let mut rig = Rig::new(&config, [1e-3, 0.0, 0.002], [0.0; 3]);
        rig.push_down(15.0, 0.010);
        (rig.depth(), rig.hold(100))
    };
    let (sharp, _) = push(0.0);
    assert!(sharp < 1e-4, "a sharp mouth let it in by {:.1} mm", sharp * 1e3);
    let (depth, wrench) = push(1e-3);
    assert!(depth > 0.009, "the chamfer stopped it at {:.1} mm", depth * 1e3);
    // The wall pushes the soft lateral spring back by what is left of the offset.
    let stiffness = 1.0 / (1.0 / 1e4 + 0.14f64.powi(2) / 100.0);
    let expected = -stiffness * 0.5e-3;
    assert!(
        (wrench.force.x / expected - 1.0).abs() < 0.05,
        "{:.2} against {expected:.2} N",
        wrench.force.x
    );
}

#[test]
fn on_the_chamfer_the_force_leans_by_the_friction_angle() {
    // A peg edge that slides down 45°: force angle from vertical = 45° − atan μ.
    let mut config = config(1e-3, 2e-3);
    config.friction = 0.2;
    let mut rig = Rig::new(&config, [1.5e-3, 0.0, 0.004], [0.0; 3]);
    let (mut seen, mut worst) = (0, 0.0f64);
    let expected = (std::f64::consts::FRAC_PI_4 - 0.2f64.atan()).tan();
    while rig.tip.z > -1.8e-3 {
        let wrench = rig.slide([0.0, 0.0, -0.002]);
        // From a tenth of a millimetre after first touch (at z = −1 mm).
        if rig.tip.z < -1.15e-3 && rig.tip.z > -1.4e-3 {
            worst = worst.max((-wrench.force.x / wrench.force.z / expected - 1.0).abs());
            seen += 1;
        }
    }
    assert!(seen > 20 && worst < 0.02, "{seen} ticks, off by {:.1} %", worst * 100.0);
}

#[test]
fn a_hexagonal_peg_enters_freely_and_jams_like_the_others() {
    let tilt = 1f64.to_radians();
    for clearance in CLEARANCES {
        let mut config = config(clearance, 0.0);
        config.peg.shape = palpate_sim::PegShape::Hexagonal;
        let mut rig = Rig::new(&config, [0.0, 0.0, 0.002], [0.0; 3]);
        assert!(
            rig.push_down(20.0, 0.020).force.z < 3.0,
            "{clearance}: more than the tool's inertia"
        );
        assert!((rig.depth() - 0.020).abs() < 1e-4);
        if clearance < 5e-4 {
            let mut rig = Rig::new(&config, [0.0, 0.0, 0.002], [0.0, tilt, 0.0]);
            rig.push_down(20.0, 0.020);
            let exact = two_point_depth(clearance, rig.true_tilt());
            assert!(
                (rig.depth() / exact - 1.0).abs() < 0.05,
                "{:.5} against {exact:.5}",
                rig.depth()
            );
        }
    }
}
