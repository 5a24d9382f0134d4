//! Exponentials of sixteen numbers at a time, without branches, so that they compile to vector code.
//!
//! Plain additions and multiplications in a fixed order: the same bits on every machine. NaN stays NaN.
#![expect(
    clippy::inline_always,
    reason = "code is compiled for the vector unit only inside its caller"
)]

pub(crate) const LANES: usize = 16;
pub(crate) type Lanes = [f32; LANES];

/// eˣ, for |x| ≤ 87; beyond, as there.
#[inline(always)]
pub(crate) fn exp(x: f32) -> f32 {
    let (scale, p) = reduced(x);
    scale * p + scale
}

/// eˣ − 1, exact near zero; for |x| ≤ 87, beyond, as there.
#[inline(always)]
pub(crate) fn exp_m1(x: f32) -> f32 {
    let (scale, p) = reduced(x);
    scale * p + (scale - 1.0)
}

/// (2ⁿ, eʳ − 1) with x = n log 2 + r, |r| ≤ ½ log 2.
#[inline(always)]
fn reduced(x: f32) -> (f32, f32) {
    /// Adding it rounds to a whole number, which is then in the low bits.
    const ROUND: f32 = 12_582_912.0;
    // log 2 in two pieces, the first with so few bits that n times it is exact.
    const HIGH: f32 = 0.693_359_4;
    const LOW: f32 = -2.121_944_4e-4;
    const LIMIT: f32 = 87.0;
    let x = if x < -LIMIT { -LIMIT } else { x };
    let x = if x > LIMIT { LIMIT } else { x };
    let shifted = x * std::f32::consts::LOG2_E + ROUND;
    let n = shifted - ROUND;
    let r = (x - n * HIGH) - n * LOW;
    // Taylor series: the first term left out is below 1e-8.
    let tail = 1.0 / 120.0 + r * (1.0 / 720.0 + r * (1.0 / 5040.0));
    let p = r + r * r * (0.5 + r * (1.0 / 6.0 + r * (1.0 / 24.0 + r * tail)));
    (f32::from_bits((shifted.to_bits() << 23).wrapping_add(0x3f80_0000)), p)
}

/// log(1 + x), for x in [0, 1].
#[inline(always)]
pub(crate) fn ln_1p(x: f32) -> f32 {
    // log(1 + x) = 2 artanh(s): s² ≤ 1/9, so that eight terms do.
    let s = x / (2.0 + x);
    let z = s * s;
    let tail = 1.0 / 9.0 + z * (1.0 / 11.0 + z * (1.0 / 13.0 + z * (1.0 / 15.0)));
    2.0 * s * (1.0 + z * (1.0 / 3.0 + z * (1.0 / 5.0 + z * (1.0 / 7.0 + z * tail))))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn worst(from: f64, to: f64, got: fn(f32) -> f32, expected: fn(f64) -> f64) -> f64 {
        (0..=100_000)
            .map(|i| (from + (to - from) * f64::from(i) / 1e5) as f32)
            .map(|x| (f64::from(got(x)) / expected(f64::from(x)) - 1.0).abs())
            .fold(0.0, |worst, error| if error <= worst { worst } else { error })
    }

    #[test]
    fn agree_with_f64_to_a_few_roundings() {
        assert!(worst(-87.0, 87.0, exp, f64::exp) < 2.5e-7);
        assert!(worst(-30.0, -1e-6, exp_m1, f64::exp_m1) < 2.5e-7);
        assert!(worst(1e-6, 1.0, ln_1p, f64::ln_1p) < 2.5e-7);
        assert_eq!((exp(0.0), exp_m1(0.0), ln_1p(0.0)), (1.0, 0.0, 0.0));
        assert!(exp(f32::NAN).is_nan() && exp_m1(f32::NAN).is_nan() && ln_1p(f32::NAN).is_nan());
        assert_eq!(exp_m1(-1e9), -1.0);
    }
}
