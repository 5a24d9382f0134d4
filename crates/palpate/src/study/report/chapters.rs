//! What the report says, chapter by chapter.

use palpate_runs::stats::{iqm, mean};

use super::document::{Chapter, Item};
use super::evolution::{self, Motion};
use super::group::{Group, dash, groups, median, middle, success};
use super::orderings::{claims, compared};
use super::{figures, paper};
use crate::study::folder::Folder;
use crate::study::rows::{JudgedRow, Rows};

/// Steps at which success during the training is tabled.
const MARKS: [u64; 4] = [5_000, 10_000, 20_000, 50_000];
/// Exploration is over.
const SETTLED: u64 = 10_000;

/// All chapters.
pub(super) fn all(folder: &Folder, rows: &Rows, motions: &[Motion]) -> Vec<Chapter> {
    let all = groups(rows);
    let learned: Vec<&Group<'_>> = all.iter().filter(|g| g.is_learned()).collect();
    let plain: Vec<&Group<'_>> =
        learned.iter().copied().filter(|g| g.first.varied.is_empty()).collect();
    vec![
        overview(folder, rows),
        curves(&plain),
        collisions(&plain),
        judged(&plain),
        on_the_way(&plain),
        orderings(&plain),
        baselines(&all),
        sensitivity(&learned),
        policies(motions),
    ]
}

fn overview(folder: &Folder, rows: &Rows) -> Chapter {
    let mut chapter = Chapter::new("The study");
    let planned = folder.plan.len();
    chapter.text(format!("{}.", folder.study.about));
    let steps: u64 = rows.runs.iter().map(|run| run.steps).sum();
    let hours: f64 = rows.times.iter().map(|t| t.seconds * t.threads as f64).sum::<f64>() / 3600.0;
    let mut commits: Vec<&str> = rows.times.iter().map(|t| t.commit.as_str()).collect();
    commits.sort_unstable();
    commits.dedup();
    let mut cpus: Vec<&str> = rows.times.iter().map(|t| t.cpu.as_str()).collect();
    cpus.sort_unstable();
    cpus.dedup();
    chapter.items.push(Item::List(vec![
        format!("{} of {planned} runs are in it, {:.2} million environment steps; {} judged episodes.", rows.runs.len(), steps as f64 / 1e6, rows.judged.len()),
        format!("Simulated; no arm took part. {hours:.1} core hours, judging included, on: {}.", cpus.join(", ")),
        format!("Code: {}. Command: `cargo xtask study run {}`, then `study report`.", commits.join(", "), folder.study.name),
        "Intervals are of 95 %: Clopper and Pearson for shares of episodes, percentile bootstrap over runs for interquartile means (IQM) and probabilities.".into(),
        "Rows for pandas and rliable: runs.csv, episodes.csv (training), evaluation.csv (judged episodes), curves.csv (evaluations while training), times.csv.".into(),
    ]));
    chapter
}

