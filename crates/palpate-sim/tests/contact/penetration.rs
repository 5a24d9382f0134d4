//! The closed-form penetration against brute force.

use palpate_sim::SimConfig;
use palpate_spatial::Pose;
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;

use crate::rig::{config, flange};

/// Depth of the deepest of many points on the peg's edges in the board's material, m.
pub(crate) fn sampled_depth(hole_T_tip: &Pose, config: &SimConfig) -> f64 {
    let (half, length) = (config.peg.width / 2.0, config.peg.length);
    let (hole, chamfer) = (config.hole_half_width(), config.hole.chamfer);
    let depth_at = |x: f64, y: f64, z: f64| {
        let p = (hole_T_tip * nalgebra::Point3::new(x, y, z)).coords;
        let across = p.x.abs().max(p.y.abs());
        let wall = across - hole;
        let ramp = (wall - chamfer - p.z) / 2f64.sqrt();
        wall.min(ramp).min(-p.z).min(p.z + config.hole.depth)
    };
    const SAMPLES: u32 = 200;
    let mut deepest = 0.0f64;
    for i in 0..=SAMPLES {
        let t = f64::from(i) / f64::from(SAMPLES);
        for (a, b) in [(1.0, 1.0), (1.0, -1.0), (-1.0, 1.0), (-1.0, -1.0)] {
            // Only the lowest millimetres can be near the mouth from inside; the rest is spread out.
            deepest = deepest.max(depth_at(a * half, b * half, -t * t * length));
            deepest = deepest.max(depth_at(a * half, (2.0 * t - 1.0) * half * b, 0.0));
            deepest = deepest.max(depth_at((2.0 * t - 1.0) * half * b, a * half, 0.0));
        }
    }
    deepest
}

#[test]
fn the_closed_form_agrees_with_points_on_the_edges() {
    let mut rng = ChaCha8Rng::seed_from_u64(3);
    let (mut worst, mut overlapping) = (0.0f64, 0);
    for _ in 0..3000 {
        let mut within = |half: f64| rng.random_range(-half..half);
        let config = config(2e-4, if within(1.0) > 0.0 { 1e-3 } else { 0.0 });
        let tip = [within(1e-3), within(1e-3), within(0.010)].into();
        let tilt = [within(0.03), within(0.03), within(0.03)].into();
        let hole_T_tip = flange(&tip, &tilt, 0.0);
        let exact = config.overlap(&hole_T_tip);
        let sampled = sampled_depth(&hole_T_tip, &config);
        overlapping += u32::from(exact > 0.0);
        assert!(sampled <= exact + 1e-12, "points are {sampled:.6} deep, the form says {exact:.6}");
        worst = worst.max(exact - sampled);
    }
    assert!(overlapping > 500 && overlapping < 2900, "{overlapping} of 3000 overlap");
    assert!(worst < 2e-4, "off by {:.1} µm", worst * 1e6);
}
