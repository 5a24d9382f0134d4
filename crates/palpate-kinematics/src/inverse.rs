//! Inverse kinematics near a seed.

use nalgebra::{Cholesky, SMatrix, SVector};
use palpate_spatial::{Pose, Vector3, rotation_error_log};

use crate::chain::{Frame, Kinematics, SerialChain};
use crate::error::IkError;

/// How a solution is searched and accepted.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct IkOptions {
    /// Iterations before giving up.
    pub max_iterations: u32,
    /// The search stops at this error, m and rad.
    pub tolerance: f64,
    /// A result is accepted at this error, m and rad.
    pub accept: f64,
    /// Largest step of any joint from the seed, rad or m.
    pub max_step: f64,
}

impl Default for IkOptions {
    /// 40 iterations, 1e-9 sought, 1e-6 accepted, steps of any size.
    fn default() -> Self {
        Self { max_iterations: 40, tolerance: 1e-9, accept: 1e-6, max_step: f64::INFINITY }
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
}

impl<const N: usize> SerialChain<N> {
    /// Finds joints that put the tip at `base_T_tip`, in the solution branch of `seed`.
    ///
    /// Levenberg-Marquardt with Chan's damping, λ = ½‖e‖²: quadratic near the solution, calm at a
    /// singularity. Joint limits are ignored on the way and checked at the end, after each revolute
    /// joint has been brought to within half a turn of its seed. No randomness, no clock, no allocation.
    ///
    /// # Errors
    /// A typed reason with numbers; see [`IkError`].
    ///
    /// # References
    /// Sugihara 2011, doi:10.1109/TRO.2011.2148230; Chan & Lawrence 1988, doi:10.1109/ROBOT.1988.12166.
    pub fn solve_near(
        &self,
        base_T_tip: &Pose,
        seed: &SVector<f64, N>,
        options: &IkOptions,
    ) -> Result<IkSolution<N>, IkError> {
        check_target(base_T_tip)?;
        self.check_limits(seed).map_err(|(joint, value, lower, upper)| IkError::SeedOutOfLimits {
            joint,
            value,
            lower,
            upper,
        })?;
        let beyond = base_T_tip.translation.vector.norm() - self.reach();
        if !(beyond <= 0.0) {
            return Err(IkError::Unreachable { beyond });
        }
        let (mut q, iterations) = self.iterate(base_T_tip, seed, options);
        for i in 0..N {
            // Half-turn windows keep the branch; prismatic joints are never near a full turn of metres.
            if self.is_revolute(i) {
                let turns = ((q[i] - seed[i]) / std::f64::consts::TAU).round();
                q[i] -= turns * std::f64::consts::TAU;
            }
        }
        let (position, rotation) = Errors::of(base_T_tip, &self.kinematics(&q)).norms();
        if !(position <= options.accept && rotation <= options.accept) {
            return Err(IkError::NotConverged { iterations, position, rotation });
        }
        self.check_limits(&q).map_err(|(joint, value, lower, upper)| IkError::LimitViolation {
            joint,
            value,
            lower,
            upper,
        })?;
        for joint in 0..N {
            let step = (q[joint] - seed[joint]).abs();
            if !(step <= options.max_step) {
                return Err(IkError::Discontinuous { joint, step, allowed: options.max_step });
            }
        }
        Ok(IkSolution { q, iterations, position_error: position, rotation_error: rotation })
    }

    fn iterate(&self, target: &Pose, seed: &SVector<f64, N>, options: &IkOptions) -> (SVector<f64, N>, u32) {
        let mut q = *seed;
        for iteration in 0..options.max_iterations {
            let kinematics = self.kinematics(&q);
            let errors = Errors::of(target, &kinematics);
            let (position, rotation) = errors.norms();
            if position < options.tolerance && rotation < options.tolerance {
                return (q, iteration);
            }
            let e = errors.stacked();
            let J = kinematics.jacobian(Frame::BaseAligned);
            let damping = 0.5 * e.norm_squared() + 1e-14;
            let A = J.tr_mul(&J) + SMatrix::<f64, N, N>::identity() * damping;
            // Positive definite by construction; what rounding breaks ends the search where it is.
            let Some(cholesky) = Cholesky::new(A) else { return (q, iteration) };
            q += cholesky.solve(&J.tr_mul(&e));
        }
        (q, options.max_iterations)
    }

    /// First joint outside its limits; NaN is outside.
    fn check_limits(&self, q: &SVector<f64, N>) -> Result<(), (usize, f64, f64, f64)> {
        let limits = self.limits();
        for i in 0..N {
            let (value, lower, upper) = (q[i], limits.lower[i], limits.upper[i]);
            if !(value >= lower && value <= upper && value.is_finite()) {
                return Err((i, value, lower, upper));
            }
        }
        Ok(())
    }
}

fn check_target(target: &Pose) -> Result<(), IkError> {
    let norm = target.rotation.quaternion().norm();
    let finite = target.translation.vector.iter().all(|x| x.is_finite());
    if !(finite && (norm - 1.0).abs() < 1e-6) {
        return Err(IkError::InvalidTarget);
    }
    Ok(())
}

/// e = [p* − p; log(R* Rᵀ)], base axes.
struct Errors {
    position: Vector3,
    rotation: Vector3,
}

impl Errors {
    fn of<const N: usize>(target: &Pose, kinematics: &Kinematics<N>) -> Self {
        let pose = kinematics.pose();
        Self {
            position: target.translation.vector - pose.translation.vector,
            rotation: rotation_error_log(&target.rotation, &pose.rotation),
        }
    }

    fn norms(&self) -> (f64, f64) {
        (self.position.norm(), self.rotation.norm())
    }

    fn stacked(&self) -> SVector<f64, 6> {
        let (p, r) = (self.position, self.rotation);
        SVector::<f64, 6>::new(p.x, p.y, p.z, r.x, r.y, r.z)
    }
}
