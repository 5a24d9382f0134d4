//! The report's curves.

use palpate_runs::plot::{Curve, Panel, Spread, draw};
use palpate_runs::stats::ema;

use super::group::Group;
use crate::study::rows::{EpisodeRow, RunRow};

/// Weight of the moving average of the paper's learning curves.
const EMA: f64 = 0.6;
/// Points of a curve.
const POINTS: u64 = 100;
const STEPS: &str = "environment steps";

fn panel(title: &str, x: &str, y: &str, spread: Spread) -> Panel {
    Panel { title: title.into(), x_label: x.into(), y_label: y.into(), spread, ..Panel::default() }
}

/// A value of every run on a common grid of steps, a curve per group.
fn curves(
    groups: &[&Group<'_>],
    of: impl Fn(&Group<'_>, &RunRow) -> Vec<(f64, f64)>,
) -> Vec<Curve> {
    let one = |group: &&Group<'_>| {
        let runs = group.runs.iter().map(|run| grid(&of(group, run), run.steps));
        Curve { label: group.name(), runs: runs.collect() }
    };
    groups.iter().map(one).collect()
}

/// The last value at or before each of [`POINTS`] steps.
fn grid(points: &[(f64, f64)], steps: u64) -> Vec<(f64, f64)> {
    let at = |i: u64| {
        let x = (i * steps) as f64 / POINTS as f64;
        let before = points.iter().take_while(|(step, _)| *step <= x).last();
        before.map(|(_, y)| (x, *y))
    };
    (1..=POINTS).filter_map(at).collect()
}

/// Return of the training episodes as the paper draws it: moving average, mean and standard deviation over the runs.
pub(super) fn returns(title: &str, groups: &[&Group<'_>]) -> Option<String> {
    let panel = panel(title, STEPS, "return, moving average 0.6", Spread::StandardDeviation);
    draw(&panel, &curves(groups, smoothed))
}

/// A run's returns, smoothed over its episodes.
pub(super) fn smoothed(group: &Group<'_>, run: &RunRow) -> Vec<(f64, f64)> {
    let episodes: Vec<&EpisodeRow> = group.episodes(run).collect();
    let smooth = ema(&episodes.iter().map(|e| e.total).collect::<Vec<_>>(), EMA);
    episodes.iter().map(|e| e.step as f64).zip(smooth).collect()
}

/// Success of the deterministic policy on frozen starts: interquartile mean and bootstrap interval.
pub(super) fn successes(title: &str, groups: &[&Group<'_>]) -> Option<String> {
    let panel = Panel {
        y_range: Some((0.0, 1.0)),
        ..panel(title, STEPS, "success, interquartile mean, 95 %", Spread::Iqm)
    };
    draw(&panel, &curves(groups, evaluations))
}

fn evaluations(group: &Group<'_>, run: &RunRow) -> Vec<(f64, f64)> {
    group.curve(run)
}

/// Collisions so far.
pub(super) fn collisions(title: &str, groups: &[&Group<'_>]) -> Option<String> {
    let so_far = |group: &Group<'_>, run: &RunRow| {
        let count = |sum: &mut f64, e: &EpisodeRow| {
            *sum += f64::from(e.collision);
            Some((e.step as f64, *sum))
        };
        group.episodes(run).scan(0.0, count).collect()
    };
    let panel = panel(title, STEPS, "collisions so far", Spread::MinMax);
    draw(&panel, &curves(groups, so_far))
}

/// One quantity against the value of a varied key.
pub(super) fn sensitivity(
    key: &str,
    label: &str,
    groups: &[&Group<'_>],
    of: impl Fn(&Group<'_>) -> Vec<f64>,
) -> Option<String> {
    let mut points: Vec<(f64, Vec<f64>)> =
        groups.iter().filter_map(|g| Some((value(&g.first.varied, key)?, of(g)))).collect();
    points.sort_by(|a, b| a.0.total_cmp(&b.0));
    let seeds = points.iter().map(|(_, values)| values.len()).min()?;
    let run = |i: usize| {
        points.iter().filter_map(|(x, values)| Some((*x, *values.get(i)?))).collect::<Vec<_>>()
    };
    let curve = Curve { label: label.into(), runs: (0..seeds).map(run).collect() };
    draw(&panel(key, key, label, Spread::MinMax), &[curve])
}

/// The value of a key in "key=value key=value".
pub(super) fn value(varied: &str, key: &str) -> Option<f64> {
    let pairs = varied.split(' ').filter_map(|pair| pair.split_once('='));
    pairs.filter(|(k, _)| *k == key).find_map(|(_, v)| v.parse().ok())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_grid_holds_the_last_value_before_each_point() {
        let found = grid(&[(150.0, 1.0), (320.0, 2.0), (990.0, 3.0)], 1000);
        assert_eq!(found.first(), Some(&(150.0, 1.0)));
        assert_eq!(found.iter().find(|(x, _)| *x == 310.0), Some(&(310.0, 1.0)));
        assert_eq!(found.iter().find(|(x, _)| *x == 320.0), Some(&(320.0, 2.0)));
        assert_eq!(found.last(), Some(&(1000.0, 3.0)));
    }

    #[test]
    fn a_varied_value_is_read_by_its_key() {
        assert_eq!(value("a.b=2.5 c=7", "a.b"), Some(2.5));
        assert_eq!(value("a.b=2.5 c=7", "c"), Some(7.0));
        assert_eq!(value("a.b=2.5", "b"), None);
    }
}
