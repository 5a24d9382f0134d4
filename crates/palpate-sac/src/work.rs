//! A multi-layer perceptron on plain slices: its values and its gradients.
//!
//! A batch is worked on in two halves, which never meet before the gradient of the parameters: there each
//! element sums over the first half, then over the second, whoever computes it.

use std::ops::Range;

use crate::kernel;
use crate::mlp::{Layer, Shape};
use crate::product::{Left, Product, Start, as_it_is, transpose};
use crate::team::Team;

/// Rows that a product computes together; halves are a multiple where they can be.
const BLOCK: usize = 8;

/// What one forward pass leaves for its backward pass. Grows to the largest batch, then stays.
#[derive(Debug, Default)]
pub(crate) struct Work {
    halves: [Half; 2],
    /// Gradient of the parameters, from the latest backward pass that was asked for it.
    pub(crate) gradient: Vec<f32>,
    /// Every weight but the first layer's as (outputs, inputs), where its weight is in the parameters.
    turned: Vec<f32>,
    /// Whether `turned` is that of the parameters as they are.
    turned_is_current: bool,
}

/// Half of a batch.
#[derive(Debug, Default)]
struct Half {
    rows: usize,
    input: Vec<f32>,
    hidden: Vec<Hidden>,
    output: Vec<f32>,
    /// Gradient of each layer's output, before LayerNorm and ReLU.
    deltas: Vec<Vec<f32>>,
    d_input: Vec<f32>,
    /// Weight rows of the wanted input columns, turned.
    turned_input: Vec<f32>,
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
    /// Makes room for a batch; the input rows to fill come in two pieces.
    pub(crate) fn prepare(&mut self, shape: &Shape, batch: usize) -> [&mut [f32]; 2] {
        self.gradient.resize(shape.parameters(), 0.0);
        let first = batch.div_ceil(2).next_multiple_of(BLOCK).min(batch);
        let [a, b] = &mut self.halves;
        [a.prepare(shape, first), b.prepare(shape, batch - first)]
    }

    /// Says that the parameters are no longer what they were.
    pub(crate) fn parameters_changed(&mut self) {
        self.turned_is_current = false;
    }

    /// Computes the output rows for the prepared input.
    pub(crate) fn forward(&mut self, shape: &Shape, parameters: &[f32], team: Option<&Team>) {
        let [a, b] = &mut self.halves;
        in_pair(team, || a.forward(shape, parameters), || b.forward(shape, parameters));
    }

    /// The output rows, in two pieces.
    pub(crate) fn output(&self) -> [&[f32]; 2] {
        self.halves.each_ref().map(|half| &half.output[..])
    }

    /// Where the gradient of the output goes, in two pieces.
    pub(crate) fn d_output(&mut self) -> [&mut [f32]; 2] {
        self.halves
            .each_mut()
            .map(|half| half.deltas.last_mut().map_or(&mut [][..], |d| &mut d[..]))
    }

    /// The gradient of the wanted input columns, in two pieces.
    pub(crate) fn d_input(&self) -> [&[f32]; 2] {
        self.halves.each_ref().map(|half| &half.d_input[..])
    }

    /// Gradients of what was wanted, for the latest forward pass and the gradient of its output.
    ///
    /// The parameters' go to [`gradient`](Self::gradient).
    pub(crate) fn backward(
        &mut self,
        shape: &Shape,
        parameters: &[f32],
        wanted: &Wanted,
        team: Option<&Team>,
    ) {
        if !self.turned_is_current {
            self.turned.resize(shape.parameters(), 0.0);
            for layer in &shape.layers()[1..] {
                let (from, to) = (&parameters[layer.weight.clone()], layer.weight.clone());
                transpose(from, layer.outputs, &mut self.turned[to]);
            }
            self.turned_is_current = true;
        }
        let turned = &self.turned[..];
        let [a, b] = &mut self.halves;
        in_pair(
            team,
            || a.backward(shape, parameters, turned, &wanted.input),
            || b.backward(shape, parameters, turned, &wanted.input),
        );
        if wanted.parameters {
            // A weight is a sum over the batch: all cost the same.
            let middle = split(shape, shape.parameters() / 2);
            let (low, high) = self.gradient.split_at_mut(middle);
            let halves = &self.halves;
            in_pair(
                team,
                || gradient(shape, halves, 0, low),
                || gradient(shape, halves, middle, high),
            );
        }
    }
}

