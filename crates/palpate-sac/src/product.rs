//! Matrix products: register tiles of fused multiply-adds.
//!
//! Every element of a product is one chain of fused multiply-adds over the inner index, in order. Neither the
//! size of a tile, nor the width of a vector, nor which thread computes which rows changes one bit of it.
#![expect(
    clippy::inline_always,
    reason = "code is compiled for the vector unit only inside its caller"
)]

use pulp::{Simd, WithSimd};

/// The left factor A, row-major in memory.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Left<'a> {
    /// A itself.
    Rows(&'a [f32]),
    /// Aᵀ is multiplied: columns of A, whose rows are this long, from the first one on.
    Columns { values: &'a [f32], width: usize, first: usize },
}

/// What the sums start from.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Start<'a> {
    Zero,
    /// One number per column.
    Bias(&'a [f32]),
    /// What the output holds.
    Output,
}

/// C = start + A B, one block of rows after the other.
pub(crate) struct Product<'a, F> {
    pub(crate) left: Left<'a>,
    /// B, inner × columns; its rows begin this far apart.
    pub(crate) right: &'a [f32],
    pub(crate) stride: usize,
    pub(crate) inner: usize,
    pub(crate) start: Start<'a>,
    pub(crate) columns: usize,
    /// C, row-major; its length says how many rows.
    pub(crate) output: &'a mut [f32],
    /// Called with each finished block of rows, while it is in the nearest cache, and the number of its first row.
    pub(crate) finish: F,
}

/// Leaves a block of rows as it is.
pub(crate) fn as_it_is(_: usize, _: &mut [f32]) {}

impl<F: FnMut(usize, &mut [f32])> Product<'_, F> {
    pub(crate) fn run(self) {
        pulp::Arch::new().dispatch(self);
    }
}

impl<F: FnMut(usize, &mut [f32])> WithSimd for Product<'_, F> {
    type Output = ();

    // Compiled for the vector unit only inside its caller, as everything below.
    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        // Up to 24 or 12 running sums hide the latency of the multiply-adds and leave registers for the factors.
        if S::REGISTER_COUNT >= 32 {
            self.in_blocks::<S, 8>(simd);
        } else {
            self.in_blocks::<S, 4>(simd);
        }
    }
}

impl<F: FnMut(usize, &mut [f32])> Product<'_, F> {
    #[inline(always)]
    fn in_blocks<S: Simd, const HEIGHT: usize>(mut self, simd: S) {
        let Self { left, right, stride, inner, start, columns, .. } = self;
        if columns == 0 {
            return;
        }
        for (index, output) in self.output.chunks_mut(HEIGHT * columns).enumerate() {
            let row = index * HEIGHT;
            let full = output.len() == HEIGHT * columns;
            let mut block = Block { right, stride, inner, start, columns, output };
            match left {
                Left::Rows(a) if full => {
                    let rows: [&[f32]; HEIGHT] =
                        std::array::from_fn(|r| &a[(row + r) * inner..][..inner]);
                    block.run::<S, HEIGHT>(simd, |p| std::array::from_fn(|r| rows[r][p]));
                }
                Left::Rows(a) => {
                    for (r, output) in block.output.chunks_exact_mut(columns).enumerate() {
                        let a = &a[(row + r) * inner..][..inner];
                        Block { output, ..block }.run::<S, 1>(simd, |p| [a[p]]);
                    }
                }
                Left::Columns { values, width, first } if full => {
                    let a = &values[first + row..];
                    block.run::<S, HEIGHT>(simd, |p| {
                        let a = &a[p * width..][..HEIGHT];
                        std::array::from_fn(|r| a[r])
                    });
                }
                Left::Columns { values, width, first } => {
                    for (r, output) in block.output.chunks_exact_mut(columns).enumerate() {
                        let a = &values[first + row + r..];
                        Block { output, ..block }.run::<S, 1>(simd, |p| [a[p * width]]);
                    }
                }
            }
            (self.finish)(row, block.output);
        }
    }
}

/// Some rows of a product.
struct Block<'a> {
    right: &'a [f32],
    stride: usize,
    inner: usize,
    start: Start<'a>,
    columns: usize,
    output: &'a mut [f32],
}

