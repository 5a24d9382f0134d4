//! Twenty thousand ticks of random exploration in the tightest fit: nothing spikes, nothing sinks in.

use palpate_spatial::{Vector3, Wrench};
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;

use crate::penetration::sampled_depth;
use crate::rig::{DT, Rig, config};
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

#[test]
fn random_exploration_stays_bounded() {
    for chamfer in [0.0, 1e-3] {
        let config = config(5e-5, chamfer);
        let mut wanderer = Wanderer::new(&config, 1);
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
            let sampled = sampled_depth(&wanderer.rig.world.tip_pose(), &config);
            let exact = wanderer.rig.world.penetration();
            deepest = deepest.max(sampled);
            mismatch = mismatch.max((sampled - exact).abs());
        }
        println!("chamfer {chamfer}: peak {peak:.1} N, jump {jump:.1} N, {:.1} µm", deepest * 1e6);
        assert!(touching > 2000 && inside > 2000, "{touching} ticks in contact, {inside} inside");
        // The peaks are pulls on a wedged peg: 2 mrad of tilt in a 100 times stiffer sensor clamp it with
        // hundreds of newtons, and it lets go within a few ticks.
        assert!(peak < 150.0, "peak {peak:.1} N");
        assert!(jump < 50.0, "jump {jump:.1} N in a tick");
        assert!(deepest < 50e-6, "penetration {:.1} µm", deepest * 1e6);
        assert!(mismatch < 5e-6, "two ways of measuring it differ by {:.1} µm", mismatch * 1e6);
    }
}
