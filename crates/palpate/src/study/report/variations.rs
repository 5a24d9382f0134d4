//! The chapters about what was changed: settings of the training, and the world in which finished policies act.

use palpate_runs::stats::mean;

use super::document::{Chapter, Item};
use super::figures;
use super::group::{Group, dash, median, success};
use super::policies::{numbers, peak_force};
use crate::study::plan::{Condition, Study};
use crate::study::rows::RunRow;

/// Exploration is over.
pub(super) const SETTLED: u64 = 10_000;

/// What blocks vary: one row per value.
pub(super) fn settings(groups: &[&Group<'_>]) -> Chapter {
    let mut chapter = Chapter::new("What was varied");
    let varied: Vec<&Group<'_>> =
        groups.iter().copied().filter(|g| !g.first.varied.is_empty()).collect();
    if varied.is_empty() {
        return chapter;
    }
    chapter.text(
        "One setting at a time around the study's own. Success while training is that of the deterministic policy on frozen \
         starts, mean over the runs and the worst run; the last policy's is on fresh episodes. Collisions are those of the \
         training, per run.",
    );
    let row = |g: &&Group<'_>| {
        let last = g.judged("last", "mean");
        let worst = g.success_by_run("last", "mean").into_iter().reduce(f64::min);
        let able = g.first_at(0.95);
        vec![
            g.first.block.clone(),
            g.first.task.clone(),
            g.first.model.clone(),
            g.first.varied.clone(),
            g.seeds().to_string(),
            at(g, 5_000),
            at(g, 10_000),
            format!("{} ({} of {})", dash(median(&able), 0), able.len(), g.seeds()),
            success(&last),
            worst.map_or_else(|| "–".into(), |w| format!("{:.0} %", 100.0 * w)),
            dash(mean(&g.collisions(0, u64::MAX)), 1),
            dash(mean(&g.collisions(SETTLED, u64::MAX)), 1),
            dash(median(&numbers(&last, |e| e.seconds, true)), 2),
            dash(median(&numbers(&last, |e| e.peak_force, false)), 1),
        ]
    };
    chapter.table(
        &[
            "block",
            "task",
            "model",
            "setting",
            "runs",
            "at 5,000",
            "at 10,000",
            "first 95 %",
            "last policy",
            "worst run",
            "collisions",
            "after 10,000",
            "time, s",
            "peak force, N",
        ],
        varied.iter().map(row).collect(),
    );
    for key in keys(&varied) {
        let rate = |g: &Group<'_>| -> Vec<f64> {
            let of = |run: &&RunRow| 1e3 * run.collisions as f64 / run.steps.max(1) as f64;
            g.runs.iter().map(of).collect()
        };
        let svg = figures::sensitivity(&key, "collisions per 1,000 steps", &varied, rate);
        chapter.figure(&format!("sensitivity-{}.svg", key.replace('.', "-")), svg, &key);
    }
    chapter
}

/// Success at a step: mean over the runs, and the worst run.
pub(super) fn at(group: &Group<'_>, step: u64) -> String {
    let of = group.success_at(step);
    let worst = of.iter().copied().reduce(f64::min);
    match (mean(&of), worst) {
        (Some(m), Some(w)) => format!("{:.0} / {:.0} %", 100.0 * m, 100.0 * w),
        _ => "–".into(),
    }
}

fn keys(varied: &[&Group<'_>]) -> Vec<String> {
    let mut keys: Vec<String> = varied
        .iter()
        .flat_map(|g| g.first.varied.split(' '))
        .filter_map(|pair| pair.split_once('=').map(|(key, _)| key.to_owned()))
        .collect();
    keys.sort();
    keys.dedup();
    keys
}

/// How finished policies and baselines fare in changed worlds.
pub(super) fn conditions(study: &Study, groups: &[Group<'_>]) -> Chapter {
    let mut chapter = Chapter::new("In a changed world");
    let mut names: Vec<&str> = Vec::new();
    // Every group holds the rows of all.
    for row in groups.first().iter().flat_map(|g| &g.rows.judged) {
        if !names.contains(&row.condition.as_str()) {
            names.push(&row.condition);
        }
    }
    if names.len() < 2 {
        return chapter;
    }
    chapter.text(
        "The last policy's mean action and what needs no learning, in changed worlds: settings beside the run's \
         own; the same seeds for all. Time is the median of the successes, force the median and the largest peak of all episodes.",
    );
    let changed = |c: &Condition| format!("{}: `{}`", c.name, c.settings().join(", "));
    chapter.items.push(Item::List(study.conditions.iter().map(changed).collect()));
    let mut rows = Vec::new();
    for name in names {
        for g in groups {
            for policy in ["last", "scripted", "random", "zero"] {
                let actions = if policy == "random" { "sampled" } else { "mean" };
                let episodes = g.judged_under(name, policy, actions);
                if episodes.is_empty() {
                    continue;
                }
                rows.push(vec![
                    if name.is_empty() { "as trained".into() } else { name.to_owned() },
                    g.first.block.clone(),
                    g.first.task.clone(),
                    g.name(),
                    if policy == "last" { "learned".into() } else { policy.to_owned() },
                    success(&episodes),
                    dash(median(&numbers(&episodes, |e| e.seconds, true)), 2),
                    peak_force(&episodes),
                    episodes.iter().filter(|e| e.collision == 1).count().to_string(),
                ]);
            }
        }
    }
    chapter.table(
        &[
            "condition",
            "block",
            "task",
            "model",
            "policy",
            "success",
            "time, s",
            "peak force, N",
            "collisions",
        ],
        rows,
    );
    chapter
}
