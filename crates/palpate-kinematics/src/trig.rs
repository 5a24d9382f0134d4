//! Sines and cosines of all joints at once, without a branch, so that the compiler uses vector lanes.
//!
//! Six calls of the standard library's `sin_cos` are most of the cost of forward kinematics. Here an
//! angle is reduced to [−π/4, π/4] with π/2 in three parts (Cody & Waite, *Software Manual for the
//! Elementary Functions*, 1980) and both functions are summed from their Taylor series, whose first
//! dropped terms are below 3e-18 there.

use std::f64::consts::FRAC_2_PI;

use nalgebra::SVector;

/// π/2 in three parts; the first two have 33 bits, so that their products with a count below 2²⁰ are exact.
const HALF_PI: [f64; 3] =
    [1.570_796_326_734_125_6, 6.077_100_506_303_966e-11, 2.022_266_248_795_950_6e-21];

/// Adding 1.5·2⁵² rounds to an integer, which then stands in the lowest bits.
const ROUND: f64 = 6_755_399_441_055_744.0;

/// Larger angles lose digits in the reduction and go the slow way.
const LARGEST: f64 = 1e5;

/// (sin, cos) of every component, within 4.5e-16; NaN and infinity give NaN.
#[inline]
pub(crate) fn sin_cos<const N: usize>(angles: &SVector<f64, N>) -> ([f64; N], [f64; N]) {
    let (mut sin, mut cos) = ([0.0; N], [0.0; N]);
    if angles.iter().all(|x| x.abs() <= LARGEST) {
        for i in 0..N {
            (sin[i], cos[i]) = lane(angles[i]);
        }
    } else {
        for i in 0..N {
            (sin[i], cos[i]) = angles[i].sin_cos();
        }
    }
    (sin, cos)
}

#[inline]
fn lane(x: f64) -> (f64, f64) {
    let shifted = x * FRAC_2_PI + ROUND;
    let count = shifted - ROUND;
    let quadrant = shifted.to_bits();
    let r = ((x - count * HALF_PI[0]) - count * HALF_PI[1]) - count * HALF_PI[2];
    let r2 = r * r;
    let sin = r + r * r2 * series(r2, &SIN);
    let cos = 1.0 - r2 * (0.5 - r2 * series(r2, &COS));
    // Odd quadrants swap sine and cosine; the second bit is the sign.
    let swap = (quadrant & 1).wrapping_neg();
    let (s, c) = (sin.to_bits(), cos.to_bits());
    let s_out = ((s & !swap) | (c & swap)) ^ ((quadrant & 2) << 62);
    let c_out = ((c & !swap) | (s & swap)) ^ ((quadrant.wrapping_add(1) & 2) << 62);
    (f64::from_bits(s_out), f64::from_bits(c_out))
}

/// Horner's scheme.
#[inline]
fn series(x: f64, coefficients: &[f64; 7]) -> f64 {
    let [a, b, c, d, e, f, g] = coefficients;
    ((((((g * x + f) * x + e) * x + d) * x + c) * x + b) * x) + a
}

/// −1/3!, 1/5!, …, −1/15!
const SIN: [f64; 7] = [
    -1.0 / 6.0,
    1.0 / 120.0,
    -1.0 / 5_040.0,
    1.0 / 362_880.0,
    -1.0 / 39_916_800.0,
    1.0 / 6_227_020_800.0,
    -1.0 / 1_307_674_368_000.0,
];

/// 1/4!, −1/6!, …, 1/16!
const COS: [f64; 7] = [
    1.0 / 24.0,
    -1.0 / 720.0,
    1.0 / 40_320.0,
    -1.0 / 3_628_800.0,
    1.0 / 479_001_600.0,
    -1.0 / 87_178_291_200.0,
    1.0 / 20_922_789_888_000.0,
];

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Vector6;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn agrees_with_the_standard_library(x in -1.1e5..1.1e5f64, small in -13.0..13.0f64, n in -100i32..100) {
            let near = f64::from(n) * std::f64::consts::FRAC_PI_4;
            let angles = Vector6::new(small, near, near + 1e-9, -near, small * 1e-8, x.clamp(-1e5, 1e5));
            for angles in [angles, Vector6::repeat(x)] {
                let (sin, cos) = sin_cos(&angles);
                for i in 0..6 {
                    prop_assert!((sin[i] - angles[i].sin()).abs() <= 4.5e-16, "sin {}", angles[i]);
                    prop_assert!((cos[i] - angles[i].cos()).abs() <= 4.5e-16, "cos {}", angles[i]);
                }
            }
        }
    }

    #[test]
    fn what_is_not_finite_stays_so() {
        let (sin, cos) =
            sin_cos(&Vector6::new(f64::NAN, f64::INFINITY, 0.0, 1.0, f64::NEG_INFINITY, 2.0));
        assert!(sin[0].is_nan() && cos[0].is_nan() && sin[1].is_nan() && cos[4].is_nan());
        assert_eq!((sin[2], cos[2]), (0.0, 1.0));
    }
}
