//! A multi-layer perceptron on plain slices: its values and its gradients.
//!
//! A batch is worked on in two halves, which never meet before the gradient of the parameters: there each
//! element sums over the first half, then over the second, whoever computes it.

mod gradient;

use std::ops::Range;

use crate::aligned::Aligned;
use crate::kernel;
use crate::mlp::{Layer, Shape};
use crate::norm;
use crate::product::{Left, Product, Start, as_it_is};
use crate::team::Team;
use crate::turn::transpose;
use gradient::gradient;

/// Rows that a product computes together; halves are a multiple where they can be.
const BLOCK: usize = 8;
/// Rows that go through all layers before the next ones do, so that they stay in the nearer caches.
const CHUNK: usize = 64;

/// What one forward pass leaves for its backward pass. Grows to the largest batch, then stays.
#[derive(Debug, Default)]
pub(crate) struct Work {
    halves: [Half; 2],
    /// Gradient of the parameters, from the latest backward pass that was asked for it.
    pub(crate) gradient: Aligned,
    /// Every weight but the first layer's as (outputs, inputs), where its weight is in the parameters.
    turned: Aligned,
    /// Whether `turned` is that of the parameters as they are.
    turned_is_current: bool,
}

/// Half of a batch.
#[derive(Debug, Default)]
struct Half {
    rows: usize,
    input: Aligned,
    hidden: Vec<Hidden>,
    output: Aligned,
    /// Gradient of each layer's output, before LayerNorm and ReLU.
    deltas: Vec<Aligned>,
    d_input: Aligned,
    /// Weight rows of the wanted input columns, turned.
    turned_input: Aligned,
    /// The rows that a backward pass went through.
    taken: Vec<usize>,
}