/// Groups with the same block and task, in order.
fn tasks<'a, 'b>(groups: &[&'b Group<'a>]) -> Vec<(String, Vec<&'b Group<'a>>)> {
    let mut all: Vec<(String, Vec<&Group<'_>>)> = Vec::new();
    for group in groups {
        let name = format!("{}, {}", group.first.block, group.first.task);
        match all.iter_mut().find(|(known, _)| *known == name) {
            Some((_, of)) => of.push(group),
            None => all.push((name, vec![group])),
        }
    }
    all
}

fn curves(groups: &[&Group<'_>]) -> Chapter {
    let mut chapter = Chapter::new("Learning curves");
    chapter.text(
        "Left as the paper draws them: return of the training episodes, moving average 0.6, mean and standard deviation \
         over the runs. Right: success of the deterministic policy on frozen starts, IQM over the runs and its interval. \
         Return is not success, and not comparable between with and without penalty.",
    );
    for (name, of) in tasks(groups) {
        for (letter, family) in [('P', "parallel"), ('A', "admittance")] {
            for penalty in [true, false] {
                let these: Vec<&Group<'_>> = of
                    .iter()
                    .copied()
                    .filter(|g| g.family() == letter && g.first.penalty == penalty)
                    .collect();
                let what = if penalty { "with penalty" } else { "without penalty" };
                let title = format!("{name}: {family}, {what}");
                let file = title.replace([',', ':'], "").replace(' ', "-");
                chapter.figure(
                    &format!("return-{file}.svg"),
                    figures::returns(&title, &these),
                    &title,
                );
                chapter.figure(
                    &format!("success-{file}.svg"),
                    figures::successes(&title, &these),
                    &title,
                );
            }
        }
    }
    chapter
}

fn collisions(groups: &[&Group<'_>]) -> Chapter {
    let mut chapter = Chapter::new("Collisions while training");
    let row = |g: &&Group<'_>| {
        let all: Vec<f64> = g.collisions(0, u64::MAX);
        let late = g.collisions(SETTLED, u64::MAX);
        vec![
            g.first.block.clone(),
            g.first.task.clone(),
            g.name(),
            g.seeds().to_string(),
            dash(mean(&all), 1),
            all.iter().map(|n| format!("{n:.0}")).collect::<Vec<_>>().join(" "),
            format!("{:.2}", g.collision_rate()),
            dash(mean(&g.collisions(0, 1_000)), 1),
            dash(mean(&late), 1),
        ]
    };
    chapter.table(
        &[
            "block",
            "task",
            "model",
            "runs",
            "mean per run",
            "each run",
            "per 1,000 steps",
            "in the first 1,000 steps",
            "after 10,000 steps",
        ],
        groups.iter().map(row).collect(),
    );
    let find = |model: &str, penalty: bool| {
        let is = |g: &&&Group<'_>| g.first.model == model && g.first.penalty == penalty;
        let groups = groups.iter().filter(is);
        groups
            .copied()
            .find(|g| g.first.block == "peg")
            .and_then(|g| mean(&g.collisions(0, u64::MAX)))
    };
    let rows: Vec<Vec<String>> = paper::TABLE_II
        .iter()
        .filter_map(|p| {
            let (with, without) = (find(p.model, true)?, find(p.model, false)?);
            Some(vec![
                p.model.into(),
                format!("{:.0}", p.penalty),
                format!("{:.0}", p.free),
                format!("{:.0} %", p.difference),
                format!("{:.0} %", paper::reduction(p.penalty, p.free)),
                format!("{with:.1}"),
                format!("{without:.1}"),
                format!("{:.0} %", paper::difference(with, without)),
                format!("{:.0} %", paper::reduction(with, without)),
            ])
        })
        .collect();
    if !rows.is_empty() {
        chapter.text(
            "Beside the paper's Table II. Its \"difference\" is relative to the count **with** the penalty; the reduction is \
             the usual one, relative to the count without. P-24's printed −43 % does not follow from its counts: it should \
             read −54 %. The paper's counts depend on a force limit, a filter and a contact stiffness that it does not print.",
        );
        chapter.table(
            &[
                "model",
                "paper: penalty",
                "none",
                "difference",
                "reduction",
                "here: penalty",
                "none",
                "difference",
                "reduction",
            ],
            rows,
        );
    }
    for (name, of) in tasks(groups) {
        let these: Vec<&Group<'_>> = of.into_iter().filter(|g| g.first.penalty).collect();
        let title = format!("{name}: collisions, with penalty");
        let file = title.replace([',', ':'], "").replace(' ', "-");
        chapter.figure(&format!("{file}.svg"), figures::collisions(&title, &these), &title);
    }
    chapter
}

fn numbers(episodes: &[&JudgedRow], of: fn(&JudgedRow) -> f64, succeeded: bool) -> Vec<f64> {
    episodes.iter().filter(|e| !succeeded || e.success == 1).map(|e| of(e)).collect()
}

fn judged(groups: &[&Group<'_>]) -> Chapter {
    let mut chapter = Chapter::new("The finished policies");
    chapter.text(
        "On fresh episodes, the same for every run. Last: the policy at the end of the training; kept: the best of its \
         evaluations. Mean and sampled are the policy's actions. Time is the median of the successes, force the median and \
         the largest peak of all episodes; all of the last policy's mean actions.",
    );
    let row = |g: &&Group<'_>| {
        let last = g.judged("last", "mean");
        let by_run = g.success_by_run("last", "mean");
        let worst = by_run.iter().copied().reduce(f64::min);
        let peaks = numbers(&last, |e| e.peak_force, false);
        vec![
            g.first.block.clone(),
            g.first.task.clone(),
            g.name(),
            success(&last),
            worst.map_or_else(|| "–".into(), |w| format!("{:.0} %", 100.0 * w)),
            iqm(&by_run).map_or_else(
                || "–".into(),
                |_| middle(&by_run.iter().map(|x| 100.0 * x).collect::<Vec<_>>(), 1),
            ),
            success(&g.judged("last", "sampled")),
            success(&g.judged("kept", "mean")),
            success(&g.judged("kept", "sampled")),
            dash(median(&numbers(&last, |e| e.seconds, true)), 2),
            format!(
                "{} / {}",
                dash(median(&peaks), 1),
                dash(peaks.iter().copied().reduce(f64::max), 1)
            ),
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

fn on_the_way(groups: &[&Group<'_>]) -> Chapter {
    let mut chapter = Chapter::new("On the way");
    chapter.text(
        "Success of the deterministic policy at the first evaluation at or after a step: mean over the runs, and the worst \
         run. Steps to the first success of an exploring policy, and to the first evaluation with at least 90 %: medians of \
         the runs that got there.",
    );
    let row = |g: &&Group<'_>| {
        let at = |step: &u64| {
            let of = g.success_at(*step);
            let worst = of.iter().copied().reduce(f64::min);
            match (mean(&of), worst) {
                (Some(m), Some(w)) => format!("{:.0} / {:.0} %", 100.0 * m, 100.0 * w),
                _ => "–".into(),
            }
        };
        let first: Vec<f64> =
            g.runs.iter().filter_map(|run| run.first_success_step).map(|s| s as f64).collect();
        let able = g.first_at(0.9);
        let mut cells =
            vec![g.first.block.clone(), g.first.task.clone(), g.name(), g.seeds().to_string()];
        cells.extend(MARKS.iter().map(at));
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

fn orderings(groups: &[&Group<'_>]) -> Chapter {
    let mut chapter = Chapter::new("The paper's orderings");
    let peg: Vec<&Group<'_>> = groups.iter().copied().filter(|g| g.first.block == "peg").collect();
    let claims = claims(&peg);
    if claims.is_empty() {
        return chapter;
    }
    chapter.text(
        "Each as a probability that one run is better than another, with its interval. An ordering holds where the interval \
         lies above one half, is contradicted where it lies below, and is open otherwise.",
    );
    let count = |verdict: &str| claims.iter().filter(|c| c.verdict == verdict).count();
    chapter.text(format!(
        "**{} hold, {} are contradicted, {} are open.**",
        count("holds"),
        count("contradicted"),
        count("open")
    ));
    let rows = claims.into_iter().map(|c| vec![c.claim, c.found, c.verdict.into()]).collect();
    chapter.table(&["the paper", "here", ""], rows);
    chapter.text("Probability that a run of the row learns better (success over the whole training) than one of the column, with penalty:");
    for letter in ['P', 'A'] {
        let of: Vec<&Group<'_>> =
            peg.iter().copied().filter(|g| g.family() == letter && g.first.penalty).collect();
        let head: Vec<String> =
            std::iter::once(String::new()).chain(of.iter().map(|g| g.name())).collect();
        let row = |a: &&Group<'_>| {
            let cell = |b: &&Group<'_>| {
                if a.first.model == b.first.model {
                    "–".into()
                } else {
                    compared(&a.areas(), &b.areas()).0
                }
            };
            std::iter::once(a.name()).chain(of.iter().map(cell)).collect()
        };
        let head: Vec<&str> = head.iter().map(String::as_str).collect();
        chapter.table(&head, of.iter().map(row).collect());
    }
    chapter
}

fn baselines(groups: &[Group<'_>]) -> Chapter {
    let mut chapter = Chapter::new("Without learning");
    let row = |g: &Group<'_>| {
        let episodes: Vec<&JudgedRow> = ["zero", "random", "scripted"]
            .iter()
            .flat_map(|name| ["mean", "sampled"].map(|actions| g.judged(name, actions)))
            .flatten()
            .collect();
        let peaks = numbers(&episodes, |e| e.peak_force, false);
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
            format!(
                "{} / {}",
                dash(median(&peaks), 1),
                dash(peaks.iter().copied().reduce(f64::max), 1)
            ),
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

fn sensitivity(groups: &[&Group<'_>]) -> Chapter {
    let mut chapter = Chapter::new("What the paper does not print");
    let mut keys: Vec<String> = groups
        .iter()
        .flat_map(|g| g.first.varied.split(' '))
        .filter_map(|pair| pair.split_once('=').map(|(key, _)| key.to_owned()))
        .collect();
    keys.sort();
    keys.dedup();
    if keys.is_empty() {
        return chapter;
    }
    chapter.text("Filter, force limit and stiffness, one at a time around the preset. Collisions per 1,000 steps and success of the last policy:");
    let row = |g: &&Group<'_>| {
        vec![
            g.first.varied.clone(),
            g.seeds().to_string(),
            format!("{:.2}", g.collision_rate()),
            success(&g.judged("last", "mean")),
            dash(median(&numbers(&g.judged("last", "mean"), |e| e.peak_force, false)), 1),
        ]
    };
    let varied: Vec<&Group<'_>> =
        groups.iter().copied().filter(|g| !g.first.varied.is_empty()).collect();
    chapter.table(
        &[
            "setting",
            "runs",
            "collisions per 1,000 steps",
            "success of the last policy",
            "peak force, N, median",
        ],
        varied.iter().map(row).collect(),
    );
    for key in &keys {
        let rate = |g: &Group<'_>| -> Vec<f64> {
            let of = |run: &&crate::study::rows::RunRow| {
                1e3 * run.collisions as f64 / run.steps.max(1) as f64
            };
            g.runs.iter().map(of).collect()
        };
        let svg = figures::sensitivity(key, "collisions per 1,000 steps", &varied, rate);
        chapter.figure(&format!("sensitivity-{}.svg", key.replace('.', "-")), svg, key);
    }
    chapter
}

fn policies(motions: &[Motion]) -> Chapter {
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
