//! Random numbers: four streams of one seed, saved with the agent.
//!
//! candle's CPU generator cannot be seeded, so nothing here uses it. Separate streams keep the
//! consumers apart: exploring longer does not change what replay draws.

use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};
use serde::{Deserialize, Serialize};

/// The generators of one agent.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(crate) struct Streams {
    /// First weights.
    pub(crate) init: ChaCha8Rng,
    /// Actions while exploring.
    pub(crate) exploration: ChaCha8Rng,
    /// Which transitions a batch holds.
    pub(crate) replay: ChaCha8Rng,
    /// Actions sampled inside an update.
    pub(crate) update: ChaCha8Rng,
}

impl Streams {
    pub(crate) fn new(seed: u64) -> Self {
        let stream = |number| {
            let mut rng = ChaCha8Rng::seed_from_u64(seed);
            rng.set_stream(number);
            rng
        };
        Self { init: stream(0), exploration: stream(1), replay: stream(2), update: stream(3) }
    }
}

/// Fills `noise` with standard normal numbers.
pub(crate) fn fill_normal(rng: &mut impl rand::Rng, noise: &mut [f32]) {
    noise.fill_with(|| StandardNormal.sample(rng));
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::RngCore;

    #[test]
    fn streams_differ_and_continue_after_saving() {
        let mut streams = Streams::new(7);
        let first: Vec<u64> =
            [&mut streams.init, &mut streams.exploration, &mut streams.replay, &mut streams.update]
                .into_iter()
                .map(RngCore::next_u64)
                .collect();
        for i in 0..4 {
            assert!(!first[..i].contains(&first[i]));
        }
        // An odd number of words: the position inside a block must survive too.
        streams.update.next_u32();
        let text = serde_json::to_string(&streams).unwrap();
        let mut restored: Streams = serde_json::from_str(&text).unwrap();
        assert_eq!(restored, streams);
        let draw = |s: &mut Streams| (0..100).map(|_| s.update.next_u64()).collect::<Vec<_>>();
        assert_eq!(draw(&mut restored), draw(&mut streams));
    }

    #[test]
    fn normals_have_unit_variance() {
        let mut noise = vec![0.0; 100_000];
        fill_normal(&mut Streams::new(1).update, &mut noise);
        let n = noise.len() as f32;
        let mean = noise.iter().sum::<f32>() / n;
        let variance = noise.iter().map(|x| (x - mean).powi(2)).sum::<f32>() / n;
        assert!(mean.abs() < 0.01 && (variance - 1.0).abs() < 0.02, "{mean} {variance}");
    }
}