#[derive(Debug, Default)]
struct Hidden {
    /// Output of the ReLU; with LayerNorm the normalised pre-activation, until a backward pass for the
    /// parameters has gone by and only the former is needed.
    kept: Aligned,
    inverse_std: Aligned,
    /// Output of the ReLU of the latest chunk, with LayerNorm.
    passing: Aligned,
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
        self.gradient.set_length(shape.parameters());
        let first = batch.div_ceil(2).next_multiple_of(BLOCK).min(batch);
        let [a, b] = &mut self.halves;
        [a.prepare(shape, first), b.prepare(shape, batch - first)]
    }

    /// Says that the parameters are no longer what they were.
    pub(crate) fn parameters_changed(&mut self) {
        self.turned_is_current = false;
    }

    /// Computes the output rows for the prepared input. Without `keep`, no backward pass can follow.
    pub(crate) fn forward(
        &mut self,
        shape: &Shape,
        parameters: &[f32],
        keep: bool,
        team: Option<&Team>,
    ) {
        let [a, b] = &mut self.halves;
        let (a, b) = (|| a.forward(shape, parameters, keep), || b.forward(shape, parameters, keep));
        in_pair(team, a, b);
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
            self.turned.set_length(shape.parameters());
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
            || a.backward(shape, parameters, turned, wanted),
            || b.backward(shape, parameters, turned, wanted),
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
        self.input.set_length(rows * shape.inputs());
        self.output.set_length(rows * shape.outputs());
        self.deltas.resize_with(layers.len(), Aligned::default);
        for (delta, layer) in self.deltas.iter_mut().zip(layers) {
            delta.set_length(rows * layer.outputs);
        }
        self.hidden.resize_with(layers.len() - 1, Hidden::default);
        for (work, layer) in self.hidden.iter_mut().zip(layers) {
            work.kept.set_length(rows * layer.outputs);
            if shape.layer_norm {
                work.inverse_std.set_length(rows);
                work.passing.set_length(CHUNK.min(rows) * layer.outputs);
            }
        }
        &mut self.input
    }

    fn forward(&mut self, shape: &Shape, parameters: &[f32], keep: bool) {
        let last = shape.last();
        for from in (0..self.rows).step_by(CHUNK) {
            let count = CHUNK.min(self.rows - from);
            // What nobody asks for again is overwritten while it is near.
            let at = if keep { from } else { 0 };
            let mut below = part(&self.input, from, count, shape.inputs());
            for (hidden, layer) in self.hidden.iter_mut().zip(shape.layers()) {
                let width = layer.outputs;
                let kept = part_mut(&mut hidden.kept, at, count, width);
                if shape.layer_norm {
                    let relu = part_mut(&mut hidden.passing, 0, count, width);
                    let inverse_std = part_mut(&mut hidden.inverse_std, at, count, 1);
                    linear(layer, parameters, below, kept, |row, z| {
                        let rows = z.len() / width;
                        let inverse_std = &mut inverse_std[row..row + rows];
                        norm::norm_relu(z, width, inverse_std, part_mut(relu, row, rows, width));
                    });
                    below = relu;
                } else {
                    linear(layer, parameters, below, kept, |_, z| kernel::relu(z));
                    below = kept;
                }
            }
            let output = part_mut(&mut self.output, from, count, last.outputs);
            if last.outputs == 1 {
                let (w, b) = (&parameters[last.weight.clone()], parameters[last.bias.start]);
                for (output, row) in output.iter_mut().zip(below.chunks_exact(last.inputs)) {
                    *output = kernel::dot(row, w) + b;
                }
            } else {
                linear(last, parameters, below, output, as_it_is);
            }
        }
    }

    /// From the gradient of the output down to the first layer, and to the wanted input columns.
    fn backward(&mut self, shape: &Shape, parameters: &[f32], turned: &[f32], wanted: &Wanted) {
        self.take_rows(shape.outputs(), wanted.parameters);
        let (first, columns) = (&shape.layers()[0], wanted.input.len());
        if columns > 0 {
            // Rows of W belong to inputs, so a range of input columns is a contiguous part of it.
            let from = first.weight.start + wanted.input.start * first.outputs;
            self.turned_input.set_length(first.outputs * columns);
            let rows = &parameters[from..from + columns * first.outputs];
            transpose(rows, first.outputs, &mut self.turned_input);
        }
        self.d_input.set_length(self.rows * columns);
        for from in (0..self.taken.len()).step_by(CHUNK).rev() {
            let count = CHUNK.min(self.taken.len() - from);
            let at = if wanted.parameters { from } else { 0 };
            // The gradient of the output is where it was put.
            let place = |layer: usize| if layer + 1 < shape.layers().len() { at } else { from };
            let taken = &self.taken[from..from + count];
            for (index, layer) in shape.layers().iter().enumerate().skip(1).rev() {
                let (below, above) = self.deltas.split_at_mut(index);
                let Some(below) = below.last_mut() else { continue };
                let hidden = &mut self.hidden[index - 1];
                let (width, inner) = (layer.inputs, layer.outputs);
                let finish = |row: usize, d: &mut [f32]| {
                    for (d, &row) in d.chunks_exact_mut(width).zip(&taken[row..]) {
                        let kept = part_mut(&mut hidden.kept, row, 1, width);
                        if shape.layer_norm {
                            norm::norm_relu_backward(d, kept, hidden.inverse_std[row]);
                            if wanted.parameters {
                                kernel::relu(kept);
                            }
                        } else {
                            kernel::relu_backward(d, kept);
                        }
                    }
                };
                through(
                    part(&above[0], place(index), count, inner),
                    &turned[layer.weight.clone()],
                    inner,
                    part_mut(below, at, count, width),
                    finish,
                );
            }
            if columns > 0 {
                through(
                    part(&self.deltas[0], place(0), count, first.outputs),
                    &self.turned_input,
                    first.outputs,
                    part_mut(&mut self.d_input, from, count, columns),
                    as_it_is,
                );
            }
        }
        self.put_rows_back(columns);
    }

    /// Decides which rows go backward and moves the gradient of their outputs to the front.
    ///
    /// A row whose output has no gradient gives none to its input: of two critics, one is not the lower. Some such rows
    /// go along where the others fill no whole block: a block costs less than a part of one.
    fn take_rows(&mut self, outputs: usize, all: bool) {
        let Self { rows, deltas, taken, .. } = self;
        taken.clear();
        let Some(delta) = deltas.last_mut() else { return };
        let has_some = |d: &[f32]| all || d.iter().any(|d| *d != 0.0);
        let count = delta.chunks_exact(outputs).filter(|d| has_some(d)).count();
        let mut spare = count.next_multiple_of(BLOCK).min(*rows) - count;
        for row in 0..*rows {
            let here = row * outputs..(row + 1) * outputs;
            let fills = !has_some(&delta[here.clone()]);
            if fills && spare == 0 {
                continue;
            }
            spare -= usize::from(fills);
            delta.copy_within(here, taken.len() * outputs);
            taken.push(row);
        }
    }

    /// Moves the gradients of input rows from the front to where they belong.
    fn put_rows_back(&mut self, columns: usize) {
        let mut left = self.taken.len();
        if left == self.rows {
            return;
        }
        for row in (0..self.rows).rev() {
            let here = row * columns..(row + 1) * columns;
            if left > 0 && self.taken[left - 1] == row {
                left -= 1;
                self.d_input.copy_within(left * columns..(left + 1) * columns, here.start);
            } else {
                self.d_input[here].fill(0.0);
            }
        }
    }

    /// What went into a layer.
    fn below(&self, layer: usize) -> &[f32] {
        match layer.checked_sub(1) {
            None => &self.input,
            Some(hidden) => &self.hidden[hidden].kept,
        }
    }
}

/// Rows of a matrix of so many columns.
fn part(values: &[f32], row: usize, rows: usize, columns: usize) -> &[f32] {
    &values[row * columns..][..rows * columns]
}

fn part_mut(values: &mut [f32], row: usize, rows: usize, columns: usize) -> &mut [f32] {
    &mut values[row * columns..][..rows * columns]
}

/// below = delta Wᵀ, for Wᵀ of `inner` rows.
fn through(
    delta: &[f32],
    turned: &[f32],
    inner: usize,
    below: &mut [f32],
    mut finish: impl FnMut(usize, &mut [f32]),
) {
    if inner == 1 {
        for (block, (delta, below)) in
            delta.chunks(BLOCK).zip(below.chunks_mut(BLOCK * turned.len())).enumerate()
        {
            kernel::outer(delta, turned, below);
            finish(block * BLOCK, below);
        }
        return;
    }
    let (columns, start) = (turned.len() / inner, Start::Zero);
    let (left, right, stride, output) = (Left::Rows(delta), turned, columns, below);
    Product { left, right, stride, inner, start, columns, output, finish }.run();
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
