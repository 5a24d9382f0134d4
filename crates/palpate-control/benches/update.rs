//! Cost of one 500 Hz tick of each law, and of the policy step that changes its gains.
#![expect(clippy::unwrap_used, reason = "what cannot go on fails")]

use std::hint::black_box;

use criterion::{Criterion, criterion_group, criterion_main};
use palpate_control::{
    ActionMap, ControlConfig, ControlInput, Controller, ForceController, LowPass, PolicyModel,
};
use palpate_spatial::{Twist, Vector6, Wrench};

#[derive(Debug)]
struct Subject {
    map: ActionMap,
    law: Controller,
}

fn subject(model: &str) -> Subject {
    let control: ControlConfig =
        toml::from_str(include_str!("../tests/data/control.toml")).unwrap();
    let path = format!("{}/../../assets/policies/{model}.toml", env!("CARGO_MANIFEST_DIR"));
    let model: PolicyModel = toml::from_str(&std::fs::read_to_string(path).unwrap()).unwrap();
    Subject {
        map: ActionMap::new(&model).unwrap(),
        law: Controller::new(&control, model.law).unwrap(),
    }
}

fn ticks(c: &mut Criterion) {
    let input = ControlInput {
        pose_error: Vector6::repeat(1e-3),
        wrench: Wrench::from(Vector6::repeat(2.0)),
        action: Twist::from(Vector6::repeat(0.01)),
    };
    for name in ["p-24", "a-18"] {
        let Subject { map, mut law } = subject(name);
        let action = vec![0.3; map.dim()];
        law.set_gains(&map.decode(&action).unwrap().gains).unwrap();
        c.bench_function(&format!("{name}: tick"), |b| {
            b.iter(|| law.update(black_box(&input), 0.002));
        });
        c.bench_function(&format!("{name}: decode, set gains, tick"), |b| {
            b.iter(|| {
                law.set_gains(&map.decode(black_box(&action)).unwrap().gains).unwrap();
                law.update(black_box(&input), 0.002)
            });
        });
    }
    let mut filter = LowPass::new(50.0, 500.0);
    c.bench_function("force filter", |b| b.iter(|| filter.update(black_box(&input.wrench))));
}

criterion_group!(benches, ticks);
criterion_main!(benches);
