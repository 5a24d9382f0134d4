//! Inverse kinematics of a real UR arm: tracking first, verified closed-form starts when it fails.

use std::f64::consts::TAU;

use palpate_spatial::{JointVector, Pose};

use crate::chain::SerialChain;
use crate::error::{IkError, ModelError};
use crate::inverse::{IkOptions, IkSolution};
use crate::rigid::Rigid;
use crate::ur::UrModel;
use crate::ur_analytic::{SLACK, UrAnalytic, UrSolutions};

/// How far a calibration may move an arm from its nominal figures, m and rad.
const CALIBRATION: f64 = 0.05;

/// On a calibrated arm, closed-form candidates may miss by this much: the search on the real chain corrects
/// them, m.
const CANDIDATE_SLACK: f64 = 0.03;

/// A chain this close to its nominal figures, m and rad, is nominal: what the closed form cannot reach, it cannot.
const NOMINAL: f64 = 1e-8;

/// A UR arm with its own calibration, mounting and tool.
///
/// [`SerialChain::solve_near`] stays near its seed and so fails from about every second far one.
/// This solver then starts again from each of the eight closed-form configurations, nearest first. They
/// belong to the nominal arm; only what the search makes of them on the actual chain is ever returned.
#[derive(Clone, Debug)]
pub struct UrSolver {
    chain: SerialChain<6>,
    analytic: UrAnalytic,
    /// From the chain's base to the controller's frame *Base*, inverted.
    dh_T_base: Pose,
    tip_T_flange: Pose,
    nominal: bool,
}

impl UrSolver {
    /// Prepares the solver for a chain that is a `model` up to calibration, base mounting and tool.
    ///
    /// ```
    /// use palpate_kinematics::{IkOptions, SerialChain, UrModel, UrSolver};
    /// use palpate_spatial::JointVector;
    ///
    /// let urdf = include_str!("../../../assets/robots/ur3e.urdf");
    /// let chain = SerialChain::<6>::from_urdf_str(urdf, "base_link", "tool0")?;
    /// let goal = JointVector::from([2.0, -1.0, -1.5, 0.5, 1.2, -2.0]);
    /// let base_T_tool = chain.forward(&goal);
    ///
    /// // A cold start: the seed is nowhere near, in another branch.
    /// let arm = UrSolver::new(chain, UrModel::Ur3e)?;
    /// let seed = JointVector::from([-1.0, -1.57, 1.57, -1.57, -1.57, 0.0]);
    /// let solution = arm.solve_near(&base_T_tool, &seed, &IkOptions::default())?;
    /// assert!(solution.position_error < 1e-6);
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    ///
    /// # Errors
    /// [`ModelError::NotThisArm`] for a chain that a calibration cannot have made of this model.
    pub fn new(chain: SerialChain<6>, model: UrModel) -> Result<Self, ModelError> {
        let dh = model.dh();
        let base_T_dh = controller_base(&chain, dh.d[0]);
        let flange_T_tip = |q| dh.forward(q).inv_mul(&base_T_dh.inv_mul(&chain.forward(q)));
        let probes = probes();
        let first = flange_T_tip(&probes[0]);
        let (mut position, mut rotation) = (0.0f64, 0.0f64);
        for q in &probes[1..] {
            let departure = first.inv_mul(&flange_T_tip(q));
            position = position.max(departure.translation.vector.norm());
            rotation = rotation.max(departure.rotation.angle());
        }
        if !(position <= CALIBRATION && rotation <= CALIBRATION) {
            return Err(ModelError::NotThisArm { model: model.name(), position, rotation });
        }
        Ok(Self {
            analytic: UrAnalytic::new(model),
            dh_T_base: base_T_dh.inverse(),
            tip_T_flange: first.inverse(),
            nominal: position <= NOMINAL && rotation <= NOMINAL,
            chain,
        })
    }

    /// The chain that solutions are verified on.
    pub fn chain(&self) -> &SerialChain<6> {
        &self.chain
    }

    /// The nominal configurations for `base_T_tip`; on a calibrated arm they miss by millimetres.
    pub fn branches(&self, base_T_tip: &Pose, q6_if_free: f64) -> UrSolutions {
        self.analytic.solve_all(&self.flange(base_T_tip), q6_if_free)
    }

