//! LayerNorm with ReLU, forward and backward, on rows that have just been computed.
//!
//! Sums run in 32 lanes whatever the vector unit: two rounds of sixteen, added up, then folded pairwise. Nothing
//! is contracted into fused multiply-adds, so an instruction set changes the speed and not one bit. Four rows go
//! through together: each waits for its own sums, and the others fill the wait. What is left goes alone.
#![expect(
    clippy::inline_always,
    reason = "code is compiled for the vector unit only inside its caller"
)]

use pulp::{Simd, WithSimd};

use crate::kernel::fold;
use crate::lanes::{LANES, Lanes};

/// Added to the variance, as in torch.nn.LayerNorm.
pub(crate) const NORM_EPSILON: f32 = 1e-5;

/// Rows that go through together.
const TOGETHER: usize = 4;

/// Runs `$work` with as many vectors to sixteen lanes as the machine needs.
macro_rules! by_width {
    ($work:expr, $simd:expr) => {
        match S::F32_LANES {
            16 => $work.run::<S, 1>($simd),
            8 => $work.run::<S, 2>($simd),
            4 => $work.run::<S, 4>($simd),
            _ => $work.run::<S, 16>($simd),
        }
    };
}

/// Each row of `z` becomes ẑ = (z − mean) / √(variance + ε), and `relu` max(ẑ, 0).
pub(crate) fn norm_relu(z: &mut [f32], width: usize, inverse_std: &mut [f32], relu: &mut [f32]) {
    pulp::Arch::new().dispatch(Forward { z, width, inverse_std, relu });
}

struct Forward<'a> {
    z: &'a mut [f32],
    width: usize,
    inverse_std: &'a mut [f32],
    relu: &'a mut [f32],
}

impl WithSimd for Forward<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        by_width!(self, simd);
    }
}

impl Forward<'_> {
    #[inline(always)]
    fn run<S: Simd, const PARTS: usize>(self, simd: S) {
        let Self { z, width, inverse_std, relu } = self;
        let together = TOGETHER * width;
        let rows = z.chunks_mut(together).zip(relu.chunks_mut(together));
        for ((z, relu), inverse_std) in rows.zip(inverse_std.chunks_mut(TOGETHER)) {
            if z.len() == together {
                forward::<S, PARTS, TOGETHER>(simd, z, width, inverse_std, relu);
                continue;
            }
            let rows = z.chunks_exact_mut(width).zip(relu.chunks_exact_mut(width));
            for ((z, relu), inverse_std) in rows.zip(inverse_std.chunks_exact_mut(1)) {
                forward::<S, PARTS, 1>(simd, z, width, inverse_std, relu);
            }
        }
    }
}

#[inline(always)]
fn forward<S: Simd, const PARTS: usize, const ROWS: usize>(
    simd: S,
    z: &mut [f32],
    width: usize,
    inverse_std: &mut [f32],
    relu: &mut [f32],
) {
    let (scale, zero) = (1.0 / width as f32, simd.splat_f32s(0.0));
    let rows = rows::<ROWS>(z, width);
    let means =
        sums::<S, PARTS, ROWS>(simd, rows, rows, |_, z, _| z, |_, z, _| z).map(|sum| scale * sum);
    let many = means.map(|mean| simd.splat_f32s(mean));
    let square = |row: usize, z, _| {
        let d = simd.sub_f32s(z, many[row]);
        simd.mul_f32s(d, d)
    };
    let square_one = |row: usize, z: f32, _| (z - means[row]) * (z - means[row]);
    let factors = sums::<S, PARTS, ROWS>(simd, rows, rows, square, square_one)
        .map(|sum| 1.0 / (scale * sum + NORM_EPSILON).sqrt());
    inverse_std.copy_from_slice(&factors);
    let rows = z.chunks_exact_mut(width).zip(relu.chunks_exact_mut(width));
    for ((z, relu), (mean, factor)) in rows.zip(means.into_iter().zip(factors)) {
        let (means, factors) = (simd.splat_f32s(mean), simd.splat_f32s(factor));
        let (z, z_rest) = S::as_mut_simd_f32s(z);
        let (relu, relu_rest) = S::as_mut_simd_f32s(relu);
        for (z, relu) in z.iter_mut().zip(relu) {
            *z = simd.mul_f32s(simd.sub_f32s(*z, means), factors);
            // As written, NaN stays NaN.
            *relu = simd.select_f32s(simd.less_than_f32s(*z, zero), zero, *z);
        }
        for (z, relu) in z_rest.iter_mut().zip(relu_rest) {
            *z = (*z - mean) * factor;
            *relu = if *z < 0.0 { 0.0 } else { *z };
        }
    }
}