impl Block<'_> {
    #[inline(always)]
    fn run<S: Simd, const HEIGHT: usize>(
        &mut self,
        simd: S,
        left: impl Fn(usize) -> [f32; HEIGHT] + Copy,
    ) {
        let (columns, lanes) = (self.columns, S::F32_LANES);
        // Columns that do not fill a vector are reached from the last whole one, together with it.
        let beyond = !columns.is_multiple_of(lanes);
        let whole = columns / lanes - usize::from(beyond && columns > lanes);
        let mut column = 0;
        loop {
            // Three vectors wide, and two where three would leave a single one.
            let width = match whole - column / lanes {
                0 => break,
                1 => self.tile::<S, HEIGHT, 1>(simd, left, column),
                2 | 4 => self.tile::<S, HEIGHT, 2>(simd, left, column),
                _ => self.tile::<S, HEIGHT, 3>(simd, left, column),
            };
            column += width;
        }
        match beyond {
            false => {}
            true if columns > lanes => self.overlapping::<S, HEIGHT>(simd, left, column),
            true => self.edge::<S, HEIGHT>(simd, left),
        }
    }

    /// Some vectors of columns, from this one on; how many columns they are.
    #[inline(always)]
    fn tile<S: Simd, const HEIGHT: usize, const WIDTH: usize>(
        &mut self,
        simd: S,
        left: impl Fn(usize) -> [f32; HEIGHT],
        column: usize,
    ) -> usize {
        let width = WIDTH * S::F32_LANES;
        let mut sums = [[simd.splat_f32s(0.0); WIDTH]; HEIGHT];
        match self.start {
            Start::Zero => {}
            Start::Bias(bias) => {
                sums = [vectors::<S, WIDTH>(&bias[column..column + width]); HEIGHT];
            }
            Start::Output => {
                for (r, sums) in sums.iter_mut().enumerate() {
                    *sums = vectors::<S, WIDTH>(&self.output[r * self.columns + column..][..width]);
                }
            }
        }
        for (p, row) in self.right.chunks(self.stride).take(self.inner).enumerate() {
            let b = vectors::<S, WIDTH>(&row[column..column + width]);
            let a = left(p);
            for r in 0..HEIGHT {
                let a = simd.splat_f32s(a[r]);
                for v in 0..WIDTH {
                    sums[r][v] = simd.mul_add_e_f32s(a, b[v], sums[r][v]);
                }
            }
        }
        for (r, sums) in sums.iter().enumerate() {
            let row = &mut self.output[r * self.columns + column..][..width];
            S::as_mut_simd_f32s(row).0.copy_from_slice(sums);
        }
        width
    }

    /// A vector of columns from this one on and the last vector of columns, which share some: what they share comes out
    /// the same twice.
    #[inline(always)]
    fn overlapping<S: Simd, const HEIGHT: usize>(
        &mut self,
        simd: S,
        left: impl Fn(usize) -> [f32; HEIGHT],
        column: usize,
    ) {
        let columns = self.columns;
        let at = [column, columns - S::F32_LANES];
        let both = |row: &[f32]| at.map(|at| vectors::<S, 1>(&row[at..at + S::F32_LANES])[0]);
        let mut sums = [[simd.splat_f32s(0.0); 2]; HEIGHT];
        match self.start {
            Start::Zero => {}
            Start::Bias(bias) => sums = [both(bias); HEIGHT],
            Start::Output => {
                for (sums, row) in sums.iter_mut().zip(self.output.chunks_exact(columns)) {
                    *sums = both(row);
                }
            }
        }
        for (p, row) in self.right.chunks(self.stride).take(self.inner).enumerate() {
            let b = both(row);
            let a = left(p);
            for r in 0..HEIGHT {
                let a = simd.splat_f32s(a[r]);
                for v in 0..2 {
                    sums[r][v] = simd.mul_add_e_f32s(a, b[v], sums[r][v]);
                }
            }
        }
        for (sums, row) in sums.iter().zip(self.output.chunks_exact_mut(columns)) {
            for (at, sum) in at.into_iter().zip(sums) {
                S::as_mut_simd_f32s(&mut row[at..at + S::F32_LANES]).0[0] = *sum;
            }
        }
    }

    /// All columns, where they do not fill a vector.
    #[inline(always)]
    fn edge<S: Simd, const HEIGHT: usize>(
        &mut self,
        simd: S,
        left: impl Fn(usize) -> [f32; HEIGHT],
    ) {
        let columns = self.columns;
        let mut sums = [simd.splat_f32s(0.0); HEIGHT];
        match self.start {
            Start::Zero => {}
            Start::Bias(bias) => sums = [simd.partial_load_f32s(&bias[..columns]); HEIGHT],
            Start::Output => {
                for (sum, row) in sums.iter_mut().zip(self.output.chunks_exact(columns)) {
                    *sum = simd.partial_load_f32s(row);
                }
            }
        }
        for (p, row) in self.right.chunks(self.stride).take(self.inner).enumerate() {
            let b = simd.partial_load_f32s(&row[..columns]);
            let a = left(p);
            for r in 0..HEIGHT {
                sums[r] = simd.mul_add_e_f32s(simd.splat_f32s(a[r]), b, sums[r]);
            }
        }
        for (sum, row) in sums.iter().zip(self.output.chunks_exact_mut(columns)) {
            simd.partial_store_f32s(row, *sum);
        }
    }
}

