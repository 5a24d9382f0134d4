//! Gradients of the parameters.

use std::ops::Range;

use super::Half;
use crate::kernel;
use crate::mlp::Shape;
use crate::product::{Left, Product, Start, as_it_is};

/// Gradients of the parameters from number `from` on, as many as `to` holds.
pub(super) fn gradient(shape: &Shape, halves: &[Half; 2], from: usize, to: &mut [f32]) {
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
