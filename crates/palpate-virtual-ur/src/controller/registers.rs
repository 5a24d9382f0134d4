//! The general purpose registers, and who may write them.

use std::collections::BTreeMap;

/// One direction's registers; the lower halves (bits 0–63, numbers 0–23) belong to fieldbuses.
#[derive(Clone, Debug, PartialEq)]
pub struct Bank {
    /// 0–127.
    pub bits: [bool; 128],
    /// 0–47.
    pub ints: [i32; 48],
    /// 0–47.
    pub floats: [f64; 48],
}

impl Default for Bank {
    fn default() -> Self {
        Self { bits: [false; 128], ints: [0; 48], floats: [0.0; 48] }
    }
}

impl Bank {
    /// Bits `first` to `first + 31` as a number, the first lowest.
    pub fn word(&self, first: usize) -> u32 {
        (0..32).fold(0, |word, i| word | u32::from(self.bits[first + i]) << i)
    }

    /// Sets 32 bits from a number.
    pub fn set_word(&mut self, first: usize, word: u32) {
        for i in 0..32 {
            self.bits[first + i] = word >> i & 1 == 1;
        }
    }
}

/// All registers, the owners of input variables and when each was last written.
#[derive(Clone, Debug, Default)]
pub struct Registers {
    /// Written by clients, read by programs.
    pub input: Bank,
    /// Written by programs, read by clients.
    pub output: Bank,
    owners: BTreeMap<String, u64>,
    written: BTreeMap<String, u64>,
}

impl Registers {
    /// The owner that stands for a fieldbus or another program.
    pub(crate) const SOMEONE_ELSE: u64 = 0;

    /// Whether `client` could take the variable.
    pub(crate) fn is_free_for(&self, name: &str, client: u64) -> bool {
        self.owners.get(name).is_none_or(|owner| *owner == client)
    }

    pub(crate) fn claim(&mut self, name: &str, client: u64) {
        self.owners.insert(name.to_owned(), client);
    }

    /// Makes a fieldbus or another program the owner of a variable, or ends that.
    pub fn occupy(&mut self, name: &str, occupied: bool) {
        if occupied {
            self.claim(name, Self::SOMEONE_ELSE);
        } else if self.owners.get(name) == Some(&Self::SOMEONE_ELSE) {
            self.owners.remove(name);
        }
    }

    /// Ends all ownership of a connection.
    pub(crate) fn release(&mut self, client: u64) {
        self.owners.retain(|_, owner| *owner != client);
    }

    /// Notes that a variable came in, changed or not.
    pub fn touch(&mut self, name: &str, tick: u64) {
        match self.written.get_mut(name) {
            Some(last) => *last = tick,
            None => _ = self.written.insert(name.to_owned(), tick),
        }
    }

    /// When a variable last came in.
    pub(crate) fn last_write(&self, name: &str) -> Option<u64> {
        self.written.get(name).copied()
    }
}
