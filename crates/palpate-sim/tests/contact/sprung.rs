//! A receptacle that gives way.

use palpate_spatial::Vector3;

use crate::rig::{CLEARANCES, DT, Rig, round, sprung};

#[test]
fn a_press_has_the_stiffness_of_the_springs_in_series() {
    let mut config = sprung(2e-4, 0.0);
    // So stiff in rotation that pressing beside the middle turns it by nothing.
    let receptacle = config.receptacle.as_mut().unwrap();
    receptacle.inertia = [2e-2; 3];
    receptacle.compliance.angular_stiffness = 5e4;
    receptacle.compliance.angular_damping = 60.0;
    let mut rig = Rig::new(&config, [0.05, 0.0, 0.001], [0.0; 3]);
    rig.push_down(20.0, 1.0);
    let settled = rig.hold(600);
    let series = 1.0 / (1.0 / 1e5 + 1.0 / 5e4 + 0.05f64.powi(2) / 5e4);
    let measured = settled.force.z / -rig.tip.z;
    assert!((measured / series - 1.0).abs() < 0.02, "{measured:.0} against {series:.0} N/m");
    let given = -rig.world.receptacle_pose().translation.z;
    assert!((given / (settled.force.z / 5e4) - 1.0).abs() < 0.02, "{:.2} µm", given * 1e6);
}

#[test]
fn an_aligned_peg_moves_nothing() {
    for clearance in CLEARANCES {
        let mut rig = Rig::new(&sprung(clearance, 1e-3), [0.0, 0.0, 0.004], [0.0; 3]);
        let mut free = Rig::new(&sprung(clearance, 1e-3), [0.05, 0.0, 0.050], [0.0; 3]);
        while rig.tip.z > -0.020 {
            let felt = rig.slide([0.0, 0.0, -0.010]).vector();
            let contact = (felt - free.slide([0.0, 0.0, -0.010]).vector()).amax();
            assert!(contact < 1e-6, "{clearance}: {contact:.1e} N");
        }
        assert!(rig.world.receptacle_pose().translation.vector.norm() < 1e-9);
    }
}

#[test]
fn a_peg_that_enters_beside_the_middle_pushes_the_receptacle_aside() {
    // 10 mm deep and 0.1 mm off: peg and receptacle share the offset as their lateral stiffnesses say.
    let mut rig = Rig::new(&sprung(5e-5, 0.0), [0.0, 0.0, 0.002], [0.0; 3]);
    rig.push_down(20.0, 0.010);
    for _ in 0..250 {
        rig.slide([0.1e-3 / (250.0 * DT), 0.0, 0.0]);
    }
    let felt = rig.hold(300);
    let (tool, receptacle) = (1.0 / (1.0 / 1e5 + 0.14f64.powi(2) / 1000.0), 5e4);
    let series = 1.0 / (1.0 / tool + 1.0 / receptacle);
    let expected = -series * (0.1e-3 - 25e-6);
    assert!(
        (felt.force.x / expected - 1.0).abs() < 0.05,
        "{:.3} against {expected:.3} N",
        felt.force.x
    );
    let moved = rig.world.receptacle_pose().translation.x;
    assert!((moved / (-expected / receptacle) - 1.0).abs() < 0.05, "{:.1} µm", moved * 1e6);
}

#[test]
fn a_compliant_receptacle_lets_a_tilted_peg_deeper() {
    let depth = |config| {
        let mut rig = Rig::new(&config, [0.0, 0.0, 0.004], [0.0, 1f64.to_radians(), 0.0]);
        rig.push_down(20.0, 0.020);
        let depth = rig.depth();
        let wedged = rig.hold(25).force;
        let later: Vector3 = rig.hold(150).force;
        assert!((later.z / wedged.z - 1.0).abs() < 0.02, "{wedged:?} → {later:?}");
        depth
    };
    let (rigid, soft) = (depth(round(5e-5, 0.0)), depth(sprung(5e-5, 0.0)));
    assert!(soft > 1.05 * rigid, "{soft:.5} against {rigid:.5}");
}
