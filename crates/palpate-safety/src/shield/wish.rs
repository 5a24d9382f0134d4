//! From a proposal to where the arm may try to go in this period.
#![expect(clippy::neg_cmp_op_on_partial_ord, reason = "NaN must fail")]

use palpate_kinematics::{Frame, IkOptions};
use palpate_spatial::{DOF, JointVector, Pose, Vector3};

use super::core::{Proposal, Shield};
use super::ledger::Cause;
use crate::{Measurement, Refusal};

/// A proposal, slowed where it must be.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Wish {
    /// What was asked for, rad.
    pub(super) proposed: JointVector,
    /// Where to be after this period, rad.
    pub(super) target: JointVector,
    /// Speed from the last target to this one, rad/s.
    pub(super) velocity: JointVector,
    /// base_T_tool at the target, where it is known.
    pub(super) pose: Option<Pose>,
    /// |det J| at the target, where it is known.
    pub(super) manipulability: Option<f64>,
    /// Why it was slowed.
    pub(super) slowed: Option<Cause>,
}

impl Shield {
    pub(super) fn wish(&mut self, m: &Measurement, proposal: &Proposal) -> Result<Wish, Refusal> {
        match proposal {
            Proposal::Pose(pose) => self.wish_pose(m, pose),
            Proposal::Joints(q) => self.wish_joints(m, q),
            Proposal::Rest => self.wish_joints(m, &self.target.clone()),
        }
    }

    fn wish_pose(&mut self, m: &Measurement, base_T_tool: &Pose) -> Result<Wish, Refusal> {
        let dt = self.verifier.dt;
        let finite = |v: &[f64]| v.iter().all(|x| x.is_finite());
        let rotation = base_T_tool.rotation.coords;
        if !(finite(base_T_tool.translation.vector.as_slice()) && finite(rotation.as_slice())) {
            return Err(Refusal::NonFinite);
        }
        let from = self.target_pose().translation.vector;
        let asked = (base_T_tool.translation.vector - from) / dt;
        let limit = self.guard.soft().force;
        let allowed = self.headroom.limited(&asked, &m.raw_wrench, &m.wrench, limit);
        let mut pose = *base_T_tool;
        let mut slowed = None;
        if allowed != asked {
            pose.translation.vector = from + allowed * dt;
            slowed = Some(Cause::SlowedByForce);
        }
        let options = IkOptions {
            limit_margin: self.config.joint_margin,
            max_step: self.config.branch_step_max,
            ..IkOptions::default()
        };
        let q = self.chain.solve_near(&pose, &self.target, &options).map_err(Refusal::NoIk)?.q;
        let (to, slow) = self.towards_singularity(&q);
        let wish =
            self.scaled(&q, slow, slowed.or((slow < 1.0).then_some(Cause::SlowedBySingularity)));
        let whole = wish.target == q;
        Ok(Wish { pose: whole.then_some(pose), manipulability: whole.then_some(to), ..wish })
    }

    fn wish_joints(&mut self, m: &Measurement, q: &JointVector) -> Result<Wish, Refusal> {
        let limits = self.chain.limits();
        for joint in 0..DOF {
            let (value, lower, upper) = (q[joint], limits.lower[joint], limits.upper[joint]);
            if !value.is_finite() {
                return Err(Refusal::NonFinite);
            }
            if !(value >= lower && value <= upper) {
                return Err(Refusal::JointRange { joint, value, lower, upper });
            }
            let (step, limit) = ((value - self.target[joint]).abs(), self.config.branch_step_max);
            if !(step <= limit) {
                return Err(Refusal::Jump { joint, step, limit });
            }
        }
        let wish = self.scaled(q, 1.0, None);
        let J = self.chain.kinematics(&self.target).jacobian(Frame::BaseAligned);
        let v: Vector3 = (J * wish.velocity).fixed_rows::<3>(0).into();
        let limit = self.guard.soft().force;
        let scale = self.headroom.scale(&v, &m.raw_wrench, &m.wrench, limit);
        if scale < 1.0 {
            let velocity = wish.velocity * scale;
            let target = self.target + velocity * self.verifier.dt;
            return Ok(Wish { target, velocity, slowed: Some(Cause::SlowedByForce), ..wish });
        }
        Ok(wish)
    }

    /// `q` at no more than full speed and at `scale` of what was asked.
    fn scaled(&self, q: &JointVector, scale: f64, slowed: Option<Cause>) -> Wish {
        let dt = self.verifier.dt;
        let step = q - self.target;
        let excess = (step / dt).component_div(&self.verifier.velocity).amax();
        let (scale, slowed) = if excess * scale > 1.0 {
            (1.0 / excess, slowed.or(Some(Cause::SlowedBySpeed)))
        } else {
            (scale, slowed)
        };
        let target = if scale < 1.0 { self.target + step * scale } else { *q };
        let velocity = (target - self.target) / dt;
        Wish { proposed: *q, target, velocity, pose: None, manipulability: None, slowed }
    }

    /// |det J| at `q`, and the part of the speed that the way there is allowed: everything away from the
    /// singularity, less and less towards it.
    fn towards_singularity(&mut self, q: &JointVector) -> (f64, f64) {
        let measure = |q: &JointVector| {
            self.chain.kinematics(q).jacobian(Frame::BaseAligned).determinant().abs()
        };
        let from = self.manipulability.unwrap_or_else(|| measure(&self.target));
        let to = measure(q);
        let (slow, stop) = (self.config.singularity.slow_below, self.config.singularity.stop_below);
        let scale = if to >= from { 1.0 } else { ((to - stop) / (slow - stop)).clamp(0.0, 1.0) };
        (to, scale)
    }
}
