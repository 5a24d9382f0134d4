//! FK, Jacobian and IK of a UR3e, with the crate `k` as a peer in the same run; ends with the ratios.
//!
//! `cargo bench -p palpate-kinematics`; figures in `docs/results/kinematics.md`.
#![expect(
    clippy::unwrap_used,
    clippy::print_stdout,
    reason = "a benchmark of our own files, which prints the ratios to its peer"
)]

use std::collections::BTreeMap;
use std::hint::black_box;
use std::time::Instant;

use criterion::Criterion;
use k::InverseKinematicsSolver;
use palpate_kinematics::{Frame, IkOptions, SerialChain, UrAnalytic, UrModel, UrSolver};
use palpate_spatial::JointVector;

const UR3E: &str = include_str!("../../../assets/robots/ur3e.urdf");
const Q: [f64; 6] = [0.3, -1.2, 1.9, -2.0, -1.6, 0.4];
/// About 3 mm at the tool.
const STEP: [f64; 6] = [0.004, -0.003, 0.005, 0.002, -0.004, 0.006];

/// Criterion, keeping every sample's time per call so that ratios can be taken at the end.
struct Bench {
    criterion: Criterion,
    samples: BTreeMap<&'static str, Vec<f64>>,
}

impl Bench {
    fn time<R>(&mut self, name: &'static str, mut work: impl FnMut() -> R) {
        let samples = self.samples.entry(name).or_default();
        self.criterion.bench_function(name, |b| {
            b.iter_custom(|calls| {
                let start = Instant::now();
                for _ in 0..calls {
                    black_box(work());
                }
                let took = start.elapsed();
                samples.push(took.as_secs_f64() / calls as f64);
                took
            });
        });
    }

    /// Median, ns; none where a filter or `--test` left too few samples. The first are the warm-up's.
    fn median(&self, name: &str) -> Option<f64> {
        let all = self.samples.get(name)?;
        let mut last = all.get(all.len().checked_sub(50)?..)?.to_vec();
        last.sort_unstable_by(f64::total_cmp);
        Some(last[last.len() / 2] * 1e9)
    }

    fn print_ratios(&self) {
        for what in ["fk", "fk_jacobian", "ik_track"] {
            let median = |who: &str| self.median(&format!("{what}/{who}"));
            if let (Some(ours), Some(peer)) = (median("palpate"), median("k")) {
                println!("{what}: palpate {ours:.0} ns, k {peer:.0} ns, ratio {:.1}", peer / ours);
            }
        }
    }
}

fn ours(bench: &mut Bench) {
    let chain = SerialChain::<6>::from_urdf_str(UR3E, "base_link", "tool0").unwrap();
    let q = JointVector::from(Q);
    bench.time("fk/palpate", || chain.forward(black_box(&q)));
    bench.time("fk_jacobian/palpate", || {
        let kinematics = chain.kinematics(black_box(&q));
        (kinematics.pose(), kinematics.jacobian(Frame::BaseAligned))
    });
    let options = IkOptions::default();
    let target = chain.forward(&(q + JointVector::from(STEP)));
    bench.time("ik_track/palpate", || chain.solve_near(black_box(&target), &q, &options));
    let gated = IkOptions { min_singular_value: 1e-3, ..options };
    bench.time("ik_track/palpate_with_sigma_min", || {
        chain.solve_near(black_box(&target), &q, &gated)
    });
    let arm = UrSolver::new(chain.clone(), UrModel::Ur3e).unwrap();
    let far = JointVector::from([-2.0, -2.0, -1.0, 1.0, 1.5, 2.0]);
    bench.time("ik_far/palpate", || arm.solve_near(black_box(&target), &far, &options));
    let analytic = UrAnalytic::new(UrModel::Ur3e);
    bench.time("ik_all_8/palpate", || analytic.solve_all(black_box(&target), 0.0));
    let kinematics = chain.kinematics(&q);
    bench.time("sigma_min/palpate", || black_box(&kinematics).smallest_singular_value());
}

fn peer(bench: &mut Bench) {
    let urdf = concat!(env!("CARGO_MANIFEST_DIR"), "/../../assets/robots/ur3e.urdf");
    let robot = k::Chain::<f64>::from_urdf_file(urdf).unwrap();
    let arm = k::SerialChain::from_end(robot.find("wrist_3-tool0").unwrap());
    arm.set_joint_positions_unchecked(&Q);
    let base_T_tip =
        SerialChain::<6>::from_urdf_str(UR3E, "base_link", "tool0").unwrap().forward(&Q.into());
    let same = arm.end_transform().translation.vector
        - k::Vector3::from(base_T_tip.translation.vector.data.0[0]);
    assert!(same.norm() < 1e-12, "not the same arm");
    bench.time("fk/k", || {
        arm.set_joint_positions_unchecked(black_box(&Q));
        arm.end_transform()
    });
    bench.time("fk_jacobian/k", || {
        arm.set_joint_positions_unchecked(black_box(&Q));
        // Computes the pose on the way, but does not return it.
        k::jacobian(&arm)
    });
    let moved: Vec<f64> = Q.iter().zip(STEP).map(|(q, step)| q + step).collect();
    arm.set_joint_positions_unchecked(&moved);
    let target = arm.end_transform();
    let solver = k::JacobianIkSolver::new(1e-6, 1e-6, 1.0, 100);
    bench.time("ik_track/k", || {
        arm.set_joint_positions_unchecked(&Q);
        solver.solve(&arm, black_box(&target)).unwrap();
    });
}

fn main() {
    let criterion = Criterion::default().configure_from_args();
    let mut bench = Bench { criterion, samples: BTreeMap::new() };
    ours(&mut bench);
    peer(&mut bench);
    bench.criterion.final_summary();
    bench.print_ratios();
}
