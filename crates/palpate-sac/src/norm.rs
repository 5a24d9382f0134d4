//! LayerNorm with ReLU, forward and backward, on rows that have just been computed.
//!
//! Sums run in 32 lanes whatever the vector unit: two rounds of sixteen, added up, then folded pairwise. Nothing
//! is contracted into fused multiply-adds, so an instruction set changes the speed and not one bit.

use pulp::{Simd, WithSimd};

use crate::kernel::fold;
use crate::lanes::{LANES, Lanes};

/// Added to the variance, as in torch.nn.LayerNorm.
pub(crate) const NORM_EPSILON: f32 = 1e-5;

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
        let (scale, zero) = (1.0 / width as f32, simd.splat_f32s(0.0));
        let rows = z.chunks_exact_mut(width).zip(relu.chunks_exact_mut(width));
        for ((z, relu), inverse_std) in rows.zip(inverse_std) {
            let mean = scale * sum::<S, PARTS>(simd, z, z, |z, _| z, |z, _| z);
            let many = simd.splat_f32s(mean);
            let square = |z, _| {
                let d = simd.sub_f32s(z, many);
                simd.mul_f32s(d, d)
            };
            let variance =
                scale * sum::<S, PARTS>(simd, z, z, square, |z, _| (z - mean) * (z - mean));
            let factor = 1.0 / (variance + NORM_EPSILON).sqrt();
            *inverse_std = factor;
            let factors = simd.splat_f32s(factor);
            let (z, z_rest) = S::as_mut_simd_f32s(z);
            let (relu, relu_rest) = S::as_mut_simd_f32s(relu);
            for (z, relu) in z.iter_mut().zip(relu) {
                *z = simd.mul_f32s(simd.sub_f32s(*z, many), factors);
                // As written, NaN stays NaN.
                *relu = simd.select_f32s(simd.less_than_f32s(*z, zero), zero, *z);
            }
            for (z, relu) in z_rest.iter_mut().zip(relu_rest) {
                *z = (*z - mean) * factor;
                *relu = if *z < 0.0 { 0.0 } else { *z };
            }
        }
    }
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
        let mean = scale * sum::<S, PARTS>(simd, d, normalised, through, through_one);
        let along = scale
            * sum::<S, PARTS>(
                simd,
                d,
                normalised,
                |d, z| simd.mul_f32s(through(d, z), z),
                |d, z| through_one(d, z) * z,
            );
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

/// Σ f(aᵢ, bᵢ); `many` and `one` are f of vectors and of numbers.
#[expect(clippy::inline_always, reason = "compiled for the vector unit only inside its caller")]
#[inline(always)]
fn sum<S: Simd, const PARTS: usize>(
    simd: S,
    a: &[f32],
    b: &[f32],
    many: impl Fn(S::f32s, S::f32s) -> S::f32s,
    one: impl Fn(f32, f32) -> f32,
) -> f32 {
    let ((a, a_rest), (b, b_rest)) = (a.as_chunks::<LANES>(), b.as_chunks::<LANES>());
    let mut sums = [[simd.splat_f32s(0.0); PARTS]; 2];
    let add = |sums: &mut [S::f32s; PARTS], a: &Lanes, b: &Lanes| {
        let (a, b) = (S::as_simd_f32s(a).0, S::as_simd_f32s(b).0);
        for ((sum, a), b) in sums.iter_mut().zip(a).zip(b) {
            *sum = simd.add_f32s(*sum, many(*a, *b));
        }
    };
    let ((a, a_last), (b, b_last)) = (a.as_chunks::<2>(), b.as_chunks::<2>());
    for (a, b) in a.iter().zip(b) {
        add(&mut sums[0], &a[0], &b[0]);
        add(&mut sums[1], &a[1], &b[1]);
    }
    for (a, b) in a_last.iter().zip(b_last) {
        add(&mut sums[0], a, b);
    }
    let mut lanes: Lanes = [0.0; LANES];
    for (to, (x, y)) in
        S::as_mut_simd_f32s(&mut lanes).0.iter_mut().zip(sums[0].iter().zip(&sums[1]))
    {
        *to = simd.add_f32s(*x, *y);
    }
    for (lane, (a, b)) in lanes.iter_mut().zip(a_rest.iter().zip(b_rest)) {
        *lane += one(*a, *b);
    }
    fold(lanes)
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
        let rows = 3;
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
    fn what_is_not_a_number_stays_visible() {
        let (mut z, mut inverse_std, mut relu) = ([1.0, f32::NAN, 2.0, -1.0], [0.0], [0.0; 4]);
        norm_relu(&mut z, 4, &mut inverse_std, &mut relu);
        assert!(relu.iter().all(|x| x.is_nan()), "{relu:?}");
    }
}
