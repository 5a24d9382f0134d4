//! Which of the paper's orderings hold here.
//!
//! An ordering is a probability: that a run of the one is better than a run of the other. It holds where its interval
//! lies above one half, is contradicted where it lies below, and is open in between.

use palpate_runs::stats::probability_of_improvement;

use super::group::{CONFIDENCE, Group, RESAMPLES, dash, median};
use super::{figures, paper};

/// A claim of the paper, and what is found.
pub(super) struct Claim {
    pub(super) claim: String,
    pub(super) found: String,
    pub(super) verdict: &'static str,
}

const HOLDS: &str = "holds";
const CONTRADICTED: &str = "contradicted";
const OPEN: &str = "open";

/// P(a > b) as text and what it says.
pub(super) fn compared(a: &[f64], b: &[f64]) -> (String, &'static str) {
    match probability_of_improvement(a, b, RESAMPLES, CONFIDENCE, 1) {
        None => ("–".into(), OPEN),
        Some((p, (low, high))) => {
            let verdict = if low > 0.5 {
                HOLDS
            } else if high < 0.5 {
                CONTRADICTED
            } else {
                OPEN
            };
            (format!("{p:.2} ({low:.2}–{high:.2})"), verdict)
        }
    }
}

/// The claims about the eight models, from the groups of one block.
pub(super) fn claims(groups: &[&Group<'_>]) -> Vec<Claim> {
    let find = |model: &str, penalty: bool| {
        groups.iter().copied().find(|g| g.first.model == model && g.first.penalty == penalty)
    };
    let mut all = Vec::new();
    for row in &paper::TABLE_II {
        let (Some(with), Some(without)) = (find(row.model, true), find(row.model, false)) else {
            continue;
        };
        let (found, verdict) = compared(&counts(without), &counts(with));
        let claim = format!("{}: fewer collisions with the penalty", row.model);
        all.push(Claim { claim, found: format!("P(more without) {found}"), verdict });
    }
    let family = |letter: char| {
        move |g: &&&Group<'_>| g.family() == letter && g.first.penalty && g.first.model != "P-6"
    };
    for (model, letter, fewest) in
        [("P-14", 'P', true), ("A-13pd", 'A', true), ("P-24", 'P', false), ("A-18", 'A', false)]
    {
        let Some(one) = find(model, true) else { continue };
        let others: Vec<f64> = groups
            .iter()
            .filter(family(letter))
            .filter(|g| g.first.model != model)
            .flat_map(|g| counts(g))
            .collect();
        let (what, (found, verdict)) = if fewest {
            ("fewest", compared(&others, &counts(one)))
        } else {
            ("most", compared(&counts(one), &others))
        };
        let claim = format!("{model}: the {what} collisions of its family");
        all.push(Claim { claim, found: format!("P against the others {found}"), verdict });
    }
    let pool = |letter: char, of: fn(&Group<'_>) -> Vec<f64>| -> Vec<f64> {
        groups.iter().filter(family(letter)).flat_map(|g| of(g)).collect()
    };
    let (found, verdict) = compared(&pool('P', last_returns), &pool('A', last_returns));
    let claim = "P models end with more return than A models".into();
    all.push(Claim { claim, found: format!("P(P > A) {found}"), verdict });
    for (model, letter) in [("P-9", 'P'), ("A-8", 'A')] {
        let Some(one) = find(model, true) else { continue };
        let others: Vec<f64> = groups
            .iter()
            .filter(family(letter))
            .filter(|g| g.first.model != model)
            .flat_map(|g| last_returns(g))
            .collect();
        let (found, verdict) = compared(&others, &last_returns(one));
        let claim = format!("{model}: the least return of its family at the end");
        all.push(Claim { claim, found: format!("P(another is better) {found}"), verdict });
    }
    for (model, quick) in [("P-14", true), ("P-24", false)] {
        let Some(one) = find(model, true) else { continue };
        let others: Vec<f64> = groups
            .iter()
            .filter(family('P'))
            .filter(|g| g.first.model != model)
            .flat_map(|g| g.areas())
            .collect();
        let (what, (found, verdict)) = if quick {
            ("quickest", compared(&one.areas(), &others))
        } else {
            ("slowest", compared(&others, &one.areas()))
        };
        let claim = format!("{model}: the {what} to learn of its family");
        let found = format!("P by success over the whole training {found}");
        all.push(Claim { claim, found, verdict });
    }
    if let (Some(with), Some(without)) = (find("A-13pd", true), find("A-13pd", false)) {
        let (a, b) = (reaching(with, 100.0), reaching(without, 100.0));
        let (found, verdict) = compared(&b, &a);
        let steps = |v: &[f64]| dash(median(v), 0);
        all.push(Claim {
            claim: "A-13pd: a return of 100 sooner with the penalty (12k against 20k steps)".into(),
            found: format!("{} against {} steps; P {found}", steps(&a), steps(&b)),
            verdict,
        });
    }
    all
}

/// Collisions of each run.
fn counts(group: &Group<'_>) -> Vec<f64> {
    group.runs.iter().map(|run| run.collisions as f64).collect()
}

/// Smoothed return of each run at its end.
fn last_returns(group: &Group<'_>) -> Vec<f64> {
    let last = |run: &&crate::study::rows::RunRow| {
        figures::smoothed(group, run).last().map(|(_, total)| *total)
    };
    group.runs.iter().filter_map(last).collect()
}

/// Step at which the smoothed return of each run first reaches a value.
fn reaching(group: &Group<'_>, value: f64) -> Vec<f64> {
    let first = |run: &&crate::study::rows::RunRow| {
        let curve = figures::smoothed(group, run);
        curve.into_iter().find(|(_, total)| *total >= value).map(|(step, _)| step)
    };
    group.runs.iter().filter_map(first).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_verdict_needs_an_interval_on_one_side() {
        assert_eq!(compared(&[5.0, 6.0, 7.0], &[1.0, 2.0, 3.0]).1, HOLDS);
        assert_eq!(compared(&[1.0, 2.0, 3.0], &[5.0, 6.0, 7.0]).1, CONTRADICTED);
        assert_eq!(compared(&[1.0, 6.0, 3.0], &[5.0, 2.0, 3.0]).1, OPEN);
        assert_eq!(compared(&[], &[1.0]).1, OPEN);
    }
}
