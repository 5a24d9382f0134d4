//! The 500 Hz path takes nothing from the heap.

mod sets;

use std::hint::black_box;

use allocation_counter::measure;
use palpate_kinematics::{Frame, IkOptions, SerialChain, UrModel};
use palpate_spatial::Pose;

fn allocates(work: impl FnMut()) -> u64 {
    measure(work).count_total
}

fn chain_allocates<const N: usize>(chain: &SerialChain<N>) -> u64 {
    let rng = &mut sets::stream(60);
    let options = IkOptions { min_singular_value: 1e-9, period: Some(0.1), ..IkOptions::default() };
    (0..50)
        .map(|_| {
            let goal = sets::configuration(chain, rng) * 0.9;
            let seed = goal * 0.999;
            allocates(|| {
                let kinematics = chain.kinematics(black_box(&goal));
                black_box((kinematics.pose(), chain.forward(&seed)));
                black_box((
                    kinematics.jacobian(Frame::BaseAligned),
                    kinematics.jacobian(Frame::Body),
                ));
                black_box((kinematics.smallest_singular_value(), kinematics.manipulability()));
                black_box(chain.solve_near(&kinematics.pose(), &seed, &options)).ok();
                // Refusals are answers too.
                black_box(chain.solve_near(&Pose::translation(9.0, 0.0, 0.0), &seed, &options))
                    .ok();
                black_box(chain.solve_near(&Pose::translation(0.0, 0.0, 0.01), &seed, &options))
                    .ok();
            })
        })
        .sum()
}

#[test]
fn the_counter_counts() {
    assert_eq!(allocates(|| drop(black_box(Box::new(3)))), 1);
}

#[test]
fn chains_of_six_and_seven_joints_do_not_allocate() {
    assert_eq!(chain_allocates(&sets::ur(UrModel::Ur3e)), 0);
    assert_eq!(chain_allocates(&sets::odd_arm()), 0);
}

#[test]
fn cold_starts_do_not_allocate() {
    let chain = sets::ur(UrModel::Ur3e);
    let arm = sets::solver(chain.clone());
    let cases = sets::random(&chain, 200, &mut sets::stream(61));
    let mut cold = 0;
    for case in cases {
        let target = chain.forward(&case.goal);
        cold += u32::from(chain.solve_near(&target, &case.seed, &IkOptions::default()).is_err());
        let count = allocates(|| {
            black_box(arm.solve_near(black_box(&target), &case.seed, &IkOptions::default()))
                .unwrap();
            black_box(arm.branches(&target, 0.0));
        });
        assert_eq!(count, 0);
    }
    assert!(cold > 10, "only {cold} cold starts");
}
