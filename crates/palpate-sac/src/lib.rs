//! Soft actor-critic on candle, seeded, resumable and gradient-checked.
