//! A network: one flat candle variable, computed fused or plainly.

use std::sync::atomic::AtomicU64;
use std::sync::{Arc, Mutex};

use candle_core::backprop::GradStore;
use candle_core::{D, Device, Result, Tensor, Var};

use crate::config::Ops;
use crate::kernel::NORM_EPSILON;
use crate::mlp::Shape;
use crate::op::{Area, NetworkOp, contiguous, cpu, lock};
use crate::optimiser::{Moments, step_variable};

/// What gradients flow to when a network is called.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Flow {
    /// Nothing: the result is a constant.
    Nowhere,
    /// Its parameters: it is being trained.
    Parameters,
    /// Its right-hand input columns: it judges, frozen.
    Input,
}

/// A multi-layer perceptron with its parameters.
#[derive(Debug)]
pub(crate) struct Network {
    ops: Ops,
    shape: Arc<Shape>,
    variable: Var,
    area: Arc<Mutex<Area>>,
}

impl Network {
    pub(crate) fn new(ops: Ops, shape: Shape, parameters: Vec<f32>) -> Result<Self> {
        let variable = Var::from_vec(parameters, shape.parameters(), &Device::Cpu)?;
        Ok(Self { ops, shape: Arc::new(shape), variable, area: Arc::default() })
    }

    /// A second network with the same values.
    pub(crate) fn duplicate(&self) -> Result<Self> {
        Self::new(self.ops, (*self.shape).clone(), self.parameters()?)
    }

    pub(crate) fn shape(&self) -> &Shape {
        &self.shape
    }

    pub(crate) fn variable(&self) -> &Var {
        &self.variable
    }

    /// A copy of the flat parameters.
    pub(crate) fn parameters(&self) -> Result<Vec<f32>> {
        self.variable.as_tensor().to_vec1()
    }

    /// Copies the flat parameters into a slice of their number.
    pub(crate) fn copy_parameters(&self, to: &mut [f32]) -> Result<()> {
        let (storage, layout) = self.variable.storage_and_layout();
        to.copy_from_slice(contiguous(cpu(&storage)?, layout)?);
        Ok(())
    }

    /// Replaces the flat parameters.
    pub(crate) fn assign(&self, parameters: Vec<f32>) -> Result<()> {
        self.variable.set(&Tensor::from_vec(parameters, self.shape.parameters(), &Device::Cpu)?)
    }

    /// Output rows for input rows [held | x].
    pub(crate) fn call(&self, held: Option<&Tensor>, x: &Tensor, flow: Flow) -> Result<Tensor> {
        match self.ops {
            Ops::Fused => self.call_fused(held, x, flow),
            Ops::Plain => self.call_plain(held, x, flow),
        }
    }

    fn call_fused(&self, held: Option<&Tensor>, x: &Tensor, flow: Flow) -> Result<Tensor> {
        let op = NetworkOp {
            shape: Arc::clone(&self.shape),
            area: Arc::clone(&self.area),
            held: held.cloned(),
            train: flow == Flow::Parameters,
            through: flow == Flow::Input,
            pass: AtomicU64::new(0),
        };
        // Detaching tells candle what the flags tell the operation.
        let (constant, frozen) = (x.detach(), self.variable.as_tensor().detach());
        match flow {
            Flow::Nowhere => constant.apply_op2_no_bwd(&frozen, &op),
            Flow::Parameters => constant.apply_op2(self.variable.as_tensor(), op),
            Flow::Input => x.apply_op2(&frozen, op),
        }
    }

    fn call_plain(&self, held: Option<&Tensor>, x: &Tensor, flow: Flow) -> Result<Tensor> {
        let trained = flow == Flow::Parameters;
        let parameters = if trained {
            self.variable.as_tensor().clone()
        } else {
            self.variable.as_tensor().detach()
        };
        let x = if flow == Flow::Input { x.clone() } else { x.detach() };
        let mut x = match held {
            Some(held) => Tensor::cat(&[held, &x], 1)?,
            None => x.contiguous()?,
        };
        let layers = self.shape.layers();
        for (index, layer) in layers.iter().enumerate() {
            let w = parameters.narrow(0, layer.weight.start, layer.weight.len())?;
            let b = parameters.narrow(0, layer.bias.start, layer.bias.len())?;
            x = x.matmul(&w.reshape((layer.inputs, layer.outputs))?)?.broadcast_add(&b)?;
            if index + 1 < layers.len() {
                x = if self.shape.layer_norm { plain_norm(&x)?.relu()? } else { x.relu()? };
            }
        }
        Ok(x)
    }

    /// One Adam step along the gradient of the latest backward pass; returns the gradient's norm.
    ///
    /// A norm that is not finite leaves the parameters as they are.
    pub(crate) fn step(
        &self,
        gradients: &GradStore,
        moments: &mut Moments,
        rate: f64,
    ) -> Result<f32> {
        match self.ops {
            Ops::Fused => {
                step_variable(&self.variable, lock(&self.area)?.take_gradient()?, moments, rate)
            }
            Ops::Plain => match gradients.get(self.variable.as_tensor()) {
                Some(gradient) => {
                    step_variable(&self.variable, &gradient.to_vec1()?, moments, rate)
                }
                None => candle_core::bail!("backward did not pass through the network"),
            },
        }
    }
}

