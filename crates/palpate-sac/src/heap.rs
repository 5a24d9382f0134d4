//! The heap between updates.

use std::hint::black_box;

/// Half of the room that is kept.
const KEPT: usize = 4 << 20;

/// Lets the allocator keep what an update gives back for the next one.
///
/// The GNU one returns the end of its heap to the kernel whenever 128 kB of it are free, and asks for it again with
/// every update, until a larger block has been given back: twice the size of that is the limit from then on, in the whole
/// process, and smaller blocks than that come from the heap (mallopt(3), `M_MMAP_THRESHOLD`). This gives one back. Elsewhere,
/// and where the environment sets these limits, it does nothing.
pub(crate) fn keep_room() {
    drop(black_box(Vec::<u8>::with_capacity(KEPT)));
}
