//! FK, Jacobian and IK of a UR3e, with the crate `k` as a peer in the same run.
//!
//! `cargo bench -p palpate-kinematics`; figures in `docs/results/kinematics.md`.
#![expect(clippy::unwrap_used, reason = "a benchmark of our own files")]

use std::hint::black_box;

use criterion::{Criterion, criterion_group, criterion_main};
use k::InverseKinematicsSolver;
use palpate_kinematics::{Frame, IkOptions, SerialChain, UrAnalytic, UrModel, UrSolver};
use palpate_spatial::JointVector;

const UR3E: &str = include_str!("../../../assets/robots/ur3e.urdf");
const Q: [f64; 6] = [0.3, -1.2, 1.9, -2.0, -1.6, 0.4];
/// About 3 mm at the tool.
const STEP: [f64; 6] = [0.004, -0.003, 0.005, 0.002, -0.004, 0.006];

fn ours(c: &mut Criterion) {
    let chain = SerialChain::<6>::from_urdf_str(UR3E, "base_link", "tool0").unwrap();
    let q = JointVector::from(Q);
    c.bench_function("fk/palpate", |b| {
        b.iter(|| chain.forward(black_box(&q)));
    });
    c.bench_function("fk_jacobian/palpate", |b| {
        b.iter(|| {
            let kinematics = chain.kinematics(black_box(&q));
            (kinematics.pose(), kinematics.jacobian(Frame::BaseAligned))
        });
    });
    let options = IkOptions::default();
    let target = chain.forward(&(q + JointVector::from(STEP)));
    c.bench_function("ik_track/palpate", |b| {
        b.iter(|| chain.solve_near(black_box(&target), &q, &options));
    });
    let gated = IkOptions { min_singular_value: 1e-3, ..options };
    c.bench_function("ik_track/palpate_with_sigma_min", |b| {
        b.iter(|| chain.solve_near(black_box(&target), &q, &gated));
    });
    let arm = UrSolver::new(chain.clone(), UrModel::Ur3e).unwrap();
    let far = JointVector::from([-2.0, -2.0, -1.0, 1.0, 1.5, 2.0]);
    c.bench_function("ik_far/palpate", |b| {
        b.iter(|| arm.solve_near(black_box(&target), &far, &options));
    });
    let analytic = UrAnalytic::new(UrModel::Ur3e);
    c.bench_function("ik_all_8/palpate", |b| {
        b.iter(|| analytic.solve_all(black_box(&target), 0.0));
    });
    let kinematics = chain.kinematics(&q);
    c.bench_function("sigma_min/palpate", |b| {
        b.iter(|| black_box(&kinematics).smallest_singular_value());
    });
}

fn peer(c: &mut Criterion) {
    let urdf = concat!(env!("CARGO_MANIFEST_DIR"), "/../../assets/robots/ur3e.urdf");
    let robot = k::Chain::<f64>::from_urdf_file(urdf).unwrap();
    let arm = k::SerialChain::from_end(robot.find("wrist_3-tool0").unwrap());
    arm.set_joint_positions_unchecked(&Q);
    let base_T_tip =
        SerialChain::<6>::from_urdf_str(UR3E, "base_link", "tool0").unwrap().forward(&Q.into());
    let same = arm.end_transform().translation.vector
        - k::Vector3::from(base_T_tip.translation.vector.data.0[0]);
    assert!(same.norm() < 1e-12, "not the same arm");
    c.bench_function("fk/k", |b| {
        b.iter(|| {
            arm.set_joint_positions_unchecked(black_box(&Q));
            arm.end_transform()
        });
    });
    c.bench_function("fk_jacobian/k", |b| {
        b.iter(|| {
            arm.set_joint_positions_unchecked(black_box(&Q));
            // Computes the pose on the way, but does not return it.
            k::jacobian(&arm)
        });
    });
    let moved: Vec<f64> = Q.iter().zip(STEP).map(|(q, step)| q + step).collect();
    arm.set_joint_positions_unchecked(&moved);
    let target = arm.end_transform();
    let solver = k::JacobianIkSolver::new(1e-6, 1e-6, 1.0, 100);
    c.bench_function("ik_track/k", |b| {
        b.iter(|| {
            arm.set_joint_positions_unchecked(&Q);
            solver.solve(&arm, black_box(&target)).unwrap();
        });
    });
}

criterion_group!(benches, ours, peer);
criterion_main!(benches);
