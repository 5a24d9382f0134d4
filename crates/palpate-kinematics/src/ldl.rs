//! Small positive definite systems.
#![expect(clippy::neg_cmp_op_on_partial_ord, reason = "a NaN pivot must be refused")]

/// Solves A·x = b for a symmetric positive definite A by A = L·D·Lᵀ; reads the lower triangle.
///
/// None when a pivot is not positive, which includes NaN. No square roots, no allocation.
///
/// # References
/// Golub & Van Loan, *Matrix Computations*, 4th ed., Sect. 4.1.2.
#[expect(clippy::needless_range_loop, reason = "indices read as the formula does")]
#[inline]
pub(crate) fn solve<const D: usize>(mut A: [[f64; D]; D], mut b: [f64; D]) -> Option<[f64; D]> {
    let mut inverse_pivots = [0.0; D];
    for j in 0..D {
        if !(A[j][j] > 0.0) {
            return None;
        }
        inverse_pivots[j] = 1.0 / A[j][j];
        for i in j + 1..D {
            let l = A[i][j] * inverse_pivots[j];
            for k in j + 1..=i {
                A[i][k] -= l * A[k][j];
            }
            b[i] -= l * b[j];
        }
        // Column j keeps L·D: what the rows below still multiply by.
    }
    for j in (0..D).rev() {
        for i in j + 1..D {
            b[j] -= A[i][j] * b[i];
        }
        b[j] *= inverse_pivots[j];
    }
    Some(b)
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::{SMatrix, SVector};
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn reproduces_the_right_hand_side(m in prop::array::uniform32(-1.0..1.0f64), x in prop::array::uniform5(-1.0..1.0f64)) {
            let M = SMatrix::<f64, 5, 5>::from_fn(|i, j| m[5 * i + j]);
            let A = M * M.transpose() + SMatrix::identity() * 1e-3;
            let b = A * SVector::from(x);
            let solved = solve(A.transpose().into(), b.into()).unwrap();
            prop_assert!((SVector::from(solved) - SVector::from(x)).amax() < 1e-9);
        }
    }

    #[test]
    fn refuses_what_is_not_positive_definite() {
        assert_eq!(solve([[1.0, 0.0], [2.0, 1.0]], [1.0, 1.0]), None);
        assert_eq!(solve([[f64::NAN]], [1.0]), None);
    }
}
