//! Where the links are, for collision geometry.
#![expect(clippy::unwrap_used, reason = "our own arms load")]

mod sets;

use nalgebra::Vector3;
use palpate_kinematics::{Frame, LinkFrame, SerialChain, UrModel};
use sets::URDFS;

/// The frame is that of `link` at the end of a chain of its own.
fn up_to<const M: usize>(urdf: &str, link: &str, q: &[f64], frame: &LinkFrame) {
    let piece = SerialChain::<M>::from_urdf_str(urdf, "base_link", link).unwrap();
    let pose = piece.forward(&nalgebra::SVector::from_column_slice(&q[..M]));
    assert!((frame.origin - pose.translation.vector).norm() < 1e-13, "{link}");
    let rotation = pose.rotation.to_rotation_matrix().into_inner();
    assert!((frame.rotation - rotation).amax() < 1e-13, "{link}");
}

#[test]
fn frames_of_our_urdfs_are_their_links() {
    let rng = &mut sets::stream(70);
    for (model, urdf) in URDFS {
        let chain = sets::ur(model);
        for _ in 0..50 {
            let q = sets::configuration(&chain, rng);
            let (frames, tip) = chain.frames(&q);
            up_to::<1>(urdf, "shoulder_link", q.as_slice(), &frames[0]);
            up_to::<2>(urdf, "upper_arm_link", q.as_slice(), &frames[1]);
            up_to::<3>(urdf, "forearm_link", q.as_slice(), &frames[2]);
            up_to::<4>(urdf, "wrist_1_link", q.as_slice(), &frames[3]);
            up_to::<5>(urdf, "wrist_2_link", q.as_slice(), &frames[4]);
            up_to::<6>(urdf, "wrist_3_link", q.as_slice(), &frames[5]);
            up_to::<6>(urdf, "tool0", q.as_slice(), &tip);
        }
    }
}

#[test]
fn every_frame_stands_on_its_joints_axis() {
    let (odd, rng) = (sets::odd_arm(), &mut sets::stream(71));
    for _ in 0..50 {
        let q = sets::configuration(&odd, rng);
        let (frames, tip) = odd.frames(&q);
        let J = odd.kinematics(&q).jacobian(Frame::BaseAligned);
        for (i, frame) in frames.iter().enumerate() {
            let z: Vector3<f64> = frame.rotation.column(2).into_owned();
            let v: Vector3<f64> = J.fixed_view::<3, 1>(0, i).into_owned();
            let slides = odd.joint_names()[i] == "slide";
            let expected = if slides { z } else { z.cross(&(tip.origin - frame.origin)) };
            assert!((v - expected).norm() < 1e-13, "joint {i}");
            assert!((frame.rotation.determinant() - 1.0).abs() < 1e-13);
        }
        assert!((odd.forward(&q).translation.vector - tip.origin).norm() < 1e-14);
    }
}

#[test]
fn a_calibration_moves_no_link_far() {
    let rng = &mut sets::stream(72);
    let delta = sets::delta_dh(UrModel::Ur3e, sets::CALIBRATIONS[2], rng);
    let (real, nominal) =
        (UrModel::Ur3e.calibrated_chain(&delta).unwrap(), sets::ur(UrModel::Ur3e));
    assert!(delta.d[1] > 10.0);
    for _ in 0..50 {
        let q = sets::configuration(&nominal, rng);
        let (a, b) = (real.frames(&q).0, nominal.frames(&q).0);
        for i in 0..6 {
            let apart = (a[i].origin - b[i].origin).norm();
            assert!(apart < 0.05, "link {i} is {apart} m from its nominal place");
        }
    }
}