fn in_pair(team: Option<&Team>, a: impl FnOnce() + Send, b: impl FnOnce() + Send) {
    if let Some(team) = team {
        team.both(a, b);
    } else {
        a();
        b();
    }
}

/// Where the parameters can be cut, near `wish`: between blocks of rows of a weight.
fn split(shape: &Shape, wish: usize) -> usize {
    let inside = |l: &&Layer| l.weight.contains(&wish);
    shape.layers().iter().find(inside).map_or(0, |layer| {
        let rows = (wish - layer.weight.start) / layer.outputs / BLOCK * BLOCK;
        layer.weight.start + rows * layer.outputs
    })
}

impl Half {
    fn prepare(&mut self, shape: &Shape, rows: usize) -> &mut [f32] {
        self.rows = rows;
        let layers = shape.layers();
        self.input.resize(rows * shape.inputs(), 0.0);
        self.output.resize(rows * shape.outputs(), 0.0);
        self.deltas.resize_with(layers.len(), Vec::new);
        for (delta, layer) in self.deltas.iter_mut().zip(layers) {
            delta.resize(rows * layer.outputs, 0.0);
        }
        self.hidden.resize_with(layers.len() - 1, Hidden::default);
        for (work, layer) in self.hidden.iter_mut().zip(layers) {
            work.activation.resize(rows * layer.outputs, 0.0);
            if shape.layer_norm {
                work.normalised.resize(rows * layer.outputs, 0.0);
                work.inverse_std.resize(rows, 0.0);
            }
        }
        &mut self.input
    }

    fn forward(&mut self, shape: &Shape, parameters: &[f32]) {
        let (last, mut below) = (shape.last(), &self.input[..]);
        for (hidden, layer) in self.hidden.iter_mut().zip(shape.layers()) {
            let Hidden { normalised, inverse_std, activation } = hidden;
            if shape.layer_norm {
                linear(layer, parameters, below, normalised, |row, z| {
                    let rows = z.len() / layer.outputs;
                    let relu = &mut activation[row * layer.outputs..][..z.len()];
                    kernel::norm_relu(z, layer.outputs, &mut inverse_std[row..row + rows], relu);
                });
            } else {
                linear(layer, parameters, below, activation, |_, z| kernel::relu(z));
            }
            below = activation;
        }
        if last.outputs == 1 {
            let (w, b) = (&parameters[last.weight.clone()], parameters[last.bias.start]);
            for (output, row) in self.output.iter_mut().zip(below.chunks_exact(last.inputs)) {
                *output = kernel::dot(row, w) + b;
            }
        } else {
            linear(last, parameters, below, &mut self.output, as_it_is);
        }
    }

