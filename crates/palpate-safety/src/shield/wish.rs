//! From a proposal to where the arm may try to go in this period.
#![expect(clippy::neg_cmp_op_on_partial_ord, reason = "NaN must fail")]

use palpate_kinematics::{Frame, IkOptions};
use palpate_spatial::{DOF, JointVector, Pose, UnitQuaternion};

use super::core::Shield;
use super::decision::Proposal;
use super::verify::GUARD;
use crate::{Cause, Measurement, Refusal};

/// Time constant of an approach to an obstacle, s: several times a brake from moderate speed.
const APPROACH: f64 = 0.15;

/// Lag behind a path of joints from which on the path is slowed, rad; at twice as much it waits.
const LAG: f64 = 0.02;

/// A proposal, slowed where it must be.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Wish {
    /// What was asked for, rad.
    pub(super) proposed: JointVector,
    /// Where to be after this period, rad.
    pub(super) target: JointVector,
    /// Speed from the last target to this one, rad/s.
    pub(super) velocity: JointVector,
    /// Whether the target is a point of a path that is to be caught up with.
    pub(super) absolute: bool,
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
        let here = self.target_pose();
        let from = here.translation.vector;
        let step = (base_T_tool.translation.vector - from).norm();
        let limit = self.config.tool_step_max;
        if !(step <= limit) {
            return Err(Refusal::ToolJump { step, limit });
        }
        let asked = (base_T_tool.translation.vector - from) / dt;
        let allowed = self.bounds(m).limited(&asked);
        let mut pose = *base_T_tool;
        let mut slowed = None;
        if allowed != asked {
            pose.translation.vector = from + allowed * dt;
            slowed = Some(Cause::SlowedByForce);
        }
        let asked_turn = (pose.rotation * here.rotation.inverse()).scaled_axis() / dt;
        let turn = self.turned(m, &allowed, &asked_turn);
        if turn != asked_turn {
            pose.rotation = UnitQuaternion::from_scaled_axis(turn * dt) * here.rotation;
            slowed = Some(Cause::SlowedByForce);
        }
        let options = IkOptions {
            limit_margin: self.config.joint_margin,
            max_step: self.config.branch_step_max,
            ..IkOptions::default()
        };
        let q = self.chain.solve_near(&pose, &self.target, &options).map_err(Refusal::NoIk)?.q;
        let (to, slow) = self.towards_singularity(&q);
        let slowed = (slow < 1.0).then_some(Cause::SlowedBySingularity).or(slowed);
        let wish = self.scaled(&q, slow, slowed);
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
        // An arm too far behind its path is waited for.
        let lag = self.motion().map_or(0.0, |here| (self.target - here.q).amax());
        let patience = (2.0 - lag / LAG).clamp(0.0, 1.0);
        let wish = Wish {
            absolute: true,
            ..self.scaled(q, patience, (patience < 1.0).then_some(Cause::Shaped))
        };
        let scale = self.bounds(m).scale(&self.tool_velocity(&wish.velocity));
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
        let (scale, slowed) = match self.towards_obstacle(&(step * scale)) {
            part if part < 1.0 => (scale * part, Some(Cause::SlowedByObstacle)),
            _ => (scale, slowed),
        };
        let target = if scale < 1.0 { self.target + step * scale } else { *q };
        let velocity = (target - self.target) / dt;
        Wish {
            proposed: *q,
            target,
            velocity,
            absolute: false,
            pose: None,
            manipulability: None,
            slowed,
        }
    }

    /// The part of a joint step that the distance to the nearest obstacle allows: the clearance may shrink by no
    /// more than its [`APPROACH`]th part per second. The arm then settles before a wall instead of running into
    /// the refusals that guarantee it.
    fn towards_obstacle(&self, step: &JointVector) -> f64 {
        let Some(here) = self.motion() else { return 1.0 };
        let part = self.verifier.dt / APPROACH;
        let clearance = self.clearance(here);
        let geometry = &self.verifier.geometry;
        if geometry.travel(&step.abs()) <= (clearance - 2.0 * GUARD) * part {
            return 1.0;
        }
        let there = geometry.clearance(&self.chain, &(here.q + step)).distance;
        let (shrinks, allowed) = (clearance - there, (clearance - 2.0 * GUARD).max(0.0) * part);
        if shrinks > allowed { allowed / shrinks } else { 1.0 }
    }

    /// |det J| at `q`, and the part of the speed that the way there is allowed: everything away from the
    /// singularity, less and less towards it. On the way in it also counts where a brake from there would end: the
    /// nearer the singularity, the faster the joints for the same speed of the tool.
    fn towards_singularity(&mut self, q: &JointVector) -> (f64, f64) {
        let measure = |q: &JointVector| {
            self.chain.kinematics(q).jacobian(Frame::BaseAligned).determinant().abs()
        };
        let from = self.manipulability.unwrap_or_else(|| measure(&self.target));
        let to = measure(q);
        let brake =
            self.motion().map_or(JointVector::zeros(), |m| m.v * (0.5 * self.stopping_time));
        let least = to.min(measure(&(q + brake)));
        let (slow, stop) = (self.config.singularity.slow_below, self.config.singularity.stop_below);
        let part = (least - stop) / (slow - stop);
        let scale = match part {
            _ if to >= from => 1.0,
            part if part > 0.0 => part.min(1.0),
            // NaN as well.
            _ => 0.0,
        };
        (to, scale)
    }
}
