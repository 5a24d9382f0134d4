//! The chapters about the policies: finished ones, those on the way, baselines, and what they do.

use super::document::Chapter;
use super::evolution::{self, Motion};
use super::group::{Group, dash, median, middle, success};
use super::variations::at;
use crate::study::rows::JudgedRow;

/// Steps at which success during the training is tabled.
const MARKS: [u64; 4] = [5_000, 10_000, 20_000, 50_000];

/// A number of each judged episode, or of those that succeeded.
pub(super) fn numbers(
    episodes: &[&JudgedRow],
    of: fn(&JudgedRow) -> f64,
    succeeded: bool,
) -> Vec<f64> {
    episodes.iter().filter(|e| !succeeded || e.success == 1).map(|e| of(e)).collect()
}

/// Peak force of the episodes: median and largest, N.
pub(super) fn peak_force(episodes: &[&JudgedRow]) -> String {
    let peaks = numbers(episodes, |e| e.peak_force, false);
    let largest = peaks.iter().copied().reduce(f64::max);
    format!("{} / {}", dash(median(&peaks), 1), dash(largest, 1))
}

pub(super) fn judged(groups: &[&Group<'_>]) -> Chapter {
    let mut chapter = Chapter::new("The finished policies");
    chapter.text(
        "On fresh episodes, the same for every run. Last: the policy at the end of the training; kept: the latest of its \
         best evaluations. Mean and sampled are the policy's actions. Time is the median of the successes, force the median and \
         the largest peak of all episodes; all of the last policy's mean actions.",
    );
    let row = |g: &&Group<'_>| {
        let last = g.judged("last", "mean");
        let by_run = g.success_by_run("last", "mean");
        let worst = by_run.iter().copied().reduce(f64::min);
        vec![
            g.first.block.clone(),
            g.first.task.clone(),
            g.name(),
            success(&last),
            worst.map_or_else(|| "–".into(), |w| format!("{:.0} %", 100.0 * w)),
            middle(&by_run.iter().map(|x| 100.0 * x).collect::<Vec<_>>(), 1),
            success(&g.judged("last", "sampled")),
            success(&g.judged("kept", "mean")),
            success(&g.judged("kept", "sampled")),
            dash(median(&numbers(&last, |e| e.seconds, true)), 2),
            peak_force(&last),
            last.iter().filter(|e| e.collision == 1).count().to_string(),
        ]
    };
    chapter.table(
        &[
            "block",
            "task",
            "model",
            "last, mean",
            "worst run",
            "IQM over runs, %",
            "last, sampled",
            "kept, mean",
            "kept, sampled",
            "time, s",
            "peak force, N",
            "collisions",
        ],
        groups.iter().map(row).collect(),
    );
    chapter
}

pub(super) fn on_the_way(groups: &[&Group<'_>]) -> Chapter {
    let mut chapter = Chapter::new("On the way");
    chapter.text(
        "Success of the deterministic policy at the first evaluation at or after a step: mean over the runs, and the worst \
         run. Steps to the first success of an exploring policy, and to the first evaluation with at least 90 %: medians of \
         the runs that got there.",
    );
    let row = |g: &&Group<'_>| {
        let first: Vec<f64> =
            g.runs.iter().filter_map(|run| run.first_success_step).map(|s| s as f64).collect();
        let able = g.first_at(0.9);
        let mut cells =
            vec![g.first.block.clone(), g.first.task.clone(), g.name(), g.seeds().to_string()];
        cells.extend(MARKS.iter().map(|step| at(g, *step)));
        cells.push(dash(median(&first), 0));
        cells.push(format!("{} ({} of {})", dash(median(&able), 0), able.len(), g.seeds()));
        cells.push(middle(&g.areas(), 2));
        cells
    };
    chapter.table(
        &[
            "block",
            "task",
            "model",
            "runs",
            "at 5,000",
            "at 10,000",
            "at 20,000",
            "at 50,000",
            "first success",
            "first 90 %",
            "success over the training, IQM",
        ],
        groups.iter().map(row).collect(),
    );
    chapter
}

pub(super) fn baselines(groups: &[Group<'_>]) -> Chapter {
    let mut chapter = Chapter::new("Without learning");
    let row = |g: &Group<'_>| {
        let episodes: Vec<&JudgedRow> = ["zero", "random", "scripted"]
            .iter()
            .flat_map(|name| ["mean", "sampled"].map(|actions| g.judged(name, actions)))
            .flatten()
            .collect();
        let name = match episodes.first().map(|e| e.policy.as_str()) {
            Some("zero") => "a = 0: the force controller alone",
            Some("random") => "uniform random actions",
            _ => "align, descend, spiral search with force control",
        };
        vec![
            g.first.task.clone(),
            g.first.model.clone(),
            name.into(),
            success(&episodes),
            dash(median(&numbers(&episodes, |e| e.seconds, true)), 2),
            peak_force(&episodes),
            episodes.iter().filter(|e| e.collision == 1).count().to_string(),
        ]
    };
    let rows: Vec<_> = groups.iter().filter(|g| !g.is_learned()).map(row).collect();
    chapter.table(
        &["task", "model", "policy", "success", "time, s", "peak force, N", "collisions"],
        rows,
    );
    chapter
}

pub(super) fn policies(motions: &[Motion]) -> Chapter {
    let mut chapter = Chapter::new("What the policy does");
    let pictures = evolution::figures(motions);
    if !pictures.is_empty() {
        chapter.text(
            "One insertion on the same frozen start by the fresh policy and by the trained one, along base axes: white is \
             search in free air, orange contact outside, green insertion.",
        );
    }
    for (file, svg, caption) in pictures {
        chapter.figure(&file, svg, &caption);
    }
    chapter
}
