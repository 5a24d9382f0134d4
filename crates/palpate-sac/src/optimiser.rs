//! Adam and target tracking, in place on flat variables, with moments that can be saved.

use std::cell::RefCell;

use candle_core::{CpuStorage, InplaceOp1, InplaceOp2, Layout, Result, Tensor, Var, bail};

use crate::kernel::{self, AdamStep};
use crate::op::contiguous;

const BETA1: f64 = 0.9;
const BETA2: f64 = 0.999;
const EPSILON: f32 = 1e-8;

/// State of Adam for one variable.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Moments {
    /// Running mean of the gradient.
    pub(crate) first: Vec<f32>,
    /// Running mean of its square.
    pub(crate) second: Vec<f32>,
    /// Steps taken.
    pub(crate) steps: u64,
}

impl Moments {
    pub(crate) fn new(parameters: usize) -> Self {
        Self { first: vec![0.0; parameters], second: vec![0.0; parameters], steps: 0 }
    }
}

/// One Adam step (Kingma & Ba 2015, Algorithm 1; β = 0.9, 0.999, ε = 1e-8); returns the gradient's norm.
///
/// A norm that is not finite leaves variable and moments as they are.
pub(crate) fn step_variable(
    variable: &Var,
    gradient: &[f32],
    moments: &mut Moments,
    rate: f64,
) -> Result<f32> {
    let norm = kernel::sum_of_squares(gradient).sqrt();
    if !norm.is_finite() {
        return Ok(norm);
    }
    moments.steps += 1;
    let power = moments.steps as f64;
    let step = AdamStep {
        beta1: BETA1 as f32,
        beta2: BETA2 as f32,
        rate: (rate / (1.0 - BETA1.powf(power))) as f32,
        correction: (1.0 / (1.0 - BETA2.powf(power)).sqrt()) as f32,
        epsilon: EPSILON,
    };
    let adam = Adam { step, gradient, moments: RefCell::new(moments) };
    if variable.device().is_cpu() {
        variable.inplace_op1(&adam)?;
    } else {
        // The moments live here, as they are saved; so the step is taken here.
        let (mut parameters, shape) = (variable.to_vec1()?, variable.shape());
        adam.step(&mut parameters)?;
        variable.set(&Tensor::from_vec(parameters, shape, variable.device())?)?;
    }
    Ok(norm)
}

/// target += τ (source − target).
pub(crate) fn track(target: &Var, source: &Tensor, tau: f64) -> Result<()> {
    if !target.device().is_cpu() {
        let step = (source - target.as_tensor())?.affine(tau, 0.0)?;
        return target.set(&(target.as_tensor() + step)?);
    }
    target.inplace_op2(source, &Track { tau: tau as f32 })
}

struct Adam<'a> {
    step: AdamStep,
    gradient: &'a [f32],
    // candle lends operations by shared reference; the moments are written once, inside the call.
    moments: RefCell<&'a mut Moments>,
}

impl Adam<'_> {
    fn step(&self, parameters: &mut [f32]) -> Result<()> {
        let mut moments = self.moments.borrow_mut();
        let Moments { first, second, .. } = &mut **moments;
        if [self.gradient.len(), first.len(), second.len()] != [parameters.len(); 3] {
            bail!("{} parameters given a gradient of {}", parameters.len(), self.gradient.len());
        }
        kernel::adam(self.step, parameters, self.gradient, first, second);
        Ok(())
    }
}

impl InplaceOp1 for Adam<'_> {
    fn name(&self) -> &'static str {
        "adam"
    }

    fn cpu_fwd(&self, variable: &mut CpuStorage, layout: &Layout) -> Result<()> {
        self.step(contiguous_mut(variable, layout)?)
    }
}

struct Track {
    tau: f32,
}

impl InplaceOp2 for Track {
    fn name(&self) -> &'static str {
        "track"
    }

    fn cpu_fwd(
        &self,
        target: &mut CpuStorage,
        target_layout: &Layout,
        source: &CpuStorage,
        source_layout: &Layout,
    ) -> Result<()> {
        let (target, source) =
            (contiguous_mut(target, target_layout)?, contiguous(source, source_layout)?);
        if target.len() != source.len() {
            bail!("a target of {} parameters cannot track {}", target.len(), source.len());
        }
        kernel::track(self.tau, target, source);
        Ok(())
    }
}

fn contiguous_mut<'a>(storage: &'a mut CpuStorage, layout: &Layout) -> Result<&'a mut [f32]> {
    match (storage, layout.contiguous_offsets()) {
        (CpuStorage::F32(values), Some((from, to))) => Ok(&mut values[from..to]),
        _ => bail!("expected a contiguous f32 variable, got {layout:?}"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use candle_core::Device;

    #[test]
    fn adam_follows_its_definition() {
        // Literal transcription of Algorithm 1 in f64.
        let gradients = [[0.3, -2.0], [-0.1, 1e-4], [0.5, 0.0]];
        let (mut p, mut m, mut v) = ([1.0f64, -1.0], [0.0f64; 2], [0.0f64; 2]);
        let variable = Var::from_slice(&[1.0f32, -1.0], 2, &Device::Cpu).unwrap();
        let mut moments = Moments::new(2);
        for (t, gradient) in (1..).zip(&gradients) {
            for i in 0..2 {
                let g = f64::from(gradient[i] as f32);
                m[i] = 0.9 * m[i] + 0.1 * g;
                v[i] = 0.999 * v[i] + 0.001 * g * g;
                let (mh, vh) = (m[i] / (1.0 - 0.9f64.powi(t)), v[i] / (1.0 - 0.999f64.powi(t)));
                p[i] -= 0.01 * mh / (vh.sqrt() + 1e-8);
            }
            step_variable(&variable, &gradient.map(|g| g as f32), &mut moments, 0.01).unwrap();
            let got: Vec<f32> = variable.to_vec1().unwrap();
            for i in 0..2 {
                assert!((f64::from(got[i]) - p[i]).abs() < 1e-6, "{got:?} {p:?}");
            }
        }
    }

    #[test]
    fn a_gradient_that_is_not_finite_changes_nothing() {
        let variable = Var::from_slice(&[1.0f32, -1.0], 2, &Device::Cpu).unwrap();
        let mut moments = Moments::new(2);
        let norm = step_variable(&variable, &[f32::NAN, 0.0], &mut moments, 0.1).unwrap();
        assert!(norm.is_nan());
        assert_eq!(moments, Moments::new(2));
        assert_eq!(variable.to_vec1::<f32>().unwrap(), [1.0, -1.0]);
    }

    #[test]
    fn a_target_moves_its_share() {
        let target = Var::from_slice(&[0.0f32, 10.0], 2, &Device::Cpu).unwrap();
        let source = Tensor::new(&[1.0f32, 0.0], &Device::Cpu).unwrap();
        track(&target, &source, 0.25).unwrap();
        assert_eq!(target.to_vec1::<f32>().unwrap(), [0.25, 7.5]);
    }
}
