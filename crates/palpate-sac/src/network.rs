//! A network: one flat candle variable, computed fused or plainly.

use std::sync::{Arc, Mutex};

use candle_core::backprop::GradStore;
use candle_core::{D, Device, Result, Tensor, Var};

use crate::config::Ops;
use crate::mlp::Shape;
use crate::norm::NORM_EPSILON;
use crate::op::{Area, Call, NetworkOp, PairOp, Part, contiguous, cpu, lock};
use crate::optimiser::{Moments, step_variable};
use crate::team::Team;

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

/// How networks are computed, and by whom.
#[derive(Clone, Debug)]
pub(crate) struct Engine {
    pub(crate) ops: Ops,
    pub(crate) device: Device,
    pub(crate) team: Arc<Team>,
}

impl Engine {
    fn call(&self, held: Option<&Tensor>, flow: Flow) -> Call {
        Call {
            team: Arc::clone(&self.team),
            held: held.cloned(),
            train: flow == Flow::Parameters,
            through: flow == Flow::Input,
        }
    }
}

/// A multi-layer perceptron with its parameters.
#[derive(Debug)]
pub(crate) struct Network {
    engine: Engine,
    shape: Arc<Shape>,
    variable: Var,
    area: Arc<Mutex<Area>>,
}

impl Network {
    pub(crate) fn new(engine: &Engine, shape: Shape, parameters: Vec<f32>) -> Result<Self> {
        let variable = Var::from_vec(parameters, shape.parameters(), &engine.device)?;
        Ok(Self { engine: engine.clone(), shape: Arc::new(shape), variable, area: Arc::default() })
    }

    /// A second network with the same values.
    pub(crate) fn duplicate(&self) -> Result<Self> {
        Self::new(&self.engine, (*self.shape).clone(), self.parameters()?)
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
        if !self.engine.device.is_cpu() {
            to.copy_from_slice(&self.parameters()?);
            return Ok(());
        }
        let (storage, layout) = self.variable.storage_and_layout();
        to.copy_from_slice(contiguous(cpu(&storage)?, layout)?);
        Ok(())
    }

    /// Replaces the flat parameters.
    pub(crate) fn assign(&self, parameters: Vec<f32>) -> Result<()> {
        lock(&self.area)?.parameters_changed();
        let (size, device) = (self.shape.parameters(), &self.engine.device);
        self.variable.set(&Tensor::from_vec(parameters, size, device)?)
    }

    /// Output rows for input rows [held | x].
    pub(crate) fn call(&self, held: Option<&Tensor>, x: &Tensor, flow: Flow) -> Result<Tensor> {
        if self.engine.ops == Ops::Plain {
            return self.call_plain(held, x, flow);
        }
        let op = NetworkOp { call: self.engine.call(held, flow), part: self.part() };
        // Detaching tells candle what the flags tell the operation.
        let (constant, frozen) = (x.detach(), self.variable.as_tensor().detach());
        match flow {
            Flow::Nowhere => constant.apply_op2_no_bwd(&frozen, &op),
            Flow::Parameters => constant.apply_op2(self.variable.as_tensor(), op),
            Flow::Input => x.apply_op2(&frozen, op),
        }
    }

    /// Output rows (first | second) of two networks of one shape for input rows [held | x].
    pub(crate) fn call_both(
        [a, b]: &[Self; 2],
        held: Option<&Tensor>,
        x: &Tensor,
        flow: Flow,
    ) -> Result<Tensor> {
        if a.engine.ops == Ops::Plain {
            return Tensor::cat(&[a.call(held, x, flow)?, b.call(held, x, flow)?], 1);
        }
        let op = PairOp { call: a.engine.call(held, flow), parts: [a.part(), b.part()] };
        let variables = [a.variable.as_tensor(), b.variable.as_tensor()];
        let (constant, frozen) = (x.detach(), variables.map(Tensor::detach));
        match flow {
            Flow::Nowhere => constant.apply_op3_no_bwd(&frozen[0], &frozen[1], &op),
            Flow::Parameters => constant.apply_op3(variables[0], variables[1], op),
            Flow::Input => x.apply_op3(&frozen[0], &frozen[1], op),
        }
    }

    fn part(&self) -> Part {
        Part::new(&self.shape, &self.area)
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
        match self.engine.ops {
            Ops::Fused => {
                let mut area = lock(&self.area)?;
                area.parameters_changed();
                step_variable(&self.variable, area.take_gradient()?, moments, rate)
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
mod gradients;
