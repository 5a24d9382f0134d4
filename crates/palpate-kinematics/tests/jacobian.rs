//! The Jacobian is the derivative of the pose.

mod sets;

use nalgebra::SVector;
use palpate_kinematics::{Frame, SerialChain, UrModel};
use palpate_spatial::{Vector6, pose_error_log};
use proptest::prelude::*;

/// Central differences of base_T_tip, h = 1e-6: their own error is about 1e-10.
fn differences<const N: usize>(
    chain: &SerialChain<N>,
    q: &SVector<f64, N>,
    joint: usize,
) -> Vector6 {
    let step = SVector::<f64, N>::from_fn(|i, _| if i == joint { 1e-6 } else { 0.0 });
    pose_error_log(&chain.forward(&(q + step)), &chain.forward(&(q - step))) / 2e-6
}

fn is_derivative<const N: usize>(
    chain: &SerialChain<N>,
    q: &SVector<f64, N>,
) -> Result<(), TestCaseError> {
    let J = chain.kinematics(q).jacobian(Frame::BaseAligned);
    for joint in 0..N {
        let error = (J.column(joint) - differences(chain, q, joint)).amax();
        prop_assert!(error < 1e-8, "joint {joint} is off by {error:.1e}");
    }
    Ok(())
}

/// J·δ predicts the pose to second order: halving the step quarters the error.
fn predicts_to_second_order<const N: usize>(
    chain: &SerialChain<N>,
    q: &SVector<f64, N>,
    dq: SVector<f64, N>,
) {
    let kinematics = chain.kinematics(q);
    let missed = |step: f64| {
        let moved = pose_error_log(&chain.forward(&(q + dq * step)), &kinematics.pose());
        (moved - kinematics.jacobian(Frame::BaseAligned) * dq * step).norm()
    };
    let ratio = missed(2e-3) / missed(1e-3);
    assert!((3.8..4.2).contains(&ratio), "halving the step changed the error by {ratio}");
}

proptest! {
    #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn columns_are_finite_differences(seed: u64) {
        let rng = &mut sets::stream(seed);
        for model in UrModel::ALL {
            let chain = sets::ur(model);
            is_derivative(&chain, &sets::configuration(&chain, rng))?;
        }
        let odd = sets::odd_arm();
        is_derivative(&odd, &sets::configuration(&odd, rng))?;
        let tool = palpate_spatial::Pose::new([0.1, -0.2, 0.3].into(), [0.5, 1.0, -0.7].into());
        is_derivative(&odd.clone().with_tool(tool), &sets::configuration(&odd, rng))?;
    }
}

#[test]
fn steps_are_predicted_to_second_order() {
    let rng = &mut sets::stream(5);
    for _ in 0..50 {
        let ur = sets::ur(UrModel::Ur3e);
        predicts_to_second_order(
            &ur,
            &sets::configuration(&ur, rng),
            sets::configuration(&ur, rng),
        );
        let odd = sets::odd_arm();
        predicts_to_second_order(
            &odd,
            &sets::configuration(&odd, rng),
            sets::configuration(&odd, rng),
        );
    }
}

#[test]
fn singular_values_vanish_at_the_ur_singularities_only() {
    let chain = sets::ur(UrModel::Ur3e);
    let rng = &mut sets::stream(6);
    let mut usual = Vec::new();
    for kind in sets::SINGULARITIES {
        for _ in 0..50 {
            let at = chain.kinematics(&sets::singular(kind, 0.0, rng));
            assert!(
                at.smallest_singular_value() < 1e-15,
                "{kind:?}: {}",
                at.smallest_singular_value()
            );
            assert!(at.manipulability() < 1e-15);
            usual.push(
                chain.kinematics(&sets::configuration(&chain, rng)).smallest_singular_value(),
            );
        }
    }
    usual.sort_by(f64::total_cmp);
    assert!(usual[usual.len() / 2] > 0.01);
}

#[test]
fn manipulability_is_the_determinant() {
    let rng = &mut sets::stream(7);
    let odd = sets::odd_arm();
    for _ in 0..50 {
        let kinematics = odd.kinematics(&sets::configuration(&odd, rng));
        let J = kinematics.jacobian(Frame::Body);
        let expected = (J * J.transpose()).determinant().sqrt();
        assert!((kinematics.manipulability() / expected - 1.0).abs() < 1e-9);
    }
    assert!(odd.kinematics(&SVector::repeat(f64::NAN)).smallest_singular_value().is_nan());
}
