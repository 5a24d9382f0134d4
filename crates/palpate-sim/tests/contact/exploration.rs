//! Twenty thousand ticks of random exploration in the tightest fit: nothing spikes, nothing sinks in.

use palpate_spatial::{Vector3, Wrench};
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;

use crate::penetration::sampled_depth;
use crate::rig::{DT, Rig, config, ring, round, soft, sprung};
use palpate_sim::SimConfig;

/// Wanders about the mouth: a new goal every 25 ticks (±0.6 mm, 1 mm above to 12 mm deep, ±0.012 rad),
/// 20 mm/s and 0.2 rad/s, upwards above 30 N.
pub(crate) struct Wanderer {
    pub(crate) rig: Rig,
    rng: ChaCha8Rng,
    goal: (Vector3, Vector3),
    last: Wrench,
    tick: u64,
}

impl Wanderer {
    pub(crate) fn new(config: &SimConfig, seed: u64) -> Self {
        let rig = Rig::new(config, [0.0, 0.0, 0.002], [0.0; 3]);
        let goal = (rig.tip, rig.tilt);
        Self { rig, rng: ChaCha8Rng::seed_from_u64(seed), goal, last: Wrench::zero(), tick: 0 }
    }

    pub(crate) fn step(&mut self) -> Wrench {
        if self.tick.is_multiple_of(25) {
            let mut within = |low: f64, high: f64| self.rng.random_range(low..high);
            self.goal = (
                Vector3::new(within(-6e-4, 6e-4), within(-6e-4, 6e-4), within(-0.012, 0.001)),
                Vector3::new(within(-0.012, 0.012), within(-0.012, 0.012), 0.0),
            );
        }
        if self.last.force.norm() > 30.0 {
            self.goal.0.z = self.rig.tip.z + 0.001;
        }
        self.tick += 1;
        let tip = towards(self.rig.tip, self.goal.0, 0.020 * DT);
        let tilt = towards(self.rig.tilt, self.goal.1, 0.2 * DT);
        self.last = self.rig.to(tip, tilt);
        self.last
    }
}

fn towards(from: Vector3, to: Vector3, most: f64) -> Vector3 {
    let way = to - from;
    from + way * (most / way.norm().max(most))
}

/// Bounds of the force, of its step in a tick, N, and of the penetration, m.
type Bounds = (f64, f64, f64);

/// Explores for 20 000 ticks; `check` measures the penetration another way.
#[expect(clippy::print_stdout, reason = "the figures of the results page")]
fn explore(label: &str, config: &SimConfig, bounds: Bounds, check: impl Fn(&Wanderer) -> f64) {
    let mut wanderer = Wanderer::new(config, 1);
    let mut last = Vector3::zeros();
    let (mut peak, mut jump, mut deepest, mut mismatch) = (0.0f64, 0.0f64, 0.0f64, 0.0f64);
    let (mut touching, mut inside) = (0, 0);
    for _ in 0..20_000 {
        let force = wanderer.step().force;
        jump = jump.max((force - last).norm());
        peak = peak.max(force.norm());
        touching += u32::from(force.norm() > 3.0);
        inside += u32::from(wanderer.rig.depth() > 0.002);
        last = force;
        let exact = wanderer.rig.world.penetration();
        deepest = deepest.max(exact);
        mismatch = mismatch.max((check(&wanderer) - exact).abs());
    }
    println!("{label}: peak {peak:.1} N, jump {jump:.1} N, {:.1} µm", deepest * 1e6);
    assert!(touching > 2000 && inside > 2000, "{touching} ticks in contact, {inside} inside");
    assert!(peak < bounds.0, "{label}: peak {peak:.1} N");
    assert!(jump < bounds.1, "{label}: jump {jump:.1} N in a tick");
    assert!(deepest < bounds.2, "{label}: penetration {:.1} µm", deepest * 1e6);
    assert!(mismatch < 5e-6, "{label}: two measures differ by {:.1} µm", mismatch * 1e6);
}

/// On the stiff rig 12 mrad of tilt clamp the peg with up to a thousand newtons a side. The peaks are pulls on a
/// peg so wedged, the steps its letting go, and the penetration is what that load does to one contact point.
const CLAMPED: Bounds = (150.0, 45.0, 70e-6);
/// On the sensor that training uses: a tick at 20 mm/s is 40 µm, which is what an edge can meet an edge with.
const SOFT: Bounds = (40.0, 20.0, 40e-6);

#[test]
fn random_exploration_stays_bounded() {
    for chamfer in [0.0, 1e-3] {
        let config = config(5e-5, chamfer);
        explore(&format!("square, chamfer {chamfer}"), &config, CLAMPED, |wanderer| {
            sampled_depth(&wanderer.rig.world.tip_pose(), &config)
        });
    }
}

#[test]
fn random_exploration_of_round_parts_stays_bounded() {
    for (label, config) in [
        ("peg", round(5e-5, 0.0)),
        ("peg, chamfer", round(5e-5, 1e-3)),
        ("ring", ring(5e-5, 0.0)),
        ("ring, chamfer", ring(2e-4, 1e-3)),
        ("sprung", sprung(5e-5, 1e-3)),
    ] {
        explore(label, &config, CLAMPED, |wanderer| wanderer.rig.world.penetration());
    }
}

#[test]
fn random_exploration_on_the_training_sensor_stays_bounded() {
    for (label, config) in [
        ("soft square", soft(5e-5, 1e-3)),
        ("soft round", SimConfig { peg: round(5e-5, 1e-3).peg, ..soft(5e-5, 1e-3) }),
    ] {
        explore(label, &config, SOFT, |wanderer| wanderer.rig.world.penetration());
    }
}
