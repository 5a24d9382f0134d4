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
