//! Cost of one tick of the shield, geometry included.
#![expect(clippy::unwrap_used, reason = "our own limits load")]

#[path = "../tests/support/mod.rs"]
mod support;

use std::time::{Duration, Instant};

use criterion::{Criterion, criterion_group, criterion_main};
use palpate_safety::shield::Shield;
use palpate_spatial::Wrench;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use support::adversary::{Adversary, KINDS};
use support::{DT, chain, home, sample, tool0_T_tool};

fn tick(c: &mut Criterion) {
    let mut group = c.benchmark_group("shield");
    let (safety, chain) = (support::preset(), chain());
    for kind in KINDS {
        let rng = &mut ChaCha8Rng::seed_from_u64(1);
        let mut shield = Shield::new(&safety, chain.clone(), &tool0_T_tool(), DT).unwrap();
        shield.begin_episode();
        let (home, mut time) = (home(), 0.0);
        let mut adversary = Adversary::new(kind, &home, rng);
        group.bench_function(format!("{kind:?}"), |b| {
            b.iter_custom(|iterations| {
                let mut spent = Duration::ZERO;
                for _ in 0..iterations {
                    time += DT;
                    let q = shield.motion().map_or(home, |m| m.q);
                    let proposal = adversary.next(&chain, &q, &safety.joint_velocity_max, rng);
                    let m = sample(&chain, time, &q, &q, Wrench::zero());
                    let start = Instant::now();
                    std::hint::black_box(shield.tick(&m, &proposal));
                    spent += start.elapsed();
                }
                spent
            });
        });
    }
    group.finish();
}

criterion_group!(benches, tick);
criterion_main!(benches);