    /// Finds joints that put the tip at `base_T_tip`: in the seed's branch if that works, else in the
    /// branch whose joints are nearest.
    ///
    /// With [`IkOptions::max_step`] or [`IkOptions::period`] set, another branch is returned only where it
    /// is that near, so a control loop may use this as it uses [`SerialChain::solve_near`].
    ///
    /// ```
    /// # use palpate_kinematics::{DhTable, IkOptions, UrModel, UrSolver};
    /// # use palpate_spatial::JointVector;
    /// # let zero = DhTable { theta: [0.0; 6], d: [0.0; 6], a: [0.0; 6], alpha: [0.0; 6] };
    /// # let delta = DhTable { alpha: [1e-3, -5e-4, 8e-4, 0.0, 0.0, 0.0], ..zero };
    /// let arm = UrSolver::new(UrModel::Ur5e.calibrated_chain(&delta)?, UrModel::Ur5e)?;
    /// let goal = JointVector::from([2.0, -1.0, -1.5, 0.5, 1.2, -2.0]);
    /// let base_T_tool = arm.chain().forward(&goal);
    /// let seed = JointVector::from([-1.0, -1.57, 1.57, -1.57, -1.57, 0.0]);
    /// assert!(arm.solve_near(&base_T_tool, &seed, &IkOptions::default()).is_ok());
    /// // The same in a control loop: too far for one period.
    /// let in_time = IkOptions { period: Some(0.002), ..IkOptions::default() };
    /// assert!(arm.solve_near(&base_T_tool, &seed, &in_time).is_err());
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    ///
    /// # Errors
    /// As [`SerialChain::solve_near`], for the search from the seed; [`IkError::Unreachable`] also where
    /// the closed form of a nominal arm proves it.
    pub fn solve_near(
        &self,
        base_T_tip: &Pose,
        seed: &JointVector,
        options: &IkOptions,
    ) -> Result<IkSolution<6>, IkError> {
        let target = self.chain.admit(base_T_tip, seed, options)?;
        let reason = match self.chain.settle(&target, seed, seed, options) {
            Ok(solution) => return Ok(solution),
            Err(reason) => reason,
        };
        if options.task != [true; 6] {
            return Err(reason);
        }
        self.cold_start(base_T_tip, &target, seed, options, reason)
    }

    #[cold]
    fn cold_start(
        &self,
        base_T_tip: &Pose,
        target: &Rigid,
        seed: &JointVector,
        options: &IkOptions,
        reason: IkError,
    ) -> Result<IkSolution<6>, IkError> {
        let base_T_flange = Rigid::from(&self.flange(base_T_tip));
        let slack = if self.nominal { SLACK } else { CANDIDATE_SLACK };
        let found = self.analytic.solve_with_slack(&base_T_flange, seed[5], slack);
        let mut starts = [(f64::INFINITY, JointVector::zeros()); 8];
        for (start, (_, q)) in starts.iter_mut().zip(found.as_slice()) {
            let q = self.nearest_window(q, seed);
            *start = ((q - seed).amax(), q);
        }
        let starts = &mut starts[..found.as_slice().len()];
        starts.sort_unstable_by(|a, b| a.0.total_cmp(&b.0));
        for (_, start) in starts.iter() {
            if let Ok(solution) = self.chain.settle(target, start, seed, options) {
                return Ok(solution);
            }
        }
        let beyond = found.shortfall();
        if self.nominal && beyond > options.accept && matches!(reason, IkError::NotConverged { .. })
        {
            return Err(IkError::Unreachable { beyond });
        }
        Err(reason)
    }

    fn flange(&self, base_T_tip: &Pose) -> Pose {
        self.dh_T_base * base_T_tip * self.tip_T_flange
    }

    /// Whole turns added so that each joint is as near to the seed as its limits allow.
    fn nearest_window(&self, q: &JointVector, seed: &JointVector) -> JointVector {
        let limits = self.chain.limits();
        JointVector::from_fn(|i, _| {
            let nearest = q[i] + TAU * ((seed[i] - q[i]) / TAU).round();
            if nearest > limits.upper[i] {
                nearest - TAU
            } else if nearest < limits.lower[i] {
                nearest + TAU
            } else {
                nearest
            }
        })
    }
}

/// base_T_Base from the first two axes: z along shoulder pan, y against shoulder lift at q = 0, d1 below it.
fn controller_base(chain: &SerialChain<6>, d1: f64) -> Pose {
    let [(pan, z), (lift, z1), ..] = chain.kinematics(&JointVector::zeros()).axes;
    let y = (z.cross(&z1).cross(&z)).normalize() * -1.0;
    // The point of the pan axis nearest to the lift axis. They meet, or nearly: then any point of the lift
    // axis will do, and this one is the nearest to the frame before it.
    let origin = pan + z * (z.dot(&(lift - pan)) - d1);
    Rigid { x: y.cross(&z), y, z, p: origin }.pose()
}

/// Configurations far apart, to tell one arm from another.
fn probes() -> [JointVector; 6] {
    let at = |phase: f64| JointVector::from_fn(|i, _| 2.0 * (phase * (i as f64 + 1.3)).sin());
    [JointVector::zeros(), at(0.7), at(1.9), at(3.1), at(4.4), at(5.6)]
}

#[cfg(test)]
mod tests {
    use super::*;
    use palpate_spatial::Vector3;

    #[test]
    fn finds_mounting_and_tool() {
        let mounting = Pose::new(Vector3::new(0.3, -0.2, 0.9), Vector3::new(0.4, 2.0, -0.3));
        let tool = Pose::new(Vector3::new(0.01, 0.02, 0.15), Vector3::new(0.1, -0.2, 0.3));
        for model in UrModel::ALL {
            let chain =
                SerialChain::from_dh(&model.dh(), &mounting, &model.limits(), crate::UR_JOINTS)
                    .unwrap();
            let solver = UrSolver::new(chain.with_tool(tool), model).unwrap();
            assert!(solver.nominal);
            assert!((solver.dh_T_base * mounting).translation.vector.norm() < 1e-14);
            assert!((solver.dh_T_base * mounting).rotation.angle() < 1e-14);
            assert!((solver.tip_T_flange * tool).translation.vector.norm() < 1e-14);
        }
    }
}
