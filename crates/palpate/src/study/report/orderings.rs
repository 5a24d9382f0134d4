//! Which of the paper's orderings hold here.
//!
//! An ordering is a probability: that a run of the one is better than a run of the other. It holds where its interval
//! lies above one half, is contradicted where it lies below, and is open in between.

use palpate_runs::stats::probability_of_improvement;

use super::group::{CONFIDENCE, Group, RESAMPLES, dash, median};
use super::{figures, paper};
use crate::study::rows::{EpisodeRow, RunRow};

/// A claim of the paper, and what is found.
pub(super) struct Claim {
    pub(super) words: String,
    pub(super) found: String,
    pub(super) verdict: &'static str,
}

pub(super) const HOLDS: &str = "holds";
pub(super) const CONTRADICTED: &str = "contradicted";
pub(super) const OPEN: &str = "open";

/// P(a > b) as text and what it says.
pub(super) fn compared(a: &[f64], b: &[f64]) -> (String, &'static str) {
    let Some((p, (low, high))) = probability_of_improvement(a, b, RESAMPLES, CONFIDENCE, 1) else {
        return ("–".into(), OPEN);
    };
    let verdict = match (low > 0.5, high < 0.5) {
        (true, _) => HOLDS,
        (_, true) => CONTRADICTED,
        _ => OPEN,
    };
    (format!("{p:.2} ({low:.2}–{high:.2})"), verdict)
}

/// Episodes of a mean return.
const WINDOW: usize = 20;

/// One number per run of a group.
type Score = fn(&Group<'_>) -> Vec<f64>;

/// The eight models, from the groups of one block.
struct Models<'a, 'b>(&'b [&'b Group<'a>]);

impl<'a> Models<'a, '_> {
    fn find(&self, model: &str, penalty: bool) -> Option<&Group<'a>> {
        let is = |g: &&&Group<'_>| g.first.model == model && g.first.penalty == penalty;
        self.0.iter().find(is).copied()
    }

    /// A score of all runs of a family with penalty, but for one model.
    fn family(&self, letter: char, but: &str, score: Score) -> Vec<f64> {
        let is = |g: &&&Group<'_>| g.family() == letter && g.first.penalty && g.first.model != but;
        self.0.iter().filter(is).flat_map(|g| score(g)).collect()
    }

    /// One model against the rest of its family: whether its score is the highest, or the lowest.
    fn extreme(&self, model: &str, highest: bool, score: Score, words: &str) -> Option<Claim> {
        let own = score(self.find(model, true)?);
        let rest = self.family(model.chars().next()?, model, score);
        let (found, verdict) = if highest { compared(&own, &rest) } else { compared(&rest, &own) };
        let words = format!("{model}: {words}");
        Some(Claim { words, found: format!("P against the others {found}"), verdict })
    }

    /// The same model without the penalty: is its score higher?
    fn without(&self, model: &str, score: Score, words: &str) -> Option<Claim> {
        let (with, without) = (score(self.find(model, true)?), score(self.find(model, false)?));
        let (found, verdict) = compared(&without, &with);
        let middle = |scores: &[f64]| dash(median(scores), 0);
        let found = format!("{} against {} without; P {found}", middle(&with), middle(&without));
        Some(Claim { words: format!("{model}: {words}"), found, verdict })
    }
}

