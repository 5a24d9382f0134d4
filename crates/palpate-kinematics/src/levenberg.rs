//! Levenberg-Marquardt with Chan's damping, from a start towards a target, limits ignored.

use nalgebra::{SMatrix, SVector};
use palpate_spatial::{Vector3, rotation_error_log};

use crate::chain::SerialChain;
use crate::inverse::IkOptions;
use crate::jacobian::Frame;
use crate::ldl;
use crate::rigid::Rigid;

/// Keeps the normal equations solvable where the error and a singular value vanish together.
const LEAST_DAMPING: f64 = 1e-14;

/// Where a search ended.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Search<const N: usize> {
    pub(crate) q: SVector<f64, N>,
    pub(crate) iterations: u32,
    pub(crate) residual: Residual,
}

/// Lengths of what is left of the pose error.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Residual {
    pub(crate) position: f64,
    pub(crate) rotation: f64,
}

impl Residual {
    /// Whether both parts are at most `bound`; NaN is not.
    pub(crate) fn within(&self, bound: f64) -> bool {
        self.position <= bound && self.rotation <= bound
    }
}

impl<const N: usize> SerialChain<N> {
    /// q ← q + (JᵀJ + λI)⁻¹Jᵀe with e = [p* − p; log(R*Rᵀ)] and λ = ½‖e‖².
    ///
    /// Quadratic near a solution, where λ vanishes; calm at a singularity, where it does not.
    ///
    /// # References
    /// Chan & Lawrence 1988, doi:10.1109/ROBOT.1988.12166; Sugihara 2011, doi:10.1109/TRO.2011.2148230.
    #[inline]
    pub(crate) fn search(
        &self,
        target: &Rigid,
        start: &SVector<f64, N>,
        options: &IkOptions,
    ) -> Search<N> {
        let mut q = *start;
        let mut iterations = 0;
        loop {
            let kinematics = self.kinematics(&q);
            let e = error(target, &kinematics.tip, options.task);
            let residual = lengths(&e);
            if residual.within(options.tolerance) || iterations >= options.max_iterations {
                return Search { q, iterations, residual };
            }
            let mut J = kinematics.jacobian(Frame::BaseAligned);
            for (row, _) in options.task.iter().enumerate().filter(|(_, wanted)| !**wanted) {
                J.row_mut(row).fill(0.0);
            }
            let damping = 0.5 * e.iter().map(|x| x * x).sum::<f64>() + LEAST_DAMPING;
            // Positive definite by construction; an input that breaks this ends the search where it is.
            let Some(step) = step(&J, &e, damping) else {
                return Search { q, iterations, residual };
            };
            q += step;
            iterations += 1;
        }
    }

    /// The error left at `q`.
    pub(crate) fn residual(
        &self,
        target: &Rigid,
        q: &SVector<f64, N>,
        options: &IkOptions,
    ) -> Residual {
        lengths(&error(target, &self.kinematics(q).tip, options.task))
    }
}

/// (JᵀJ + λI)⁻¹Jᵀe for short chains and the identical Jᵀ(JJᵀ + λI)⁻¹e for redundant ones: the smaller
/// system is also the one that stays well conditioned.
#[inline]
fn step<const N: usize>(
    J: &SMatrix<f64, 6, N>,
    e: &[f64; 6],
    damping: f64,
) -> Option<SVector<f64, N>> {
    let columns: &[[f64; 6]; N] = &J.data.0;
    if N <= 6 {
        let mut A = [[0.0; N]; N];
        let mut b = [0.0; N];
        for i in 0..N {
            for j in 0..=i {
                A[i][j] = dot(&columns[i], &columns[j]);
            }
            A[i][i] += damping;
            b[i] = dot(&columns[i], e);
        }
        ldl::solve(A, b).map(SVector::from)
    } else {
        let mut A = [[0.0; 6]; 6];
        for i in 0..6 {
            for j in 0..=i {
                A[i][j] = columns.iter().map(|c| c[i] * c[j]).sum();
            }
            A[i][i] += damping;
        }
        let y = ldl::solve(A, *e)?;
        Some(SVector::from_fn(|i, _| dot(&columns[i], &y)))
    }
}

