//! Inverse kinematics near a seed: what is asked, what is answered, what is refused.
#![expect(clippy::neg_cmp_op_on_partial_ord, reason = "NaN must be refused")]

use std::f64::consts::TAU;

use nalgebra::SVector;
use palpate_spatial::{Pose, UnitQuaternion};

use crate::chain::SerialChain;
use crate::error::IkError;
use crate::rigid::Rigid;

/// How a solution is searched and accepted.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct IkOptions {
    /// Iterations before giving up.
    pub max_iterations: u32,
    /// The search stops at this error, m and rad.
    pub tolerance: f64,
    /// A result is accepted at this error, m and rad.
    pub accept: f64,
    /// Distance that a solution keeps from every finite joint limit, rad or m.
    pub limit_margin: f64,
    /// Largest step of any joint from the seed, rad or m.
    pub max_step: f64,
    /// Time in which the step must be possible, s: |Δq_i| ≤ q̇max_i · period. The paper's speed check.
    pub period: Option<f64>,
    /// Least singular value of the Jacobian at a solution; 0 asks for none. Mixes m and rad, as the Jacobian
    /// does. Costs about as much as the rest of the solve.
    pub min_singular_value: f64,
    /// Components of (v, ω), base axes, that must match; a chain of fewer than six joints can track
    /// the ones that it controls.
    pub task: [bool; 6],
}

impl Default for IkOptions {
    /// 40 iterations, 1e-9 sought, 1e-6 accepted, no gate but the joint limits.
    fn default() -> Self {
        Self {
            max_iterations: 40,
            tolerance: 1e-9,
            accept: 1e-6,
            limit_margin: 0.0,
            max_step: f64::INFINITY,
            period: None,
            min_singular_value: 0.0,
            task: [true; 6],
        }
    }
}

/// A joint configuration that reaches the target.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct IkSolution<const N: usize> {
    /// Joints, rad or m.
    pub q: SVector<f64, N>,
    /// Iterations used.
    pub iterations: u32,
    /// Position error left, m.
    pub position_error: f64,
    /// Rotation error left, rad.
    pub rotation_error: f64,
    /// Largest step of any joint from the seed, rad or m.
    pub max_step: f64,
}

impl<const N: usize> SerialChain<N> {
    /// Finds joints that put the tip at `base_T_tip`, in the solution branch of `seed`.
    ///
    /// Levenberg-Marquardt from the seed. Joint limits are ignored on the way and checked at the end, after
    /// each revolute joint has been brought to within half a turn of its seed. Chains of any length:
    /// redundant ones take the smallest steps, short ones reach what they can, see [`IkOptions::task`].
    /// No randomness, no clock, no allocation; the iterations are capped. `base_T_tip` may hold q or −q:
    /// the answer is the same to the last bit.
    ///
    /// ```
    /// # use palpate_kinematics::{IkError, IkOptions, SerialChain};
    /// # use palpate_spatial::JointVector;
    /// # let urdf = include_str!("../../../assets/robots/ur3e.urdf");
    /// let chain = SerialChain::<6>::from_urdf_str(urdf, "base_link", "tool0")?;
    /// let seed = JointVector::from([0.0, -1.57, 1.57, -1.57, -1.57, 0.0]);
    /// let mut base_T_tool = chain.forward(&seed);
    /// base_T_tool.translation.z -= 0.001;
    /// // At most what the joints can travel in 2 ms.
    /// let options = IkOptions { period: Some(0.002), ..IkOptions::default() };
    /// let solution = chain.solve_near(&base_T_tool, &seed, &options)?;
    /// assert!(solution.max_step < std::f64::consts::PI * 0.002);
    ///
    /// base_T_tool.translation.z -= 0.1;
    /// let refused = chain.solve_near(&base_T_tool, &seed, &options);
    /// assert!(matches!(refused, Err(IkError::Discontinuous { .. })));
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    ///
    /// # Errors
    /// The first gate that fails, with numbers: a target that is no pose, a seed outside the limits, a
    /// target beyond the reach, no convergence, limits, step, singular value. See [`IkError`].
    pub fn solve_near(
        &self,
        base_T_tip: &Pose,
        seed: &SVector<f64, N>,
        options: &IkOptions,
    ) -> Result<IkSolution<N>, IkError> {
        let target = self.admit(base_T_tip, seed, options)?;
        self.settle(&target, seed, seed, options)
    }

