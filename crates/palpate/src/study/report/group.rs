//! Runs that differ in their seed alone.

use palpate_runs::stats::{bootstrap, clopper_pearson, iqm, mean};

use crate::study::plan::Kind;
use crate::study::rows::{EpisodeRow, JudgedRow, Rows, RunRow};

/// Resamples of every bootstrap interval.
pub(super) const RESAMPLES: usize = 2000;
pub(super) const CONFIDENCE: f64 = 0.95;

/// Runs that differ in their seed alone.
#[derive(Clone, Debug)]
pub(super) struct Group<'a> {
    pub(super) rows: &'a Rows,
    pub(super) runs: Vec<&'a RunRow>,
    pub(super) first: &'a RunRow,
}

/// In the order of the runs.
pub(super) fn groups(rows: &Rows) -> Vec<Group<'_>> {
    let mut all: Vec<Group<'_>> = Vec::new();
    for run in &rows.runs {
        match all.iter_mut().find(|group| alike(group.first, run)) {
            Some(group) => group.runs.push(run),
            None => all.push(Group { rows, runs: vec![run], first: run }),
        }
    }
    all
}

fn alike(a: &RunRow, b: &RunRow) -> bool {
    let key = |r: &RunRow| {
        let place = (r.block.clone(), r.task.clone(), r.model.clone());
        (place, r.policy, r.penalty, r.demonstrations, r.varied.clone())
    };
    key(a) == key(b)
}

impl<'a> Group<'a> {
    pub(super) fn is_learned(&self) -> bool {
        self.first.policy == Kind::Learned
    }

    /// P: parallel position/force; A: admittance.
    pub(super) fn family(&self) -> char {
        self.first.model.chars().next().unwrap_or('?')
    }

    pub(super) fn name(&self) -> String {
        let RunRow { model, penalty, varied, demonstrations, .. } = self.first;
        let penalty = if *penalty { "" } else { ", no penalty" };
        let shown = match demonstrations {
            0 => String::new(),
            1 => ", 1 demonstration".into(),
            n => format!(", {n} demonstrations"),
        };
        let varied = if varied.is_empty() { String::new() } else { format!(", {varied}") };
        format!("{model}{penalty}{shown}{varied}")
    }

    pub(super) fn seeds(&self) -> usize {
        self.runs.len()
    }

    /// Training episodes of a run.
    pub(super) fn episodes(&self, run: &RunRow) -> impl Iterator<Item = &'a EpisodeRow> {
        let name = run.run.clone();
        self.rows.episodes.iter().filter(move |e| e.run == name)
    }

    /// Judged episodes of all its runs, of one policy and kind of action.
    pub(super) fn judged(&self, policy: &str, actions: &str) -> Vec<&'a JudgedRow> {
        self.judged_under("", policy, actions)
    }

    /// The same in a changed world.
    pub(super) fn judged_under(
        &self,
        condition: &str,
        policy: &str,
        actions: &str,
    ) -> Vec<&'a JudgedRow> {
        let ours = |e: &&JudgedRow| self.runs.iter().any(|run| run.run == e.run);
        let rows = self.rows.judged.iter().filter(ours);
        rows.filter(|e| e.condition == condition && e.policy == policy && e.actions == actions)
            .collect()
    }

    /// Collisions of each run from one step to another.
    pub(super) fn collisions(&self, from: u64, to: u64) -> Vec<f64> {
        let of = |run: &&RunRow| {
            let within = self.episodes(run).filter(|e| (from..to).contains(&e.step));
            within.filter(|e| e.collision == 1).count() as f64
        };
        self.runs.iter().map(of).collect()
    }

    /// Per 1,000 steps, over all runs.
    pub(super) fn collision_rate(&self) -> f64 {
        let steps: u64 = self.runs.iter().map(|run| run.steps).sum();
        let collisions: u64 = self.runs.iter().map(|run| run.collisions).sum();
        1e3 * collisions as f64 / steps.max(1) as f64
    }

    /// A run's evaluations while it trained: step and success.
    pub(super) fn curve(&self, run: &RunRow) -> Vec<(f64, f64)> {
        let of = self.rows.curves.iter().filter(|row| row.run == run.run);
        of.map(|row| (row.step as f64, row.success_rate)).collect()
    }

    /// Mean success over the evaluations of each run: how much of the training it succeeded.
    pub(super) fn areas(&self) -> Vec<f64> {
        let area = |run: &&RunRow| {
            let curve = self.curve(run);
            mean(&curve.iter().map(|(_, success)| *success).collect::<Vec<_>>())
        };
        self.runs.iter().filter_map(area).collect()
    }

    /// Success at the first evaluation at or after a step, of each run.
    pub(super) fn success_at(&self, step: u64) -> Vec<f64> {
        let at = |run: &&RunRow| {
            let curve = self.curve(run);
            curve.iter().find(|(s, _)| *s >= step as f64).map(|(_, success)| *success)
        };
        self.runs.iter().filter_map(at).collect()
    }

    /// Step of the first evaluation with at least this success, of each run that had one.
    pub(super) fn first_at(&self, success: f64) -> Vec<f64> {
        let of = |run: &&RunRow| {
            self.curve(run).into_iter().find(|(_, s)| *s >= success).map(|(step, _)| step)
        };
        self.runs.iter().filter_map(of).collect()
    }

    /// Share of judged episodes of each run that succeeded.
    pub(super) fn success_by_run(&self, policy: &str, actions: &str) -> Vec<f64> {
        let judged = self.judged(policy, actions);
        let of = |run: &&RunRow| {
            let own: Vec<f64> =
                judged.iter().filter(|e| e.run == run.run).map(|e| f64::from(e.success)).collect();
            mean(&own)
        };
        self.runs.iter().filter_map(of).collect()
    }
}

/// "98.2 % (96.1–99.3)" of judged episodes, Clopper-Pearson; "–" of none.
pub(super) fn success(episodes: &[&JudgedRow]) -> String {
    let n = episodes.len() as u64;
    if n == 0 {
        return "–".into();
    }
    let k = episodes.iter().filter(|e| e.success == 1).count() as u64;
    let (low, high) = clopper_pearson(k, n, CONFIDENCE);
    format!("{:.1} % ({:.1}–{:.1})", 100.0 * k as f64 / n as f64, 100.0 * low, 100.0 * high)
}

/// "1.2 (0.9–1.6)": the interquartile mean and its bootstrap interval.
pub(super) fn middle(values: &[f64], digits: usize) -> String {
    let interval = bootstrap(values, iqm, RESAMPLES, CONFIDENCE, 1);
    match (iqm(values), interval) {
        (Some(m), Some((low, high))) => format!("{m:.digits$} ({low:.digits$}–{high:.digits$})"),
        _ => "–".into(),
    }
}

/// The middle value.
pub(super) fn median(values: &[f64]) -> Option<f64> {
    let mut sorted = values.to_vec();
    sorted.sort_by(f64::total_cmp);
    let at = sorted.len().checked_sub(1)? / 2;
    Some(f64::midpoint(*sorted.get(at)?, *sorted.get(sorted.len() / 2)?))
}

/// A number, or a dash.
pub(super) fn dash(value: Option<f64>, digits: usize) -> String {
    value.map_or_else(|| "–".into(), |value| format!("{value:.digits$}"))
}