/// The rows of a matrix.
#[inline(always)]
fn rows<const ROWS: usize>(values: &[f32], width: usize) -> [&[f32]; ROWS] {
    std::array::from_fn(|row| &values[row * width..][..width])
}

/// Gradient of a row through ReLU and LayerNorm, in place; `normalised` is ẑ.
///
/// With g = d·[ẑ > 0]: dz = (g − mean(g) − ẑ·mean(g·ẑ)) / √(variance + ε).
pub(crate) fn norm_relu_backward(d: &mut [f32], normalised: &[f32], inverse_std: f32) {
    pulp::Arch::new().dispatch(Backward { d, normalised, inverse_std });
}

struct Backward<'a> {
    d: &'a mut [f32],
    normalised: &'a [f32],
    inverse_std: f32,
}

impl WithSimd for Backward<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        by_width!(self, simd);
    }
}

impl Backward<'_> {
    #[inline(always)]
    fn run<S: Simd, const PARTS: usize>(self, simd: S) {
        let Self { d, normalised, inverse_std } = self;
        let (scale, zero) = (1.0 / d.len() as f32, simd.splat_f32s(0.0));
        let through = |d, z| simd.select_f32s(simd.greater_than_f32s(z, zero), d, zero);
        let through_one = |d: f32, z: f32| if z > 0.0 { d } else { 0.0 };
        let many = |sum, d, z| match sum {
            0 => through(d, z),
            _ => simd.mul_f32s(through(d, z), z),
        };
        let one = |sum, d, z| match sum {
            0 => through_one(d, z),
            _ => through_one(d, z) * z,
        };
        let [mean, along] =
            sums::<S, PARTS, 2>(simd, [&*d; 2], [normalised; 2], many, one).map(|sum| scale * sum);
        let [means, alongs, factors] = [mean, along, inverse_std].map(|x| simd.splat_f32s(x));
        let (d, d_rest) = S::as_mut_simd_f32s(d);
        let (z, z_rest) = S::as_simd_f32s(normalised);
        for (d, z) in d.iter_mut().zip(z) {
            let centred = simd.sub_f32s(through(*d, *z), means);
            *d = simd.mul_f32s(simd.sub_f32s(centred, simd.mul_f32s(*z, alongs)), factors);
        }
        for (d, z) in d_rest.iter_mut().zip(z_rest) {
            *d = (through_one(*d, *z) - mean - z * along) * inverse_std;
        }
    }
}

