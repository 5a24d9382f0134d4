//! Whether the model here is the arm there.

use palpate_kinematics::{SerialChain, UrModel};

use crate::Sample;

/// How far a kinematic model is from the controller's own.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ModelError {
    /// Distance of the flange, m.
    pub position: f64,
    /// Angle of the flange, rad.
    pub rotation: f64,
}

/// Compares the flange that `chain` (base_link to tool0) computes for the measured joints with the one
/// that the controller reports.
///
/// An arm without its calibration differs by a few tenths of a millimetre to a few millimetres, another
/// model by centimetres. A tool centre point that is not the one in the installation does not show here:
/// the controller's own offset is taken out. Compare [`Sample::tcp_offset`] for that.
pub fn model_error(chain: &SerialChain<6>, sample: &Sample) -> ModelError {
    let ours = chain.forward(&sample.q());
    let theirs = UrModel::base_link_T_base() * sample.base_T_flange();
    let gap = ours.inv_mul(&theirs);
    ModelError { position: gap.translation.vector.norm(), rotation: gap.rotation.angle() }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sample::tests::sample;

    /// A controller whose own model is the DH table of `model`, with a tool on the flange.
    fn reported(model: UrModel, q: [f64; 6]) -> Sample {
        let offset = [0.01, -0.02, 0.15, 0.3, 0.0, -0.7];
        let base_T_tcp = model.dh().forward(&q.into()) * crate::pose(&offset);
        let (p, r) = (base_T_tcp.translation.vector, base_T_tcp.rotation.scaled_axis());
        let mut sample = sample([p.x, p.y, p.z, r.x, r.y, r.z], offset, [0.0; 6]);
        sample.actual_q = q;
        sample
    }

    #[test]
    fn the_same_model_agrees_and_another_does_not() {
        let q = [0.4, -1.3, 1.1, -0.9, -1.6, 0.5];
        let urdf = include_str!("../../../assets/robots/ur3e.urdf");
        let chain = SerialChain::<6>::from_urdf_str(urdf, "base_link", "tool0").unwrap();
        let same = model_error(&chain, &reported(UrModel::Ur3e, q));
        assert!(same.position < 1e-9 && same.rotation < 1e-6, "{same:?}");
        let other = model_error(&chain, &reported(UrModel::Ur5e, q));
        assert!(other.position > 0.05, "{other:?}");
    }
}
