//! Loops over activations and parameters, compiled for the vector unit of the machine at hand.
//!
//! Every sum runs in a fixed order (sixteen running sums, folded pairwise) and nothing is contracted
//! into fused multiply-adds, so an instruction set changes the speed and not one bit. Matrix products
//! are in [`product`](crate::product).
#![expect(
    clippy::inline_always,
    reason = "code is compiled for the vector unit only inside its caller"
)]

use crate::lanes::{LANES, Lanes};

/// Runs `work` with the widest vector instructions the machine has.
pub(crate) fn vectorised<R>(work: impl FnOnce() -> R) -> R {
    pulp::Arch::new().dispatch(work)
}

/// Σ f(aᵢ, bᵢ).
#[inline(always)]
fn sum(a: &[f32], b: &[f32], f: impl Fn(f32, f32) -> f32) -> f32 {
    let mut lanes = [0.0; LANES];
    let ((a, a_rest), (b, b_rest)) = (a.as_chunks::<LANES>(), b.as_chunks::<LANES>());
    for (x, y) in a.iter().zip(b) {
        for lane in 0..LANES {
            lanes[lane] += f(x[lane], y[lane]);
        }
    }
    for (lane, (x, y)) in a_rest.iter().zip(b_rest).enumerate() {
        lanes[lane] += f(*x, *y);
    }
    fold(lanes)
}

/// The sum of all lanes, pairwise.
#[inline(always)]
pub(crate) fn fold(mut lanes: Lanes) -> f32 {
    let mut width = LANES / 2;
    while width > 0 {
        for lane in 0..width {
            lanes[lane] += lanes[lane + width];
        }
        width /= 2;
    }
    lanes[0]
}

/// Σ aᵢ bᵢ.
pub(crate) fn dot(a: &[f32], b: &[f32]) -> f32 {
    vectorised(
        #[inline(always)]
        || sum(a, b, |x, y| x * y),
    )
}

/// Σ xᵢ².
pub(crate) fn sum_of_squares(x: &[f32]) -> f32 {
    vectorised(
        #[inline(always)]
        || sum(x, x, |x, y| x * y),
    )
}

/// max(x, 0), except that NaN stays NaN: a ReLU must not hide it.
#[inline(always)]
fn positive(x: f32) -> f32 {
    if x < 0.0 { 0.0 } else { x }
}

/// Each x becomes max(x, 0).
pub(crate) fn relu(x: &mut [f32]) {
    vectorised(
        #[inline(always)]
        || {
            for x in x {
                *x = positive(*x);
            }
        },
    );
}

/// Gradient through ReLU, in place; `relu` is its output.
pub(crate) fn relu_backward(d: &mut [f32], relu: &[f32]) {
    vectorised(
        #[inline(always)]
        || {
            for (d, y) in d.iter_mut().zip(relu) {
                *d = if *y > 0.0 { *d } else { 0.0 };
            }
        },
    );
}

/// Adds every row of `d` to `sums`, in order: the gradient of a bias.
pub(crate) fn add_rows(d: &[f32], sums: &mut [f32]) {
    vectorised(
        #[inline(always)]
        || {
            for row in d.chunks_exact(sums.len()) {
                for (sum, d) in sums.iter_mut().zip(row) {
                    *sum += d;
                }
            }
        },
    );
}

/// Each row of `to` becomes its number of `x` times `y`, added to zero: a chain of one term.
pub(crate) fn outer(x: &[f32], y: &[f32], to: &mut [f32]) {
    vectorised(
        #[inline(always)]
        || {
            for (x, to) in x.iter().zip(to.chunks_exact_mut(y.len())) {
                for (to, y) in to.iter_mut().zip(y) {
                    *to = x * y + 0.0;
                }
            }
        },
    );
}

/// Factors of one Adam step (Kingma & Ba 2015, Algorithm 1, with the bias corrections taken out of the loop).
#[derive(Clone, Copy)]
pub(crate) struct AdamStep {
    pub(crate) beta1: f32,
    pub(crate) beta2: f32,
    /// Learning rate / (1 − β₁ᵗ).
    pub(crate) rate: f32,
    /// 1 / √(1 − β₂ᵗ).
    pub(crate) correction: f32,
    pub(crate) epsilon: f32,
}

