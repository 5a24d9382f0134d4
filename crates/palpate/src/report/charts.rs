//! The report's pictures.

use palpate_runs::plot::{Curve, Panel, draw, scatter};

use super::behaviour::{Behaviour, Trace};
use super::run::Run;
use crate::plot::Group;

/// A picture and what it is called.
pub(super) type Picture = Option<String>;

fn panel(title: &str, x: &str, y: &str) -> Panel {
    Panel { title: title.into(), x_label: x.into(), y_label: y.into(), ..Panel::default() }
}

const STEPS: &str = "environment steps";

/// A column of metrics.csv over the steps, a line per group of runs that differ in their seed alone.
pub(super) fn learning(
    runs: &[Run],
    groups: &[Group],
    (column, title, label): (&str, &str, &str),
    range: Option<(f64, f64)>,
) -> Picture {
    let curve = |group: &Group| {
        let of = |path: &std::path::PathBuf| runs.iter().find(|run| run.path == *path);
        let points = |run: &Run| Run::points(run.metrics.as_ref(), "time/total_timesteps", column);
        let runs = group.runs.iter().filter_map(of).map(points).filter(|p| !p.is_empty());
        Curve { label: group.label.clone(), runs: runs.collect() }
    };
    let curves: Vec<Curve> = groups.iter().map(curve).filter(|c| !c.runs.is_empty()).collect();
    draw(&Panel { y_range: range, ..panel(title, STEPS, label) }, &curves)
}

/// The peak force of every training episode, beside the limit.
pub(super) fn peaks(runs: &[Run]) -> Picture {
    let curve = |run: &Run| {
        let points = Run::points(run.episodes.as_ref(), "step", "peak_force");
        Curve { label: run.name.clone(), runs: vec![points] }
    };
    let limit = runs.first().map(|run| run.config.safety.force_max)?;
    let reference = Some((limit, format!("limit of one axis, {limit} N")));
    let panel = Panel { reference, ..panel("Peak force of every episode", STEPS, "N") };
    scatter(&panel, &runs.iter().map(curve).collect::<Vec<_>>())
}

/// Where the fail-safe layer said something: from above, in the hole frame.
pub(super) fn places(run: &Run) -> Picture {
    let mut causes: Vec<&str> = run.places.iter().map(|(cause, _)| cause.as_str()).collect();
    causes.sort_unstable();
    causes.dedup();
    let curve = |cause: &&str| {
        let of = run.places.iter().filter(|(c, _)| c == cause);
        let points = of.map(|(_, [x, y, _])| (1e3 * x, 1e3 * y)).collect();
        Curve { label: (*cause).into(), runs: vec![points] }
    };
    let title = "Where, seen from above: tool tip from the hole's middle";
    let panel = panel(title, "hole x, mm", "hole y, mm");
    scatter(&panel, &causes.iter().map(curve).collect::<Vec<_>>())
}

/// One quantity of a behaviour over time, a line per episode.
pub(super) fn traces(
    behaviour: &Behaviour,
    (title, label): (&str, &str),
    of: fn(&Trace) -> &Vec<(f64, f64)>,
    range: Option<(f64, f64)>,
    reference: Option<(f64, String)>,
) -> Picture {
    let curve = |(i, trace): (usize, &Trace)| Curve {
        label: format!("start {i}"),
        runs: vec![of(trace).clone()],
    };
    let panel = Panel { y_range: range, reference, ..panel(title, "s", label) };
    let curves: Vec<Curve> = behaviour.traces.iter().enumerate().map(curve).collect();
    draw(&panel, &curves)
}
