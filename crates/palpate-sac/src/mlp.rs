//! A multi-layer perceptron on plain slices: its shape, its values, its gradients.

use std::ops::Range;

use rand::Rng;
use rand_chacha::ChaCha8Rng;

use crate::kernel::{self, Matrix};

/// One linear layer inside a network's flat parameters.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Layer {
    pub(crate) inputs: usize,
    pub(crate) outputs: usize,
    /// Where the weight is, (inputs, outputs) row-major.
    pub(crate) weight: Range<usize>,
    /// Where the bias is.
    pub(crate) bias: Range<usize>,
}

/// Sizes of a network and where its layers lie in one flat vector: W₁, b₁, W₂, b₂, …
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Shape {
    layers: Vec<Layer>,
    /// LayerNorm, without affine part, between each hidden layer and its ReLU.
    pub(crate) layer_norm: bool,
}

impl Shape {
    pub(crate) fn new(inputs: usize, hidden: &[usize], outputs: usize, layer_norm: bool) -> Self {
        let (mut layers, mut from, mut start) = (Vec::new(), inputs, 0);
        for &to in hidden.iter().chain(&[outputs]) {
            let bias = start + from * to;
            layers.push(Layer {
                inputs: from,
                outputs: to,
                weight: start..bias,
                bias: bias..bias + to,
            });
            (from, start) = (to, bias + to);
        }
        Self { layers, layer_norm }
    }

    pub(crate) fn layers(&self) -> &[Layer] {
        &self.layers
    }

    pub(crate) fn inputs(&self) -> usize {
        self.layers[0].inputs
    }

    pub(crate) fn outputs(&self) -> usize {
        self.last().outputs
    }

    /// Numbers in the flat parameters.
    pub(crate) fn parameters(&self) -> usize {
        self.last().bias.end
    }

    pub(crate) fn last(&self) -> &Layer {
        &self.layers[self.layers.len() - 1]
    }

    /// Weights and biases uniform in ±1/√inputs, as torch.nn.Linear starts.
    pub(crate) fn init(&self, rng: &mut ChaCha8Rng) -> Vec<f32> {
        let mut parameters = vec![0.0; self.parameters()];
        for layer in &self.layers {
            let bound = 1.0 / (layer.inputs as f32).sqrt();
            parameters[layer.weight.start..layer.bias.end]
                .fill_with(|| rng.random_range(-bound..bound));
        }
        parameters
    }
}

/// What one forward pass leaves for its backward pass. Grows to the largest batch, then stays.
#[derive(Debug, Default)]
pub(crate) struct Work {
    batch: usize,
    /// Input rows.
    pub(crate) input: Vec<f32>,
    hidden: Vec<Hidden>,
    delta: Vec<f32>,
    delta_below: Vec<f32>,
    /// Gradient of the parameters, from the latest backward pass that was asked for it.
    pub(crate) gradient: Vec<f32>,
}

#[derive(Debug, Default)]
struct Hidden {
    /// Normalised pre-activation; empty without LayerNorm.
    normalised: Vec<f32>,
    inverse_std: Vec<f32>,
    /// Output of the ReLU.
    activation: Vec<f32>,
}

/// Which gradients a backward pass computes.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Wanted {
    /// The gradient of the parameters; without it the network is frozen.
    pub(crate) parameters: bool,
    /// The input columns whose gradient is wanted.
    pub(crate) input: Range<usize>,
}

impl Work {
    /// Makes room for a batch and returns the input rows to fill.
    pub(crate) fn prepare(&mut self, shape: &Shape, batch: usize) -> &mut [f32] {
        self.batch = batch;
        self.gradient.resize(shape.parameters(), 0.0);
        self.input.resize(batch * shape.inputs(), 0.0);
        let hidden = &shape.layers()[..shape.layers().len() - 1];
        self.hidden.resize_with(hidden.len(), Hidden::default);
        for (work, layer) in self.hidden.iter_mut().zip(hidden) {
            work.activation.resize(batch * layer.outputs, 0.0);
            if shape.layer_norm {
                work.normalised.resize(batch * layer.outputs, 0.0);
                work.inverse_std.resize(batch, 0.0);
            }
        }
        &mut self.input
    }

    /// Output rows for the prepared input.
    pub(crate) fn forward(&mut self, shape: &Shape, parameters: &[f32], output: &mut [f32]) {
        let (last, layers) = (shape.last(), shape.layers());
        let mut below: &[f32] = &self.input;
        for (hidden, layer) in self.hidden.iter_mut().zip(layers) {
            let x = Matrix::new(below, self.batch, layer.inputs);
            let w = Matrix::new(&parameters[layer.weight.clone()], layer.inputs, layer.outputs);
            let bias = &parameters[layer.bias.clone()];
            if shape.layer_norm {
                kernel::multiply(&mut hidden.normalised, x, w);
                kernel::bias_norm_relu(
                    &mut hidden.normalised,
                    bias,
                    &mut hidden.inverse_std,
                    &mut hidden.activation,
                );
            } else {
                kernel::multiply(&mut hidden.activation, x, w);
                kernel::bias_relu(&mut hidden.activation, bias);
            }
            below = &hidden.activation;
        }
        let x = Matrix::new(below, self.batch, last.inputs);
        kernel::multiply(
            output,
            x,
            Matrix::new(&parameters[last.weight.clone()], last.inputs, last.outputs),
        );
        kernel::add_bias(output, &parameters[last.bias.clone()]);
    }

    /// Gradients of what was wanted, for the latest forward pass and the gradient of its output.
    ///
    /// The parameters' go to [`gradient`](Self::gradient), those of the input columns to `d_input`.
    pub(crate) fn backward(
        &mut self,
        shape: &Shape,
        parameters: &[f32],
        d_output: &[f32],
        wanted: &Wanted,
        d_input: &mut [f32],
    ) {
        self.delta.clear();
        self.delta.extend_from_slice(d_output);
        for (index, layer) in shape.layers().iter().enumerate().rev() {
            let below = match index {
                0 => &self.input,
                _ => &self.hidden[index - 1].activation,
            };
            let delta = Matrix::new(&self.delta, self.batch, layer.outputs);
            if wanted.parameters {
                let x = Matrix::new(below, self.batch, layer.inputs);
                kernel::multiply(&mut self.gradient[layer.weight.clone()], x.transposed(), delta);
                kernel::column_sums(&self.delta, &mut self.gradient[layer.bias.clone()]);
            }
            // Rows of W belong to inputs, so a range of input columns is a contiguous part of it.
            let columns = if index == 0 { wanted.input.clone() } else { 0..layer.inputs };
            if columns.is_empty() {
                break;
            }
            let from = layer.weight.start + columns.start * layer.outputs;
            let rows = &parameters[from..from + columns.len() * layer.outputs];
            let w = Matrix::new(rows, columns.len(), layer.outputs);
            if index == 0 {
                kernel::multiply(d_input, delta, w.transposed());
                break;
            }
            self.delta_below.resize(self.batch * layer.inputs, 0.0);
            kernel::multiply(&mut self.delta_below, delta, w.transposed());
            let hidden = &self.hidden[index - 1];
            if shape.layer_norm {
                kernel::norm_relu_backward(
                    &mut self.delta_below,
                    &hidden.normalised,
                    &hidden.inverse_std,
                    layer.inputs,
                );
            } else {
                kernel::relu_backward(&mut self.delta_below, &hidden.activation);
            }
            std::mem::swap(&mut self.delta, &mut self.delta_below);
        }
    }
}
