//! Figures about few runs and few episodes, with their uncertainty.

use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::{RngCore as _, SeedableRng as _};

/// The exact interval of Clopper and Pearson (1934) for the chance of a success.
///
/// Its ends are the chances at which as many successes or more (lower) or as few or less (upper) have
/// a probability of (1 − `confidence`) / 2. Without trials it is (0, 1).
///
/// # Panics
///
/// If there are more successes than trials, or if `confidence` is not between 0 and 1.
pub fn clopper_pearson(successes: u64, trials: u64, confidence: f64) -> (f64, f64) {
    assert!(successes <= trials, "{successes} successes in {trials} trials");
    assert!(confidence > 0.0 && confidence < 1.0, "a confidence of {confidence}");
    let tail = 0.5 * (1.0 - confidence);
    let at_least = Tail::new(successes, trials);
    // "At most s successes" is "at least n − s failures".
    let at_most = Tail::new(trials - successes, trials);
    let lower = if successes == 0 { 0.0 } else { at_least.chance(tail) };
    let upper = if successes == trials { 1.0 } else { 1.0 - at_most.chance(tail) };
    (lower, upper)
}

/// P(X ≥ k) of a binomial X, as a function of the chance.
struct Tail {
    /// ln of the binomial coefficients for k … n.
    ln_choose: Vec<f64>,
    k: u64,
    n: u64,
}

impl Tail {
    fn new(k: u64, n: u64) -> Self {
        // C(n, i) = C(n, i + 1) · (i + 1) / (n − i), down from C(n, n) = 1.
        let mut ln_choose = vec![0.0; (n - k + 1) as usize];
        for i in (k..n).rev() {
            let at = (i - k) as usize;
            ln_choose[at] = ln_choose[at + 1] + ((i + 1) as f64 / (n - i) as f64).ln();
        }
        Self { ln_choose, k, n }
    }

    fn probability(&self, p: f64) -> f64 {
        let (ln_p, ln_q) = (p.ln(), (-p).ln_1p());
        let term = |(i, c): (u64, &f64)| {
            // 0 · ln 0 is 0 here.
            let failures = if i == self.n { 0.0 } else { (self.n - i) as f64 * ln_q };
            (c + i as f64 * ln_p + failures).exp()
        };
        (self.k..).zip(&self.ln_choose).map(term).sum()
    }

    /// The chance at which the tail has this probability. It grows with the chance, from 0 to 1.
    fn chance(&self, probability: f64) -> f64 {
        let (mut low, mut high) = (0.0, 1.0);
        loop {
            let middle = f64::midpoint(low, high);
            if middle <= low || middle >= high {
                return middle;
            }
            *if self.probability(middle) < probability { &mut low } else { &mut high } = middle;
        }
    }
}

/// The mean; `None` of nothing.
pub fn mean(values: &[f64]) -> Option<f64> {
    (!values.is_empty()).then(|| values.iter().sum::<f64>() / values.len() as f64)
}

/// The interquartile mean: without the lowest and the highest quarter (⌊n/4⌋ each, as in rliable);
/// `None` of nothing.
pub fn iqm(values: &[f64]) -> Option<f64> {
    let mut sorted = values.to_vec();
    sorted.sort_by(f64::total_cmp);
    let cut = sorted.len() / 4;
    mean(&sorted[cut..sorted.len() - cut])
}

/// An interval for a statistic of `values` by the percentile bootstrap (Efron 1979); `None` of nothing.
///
/// The same seed gives the same interval.
pub fn bootstrap(
    values: &[f64],
    statistic: impl Fn(&[f64]) -> Option<f64>,
    resamples: usize,
    confidence: f64,
    seed: u64,
) -> Option<(f64, f64)> {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let mut sample = values.to_vec();
    let mut found = Vec::with_capacity(resamples);
    for _ in 0..resamples {
        resample(&mut rng, values, &mut sample);
        found.push(statistic(&sample)?);
    }
    found.sort_by(f64::total_cmp);
    let tail = 0.5 * (1.0 - confidence);
    Some((quantile(&found, tail)?, quantile(&found, 1.0 - tail)?))
}

/// The probability that a draw of `x` is greater than one of `y`, ties counted half (Mann and Whitney 1947), and its
/// interval by the percentile bootstrap over both; `None` if either is empty. The same seed gives the same interval.
pub fn probability_of_improvement(
    x: &[f64],
    y: &[f64],
    resamples: usize,
    confidence: f64,
    seed: u64,
) -> Option<(f64, (f64, f64))> {
    let greater = |x: &[f64], y: &[f64]| {
        let against = |a: &f64| y.iter().map(|b| score(*a, *b)).sum::<f64>();
        x.iter().map(against).sum::<f64>() / (x.len() * y.len()) as f64
    };
    let tail = 0.5 * (1.0 - confidence);
    if x.is_empty() || y.is_empty() || !tail.is_finite() {
        return None;
    }
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let (mut a, mut b) = (x.to_vec(), y.to_vec());
    let mut found = Vec::with_capacity(resamples);
    for _ in 0..resamples {
        resample(&mut rng, x, &mut a);
        resample(&mut rng, y, &mut b);
        found.push(greater(&a, &b));
    }
    found.sort_by(f64::total_cmp);
    Some((greater(x, y), (quantile(&found, tail)?, quantile(&found, 1.0 - tail)?)))
}

/// 1 where a is greater, ½ at a tie.
fn score(a: f64, b: f64) -> f64 {
    match a.partial_cmp(&b) {
        Some(std::cmp::Ordering::Greater) => 1.0,
        Some(std::cmp::Ordering::Equal) => 0.5,
        _ => 0.0,
    }
}