/// Σᵢ f(n, aₙᵢ, bₙᵢ) for every n; `many` and `one` are f of vectors and of numbers. All rows are of one length.
#[inline(always)]
fn sums<S: Simd, const PARTS: usize, const N: usize>(
    simd: S,
    a: [&[f32]; N],
    b: [&[f32]; N],
    many: impl Fn(usize, S::f32s, S::f32s) -> S::f32s,
    one: impl Fn(usize, f32, f32) -> f32,
) -> [f32; N] {
    let length = a[0].len();
    let mut sums = [[[simd.splat_f32s(0.0); PARTS]; N]; 2];
    let mut from = 0;
    while from + LANES <= length {
        for sums in &mut sums {
            if from + LANES > length {
                break;
            }
            for n in 0..N {
                let a = S::as_simd_f32s(&a[n][from..from + LANES]).0;
                let b = S::as_simd_f32s(&b[n][from..from + LANES]).0;
                for part in 0..PARTS {
                    sums[n][part] = simd.add_f32s(sums[n][part], many(n, a[part], b[part]));
                }
            }
            from += LANES;
        }
    }
    let mut folded = [0.0; N];
    for n in 0..N {
        let mut lanes: Lanes = [0.0; LANES];
        for (part, to) in S::as_mut_simd_f32s(&mut lanes).0.iter_mut().enumerate() {
            *to = simd.add_f32s(sums[0][n][part], sums[1][n][part]);
        }
        for (lane, (a, b)) in lanes.iter_mut().zip(a[n][from..].iter().zip(&b[n][from..])) {
            *lane += one(n, *a, *b);
        }
        folded[n] = fold(lanes);
    }
    folded
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::rng::{Streams, fill_normal};

    fn draw(count: usize, seed: u64) -> Vec<f32> {
        let mut values = vec![0.0; count];
        fill_normal(&mut Streams::new(seed).update, &mut values);
        values
    }

    /// A forward and a backward pass on the vector unit asked for; all their numbers.
    fn passes(width: usize, run: impl Fn(Forward<'_>), back: impl Fn(Backward<'_>)) -> Vec<f32> {
        let rows = TOGETHER + 3;
        let mut z = draw(rows * width, 1);
        let (mut inverse_std, mut relu) = (vec![0.0; rows], vec![0.0; rows * width]);
        run(Forward { z: &mut z, width, inverse_std: &mut inverse_std, relu: &mut relu });
        let mut d = draw(width, 2);
        back(Backward { d: &mut d, normalised: &z[..width], inverse_std: inverse_std[0] });
        [z, relu, inverse_std, d].concat()
    }

    #[test]
    #[cfg(target_arch = "x86_64")]
    fn an_instruction_set_changes_no_bit() {
        let bits = |values: Vec<f32>| values.into_iter().map(f32::to_bits).collect::<Vec<_>>();
        for width in [1, 15, 16, 40, 64, 250, 256] {
            let best = pulp::Arch::new();
            let wide = passes(width, |w| best.dispatch(w), |w| best.dispatch(w));
            let plain = passes(width, |w| w.with_simd(pulp::Scalar), |w| w.with_simd(pulp::Scalar));
            assert_eq!(bits(wide.clone()), bits(plain), "{width}");
            if let Some(v3) = pulp::x86::V3::try_new() {
                let narrow = passes(width, |w| Simd::vectorize(v3, w), |w| Simd::vectorize(v3, w));
                assert_eq!(bits(wide), bits(narrow), "{width}");
            }
        }
    }

    #[test]
    fn rows_together_get_the_bits_of_each_alone() {
        let (width, rows) = (40, 2 * TOGETHER + 1);
        let start = draw(rows * width, 1);
        let (mut z, mut relu) = (start.clone(), vec![0.0; rows * width]);
        let mut inverse_std = vec![0.0; rows];
        norm_relu(&mut z, width, &mut inverse_std, &mut relu);
        for (row, at) in (0..rows).map(|row| (row, row * width..(row + 1) * width)) {
            let (mut alone, mut alone_relu, mut factor) =
                (start[at.clone()].to_vec(), vec![0.0; width], [0.0]);
            norm_relu(&mut alone, width, &mut factor, &mut alone_relu);
            assert_eq!((&z[at.clone()], &relu[at]), (&alone[..], &alone_relu[..]), "{row}");
            assert_eq!(inverse_std[row], factor[0]);
        }
    }

    #[test]
    fn what_is_not_a_number_stays_visible() {
        let (mut z, mut inverse_std, mut relu) = ([1.0, f32::NAN, 2.0, -1.0], [0.0], [0.0; 4]);
        norm_relu(&mut z, 4, &mut inverse_std, &mut relu);
        assert!(relu.iter().all(|x| x.is_nan()), "{relu:?}");
    }
}
