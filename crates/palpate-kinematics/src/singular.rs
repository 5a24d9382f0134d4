//! How far a configuration is from a singularity.

use std::mem::MaybeUninit;

use faer::diag::DiagMut;
use faer::dyn_stack::{MemBuffer, MemStack};
use faer::linalg::svd::{ComputeSvdVectors, svd, svd_scratch};
use faer::{MatRef, Par};
use nalgebra::{Matrix6, SMatrix};

use crate::jacobian::{Frame, Kinematics};

impl<const N: usize> Kinematics<N> {
    /// σ_min of the Jacobian: 0 where a direction of motion is lost.
    ///
    /// The Jacobian mixes m and rad, so compare it only with values of the same arm and tool. NaN where the
    /// joints were not finite.
    ///
    /// ```
    /// # use palpate_kinematics::SerialChain;
    /// # use palpate_spatial::JointVector;
    /// # let urdf = include_str!("../../../assets/robots/ur3e.urdf");
    /// let chain = SerialChain::<6>::from_urdf_str(urdf, "base_link", "tool0")?;
    /// let sigma_min = |q: [f64; 6]| chain.kinematics(&JointVector::from(q)).smallest_singular_value();
    /// assert!(sigma_min([0.0, -1.57, 1.57, -1.57, -1.57, 0.0]) > 0.1);
    /// // Wrist 2 straight: wrist 1 and wrist 3 turn about parallel axes.
    /// assert!(sigma_min([0.0, -1.57, 1.57, -1.57, 0.0, 0.0]) < 1e-15);
    /// # Ok::<(), palpate_kinematics::ModelError>(())
    /// ```
    pub fn smallest_singular_value(&self) -> f64 {
        self.singular_values()[N.min(6) - 1]
    }

    /// Yoshikawa's manipulability √det(J·Jᵀ), the product of the singular values; of a chain of fewer
    /// than six joints √det(Jᵀ·J).
    ///
    /// ```
    /// # use palpate_kinematics::{Frame, SerialChain};
    /// # use palpate_spatial::JointVector;
    /// # let urdf = include_str!("../../../assets/robots/ur3e.urdf");
    /// let chain = SerialChain::<6>::from_urdf_str(urdf, "base_link", "tool0")?;
    /// let here = chain.kinematics(&JointVector::from([0.3, -1.2, 1.9, -2.0, -1.6, 0.4]));
    /// // Six joints: the size of the determinant.
    /// let determinant = here.jacobian(Frame::BaseAligned).determinant();
    /// assert!((here.manipulability() - determinant.abs()).abs() < 1e-12);
    /// # Ok::<(), palpate_kinematics::ModelError>(())
    /// ```
    ///
    /// # References
    /// Yoshikawa 1985, doi:10.1177/027836498500400201.
    pub fn manipulability(&self) -> f64 {
        self.singular_values()[..N.min(6)].iter().product()
    }

    /// Largest first; the first min(6, N) count.
    fn singular_values(&self) -> [f64; 6] {
        let J = self.jacobian(Frame::BaseAligned);
        // An iterative decomposition need not end on NaN.
        if !J.iter().all(|x| x.is_finite()) {
            return [f64::NAN; 6];
        }
        if N <= 6 { small(&J) } else { large(&J) }.unwrap_or([f64::NAN; 6])
    }
}

/// On a 6×6 matrix nalgebra takes half of faer's time.
fn small<const N: usize>(J: &SMatrix<f64, 6, N>) -> Option<[f64; 6]> {
    let square = Matrix6::from_fn(|i, j| if j < N { J[(i, j)] } else { 0.0 });
    let svd = square.try_svd_unordered(false, false, f64::EPSILON, 200)?;
    let mut sigma: [f64; 6] = svd.singular_values.into();
    sigma.sort_unstable_by(|a, b| b.total_cmp(a));
    Some(sigma)
}

fn large<const N: usize>(J: &SMatrix<f64, 6, N>) -> Option<[f64; 6]> {
    let (none, params) = (ComputeSvdVectors::No, faer::Spec::default());
    let need = svd_scratch::<f64>(6, N, none, none, Par::Seq, params);
    // Enough for ordinary arms, so that they need no heap.
    let mut array = [MaybeUninit::<u8>::uninit(); 16 * 1024];
    let mut heap;
    let scratch = if need.unaligned_bytes_required() <= array.len() {
        MemStack::new(&mut array)
    } else {
        heap = MemBuffer::new(need);
        MemStack::new(&mut heap)
    };
    let mut sigma = [0.0; 6];
    let J = MatRef::from_column_major_slice(J.as_slice(), 6, N);
    svd(J, DiagMut::from_slice_mut(&mut sigma), None, None, Par::Seq, scratch, params).ok()?;
    Some(sigma)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn both_decompositions_agree(m in prop::collection::vec(-1.0..1.0f64, 36), lost in 0..7usize) {
            // A repeated column makes the matrix singular.
            let mut J = Matrix6::from_vec(m);
            if (1..6).contains(&lost) {
                J.set_column(lost, &J.column(0).into_owned());
            }
            let (a, b) = (small(&J).unwrap(), large(&J).unwrap());
            for i in 0..6 {
                prop_assert!((a[i] - b[i]).abs() < 1e-14, "{a:?} {b:?}");
            }
            let determinant: f64 = a.iter().product();
            prop_assert!((determinant - J.determinant().abs()).abs() < 1e-13);
        }
    }
}