/// Draws as many of `values` as fit, with replacement.
fn resample(rng: &mut ChaCha8Rng, values: &[f64], sample: &mut [f64]) {
    let n = values.len() as u128;
    for slot in sample {
        *slot = values[((u128::from(rng.next_u64()) * n) >> 64) as usize];
    }
}

/// Of sorted values, interpolated between neighbours.
fn quantile(sorted: &[f64], q: f64) -> Option<f64> {
    let at = q * sorted.len().checked_sub(1)? as f64;
    let (below, above) = (*sorted.get(at.floor() as usize)?, *sorted.get(at.ceil() as usize)?);
    Some(below + (above - below) * at.fract())
}

/// The exponential moving average: y₀ = x₀, yₖ = `weight`·yₖ₋₁ + (1 − `weight`)·xₖ.
pub fn ema(values: &[f64], weight: f64) -> Vec<f64> {
    let mut state = None;
    let next = |&x: &f64| *state.insert(state.map_or(x, |y: f64| weight * y + (1.0 - weight) * x));
    values.iter().map(next).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Expected: `scipy.stats.binomtest(s, n).proportion_ci(c, method="exact")`, SciPy 1.17.1.
    #[test]
    fn the_exact_interval_agrees_with_scipy() {
        for (successes, trials, confidence, low, high) in [
            (0, 10, 0.95, 0.0, 0.308_497_107_818_8),
            (1, 10, 0.95, 0.002_528_578_544_5, 0.445_016_117_028_2),
            (5, 10, 0.95, 0.187_086_028_447_4, 0.812_913_971_552_6),
            (10, 10, 0.95, 0.691_502_892_181_2, 1.0),
            (95, 100, 0.95, 0.887_165_088_894_5, 0.983_568_120_818_3),
            (100, 100, 0.95, 0.963_783_307_354_8, 1.0),
            (97, 100, 0.99, 0.894_518_746_274_9, 0.996_592_929_896_8),
            (1, 1, 0.9, 0.05, 1.0),
            (0, 1, 0.95, 0.0, 0.975),
            (3, 20, 0.8, 0.056_417_896_243_1, 0.304_186_811_407_6),
            (1234, 5000, 0.95, 0.234_899_930_299_1, 0.258_996_360_276_7),
        ] {
            let (l, h) = clopper_pearson(successes, trials, confidence);
            assert!(
                (l - low).abs() < 1e-12 && (h - high).abs() < 1e-12,
                "{successes}/{trials}: {l} {h}"
            );
        }
        assert_eq!(clopper_pearson(0, 0, 0.95), (0.0, 1.0));
    }

    #[test]
    fn the_interquartile_mean_ignores_outliers() {
        assert_eq!(iqm(&[1e9, 2.0, 3.0, -1e9]), Some(2.5));
        assert_eq!(iqm(&[1.0, 2.0, 6.0]), Some(3.0));
        assert_eq!(iqm(&[]), None);
    }

    #[test]
    fn the_bootstrap_of_a_mean_is_near_the_normal_interval() {
        // 0 … 99: standard error of the mean √((100² − 1) / 12 / 100) = 2.8866.
        let values: Vec<f64> = (0..100).map(f64::from).collect();
        let (low, high) = bootstrap(&values, mean, 20_000, 0.95, 1).unwrap();
        assert!((low - (49.5 - 1.96 * 2.8866)).abs() < 0.15, "{low}");
        assert!((high - (49.5 + 1.96 * 2.8866)).abs() < 0.15, "{high}");
        assert_eq!(bootstrap(&values, mean, 100, 0.9, 7), bootstrap(&values, mean, 100, 0.9, 7));
        assert_ne!(bootstrap(&values, mean, 100, 0.9, 7), bootstrap(&values, mean, 100, 0.9, 8));
        assert_eq!(bootstrap(&[3.0; 4], iqm, 10, 0.9, 1), Some((3.0, 3.0)));
        assert_eq!(bootstrap(&[], mean, 10, 0.9, 1), None);
    }

    /// Expected: `scipy.stats.mannwhitneyu(x, y).statistic / (len(x) * len(y))`, counted by hand as well: of 12 pairs
    /// 7 are greater and 2 equal.
    #[test]
    fn the_probability_of_improvement_counts_pairs() {
        let (x, y) = ([3.0, 1.0, 5.0, 4.0], [1.0, 2.0, 4.0]);
        let (p, (low, high)) = probability_of_improvement(&x, &y, 2_000, 0.95, 1).unwrap();
        assert_eq!(p, 8.0 / 12.0);
        assert!(low < p && p < high && low >= 0.0 && high <= 1.0, "{low} {high}");
        let same = probability_of_improvement(&[1.0; 5], &[1.0; 5], 100, 0.95, 1);
        assert_eq!(same, Some((0.5, (0.5, 0.5))));
        assert_eq!(
            probability_of_improvement(&[2.0], &[1.0], 100, 0.95, 1),
            Some((1.0, (1.0, 1.0)))
        );
        assert_eq!(probability_of_improvement(&[], &y, 100, 0.95, 1), None);
    }

    #[test]
    fn the_moving_average_starts_at_the_first_value_and_forgets() {
        assert_eq!(ema(&[1.0, 2.0, 4.0], 0.5), [1.0, 1.5, 2.75]);
        assert_eq!(ema(&[1.0, 5.0], 0.0), [1.0, 5.0]);
        assert!(ema(&[], 0.6).is_empty());
    }
}
