//! The 500 Hz path takes nothing from the heap.

mod support;

use std::hint::black_box;

use allocation_counter::measure;
use palpate_control::{ActionMap, Controller, ForceController, LowPass};
use support::*;

#[test]
fn the_counter_counts() {
    assert_eq!(measure(|| drop(black_box(Box::new(3)))).count_total, 1);
}

#[test]
fn ticks_gain_changes_and_refusals_do_not_allocate() {
    for (name, dim) in MODELS {
        let model = model(name);
        let map = ActionMap::new(&model).unwrap();
        for rule in RULES {
            let mut config = control();
            config.parallel.derivative_rule = rule;
            config.admittance.derivative_rule = rule;
            let mut law = Controller::new(&config, model.law).unwrap();
            let mut filter = LowPass::new(50.0, 500.0);
            let mut action = vec![0.0; dim];
            let count = measure(|| {
                for tick in 0..100 {
                    action.fill(f64::from(tick) / 50.0 - 1.0);
                    let decoded = map.decode(black_box(&action)).unwrap();
                    law.set_gains(&decoded.gains).unwrap();
                    let mut input = input(1e-3, f64::from(tick), 0.01);
                    input.wrench = filter.update(&input.wrench);
                    black_box(law.update(&input, DT));
                    if tick % 3 == 0 {
                        law.command_refused();
                    }
                }
                law.reset();
            });
            assert_eq!(count.count_total, 0, "{name}, {rule:?}");
        }
    }
}
