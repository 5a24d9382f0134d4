//! The tanh-Gaussian policy: from the actor's raw output to actions and their log-probability.
//!
//! μ and s are the two halves of the output, ε is standard normal:
//!
//! - log σ = min + ½ (max − min)(tanh s + 1)
//! - u = μ + σ ε,  a = tanh u
//! - log π(a) = Σ [−½ ε² − log σ − ½ log 2π] − Σ log(1 − tanh² u)
//!
//! with log(1 − tanh² u) = log 4 − 2|u| − 2 log(1 + e^(−2|u|)), exact where 1 − a² would round to
//! zero (Haarnoja et al. 2018, arXiv 1812.05905, Appendix C).

use std::f64::consts::{LN_2, PI};
use std::sync::Mutex;

use candle_core::{CpuStorage, CustomOp1, Error, Layout, Result, Shape, Tensor, bail};

use crate::config::Ops;
use crate::kernel::vectorised;
use crate::lanes::{exp, exp_m1, ln_1p};
use crate::op::{contiguous, cpu};

/// Bounds of log σ.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct LogStd {
    pub(crate) min: f32,
    pub(crate) max: f32,
}

impl LogStd {
    /// log σ for tanh s.
    #[inline]
    pub(crate) fn bounded(self, tanh_raw: f32) -> f32 {
        self.min + self.half_range() * (tanh_raw + 1.0)
    }

    /// The raw output s that gives this log σ.
    pub(crate) fn raw(self, log_std: f32) -> f32 {
        ((log_std - self.min) / self.half_range() - 1.0).atanh()
    }

    fn half_range(self) -> f32 {
        0.5 * (self.max - self.min)
    }
}

/// Actions (batch, n) and log-probabilities (batch) for raw outputs (batch, 2n) and noise (batch, n).
pub(crate) fn squash(
    ops: Ops,
    bounds: LogStd,
    raw: &Tensor,
    noise: &Tensor,
) -> Result<(Tensor, Tensor)> {
    match ops {
        Ops::Fused => {
            let n = noise.dim(1)?;
            let op = SquashOp { bounds, noise: noise.clone(), saved: Mutex::default() };
            let packed = raw.apply_op1(op)?;
            Ok((packed.narrow(1, 0, n)?, packed.narrow(1, n, 1)?.squeeze(1)?))
        }
        Ops::Plain => squash_plain(bounds, raw, noise),
    }
}

fn squash_plain(bounds: LogStd, raw: &Tensor, noise: &Tensor) -> Result<(Tensor, Tensor)> {
    let n = noise.dim(1)?;
    let half_range = f64::from(bounds.half_range());
    let mean = raw.narrow(1, 0, n)?;
    let log_std =
        raw.narrow(1, n, n)?.tanh()?.affine(half_range, half_range + f64::from(bounds.min))?;
    let u = (mean + (log_std.exp()? * noise)?)?;
    // log(1 − tanh² u) = 2 (log 2 − u − softplus(−2u)); softplus(x) = max(x, 0) + log(1 + e^(−|x|)).
    let x = (&u * -2.0)?;
    let softplus = (x.relu()? + (x.abs()?.neg()?.exp()? + 1.0)?.log()?)?;
    let correction = ((u.neg()? - softplus)? + LN_2)?.affine(2.0, 0.0)?;
    let gauss = ((noise.sqr()? * -0.5)? - log_std)?.affine(1.0, -0.5 * (2.0 * PI).ln())?;
    Ok((u.tanh()?, (gauss - correction)?.sum(1)?))
}

struct SquashOp {
    bounds: LogStd,
    noise: Tensor,
    /// tanh s and σ of the forward pass.
    saved: Mutex<(Vec<f32>, Vec<f32>)>,
}

