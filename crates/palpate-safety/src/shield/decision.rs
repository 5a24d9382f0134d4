//! What goes into the shield and what comes out.

use palpate_spatial::{JointVector, Pose};

use crate::{Cause, Verdict};

/// What the layer above asks for.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Proposal {
    /// A tool pose, base_T_tool.
    Pose(Pose),
    /// Joints, rad.
    Joints(JointVector),
    /// To come to rest.
    Rest,
}

/// What becomes of it.
#[derive(Clone, Debug, PartialEq)]
pub struct Decision {
    /// The verdict.
    pub verdict: Verdict,
    /// The set-point to send now, rad. Always finite, whatever was asked for.
    pub executed: JointVector,
    /// The proposal as joints, rad, where it had any.
    pub proposed: Option<JointVector>,
    /// Why the set-point is not simply the proposal, if it is not.
    pub cause: Option<Cause>,
    /// Where the next tool pose must start from, if the arm was slowed or braked and so did not get to where
    /// the proposal said. A stream of poses that ignores this asks for jumps.
    pub governed: Option<Pose>,
}
