//! The shape of a multi-layer perceptron.

use std::ops::Range;

use rand::Rng;
use rand_chacha::ChaCha8Rng;

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
