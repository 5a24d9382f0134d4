//! The update against PyTorch's and the fused operations against the plain ones.
//!
//! `tests/data/make_torch.py` wrote the fixture: twenty updates in float64 with PyTorch's own networks,
//! densities and Adam.

use std::path::Path;

use candle_core::{Device, Tensor};

use crate::config::{Ops, SacConfig, TargetEntropy};
use crate::learner::{Batch, Learner};
use crate::rng::{Streams, fill_normal};
use crate::tensors::Reader;

const OBSERVATION: usize = 5;
const ACTION: usize = 3;
const BATCH: usize = 8;
const UPDATES: usize = 20;

fn config(ops: Ops, layer_norm: bool) -> SacConfig {
    SacConfig {
        ops,
        hidden: vec![16, 16],
        critic_layer_norm: layer_norm,
        tau: 0.05,
        actor_learning_rate: 1e-3,
        critic_learning_rate: 1e-3,
        alpha_learning_rate: 1e-3,
        initial_alpha: 0.1,
        target_entropy: TargetEntropy::Nats(-1.5),
        ..SacConfig::default()
    }
}

/// Names and flat weights of everything that an update changes.
fn weights(learner: &Learner) -> Vec<(String, Vec<f32>)> {
    let mut all = vec![("actor".to_owned(), learner.actor.parameters().unwrap())];
    for i in 0..2 {
        all.push((format!("critic_{i}"), learner.critics[i].parameters().unwrap()));
        all.push((format!("target_{i}"), learner.targets[i].parameters().unwrap()));
    }
    all.push(("log_alpha".into(), learner.log_alpha.as_tensor().to_vec1().unwrap()));
    all
}

/// Largest difference over the largest weight.
fn difference(a: &[f32], b: &[f32]) -> f32 {
    assert_eq!(a.len(), b.len());
    let scale = b.iter().fold(0f32, |m, x| m.max(x.abs()));
    a.iter().zip(b).fold(0f32, |m, (x, y)| m.max((x - y).abs())) / scale
}

#[test]
fn twenty_updates_are_those_of_pytorch() {
    let data = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/data/torch.safetensors");
    let reader = Reader::open(&data).unwrap();
    let column = |name: &str, width: usize| {
        let shape: &[usize] = if width == 1 { &[UPDATES, BATCH] } else { &[UPDATES, BATCH, width] };
        reader.f32(name, shape).unwrap()
    };
    let columns = [
        ("observation", OBSERVATION),
        ("action", ACTION),
        ("reward", 1),
        ("discount", 1),
        ("bootstrap", OBSERVATION),
        ("target_noise", ACTION),
        ("actor_noise", ACTION),
    ]
    .map(|(name, width)| (column(name, width), width));
    let batch = |update: usize| {
        let mut tensors = columns.iter().map(|(values, width)| {
            let rows = &values[update * BATCH * width..][..BATCH * width];
            if *width == 1 {
                Tensor::from_slice(rows, BATCH, &Device::Cpu).unwrap()
            } else {
                Tensor::from_slice(rows, (BATCH, *width), &Device::Cpu).unwrap()
            }
        });
        let mut next = || tensors.next().unwrap();
        Batch {
            observation: next(),
            action: next(),
            reward: next(),
            discount: next(),
            bootstrap_observation: next(),
            target_noise: next(),
            actor_noise: next(),
        }
    };
    for (layer_norm, prefix) in [(false, "plain"), (true, "norm")] {
        for ops in [Ops::Fused, Ops::Plain] {
            let streams = &mut Streams::new(1);
            let config = config(ops, layer_norm);
            let mut learner = Learner::new(&config, OBSERVATION, ACTION, streams).unwrap();
            let first = |name: &str| {
                let rows = reader.rows(&format!("{prefix}.first.{name}")).unwrap();
                reader.f32(&format!("{prefix}.first.{name}"), &[rows]).unwrap()
            };
            learner.actor.assign(first("actor")).unwrap();
            for i in 0..2 {
                learner.critics[i].assign(first(&format!("critic_{i}"))).unwrap();
                learner.targets[i].assign(first(&format!("critic_{i}"))).unwrap();
            }
            let start = learner.actor.parameters().unwrap();
            let end = reader.f32(&format!("{prefix}.last.actor"), &[start.len()]).unwrap();
            let moved = difference(&start, &end);
            assert!(moved > 1e-2, "twenty updates move the actor by {moved} only");
            for update in 0..UPDATES {
                learner.update(&batch(update), update as u64).unwrap();
            }
            for (name, ours) in weights(&learner) {
                let theirs = reader.f32(&format!("{prefix}.last.{name}"), &[ours.len()]).unwrap();
                let apart = difference(&ours, &theirs);
                assert!(apart < 1e-4, "{prefix}, {ops:?}, {name}: {apart:.1e} apart");
            }
        }
    }
}

/// A learner of the default sizes fed with seeded noise.
fn learner_after(ops: Ops, updates: u64) -> Vec<(String, Vec<f32>)> {
    let (o, a, rows) = (18, 14, 64);
    let config = SacConfig { ops, hidden: vec![64, 64], ..SacConfig::default() };
    let streams = &mut Streams::new(5);
    let mut learner = Learner::new(&config, o, a, streams).unwrap();
    let mut draw = |width: usize, squash: bool| {
        let mut values = vec![0.0; rows * width];
        fill_normal(&mut streams.update, &mut values);
        if squash {
            values.iter_mut().for_each(|x| *x = x.tanh());
        }
        values
    };
    for update in 0..updates {
        let mut matrix = |width: usize, squash: bool| {
            Tensor::from_vec(draw(width, squash), (rows, width), &Device::Cpu).unwrap()
        };
        let batch = Batch {
            observation: matrix(o, false),
            action: matrix(a, true),
            reward: matrix(1, false).squeeze(1).unwrap(),
            discount: Tensor::from_vec(vec![0.9; rows], rows, &Device::Cpu).unwrap(),
            bootstrap_observation: matrix(o, false),
            target_noise: matrix(a, false),
            actor_noise: matrix(a, false),
        };
        learner.update(&batch, update).unwrap();
    }
    weights(&learner)
}

#[test]
fn fused_and_plain_operations_stay_together_over_a_thousand_updates() {
    let (fused, plain) = (learner_after(Ops::Fused, 1000), learner_after(Ops::Plain, 1000));
    for ((name, fused), (_, plain)) in fused.iter().zip(&plain) {
        let apart = difference(fused, plain);
        println!("{name}: {apart:.1e}");
        assert!(apart < 2e-2, "{name}: {apart:.1e} apart");
    }
}
