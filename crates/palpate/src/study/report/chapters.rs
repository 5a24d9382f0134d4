//! What the report says, chapter by chapter.

use palpate_runs::stats::mean;

use super::document::{Chapter, Item};
use super::evolution::Motion;
use super::group::{Group, dash, groups};
use super::orderings::{CONTRADICTED, HOLDS, OPEN, claims, compared};
use super::variations::{self, SETTLED};
use super::{figures, paper, policies};
use crate::study::folder::Folder;
use crate::study::rows::Rows;

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
        policies::judged(&plain),
        policies::on_the_way(&plain),
        orderings(&plain),
        policies::baselines(&all),
        variations::settings(&learned),
        variations::conditions(&folder.study, &all),
        policies::policies(motions),
    ]
}

fn overview(folder: &Folder, rows: &Rows) -> Chapter {
    let mut chapter = Chapter::new("The study");
    let planned = folder.plan.len();
    if !folder.study.about.is_empty() {
        chapter.text(format!("{}.", folder.study.about));
    }
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
        format!("Checkout at each start: {}. Command: `cargo xtask study run {}`, then `study report`.", commits.join(", "), folder.source()),
        format!("Settings of all runs beside the preset's: {}. The whole is in study.toml.", folder.study.settings()),
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
        "Of each pair, the first as the paper draws it: return of the training episodes, moving average 0.6, mean and standard deviation \
         over the runs. The second: success of the deterministic policy on frozen starts, IQM over the runs and its interval. \
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
        count(HOLDS),
        count(CONTRADICTED),
        count(OPEN)
    ));
    let rows = claims.into_iter().map(|c| vec![c.words, c.found, c.verdict.into()]).collect();
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