/// p −= rate·m / (√v·correction + ε) after m and v took in the gradient.
pub(crate) fn adam(
    step: AdamStep,
    p: &mut [f32],
    gradient: &[f32],
    first: &mut [f32],
    second: &mut [f32],
) {
    vectorised(
        #[inline(always)]
        || {
            let state = first.iter_mut().zip(second);
            for ((p, g), (m, v)) in p.iter_mut().zip(gradient).zip(state) {
                *m += (g - *m) * (1.0 - step.beta1);
                *v += (g * g - *v) * (1.0 - step.beta2);
                *p -= step.rate * *m / (v.sqrt() * step.correction + step.epsilon);
            }
        },
    );
}

/// target += τ (source − target).
pub(crate) fn track(tau: f32, target: &mut [f32], source: &[f32]) {
    vectorised(
        #[inline(always)]
        || {
            for (t, s) in target.iter_mut().zip(source) {
                *t += tau * (s - *t);
            }
        },
    );
}

/// Inputs whose rows are looked for at a time.
const BLOCK: usize = 64;

/// y += x·w for every row w of `weights` whose x is not zero, one after another; half of all ReLU outputs are.
///
/// Those rows are found without a branch and added four at a time: y then stays in registers for four of them.
pub(crate) fn add_product(y: &mut [f32], x: &[f32], weights: &[f32]) {
    let width = y.len();
    vectorised(
        #[inline(always)]
        || {
            for (x, rows) in x.chunks(BLOCK).zip(weights.chunks(BLOCK * width)) {
                let (mut active, mut count) = ([0; BLOCK], 0);
                for (i, x) in x.iter().enumerate() {
                    active[count] = i;
                    count += usize::from(*x != 0.0);
                }
                let row = |i: usize| (x[i], &rows[i * width..][..width]);
                let (fours, rest) = active[..count].as_chunks();
                for [a, b, c, d] in fours.iter().map(|four| four.map(row)) {
                    for ((((y, wa), wb), wc), wd) in
                        y.iter_mut().zip(a.1).zip(b.1).zip(c.1).zip(d.1)
                    {
                        *y = (((*y + a.0 * wa) + b.0 * wb) + c.0 * wc) + d.0 * wd;
                    }
                }
                for (x, row) in rest.iter().map(|&i| row(i)) {
                    for (y, w) in y.iter_mut().zip(row) {
                        *y += x * w;
                    }
                }
            }
        },
    );
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::{Rng as _, SeedableRng as _};

    #[test]
    fn rows_four_at_a_time_are_added_in_their_order() {
        let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(1);
        for (inputs, width) in
            [(1, 1), (18, 256), (63, 7), (64, 28), (65, 28), (130, 33), (256, 256)]
        {
            for zeros in [0.0, 0.5, 1.0] {
                let mut random = |n: usize| -> Vec<f32> {
                    (0..n).map(|_| rng.random_range(-1.0..1.0)).collect()
                };
                let (mut x, weights, start) =
                    (random(inputs), random(inputs * width), random(width));
                let dead = random(inputs);
                for (x, dead) in x.iter_mut().zip(&dead) {
                    if dead.abs() < zeros {
                        *x = 0.0;
                    }
                }
                let mut expected = start.clone();
                for (x, row) in x.iter().zip(weights.chunks_exact(width)) {
                    if *x != 0.0 {
                        expected.iter_mut().zip(row).for_each(|(y, w)| *y += x * w);
                    }
                }
                let mut y = start;
                add_product(&mut y, &x, &weights);
                let bits = |y: &[f32]| y.iter().map(|y| y.to_bits()).collect::<Vec<_>>();
                assert_eq!(bits(&y), bits(&expected), "{inputs} {width} {zeros}");
            }
        }
        let mut y = [0.0];
        add_product(&mut y, &[f32::NAN], &[1.0]);
        assert!(y[0].is_nan());
    }
}
