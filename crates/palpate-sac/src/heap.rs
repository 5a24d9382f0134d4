//! The heap between updates.

use std::hint::black_box;

/// Room that is kept, at least; an update takes and gives back less.
const KEPT: usize = 4 << 20;

/// Lets the allocator keep what an update gives back for the next one.
///
/// The GNU one returns the end of its heap to the kernel whenever 128 kB of it are free, and asks for it again with
/// every update, until a larger block has been given back: twice the size of that is the limit from then on (mallopt(3),
/// `M_MMAP_THRESHOLD`). This gives one back. Elsewhere it does nothing.
pub(crate) fn keep_room() {
    drop(black_box(Vec::<u8>::with_capacity(KEPT)));
}