/// (x − mean) / √(variance + ε) over each row, from operations that candle differentiates.
fn plain_norm(x: &Tensor) -> Result<Tensor> {
    let centred = x.broadcast_sub(&x.mean_keepdim(D::Minus1)?)?;
    let variance = centred.sqr()?.mean_keepdim(D::Minus1)?;
    centred.broadcast_div(&(variance + f64::from(NORM_EPSILON))?.sqrt()?)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::rng::{Streams, fill_normal};

    const ROWS: usize = 6;
    const HELD: usize = 4;
    const COLUMNS: usize = 3;

    fn draw(streams: &mut Streams, count: usize) -> Vec<f32> {
        let mut values = vec![0.0; count];
        fill_normal(&mut streams.update, &mut values);
        values
    }

    /// Σ w·network([held | x]) in f64, straight from the definition.
    fn reference(shape: &Shape, parameters: &[f64], rows: &[Vec<f64>], w: &[f32]) -> f64 {
        let last = shape.layers().len() - 1;
        let mut total = 0.0;
        for (row, w) in rows.iter().zip(w) {
            let mut x = row.clone();
            for (index, layer) in shape.layers().iter().enumerate() {
                let mut y: Vec<f64> = parameters[layer.bias.clone()].to_vec();
                for (i, x) in x.iter().enumerate() {
                    for (j, y) in y.iter_mut().enumerate() {
                        *y += x * parameters[layer.weight.start + i * layer.outputs + j];
                    }
                }
                if index < last {
                    if shape.layer_norm {
                        let n = y.len() as f64;
                        let mean = y.iter().sum::<f64>() / n;
                        let variance = y.iter().map(|y| (y - mean).powi(2)).sum::<f64>() / n;
                        let scale = (variance + f64::from(NORM_EPSILON)).sqrt();
                        y.iter_mut().for_each(|y| *y = (*y - mean) / scale);
                    }
                    y.iter_mut().for_each(|y| *y = y.max(0.0));
                }
                x = y;
            }
            total += f64::from(*w) * x[0];
        }
        total
    }

    /// Gradients of both operations against central differences, of weights and of the input columns.
    #[test]
    fn gradients_are_those_of_the_definition() {
        for layer_norm in [false, true] {
            let streams = &mut Streams::new(9);
            let shape = Shape::new(HELD + COLUMNS, &[12, 10], 1, layer_norm);
            let parameters = shape.init(&mut streams.init);
            let held = draw(streams, ROWS * HELD);
            let x = draw(streams, ROWS * COLUMNS);
            let w = draw(streams, ROWS);
            let rows = |x: &[f64]| -> Vec<Vec<f64>> {
                let held = held.chunks(HELD).zip(x.chunks(COLUMNS));
                held.map(|(h, x)| {
                    h.iter().map(|h| f64::from(*h)).chain(x.iter().copied()).collect()
                })
                .collect()
            };
            let wide = |v: &[f32]| v.iter().map(|x| f64::from(*x)).collect::<Vec<f64>>();
            let slope = |at: &dyn Fn(f64) -> f64| (at(1e-5) - at(-1e-5)) / 2e-5;

            for ops in [Ops::Fused, Ops::Plain] {
                let network = Network::new(ops, shape.clone(), parameters.clone()).unwrap();
                let held_t = Tensor::from_slice(&held, (ROWS, HELD), &Device::Cpu).unwrap();
                let x_t = Var::from_slice(&x, (ROWS, COLUMNS), &Device::Cpu).unwrap();
                let w_t = Tensor::from_slice(&w, (ROWS, 1), &Device::Cpu).unwrap();
                let value = |flow| {
                    let y = network.call(Some(&held_t), x_t.as_tensor(), flow).unwrap();
                    (y * &w_t).unwrap().sum_all().unwrap()
                };
                let gradients = value(Flow::Input).backward().unwrap();
                let of_input: Vec<f32> =
                    gradients.get(&x_t).unwrap().flatten_all().unwrap().to_vec1().unwrap();
                for (i, g) in of_input.iter().enumerate() {
                    let expected = slope(&|d| {
                        let mut x = wide(&x);
                        x[i] += d;
                        reference(&shape, &wide(&parameters), &rows(&x), &w)
                    });
                    let what = format!("{ops:?}, norm {layer_norm}, input {i}: {g} {expected}");
                    assert!(
                        (f64::from(*g) - expected).abs() < 2e-4 * (1.0 + expected.abs()),
                        "{what}"
                    );
                }
                let gradients = value(Flow::Parameters).backward().unwrap();
                assert!(gradients.get(&x_t).is_none(), "training a network moves no input");
                let of_weights: Vec<f32> = match ops {
                    Ops::Fused => lock(&network.area).unwrap().take_gradient().unwrap().to_vec(),
                    Ops::Plain => {
                        gradients.get(network.variable.as_tensor()).unwrap().to_vec1().unwrap()
                    }
                };
                for (i, g) in of_weights.iter().enumerate() {
                    let expected = slope(&|d| {
                        let mut parameters = wide(&parameters);
                        parameters[i] += d;
                        reference(&shape, &parameters, &rows(&wide(&x)), &w)
                    });
                    let what = format!("{ops:?}, norm {layer_norm}, weight {i}: {g} {expected}");
                    assert!(
                        (f64::from(*g) - expected).abs() < 2e-4 * (1.0 + expected.abs()),
                        "{what}"
                    );
                }
            }
        }
    }
}