#[inline(always)]
fn vectors<S: Simd, const WIDTH: usize>(values: &[f32]) -> [S::f32s; WIDTH] {
    let (vectors, _) = S::as_simd_f32s(values);
    std::array::from_fn(|i| vectors[i])
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::rng::{Streams, fill_normal};

    fn draw(count: usize, seed: u64) -> Vec<f32> {
        let mut values = vec![0.0; count];
        fill_normal(&mut Streams::new(seed).update, &mut values);
        values
    }

    /// One chain of multiply-adds per element, as promised.
    fn chain(start: f32, pairs: impl Iterator<Item = (f32, f32)>) -> f32 {
        pairs.fold(start, |sum, (a, b)| a.mul_add(b, sum))
    }

    fn wide(work: Product<'_, fn(usize, &mut [f32])>) {
        work.run();
    }

    /// The 256-bit code, where the machine has wider vectors too.
    fn narrow(work: Product<'_, fn(usize, &mut [f32])>) {
        #[cfg(target_arch = "x86_64")]
        if let Some(simd) = pulp::x86::V3::try_new() {
            return Simd::vectorize(simd, work);
        }
        work.run();
    }

    /// Sizes with and without remainders, of one to seven vectors and a piece of one, one row, one column.
    const SIZES: [(usize, usize, usize); 9] = [
        (16, 32, 32),
        (8, 256, 64),
        (13, 21, 37),
        (1, 5, 17),
        (9, 300, 1),
        (24, 7, 48),
        (3, 600, 20),
        (8, 9, 83),
        (9, 11, 115),
    ];

    /// Columns that are not asked for.
    const OTHERS: usize = 5;

    #[test]
    fn every_element_is_its_chain_whatever_the_tiles() {
        for (rows, inner, columns) in SIZES {
            let (a, b) = (draw(rows * inner, 1), draw(inner * columns, 2));
            // Rows of Aᵀ with something else in front.
            let mut turned = vec![f32::NAN; inner * (OTHERS + rows)];
            for (p, turned) in turned.chunks_exact_mut(OTHERS + rows).enumerate() {
                turned[OTHERS..].iter_mut().enumerate().for_each(|(i, x)| *x = a[i * inner + p]);
            }
            let (bias, first) = (draw(columns, 3), draw(rows * columns, 4));
            let left = Left::Columns { values: &turned, width: OTHERS + rows, first: OTHERS };
            for left in [Left::Rows(&a), left] {
                for start in [Start::Zero, Start::Bias(&bias), Start::Output] {
                    for run in [wide, narrow] {
                        let mut output = first.clone();
                        run(Product {
                            left,
                            right: &b,
                            stride: columns,
                            inner,
                            start,
                            columns,
                            output: &mut output,
                            finish: as_it_is,
                        });
                        for (at, got) in output.iter().enumerate() {
                            let (i, j) = (at / columns, at % columns);
                            let from = match start {
                                Start::Zero => 0.0,
                                Start::Bias(bias) => bias[j],
                                Start::Output => first[at],
                            };
                            let pairs = (0..inner).map(|p| (a[i * inner + p], b[p * columns + j]));
                            assert_eq!(got.to_bits(), chain(from, pairs).to_bits(), "{at}");
                        }
                    }
                }
            }
        }
    }
}