    /// The gates before any search: target, seed, reach.
    #[inline]
    pub(crate) fn admit(
        &self,
        base_T_tip: &Pose,
        seed: &SVector<f64, N>,
        options: &IkOptions,
    ) -> Result<Rigid, IkError> {
        let quaternion = base_T_tip.rotation.quaternion();
        let finite = base_T_tip.translation.vector.iter().all(|x| x.is_finite());
        if !(finite && (quaternion.norm() - 1.0).abs() < 1e-6) {
            return Err(IkError::InvalidTarget);
        }
        let outside =
            |(joint, value, lower, upper)| IkError::SeedOutOfLimits { joint, value, lower, upper };
        self.check_limits(seed, 0.0).map_err(outside)?;
        let unit = UnitQuaternion::new_normalize(*quaternion);
        let target = Rigid::from(&Pose::from_parts(base_T_tip.translation, unit));
        let beyond = target.p.norm() - self.reach();
        if options.task[..3] == [true; 3] && !(beyond <= options.accept) {
            return Err(IkError::Unreachable { beyond });
        }
        Ok(target)
    }

    /// Searches from `start` and passes what is found through the gates; steps count from `seed`.
    #[inline]
    pub(crate) fn settle(
        &self,
        target: &Rigid,
        start: &SVector<f64, N>,
        seed: &SVector<f64, N>,
        options: &IkOptions,
    ) -> Result<IkSolution<N>, IkError> {
        let found = self.search(target, start, options);
        let (mut q, iterations, mut residual) = (found.q, found.iterations, found.residual);
        if self.unwind(&mut q, start) {
            residual = self.residual(target, &q, options);
        }
        let (position_error, rotation_error) = (residual.position, residual.rotation);
        if !residual.within(options.accept) {
            return Err(IkError::NotConverged {
                iterations,
                position: position_error,
                rotation: rotation_error,
            });
        }
        let outside =
            |(joint, value, lower, upper)| IkError::LimitViolation { joint, value, lower, upper };
        self.check_limits(&q, options.limit_margin).map_err(outside)?;
        let max_step = self.check_step(&q, seed, options)?;
        if !(options.min_singular_value <= 0.0) {
            let sigma_min = self.kinematics(&q).smallest_singular_value();
            if !(sigma_min >= options.min_singular_value) {
                return Err(IkError::NearSingular {
                    sigma_min,
                    required: options.min_singular_value,
                });
            }
        }
        Ok(IkSolution { q, iterations, position_error, rotation_error, max_step })
    }

    /// Takes whole turns out of revolute joints farther than half a turn from `start`.
    #[inline]
    fn unwind(&self, q: &mut SVector<f64, N>, start: &SVector<f64, N>) -> bool {
        let mut changed = false;
        for i in 0..N {
            let turned = q[i] - start[i];
            if turned.abs() > 0.5 * TAU && self.is_revolute(i) {
                q[i] -= (turned / TAU).round() * TAU;
                changed = true;
            }
        }
        changed
    }

    /// First joint nearer than `margin` to a limit, with the limits it breaks; NaN is outside.
    #[inline]
    fn check_limits(&self, q: &SVector<f64, N>, margin: f64) -> Result<(), (usize, f64, f64, f64)> {
        let limits = self.limits();
        for i in 0..N {
            let (value, lower, upper) = (q[i], limits.lower[i] + margin, limits.upper[i] - margin);
            if !(value >= lower && value <= upper && value.is_finite()) {
                return Err((i, value, lower, upper));
            }
        }
        Ok(())
    }

    /// The largest step, or the first joint that would have to step too far.
    #[inline]
    fn check_step(
        &self,
        q: &SVector<f64, N>,
        seed: &SVector<f64, N>,
        options: &IkOptions,
    ) -> Result<f64, IkError> {
        let mut max_step: f64 = 0.0;
        for joint in 0..N {
            let step = (q[joint] - seed[joint]).abs();
            let in_time =
                options.period.map_or(f64::INFINITY, |dt| self.limits().velocity[joint] * dt);
            for allowed in [options.max_step, in_time] {
                if !(step <= allowed) {
                    return Err(IkError::Discontinuous { joint, step, allowed });
                }
            }
            max_step = max_step.max(step);
        }
        Ok(max_step)
    }
}