#[inline]
fn dot(a: &[f64; 6], b: &[f64; 6]) -> f64 {
    (a[0] * b[0] + a[1] * b[1] + a[2] * b[2]) + (a[3] * b[3] + a[4] * b[4] + a[5] * b[5])
}

/// e = [p* − p; log(R*Rᵀ)], base axes, with the components that the task leaves free set to zero.
#[inline]
fn error(target: &Rigid, tip: &Rigid, task: [bool; 6]) -> [f64; 6] {
    let (p, r) = (target.p - tip.p, rotation_error(target, tip));
    let e = [p.x, p.y, p.z, r.x, r.y, r.z];
    std::array::from_fn(|i| if task[i] { e[i] } else { 0.0 })
}

#[inline]
fn lengths(e: &[f64; 6]) -> Residual {
    Residual {
        position: (e[0] * e[0] + e[1] * e[1] + e[2] * e[2]).sqrt(),
        rotation: (e[3] * e[3] + e[4] * e[4] + e[5] * e[5]).sqrt(),
    }
}

/// log(R*Rᵀ) = θ·n from the axes: sin(θ)·n = ½ Σ r_i × r*_i and 1 + 2cos(θ) = Σ r_i · r*_i.
#[inline]
fn rotation_error(target: &Rigid, tip: &Rigid) -> Vector3 {
    let sin_n = (tip.x.cross(&target.x) + tip.y.cross(&target.y) + tip.z.cross(&target.z)) * 0.5;
    let cos = (tip.x.dot(&target.x) + tip.y.dot(&target.y) + tip.z.dot(&target.z) - 1.0) * 0.5;
    let sin2 = sin_n.norm_squared();
    if cos > 0.0 && sin2 < 1e-3 {
        // θ / sin θ = asin(s) / s; the first dropped term is below 4e-14.
        return sin_n * (1.0 + sin2 * (1.0 / 6.0 + sin2 * (3.0 / 40.0 + sin2 * (5.0 / 112.0))));
    }
    if cos > -0.99 {
        let sin = sin2.sqrt();
        return sin_n * (sin.atan2(cos) / sin);
    }
    // Next to a half turn the sine loses the axis; the quaternion does not.
    rotation_error_log(&target.pose().rotation, &tip.pose().rotation)
}

#[cfg(test)]
mod tests {
    use super::*;
    use palpate_spatial::{Pose, UnitQuaternion};
    use proptest::prelude::*;
    use std::f64::consts::PI;

    fn rigid(rotation: UnitQuaternion) -> Rigid {
        Rigid::from(&Pose::from_parts(Vector3::zeros().into(), rotation))
    }

    proptest! {
        #[test]
        fn rotation_error_is_the_logarithm_at_every_angle(
            base in prop::array::uniform3(-3.0..3.0f64),
            axis in prop::array::uniform3(-1.0..1.0f64),
            angle in prop_oneof![0.0..3.1f64, 0.0..1e-6f64, 0.02..0.05f64, 2.9..PI - 1e-6],
        ) {
            prop_assume!(Vector3::from(axis).norm() > 1e-2);
            let turn = Vector3::from(axis).normalize() * angle;
            let tip = UnitQuaternion::from_scaled_axis(base.into());
            let e = rotation_error(&rigid(UnitQuaternion::from_scaled_axis(turn) * tip), &rigid(tip));
            prop_assert!((e - turn).norm() < 1e-11, "{e} instead of {turn}");
        }
    }

    #[test]
    fn both_forms_of_the_step_agree() {
        let J = SMatrix::<f64, 6, 7>::from_fn(|i, j| ((3 * i + 5 * j) as f64).sin());
        let e = [0.1, -0.2, 0.3, 0.05, 0.4, -0.1];
        let direct =
            (J.transpose() * J + SMatrix::<f64, 7, 7>::identity() * 1e-2).try_inverse().unwrap()
                * J.transpose()
                * SVector::<f64, 6>::from(e);
        assert!((step(&J, &e, 1e-2).unwrap() - direct).amax() < 1e-11);
    }
}
