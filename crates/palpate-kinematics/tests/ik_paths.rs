//! Straight lines at 0.1 m/s behind the speed gate, 500 times a second, until the arm cannot follow.

mod sets;

use palpate_kinematics::{Frame, IkError, IkOptions, IkSolution, SerialChain, UrModel};
use palpate_spatial::{JointVector, Pose, pose_error_log};
use sets::{Line, PERIOD};

/// What came of 200 lines of 1000 steps.
#[derive(Debug, Default, PartialEq)]
struct Tally {
    accepted: u32,
    refused: u32,
    complete: u32,
    /// First refusals of a line, for speed, where the arm could have followed.
    needless: u32,
}

/// Whether the joint speeds that the Jacobian asks for were well within the limits, refused or not.
fn was_needless(chain: &SerialChain<6>, q: &JointVector, target: &Pose, reason: IkError) -> bool {
    let kinematics = chain.kinematics(q);
    let asked =
        kinematics.jacobian(Frame::BaseAligned).try_inverse().map_or(f64::INFINITY, |inverse| {
            let step = inverse * pose_error_log(target, &kinematics.pose());
            step.component_div(&(chain.limits().velocity * PERIOD)).amax()
        });
    matches!(reason, IkError::Discontinuous { .. }) && asked < 0.9
}

/// Asks for every step of every line. A refused step leaves the arm where it is; `check` sees the others.
fn follow(
    chain: &SerialChain<6>,
    options: IkOptions,
    mut check: impl FnMut(&JointVector, &IkSolution<6>),
) -> Tally {
    let arm = sets::solver(chain.clone());
    let rng = &mut sets::stream(50);
    let mut tally = Tally::default();
    for _ in 0..200 {
        let line = Line::random(chain, rng);
        let mut q = line.start;
        let before = tally.refused;
        for step in 1..=1000 {
            let target = line.at(step);
            match arm.solve_near(&target, &q, &options) {
                Ok(solution) => {
                    assert!(sets::reaches(chain, &solution.q, &target));
                    check(&q, &solution);
                    q = solution.q;
                    tally.accepted += 1;
                }
                Err(reason) => {
                    if tally.refused == before {
                        tally.needless += u32::from(was_needless(chain, &q, &target, reason));
                    }
                    tally.refused += 1;
                }
            }
        }
        tally.complete += u32::from(tally.refused == before);
    }
    tally
}

#[test]
fn no_accepted_step_is_faster_than_the_joints() {
    let chain = sets::ur(UrModel::Ur3e);
    let velocity = chain.limits().velocity;
    let gated = IkOptions { period: Some(PERIOD), ..IkOptions::default() };
    let tally = follow(&chain, gated, |q, solution| {
        let step = (solution.q - q).abs();
        assert!((0..6).all(|i| step[i] <= velocity[i] * PERIOD), "{step}");
    });
    println!("{tally:?}");
    assert_eq!(tally.accepted + tally.refused, 200_000);
    assert_eq!(tally.needless, 0);
    assert!(tally.accepted > 100_000 && tally.complete > 50, "{tally:?}");
}

#[test]
fn without_the_gate_some_step_is_too_fast() {
    let chain = sets::ur(UrModel::Ur3e);
    let velocity = chain.limits().velocity;
    let mut too_fast = 0;
    follow(&chain, IkOptions::default(), |q, solution| {
        let step = (solution.q - q).abs();
        too_fast += u32::from((0..6).any(|i| step[i] > velocity[i] * PERIOD));
    });
    println!("{too_fast} steps too fast");
    assert!(too_fast > 0);
}
