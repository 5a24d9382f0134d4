//! Transposes.

/// `to` = `from`ᵀ, where `from` has rows of `columns` numbers.
pub(crate) fn transpose(from: &[f32], columns: usize, to: &mut [f32]) {
    let rows = from.len() / columns;
    let done = in_squares(from, columns, rows, to);
    // What no square covers: below the last row of squares, then to the right of the last column of them.
    for (rows_left, columns_left) in [(done.0..rows, 0..columns), (0..done.0, done.1..columns)] {
        for r in rows_left {
            for c in columns_left.clone() {
                to[c * rows + r] = from[r * columns + c];
            }
        }
    }
}

/// Turns squares of eight in registers; how many rows and columns these cover.
#[cfg(target_arch = "x86_64")]
fn in_squares(from: &[f32], columns: usize, rows: usize, to: &mut [f32]) -> (usize, usize) {
    match pulp::x86::V3::try_new() {
        Some(simd) => {
            pulp::Simd::vectorize(simd, avx::Squares { simd, from, columns, rows, to });
            (rows / 8 * 8, columns / 8 * 8)
        }
        None => (0, 0),
    }
}

#[cfg(not(target_arch = "x86_64"))]
fn in_squares(_: &[f32], _: usize, _: usize, _: &mut [f32]) -> (usize, usize) {
    (0, 0)
}

#[cfg(target_arch = "x86_64")]
mod avx {
    use std::arch::x86_64::__m256;

    use pulp::x86::V3;
    use pulp::{Simd, WithSimd, cast};

    pub(super) struct Squares<'a> {
        pub(super) simd: V3,
        pub(super) from: &'a [f32],
        pub(super) columns: usize,
        pub(super) rows: usize,
        pub(super) to: &'a mut [f32],
    }

    impl WithSimd for Squares<'_> {
        type Output = ();

        #[inline(always)]
        fn with_simd<S: Simd>(self, _: S) {
            let Self { simd, from, columns, rows, to } = self;
            for i in (0..rows / 8 * 8).step_by(8) {
                for j in (0..columns / 8 * 8).step_by(8) {
                    let square = std::array::from_fn(|r| {
                        let row: [f32; 8] =
                            std::array::from_fn(|c| from[(i + r) * columns + j..][..8][c]);
                        cast(row)
                    });
                    for (c, column) in turn(simd, square).into_iter().enumerate() {
                        let column: [f32; 8] = cast(column);
                        to[(j + c) * rows + i..][..8].copy_from_slice(&column);
                    }
                }
            }
        }
    }

    /// The transpose: pairs of rows, then of pairs, then of halves.
    #[inline(always)]
    fn turn(simd: V3, r: [__m256; 8]) -> [__m256; 8] {
        let avx = simd.avx;
        let low = |i: usize| avx._mm256_unpacklo_ps(r[i], r[i + 1]);
        let high = |i: usize| avx._mm256_unpackhi_ps(r[i], r[i + 1]);
        let fours = |i: usize| {
            let (a, b, c, d) = (low(i), high(i), low(i + 2), high(i + 2));
            [
                avx._mm256_shuffle_ps::<0x44>(a, c),
                avx._mm256_shuffle_ps::<0xEE>(a, c),
                avx._mm256_shuffle_ps::<0x44>(b, d),
                avx._mm256_shuffle_ps::<0xEE>(b, d),
            ]
        };
        let (top, bottom) = (fours(0), fours(4));
        std::array::from_fn(|c| {
            let (a, b) = (top[c % 4], bottom[c % 4]);
            if c < 4 {
                avx._mm256_permute2f128_ps::<0x20>(a, b)
            } else {
                avx._mm256_permute2f128_ps::<0x31>(a, b)
            }
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_number_lands_where_row_and_column_change_places() {
        for (rows, columns) in [(8, 8), (16, 40), (14, 256), (256, 14), (3, 5), (1, 9), (9, 1)] {
            let from: Vec<f32> = (0..rows * columns).map(|i| i as f32).collect();
            let mut to = vec![-1.0; from.len()];
            transpose(&from, columns, &mut to);
            for r in 0..rows {
                for c in 0..columns {
                    assert_eq!(to[c * rows + r], from[r * columns + c], "{rows} x {columns}");
                }
            }
        }
    }
}