/// The claims about the eight models, from the groups of one block.
pub(super) fn claims(groups: &[&Group<'_>]) -> Vec<Claim> {
    let models = Models(groups);
    let penalised = paper::TABLE_II.iter().map(|row| row.model);
    let mut all: Vec<Claim> = penalised
        .filter_map(|m| models.without(m, collisions, "fewer collisions with the penalty"))
        .collect();
    let ends = (models.family('P', "", last_return), models.family('A', "", last_return));
    if !ends.0.is_empty() && !ends.1.is_empty() {
        let (found, verdict) = compared(&ends.0, &ends.1);
        let words = "P models end with more return than A models".into();
        all.push(Claim { words, found: format!("P {found}"), verdict });
    }
    let (fewest, most) = ("fewest collisions of its family", "most collisions of its family");
    let least = "least return of its family at the end";
    all.extend(
        [
            models.extreme("P-14", false, collisions, fewest),
            models.extreme("A-13pd", false, collisions, fewest),
            models.extreme("P-24", true, collisions, most),
            models.extreme("A-18", true, collisions, most),
            models.extreme("P-9", false, last_return, least),
            models.extreme("A-8", false, last_return, least),
            models.extreme("P-14", true, success, "learns quickest of its family"),
            models.extreme("P-24", false, success, "learns slowest of its family"),
            models.without(
                "A-13pd",
                reaching_100,
                "a return of 100, mean of 20 episodes, sooner with the penalty, steps",
            ),
        ]
        .into_iter()
        .flatten(),
    );
    all
}

fn collisions(group: &Group<'_>) -> Vec<f64> {
    group.runs.iter().map(|run| run.collisions as f64).collect()
}

/// Mean success of each run over its training.
fn success(group: &Group<'_>) -> Vec<f64> {
    group.areas()
}

/// Smoothed return of each run at its end.
fn last_return(group: &Group<'_>) -> Vec<f64> {
    let last = |run: &&RunRow| figures::smoothed(group, run).last().map(|(_, total)| *total);
    group.runs.iter().filter_map(last).collect()
}

/// Step at which the mean return of [`WINDOW`] episodes first reaches 100, of each run: one lucky success is not enough.
fn reaching_100(group: &Group<'_>) -> Vec<f64> {
    let first = |run: &&RunRow| {
        let episodes: Vec<_> = group.episodes(run).collect();
        let able =
            |w: &&[&EpisodeRow]| w.iter().map(|e| e.total).sum::<f64>() >= 100.0 * w.len() as f64;
        let window = episodes.windows(WINDOW).find(able);
        window.and_then(|w| w.last()).map(|e| e.step as f64)
    };
    group.runs.iter().filter_map(first).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::study::plan::Kind;
    use crate::study::report::group::groups;
    use crate::study::rows::Rows;

    #[test]
    fn a_verdict_needs_an_interval_on_one_side() {
        assert_eq!(compared(&[5.0, 6.0, 7.0], &[1.0, 2.0, 3.0]).1, HOLDS);
        assert_eq!(compared(&[1.0, 2.0, 3.0], &[5.0, 6.0, 7.0]).1, CONTRADICTED);
        assert_eq!(compared(&[1.0, 6.0, 3.0], &[5.0, 2.0, 3.0]).1, OPEN);
        assert_eq!(compared(&[], &[1.0]).1, OPEN);
    }

    #[test]
    fn claims_follow_the_counts() {
        let run = |model: &str, penalty: bool, seed: u64, collisions: u64| RunRow {
            run: format!("{model}{penalty}{seed}"),
            block: "peg".into(),
            task: "peg-insertion".into(),
            model: model.into(),
            policy: Kind::Learned,
            penalty,
            seed,
            demonstrations: 0,
            steps: 100,
            varied: String::new(),
            episodes: 10,
            successes: 5,
            collisions,
            first_success_step: None,
            kept_step: None,
        };
        let mut rows = Rows::default();
        for seed in 0..3 {
            rows.runs.push(run("P-14", true, seed, 1 + seed));
            rows.runs.push(run("P-14", false, seed, 20 + seed));
            rows.runs.push(run("P-9", true, seed, 9 + seed));
            rows.runs.push(run("P-9", false, seed, seed));
        }
        let groups = groups(&rows);
        let groups: Vec<&Group<'_>> = groups.iter().collect();
        let claims = claims(&groups);
        let verdict = |words: &str| {
            claims.iter().find(|c| c.words == words).map(|c| (c.verdict, c.found.as_str()))
        };
        let fewer = "fewer collisions with the penalty";
        let found = "2 against 21 without; P 1.00 (1.00–1.00)";
        assert_eq!(verdict(&format!("P-14: {fewer}")), Some((HOLDS, found)));
        assert_eq!(verdict(&format!("P-9: {fewer}")).unwrap().0, CONTRADICTED);
        assert_eq!(verdict("P-14: fewest collisions of its family").unwrap().0, HOLDS);
        assert_eq!(verdict(&format!("A-8: {fewer}")), None);
    }
}
