//! Numbers that begin at a cache line.

use std::ops::{Deref, DerefMut};

/// Numbers in a cache line, and in the widest vectors.
const LINE: usize = 16;

/// A vector of numbers that begins at a cache line: no aligned vector of it lies across two.
///
/// Where it lies changes the time of a loop over it, by up to a quarter, and no result.
#[derive(Debug, Default)]
pub(crate) struct Aligned {
    values: Vec<f32>,
    from: usize,
    length: usize,
}

impl Aligned {
    /// Makes it so long. What it then holds is not said.
    pub(crate) fn set_length(&mut self, length: usize) {
        if length == self.length {
            return;
        }
        self.values.resize(length + LINE - 1, 0.0);
        self.from = self.values.as_ptr().align_offset(size_of::<[f32; LINE]>()).min(LINE - 1);
        self.length = length;
    }
}

impl Deref for Aligned {
    type Target = [f32];

    fn deref(&self) -> &[f32] {
        &self.values[self.from..self.from + self.length]
    }
}

impl DerefMut for Aligned {
    fn deref_mut(&mut self) -> &mut [f32] {
        &mut self.values[self.from..self.from + self.length]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn begins_at_a_cache_line_whatever_its_length() {
        let mut numbers = Aligned::default();
        assert!(numbers.is_empty());
        for length in [1, 16, 100_000, 7, 0, 40] {
            numbers.set_length(length);
            assert_eq!((numbers.len(), numbers.as_ptr().addr() % 64), (length, 0));
        }
    }
}
