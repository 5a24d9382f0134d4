//! Tutorials: see the numbered programs in `examples/`.