impl CustomOp1 for SquashOp {
    fn name(&self) -> &'static str {
        "squash"
    }

    /// Rows (action | log-probability).
    fn cpu_fwd(&self, raw: &CpuStorage, layout: &Layout) -> Result<(CpuStorage, Shape)> {
        let (batch, width) = layout.shape().dims2()?;
        let n = width / 2;
        if self.noise.dims() != [batch, n] || width != 2 * n {
            bail!("{:?} noise beside an output of {batch} x {width}", self.noise.dims());
        }
        let (storage, noise_layout) = self.noise.storage_and_layout();
        let noise = contiguous(cpu(&storage)?, noise_layout)?;
        let raw = contiguous(raw, layout)?;
        let [mut means, mut tanhs, mut stds, mut terms] = [(); 4].map(|()| vec![0.0; batch * n]);
        for (row, raw) in raw.chunks_exact(width).enumerate() {
            means[row * n..][..n].copy_from_slice(&raw[..n]);
            tanhs[row * n..][..n].copy_from_slice(&raw[n..]);
        }
        vectorised(
            #[inline(always)]
            || squash_all(self.bounds, noise, (&mut means, &mut tanhs), (&mut stds, &mut terms)),
        );
        let mut packed = Vec::with_capacity(batch * (n + 1));
        for (actions, terms) in means.chunks_exact(n).zip(terms.chunks_exact(n)) {
            packed.extend_from_slice(actions);
            packed.push(terms.iter().fold(0.0, |sum, term| sum + term));
        }
        let saved = (tanhs, stds);
        *self.saved.lock().map_err(poisoned)? = saved;
        Ok((CpuStorage::F32(packed), (batch, n + 1).into()))
    }

    /// With da and dl the gradients of action and log-probability:
    /// du = da (1 − a²) + 2 a dl, dμ = du, d log σ = du σ ε − dl, ds = d log σ · ½ (max − min)(1 − tanh² s).
    fn bwd(&self, raw: &Tensor, packed: &Tensor, d_packed: &Tensor) -> Result<Option<Tensor>> {
        let (batch, width) = raw.dims2()?;
        let n = width / 2;
        let saved = self.saved.lock().map_err(poisoned)?;
        let d_packed = d_packed.contiguous()?;
        let (noise, noise_layout) = self.noise.storage_and_layout();
        let (out, out_layout) = packed.storage_and_layout();
        let (d_out, d_layout) = d_packed.storage_and_layout();
        let noise = contiguous(cpu(&noise)?, noise_layout)?;
        let out = contiguous(cpu(&out)?, out_layout)?;
        let d_out = contiguous(cpu(&d_out)?, d_layout)?;
        let half_range = self.bounds.half_range();
        let mut d_raw = vec![0.0; batch * width];
        for (row, d_raw) in d_raw.chunks_exact_mut(width).enumerate() {
            let out = &out[row * (n + 1)..][..n];
            let d_out = &d_out[row * (n + 1)..][..=n];
            for i in 0..n {
                let (tanh_raw, std) = (saved.0[row * n + i], saved.1[row * n + i]);
                let d_u = d_out[i] * (1.0 - out[i] * out[i]) + 2.0 * out[i] * d_out[n];
                let d_log_std = d_u * std * noise[row * n + i] - d_out[n];
                d_raw[i] = d_u;
                d_raw[n + i] = d_log_std * half_range * (1.0 - tanh_raw * tanh_raw);
            }
        }
        Tensor::from_vec(d_raw, (batch, width), raw.device()).map(Some)
    }
}

fn poisoned(error: impl std::fmt::Display) -> Error {
    Error::Msg(format!("values of the squash operation: {error}"))
}

/// Means become actions and raw deviations tanh s; σ and the terms of the log-probability come beside them.
#[inline(always)]
fn squash_all(
    bounds: LogStd,
    noise: &[f32],
    (means, raw_stds): (&mut [f32], &mut [f32]),
    (stds, terms): (&mut [f32], &mut [f32]),
) {
    const HALF_LOG_TAU: f32 = 0.918_938_5;
    let in_place = means.iter_mut().zip(raw_stds);
    let beside = stds.iter_mut().zip(terms);
    for ((noise, (mean, raw_std)), (std, term)) in noise.iter().zip(in_place).zip(beside) {
        let tanh_raw = tanh(*raw_std);
        let log_std = bounds.bounded(tanh_raw);
        *raw_std = tanh_raw;
        *std = exp(log_std);
        let (action, correction) = tanh_and_correction(*mean + *std * noise);
        *mean = action;
        // Log-density before squashing, less the correction.
        *term = (-0.5 * noise * noise - log_std - HALF_LOG_TAU) - correction;
    }
}

/// tanh u.
#[expect(clippy::inline_always, reason = "compiled for the vector unit only inside its caller")]
#[inline(always)]
pub(crate) fn tanh(u: f32) -> f32 {
    tanh_and_correction(u).0
}

