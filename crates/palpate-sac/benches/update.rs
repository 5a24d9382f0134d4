//! Time of one update and of one decision, at the size of the peg-insertion task.
//!
//! Observation 18, action 14, two hidden layers (the preset's 128 units, and 256), LayerNorm critics; everything an
//! update needs is inside: replay, returns, noise, four networks forward, three backward, Adam, targets.
//! One thread: set `RAYON_NUM_THREADS=1 CANDLE_NUM_THREADS=1` for the plain operations to match.

#![expect(clippy::unwrap_used, reason = "what cannot go on fails")]

use std::hint::black_box;

use criterion::{Criterion, criterion_group, criterion_main};
use palpate_sac::{Mode, Ops, Sac, SacConfig, Transition};
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;

const OBSERVATION: usize = 18;
const ACTION: usize = 14;

/// Units of a layer, as many as the batch has rows.
const SIZES: [usize; 2] = [128, 256];

fn agent(ops: Ops, size: usize) -> Sac {
    let config = SacConfig {
        ops,
        threads: 1,
        hidden: vec![size; 2],
        batch_size: size,
        updates_per_step: 1,
        replay_capacity: 20_000,
        warmup_steps: u64::MAX,
        ..SacConfig::default()
    };
    let mut agent = Sac::new(&config, OBSERVATION, ACTION, 1).unwrap();
    let mut rng = ChaCha8Rng::seed_from_u64(2);
    let (mut observation, mut action) = ([0.0; OBSERVATION], [0.0; ACTION]);
    for step in 0..20_000 {
        let next_observation = std::array::from_fn(|_| rng.random_range(-1.0..1.0));
        agent.act(&observation, Mode::Explore, &mut action).unwrap();
        let transition = Transition {
            observation: &observation,
            action: &action,
            executed: &action,
            reward: rng.random_range(-1.0..1.0),
            next_observation: &next_observation,
            terminal: false,
            episode_end: step % 150 == 149,
        };
        agent.observe(&transition).unwrap();
        observation = next_observation;
    }
    agent
}

fn update(c: &mut Criterion) {
    let mut group = c.benchmark_group("update");
    for size in SIZES {
        for ops in [Ops::Fused, Ops::Plain] {
            let mut agent = agent(ops, size);
            let name = format!("{ops:?}/{size}").to_lowercase();
            group.bench_function(name, |b| b.iter(|| agent.update().unwrap()));
        }
    }
}

fn decision(c: &mut Criterion) {
    for size in SIZES {
        let mut agent = agent(Ops::Fused, size);
        for _ in 0..200 {
            agent.update().unwrap();
        }
        let mut policy = agent.policy();
        let mut rng = ChaCha8Rng::seed_from_u64(3);
        let observation = [0.3; OBSERVATION];
        let mut action = [0.0; ACTION];
        c.bench_function(&format!("policy/mean/{size}"), |b| {
            b.iter(|| policy.mean(black_box(&observation), &mut action));
        });
        c.bench_function(&format!("policy/sample/{size}"), |b| {
            b.iter(|| policy.sample(black_box(&observation), &mut rng, &mut action));
        });
    }
}

criterion_group!(benches, update, decision);
criterion_main!(benches);
