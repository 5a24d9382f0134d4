//! Whatever is proposed, every set-point is legal.

mod support;

use palpate_safety::Cause;
use support::judge::{KINDS, Violation};
use support::soak;

/// Half a million adversarial actions each for the preset's tight workspace and for a wide one.
#[test]
fn a_million_adversarial_actions_violate_nothing() {
    let mut peaks = [0.0f64; 3];
    let mut seen = [0u64; Cause::ALL.len()];
    for (seed, safety) in [(1, support::preset()), (2, support::wide())] {
        let report = soak::run(&safety, seed, 500_000, false);
        println!(
            "{:?}\npeaks {:?}, least clearances {:?} m",
            report.counts, report.judge.peaks, report.judge.least
        );
        assert!(
            report.judge.least.iter().all(|&c| c < 1e-3),
            "every wall was reached: {:?}",
            report.judge.least
        );
        for kind in KINDS {
            assert_eq!(report.judge.counts[kind as usize], 0, "{kind:?} with seed {seed}");
        }
        for (peak, reached) in peaks.iter_mut().zip(report.judge.peaks) {
            *peak = peak.max(reached);
        }
        for (cause, count) in report.counts.iter() {
            seen[cause as usize] += count;
        }
        assert!(report.by_kind.iter().all(|&n| n > 1_000), "{:?}", report.by_kind);
    }
    // The adversaries did get to every limit.
    assert!(peaks.iter().all(|&part| part > 0.99), "{peaks:?}");
    // Samples and tracking have tests of their own; a joint that is too
    // fast is slowed before its brake could be.
    let not_attacked = [Cause::Implausible, Cause::Tracking, Cause::JointSpeed];
    for &cause in Cause::ALL.iter().filter(|c| !not_attacked.contains(c)) {
        assert!(seen[cause as usize] > 0, "nobody tried {cause:?}");
    }
}

/// The judge is no rubber stamp: the same adversaries without the shield break every rule.
#[test]
fn without_the_shield_the_same_actions_violate_everything() {
    let report = soak::run(&support::wide(), 3, 100_000, true);
    for kind in KINDS {
        assert!(report.judge.counts[kind as usize] > 0, "{kind:?}");
    }
    assert!(report.judge.total() > report.judge.counts[Violation::Jerk as usize]);
}
