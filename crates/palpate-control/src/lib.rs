//! Force-control laws for position-controlled arms, with gains a policy can move.