    /// From the gradient of the output down to the first layer, and to the wanted input columns.
    fn backward(
        &mut self,
        shape: &Shape,
        parameters: &[f32],
        turned: &[f32],
        wanted: &Range<usize>,
    ) {
        for (index, layer) in shape.layers().iter().enumerate().skip(1).rev() {
            let (below, above) = self.deltas.split_at_mut(index);
            let Some(output) = below.last_mut() else { continue };
            let Hidden { normalised, inverse_std, activation } = &self.hidden[index - 1];
            let width = layer.inputs;
            Product {
                left: Left::Rows(&above[0]),
                right: &turned[layer.weight.clone()],
                stride: width,
                inner: layer.outputs,
                start: Start::Zero,
                columns: width,
                output,
                finish: |row: usize, d: &mut [f32]| {
                    let here = row * width..row * width + d.len();
                    if shape.layer_norm {
                        let inverse_std = &inverse_std[row..row + d.len() / width];
                        kernel::norm_relu_backward(d, &normalised[here], inverse_std, width);
                    } else {
                        kernel::relu_backward(d, &activation[here]);
                    }
                },
            }
            .run();
        }
        let (layer, columns) = (&shape.layers()[0], wanted.len());
        self.d_input.resize(self.rows * columns, 0.0);
        if columns > 0 {
            // Rows of W belong to inputs, so a range of input columns is a contiguous part of it.
            let from = layer.weight.start + wanted.start * layer.outputs;
            self.turned_input.resize(layer.outputs * columns, 0.0);
            let rows = &parameters[from..from + columns * layer.outputs];
            transpose(rows, layer.outputs, &mut self.turned_input);
            Product {
                left: Left::Rows(&self.deltas[0]),
                right: &self.turned_input,
                stride: columns,
                inner: layer.outputs,
                start: Start::Zero,
                columns,
                output: &mut self.d_input,
                finish: as_it_is,
            }
            .run();
        }
    }

    /// What went into a layer.
    fn below(&self, layer: usize) -> &[f32] {
        match layer.checked_sub(1) {
            None => &self.input,
            Some(hidden) => &self.hidden[hidden].activation,
        }
    }
}

/// output = x W + b.
fn linear(
    layer: &Layer,
    parameters: &[f32],
    x: &[f32],
    output: &mut [f32],
    finish: impl FnMut(usize, &mut [f32]),
) {
    Product {
        left: Left::Rows(x),
        right: &parameters[layer.weight.clone()],
        stride: layer.outputs,
        inner: layer.inputs,
        start: Start::Bias(&parameters[layer.bias.clone()]),
        columns: layer.outputs,
        output,
        finish,
    }
    .run();
}

/// Gradients of the parameters from number `from` on, as many as `to` holds.
fn gradient(shape: &Shape, halves: &[Half; 2], from: usize, to: &mut [f32]) {
    let length = to.len();
    let part = |range: &Range<usize>| {
        let end = (range.end.max(from) - from).min(length);
        (range.start.max(from) - from).min(end)..end
    };
    for (index, layer) in shape.layers().iter().enumerate() {
        let (weight, bias) = (part(&layer.weight), part(&layer.bias));
        let start = |half: usize| if half == 0 { Start::Zero } else { Start::Output };
        if !weight.is_empty() {
            let first = (from + weight.start - layer.weight.start) / layer.outputs;
            for (i, half) in halves.iter().enumerate().filter(|(_, half)| half.rows > 0) {
                let (x, delta, output) =
                    (half.below(index), &half.deltas[index][..], &mut to[weight.clone()]);
                let (start, inner) = (start(i), half.rows);
                if layer.outputs == 1 {
                    // A column: its transpose is one wide row.
                    let (columns, right) = (output.len(), &x[first..]);
                    let left = Left::Rows(delta);
                    let stride = layer.inputs;
                    Product {
                        left,
                        right,
                        stride,
                        inner,
                        start,
                        columns,
                        output,
                        finish: as_it_is,
                    }
                    .run();
                } else {
                    let left = Left::Columns { values: x, width: layer.inputs, first };
                    let (columns, stride) = (layer.outputs, layer.outputs);
                    let right = delta;
                    Product {
                        left,
                        right,
                        stride,
                        inner,
                        start,
                        columns,
                        output,
                        finish: as_it_is,
                    }
                    .run();
                }
            }
        }
        if !bias.is_empty() {
            let sums = &mut to[bias];
            sums.fill(0.0);
            for half in halves {
                kernel::add_rows(&half.deltas[index], sums);
            }
        }
    }
}
