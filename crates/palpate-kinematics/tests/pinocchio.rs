//! Poses and Jacobians against pinocchio; `data/make_pinocchio.py` wrote the numbers.
#![expect(
    clippy::unwrap_used,
    clippy::print_stdout,
    reason = "our own files; the figures are worth seeing"
)]

mod sets;

use nalgebra::{Quaternion, SMatrix, SVector};
use palpate_kinematics::{Frame, SerialChain};
use palpate_spatial::{Pose, UnitQuaternion, Vector3};
use sets::{ODD_ARM, URDFS, apart};

const TOLERANCE: f64 = 1e-12;

#[derive(serde::Deserialize)]
struct Fixtures {
    arms: std::collections::BTreeMap<String, Arm>,
}

#[derive(serde::Deserialize)]
struct Arm {
    base: String,
    tip: String,
    cases: Vec<Case>,
}

#[derive(serde::Deserialize)]
struct Case {
    q: Vec<f64>,
    position: [f64; 3],
    quaternion_wxyz: [f64; 4],
    jacobian: Vec<Vec<f64>>,
}

fn check<const N: usize>(name: &str, urdf: &str) {
    let fixtures: Fixtures = serde_json::from_str(include_str!("data/pinocchio.json")).unwrap();
    let arm = &fixtures.arms[name];
    let chain = SerialChain::<N>::from_urdf_str(urdf, &arm.base, &arm.tip).unwrap();
    assert!(arm.cases.len() >= 16);
    let (mut worst_pose, mut worst_J) = (0.0f64, 0.0f64);
    for case in &arm.cases {
        let kinematics = chain.kinematics(&SVector::from_row_slice(&case.q));
        let [w, x, y, z] = case.quaternion_wxyz;
        let rotation = UnitQuaternion::new_normalize(Quaternion::new(w, x, y, z));
        let expected = Pose::from_parts(Vector3::from(case.position).into(), rotation);
        let (position, rotation) = apart(&kinematics.pose(), &expected);
        worst_pose = worst_pose.max(position).max(rotation);

        let base_J = SMatrix::<f64, 6, N>::from_fn(|i, j| case.jacobian[i][j]);
        worst_J = worst_J.max((kinematics.jacobian(Frame::BaseAligned) - base_J).amax());
        let tip_R_base = expected.rotation.inverse().to_rotation_matrix();
        let body_J = kinematics.jacobian(Frame::Body);
        for (body, base) in body_J.column_iter().zip(base_J.column_iter()) {
            worst_J = worst_J
                .max((body.fixed_rows::<3>(0) - tip_R_base * base.fixed_rows::<3>(0)).amax());
            worst_J = worst_J
                .max((body.fixed_rows::<3>(3) - tip_R_base * base.fixed_rows::<3>(3)).amax());
        }
    }
    println!("{name}: pose {worst_pose:.1e}, Jacobian {worst_J:.1e}");
    assert!(worst_pose <= TOLERANCE, "{name}: pose off by {worst_pose:.1e}");
    assert!(worst_J <= TOLERANCE, "{name}: Jacobian off by {worst_J:.1e}");
}

#[test]
fn ur_arms_agree() {
    for (model, urdf) in URDFS {
        check::<6>(&model.name().to_lowercase(), urdf);
    }
}

#[test]
fn a_chain_with_everything_odd_agrees() {
    check::<7>("odd_arm", ODD_ARM);
}