/// tanh u and log(1 − tanh² u), from one exponential.
#[inline(always)]
fn tanh_and_correction(u: f32) -> (f32, f32) {
    const LOG_4: f32 = 1.386_294_4;
    let magnitude = 2.0 * u.abs();
    // e^(−2|u|) − 1 keeps tanh exact near zero.
    let decay = exp_m1(-magnitude);
    let tanh = (-decay / (2.0 + decay)).copysign(u);
    (tanh, LOG_4 - magnitude - 2.0 * ln_1p(1.0 + decay))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::rng::{Streams, fill_normal};
    use candle_core::{Device, Var};

    const BOUNDS: LogStd = LogStd { min: -5.0, max: 2.0 };

    #[test]
    fn correction_is_exact_where_one_minus_tanh_squared_is_not() {
        for u in [-30.0f64, -9.0, -3.0, -0.1, 0.0, 1e-3, 0.7, 5.0, 20.0] {
            let (tanh, correction) = tanh_and_correction(u as f32);
            // log sech² u in f64, from the definition of cosh.
            let expected = -2.0 * ((u.abs() + (-2.0 * u.abs()).exp().ln_1p()) - LN_2);
            assert!((f64::from(tanh) - f64::from(u as f32).tanh()).abs() < 1e-7, "{u}");
            assert!(
                (f64::from(correction) - expected).abs() < 1e-5 * (1.0 + expected.abs()),
                "{u}"
            );
        }
    }

    #[test]
    fn raw_inverts_bounded() {
        for log_std in [-4.9f32, -1.0, 0.0, 1.9] {
            assert!((BOUNDS.bounded(BOUNDS.raw(log_std).tanh()) - log_std).abs() < 1e-5);
        }
    }

    /// The density that log π claims, integrated over all actions, is one.
    #[test]
    fn log_probability_is_that_of_a_density_over_actions() {
        let (mean, raw_std) = (0.4f32, 0.3f32);
        let std = BOUNDS.bounded(raw_std.tanh()).exp();
        let cells = 200_000;
        let actions = (0..cells).map(|i| 2.0 * (f64::from(i) + 0.5) / f64::from(cells) - 1.0);
        let noise: Vec<f32> =
            actions.map(|a| ((a.atanh() - f64::from(mean)) / f64::from(std)) as f32).collect();
        let rows = noise.len();
        let raw = Tensor::from_vec([mean, raw_std].repeat(rows), (rows, 2), &Device::Cpu).unwrap();
        let noise = Tensor::from_vec(noise, (rows, 1), &Device::Cpu).unwrap();
        for ops in [Ops::Fused, Ops::Plain] {
            let (_, log_probability) = squash(ops, BOUNDS, &raw, &noise).unwrap();
            let total: f64 =
                log_probability.to_vec1::<f32>().unwrap().iter().map(|l| f64::from(*l).exp()).sum();
            assert!((total * 2.0 / f64::from(cells) - 1.0).abs() < 2e-3, "{ops:?}: {total}");
        }
    }

    /// Value and gradient of Σ wᵢ outᵢ with every row (action | log-probability) in play.
    fn value_and_gradient(
        ops: Ops,
        raw: &[f32],
        noise: &Tensor,
        weights: &Tensor,
    ) -> (f32, Vec<f32>) {
        let (batch, n) = noise.dims2().unwrap();
        let raw = Var::from_slice(raw, (batch, 2 * n), &Device::Cpu).unwrap();
        let (action, log_probability) = squash(ops, BOUNDS, &raw, noise).unwrap();
        let rows = Tensor::cat(&[action, log_probability.unsqueeze(1).unwrap()], 1).unwrap();
        let value = (rows * weights).unwrap().sum_all().unwrap();
        let gradient =
            value.backward().unwrap().get(&raw).unwrap().flatten_all().unwrap().to_vec1().unwrap();
        (value.to_scalar().unwrap(), gradient)
    }

    #[test]
    fn gradient_matches_plain_operations_and_finite_differences() {
        let (batch, n) = (6, 5);
        let mut rng = Streams::new(3).update;
        let mut draw = |count: usize, scale: f32| {
            let mut values = vec![0.0; count];
            fill_normal(&mut rng, &mut values);
            values.iter().map(|x| scale * x).collect::<Vec<f32>>()
        };
        let raw = draw(batch * 2 * n, 1.2);
        let noise = Tensor::from_vec(draw(batch * n, 1.0), (batch, n), &Device::Cpu).unwrap();
        let weights =
            Tensor::from_vec(draw(batch * (n + 1), 1.0), (batch, n + 1), &Device::Cpu).unwrap();
        let (value, fused) = value_and_gradient(Ops::Fused, &raw, &noise, &weights);
        let (plain_value, plain) = value_and_gradient(Ops::Plain, &raw, &noise, &weights);
        assert!((value - plain_value).abs() < 1e-4 * value.abs().max(1.0), "{value} {plain_value}");
        let n_rows = noise.to_vec2::<f32>().unwrap();
        let w_rows = weights.to_vec2::<f32>().unwrap();
        for i in 0..raw.len() {
            assert!(
                (fused[i] - plain[i]).abs() < 1e-4 * (1.0 + plain[i].abs()),
                "{i}: {} {}",
                fused[i],
                plain[i]
            );
            let step = 1e-5;
            let at = |delta: f64| {
                let mut moved: Vec<f64> = raw.iter().map(|x| f64::from(*x)).collect();
                moved[i] += delta;
                reference(&moved, &n_rows, &w_rows)
            };
            let difference = (at(step) - at(-step)) / (2.0 * step);
            assert!(
                (f64::from(fused[i]) - difference).abs() < 1e-4 * (1.0 + difference.abs()),
                "{i}"
            );
        }
    }

    /// Σ wᵢ outᵢ in f64, straight from the definition.
    fn reference(raw: &[f64], noise: &[Vec<f32>], weights: &[Vec<f32>]) -> f64 {
        let n = noise[0].len();
        let mut total = 0.0;
        for (row, (noise, weights)) in noise.iter().zip(weights).enumerate() {
            let raw = &raw[row * 2 * n..][..2 * n];
            let mut log_probability = 0.0;
            for i in 0..n {
                let log_std = -5.0 + 3.5 * (raw[n + i].tanh() + 1.0);
                let e = f64::from(noise[i]);
                let a = (raw[i] + log_std.exp() * e).tanh();
                total += f64::from(weights[i]) * a;
                log_probability +=
                    -0.5 * e * e - log_std - 0.5 * (2.0 * PI).ln() - (1.0 - a * a).ln();
            }
            total += f64::from(weights[n]) * log_probability;
        }
        total
    }
}
