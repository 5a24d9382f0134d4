//! Learning curves as SVG: the mean of several seeds, their spread around it.
//!
//! Drawn by kuva, which only this file knows.

use kuva::backend::svg::SvgBackend;
use kuva::plot::annotations::{ReferenceLine, ShadedRegion};
use kuva::plot::band::BandPlot;
use kuva::plot::scatter::ScatterPlot;
use kuva::plot::{LegendPosition, LinePlot};
use kuva::render::layout::Layout;
use kuva::render::plots::Plot;
use kuva::render::render::render_multiple;

use crate::stats::{bootstrap, ema, iqm};

/// Runs that are drawn as one line.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Curve {
    /// For the legend.
    pub label: String,
    /// Points (x, y) of each run, x ascending.
    pub runs: Vec<Vec<(f64, f64)>>,
}

/// What the band around a line shows.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Spread {
    /// From the lowest run to the highest.
    #[default]
    MinMax,
    /// One standard deviation (of the sample) to each side.
    StandardDeviation,
    /// The line is the interquartile mean, the band its bootstrap interval, 95 % (Agarwal et al. 2021).
    Iqm,
}

/// A stretch of the x axis behind the curves.
#[derive(Clone, Debug, PartialEq)]
pub struct Shade {
    /// Where it begins.
    pub from: f64,
    /// Where it ends.
    pub to: f64,
    /// As #rrggbb.
    pub colour: String,
}

/// A diagram.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Panel {
    /// Above it.
    pub title: String,
    /// Below it.
    pub x_label: String,
    /// At its left.
    pub y_label: String,
    /// Ends of the y axis; fitted to the data if `None`.
    pub y_range: Option<(f64, f64)>,
    /// A dashed level and its name.
    pub reference: Option<(f64, String)>,
    /// What the band shows.
    pub spread: Spread,
    /// Stretches that are shaded.
    pub shades: Vec<Shade>,
    /// Weight of an exponential moving average over every run; 0 for none.
    pub ema: f64,
}

/// A colour-blind safe palette (Okabe and Ito 2008), without black and yellow.
const COLOURS: &[&str] = &["#0072b2", "#d55e00", "#009e73", "#cc79a7", "#e69f00", "#56b4e9"];
/// Of a bootstrap at every x.
const RESAMPLES: usize = 1000;
const REFERENCE: &str = "#777777";

/// Draws curves into a panel; `None` if no curve has a point.
pub fn draw(panel: &Panel, curves: &[Curve]) -> Option<String> {
    let (mut bands, mut lines) = (Vec::new(), Vec::new());
    for (curve, colour) in curves.iter().zip(COLOURS.iter().cycle()) {
        let summary = summarise(&curve.runs, panel.spread, panel.ema);
        if summary.is_empty() {
            continue;
        }
        let column = |f: fn(&Summary) -> f64| summary.iter().map(f).collect::<Vec<_>>();
        if curve.runs.len() > 1 {
            let band = BandPlot::new(column(|s| s.x), column(|s| s.low), column(|s| s.high));
            bands.push(Plot::Band(band.with_color(*colour).with_opacity(0.18)));
        }
        let line = LinePlot::new().with_data(summary.iter().map(|s| (s.x, s.mean)));
        let runs = curve.runs.iter().filter(|run| !run.is_empty()).count();
        let label =
            if runs > 1 { format!("{} ({runs} runs)", curve.label) } else { curve.label.clone() };
        lines.push(Plot::Line(line.with_color(*colour).with_stroke_width(2.0).with_legend(label)));
    }
    if lines.is_empty() {
        return None;
    }
    // Bands first: no line disappears under another's band.
    bands.append(&mut lines);
    Some(render(panel, bands))
}

/// Draws every run's points as dots, a colour per curve; `None` if there is no point.
pub fn scatter(panel: &Panel, curves: &[Curve]) -> Option<String> {
    let mut dots = Vec::new();
    for (curve, colour) in curves.iter().zip(COLOURS.iter().cycle()) {
        let finite = |(x, y): &&(f64, f64)| x.is_finite() && y.is_finite();
        let points: Vec<_> = curve.runs.iter().flatten().filter(finite).copied().collect();
        if points.is_empty() {
            continue;
        }
        let plot = ScatterPlot::new().with_data(points).with_color(*colour).with_size(3.5);
        let plot = plot.with_marker_opacity(0.55).with_legend(curve.label.clone());
        dots.push(Plot::Scatter(plot));
    }
    (!dots.is_empty()).then(|| render(panel, dots))
}

/// The panel around its plots.
fn render(panel: &Panel, plots: Vec<Plot>) -> String {
    let mut layout = Layout::auto_from_plots(&plots)
        .with_title(panel.title.clone())
        .with_x_label(panel.x_label.clone())
        .with_y_label(panel.y_label.clone())
        .with_legend_position(LegendPosition::OutsideBottomColumns)
        .with_legend_box(false)
        .with_width(760.0)
        .with_height(460.0);
    if let Some((low, high)) = panel.y_range {
        layout = layout.with_y_axis_min(low).with_y_axis_max(high);
    }
    if let Some((y, label)) = &panel.reference {
        let line = ReferenceLine::horizontal(*y).with_color(REFERENCE).with_label(label.clone());
        layout = layout.with_reference_line(line);
    }
    for shade in &panel.shades {
        let region = ShadedRegion::vertical(shade.from, shade.to);
        let region = region.with_color(shade.colour.clone()).with_opacity(0.16);
        layout = layout.with_shaded_region(region);
    }
    SvgBackend::new().render_scene(&render_multiple(plots, layout))
}

#[derive(Clone, Copy, Debug, PartialEq)]
struct Summary {
    x: f64,
    mean: f64,
    low: f64,
    high: f64,
}

/// Mean and spread at every x that a run has, within the range that all runs cover: otherwise the
/// line would jump where a run ends. Between its points a run is interpolated.
fn summarise(runs: &[Vec<(f64, f64)>], spread: Spread, weight: f64) -> Vec<Summary> {
    let runs: Vec<Vec<(f64, f64)>> =
        runs.iter().map(|run| smooth(run, weight)).filter(|run| !run.is_empty()).collect();
    let x = |point: Option<&(f64, f64)>| point.map(|(x, _)| *x);
    let first = runs.iter().filter_map(|run| x(run.first())).reduce(f64::max);
    let last = runs.iter().filter_map(|run| x(run.last())).reduce(f64::min);
    let Some((first, last)) = first.zip(last) else { return Vec::new() };
    let mut xs: Vec<f64> = runs.iter().flatten().map(|(x, _)| *x).collect();
    xs.retain(|x| (first..=last).contains(x));
    xs.sort_by(f64::total_cmp);
    xs.dedup();
    xs.into_iter()
        .map(|x| {
            let ys: Vec<f64> = runs.iter().map(|run| interpolate(run, x)).collect();
            let n = ys.len() as f64;
            let mean = ys.iter().sum::<f64>() / n;
            let mut middle = mean;
            let (low, high) = match spread {
                Spread::Iqm => {
                    middle = iqm(&ys).unwrap_or(mean);
                    bootstrap(&ys, iqm, RESAMPLES, 0.95, 1).unwrap_or((middle, middle))
                }
                Spread::MinMax => (
                    ys.iter().copied().fold(f64::INFINITY, f64::min),
                    ys.iter().copied().fold(f64::NEG_INFINITY, f64::max),
                ),
                Spread::StandardDeviation => {
                    let squares: f64 = ys.iter().map(|y| (y - mean).powi(2)).sum();
                    let deviation = (squares / (n - 1.0).max(1.0)).sqrt();
                    (mean - deviation, mean + deviation)
                }
            };
            Summary { x, mean: middle, low, high }
        })
        .collect()
}

/// The finite points of a run, averaged.
fn smooth(run: &[(f64, f64)], weight: f64) -> Vec<(f64, f64)> {
    let finite = run.iter().copied().filter(|(x, y)| x.is_finite() && y.is_finite());
    let (xs, ys): (Vec<f64>, Vec<f64>) = finite.unzip();
    xs.into_iter().zip(ema(&ys, weight)).collect()
}

/// At an x within the run's range.
fn interpolate(run: &[(f64, f64)], x: f64) -> f64 {
    let after = run.partition_point(|(at, _)| *at < x).min(run.len() - 1);
    let (x1, y1) = run[after];
    let (x0, y0) = run[after.saturating_sub(1)];
    if x1 > x0 { y0 + (y1 - y0) * (x - x0) / (x1 - x0) } else { y1 }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn seeds() -> Vec<Vec<(f64, f64)>> {
        vec![vec![(0.0, 0.0), (10.0, 1.0), (20.0, 2.0)], vec![(0.0, 2.0), (20.0, 4.0)]]
    }

    #[test]
    fn mean_and_spread_follow_the_runs() {
        let at = |s: &Summary| (s.x, s.mean, s.low, s.high);
        let found: Vec<_> = summarise(&seeds(), Spread::MinMax, 0.0).iter().map(at).collect();
        assert_eq!(found, [(0.0, 1.0, 0.0, 2.0), (10.0, 2.0, 1.0, 3.0), (20.0, 3.0, 2.0, 4.0)]);
        let found = summarise(&seeds(), Spread::StandardDeviation, 0.0)[0];
        assert!((found.high - found.mean - 2f64.sqrt()).abs() < 1e-15);
    }

    #[test]
    fn an_interquartile_mean_ignores_the_outer_runs() {
        let run = |y: f64| vec![(0.0, y), (1.0, y)];
        let runs = [0.0, 2.0, 3.0, 1e6].map(run).to_vec();
        let found = summarise(&runs, Spread::Iqm, 0.0)[0];
        assert_eq!(found.mean, 2.5);
        assert!(found.low < 2.5 && found.high > 3.0, "{found:?}");
    }

    #[test]
    fn a_curve_ends_where_its_shortest_run_ends() {
        let mut runs = seeds();
        runs.push(vec![(5.0, 0.0), (15.0, 0.0)]);
        let xs: Vec<_> = summarise(&runs, Spread::MinMax, 0.0).iter().map(|s| s.x).collect();
        assert_eq!(xs, [5.0, 10.0, 15.0]);
    }

    #[test]
    fn every_run_is_averaged_before_the_mean() {
        let found = summarise(&seeds(), Spread::MinMax, 0.5);
        assert_eq!((found[2].low, found[2].high), (0.5 * 0.5 + 0.5 * 2.0, 3.0));
    }

    #[test]
    fn a_panel_is_svg_with_its_texts() {
        let panel = Panel {
            title: "Return & more".into(),
            x_label: "steps".into(),
            y_label: "return".into(),
            y_range: Some((-1.0, 5.0)),
            reference: Some((4.5, "optimum".into())),
            shades: vec![Shade { from: 5.0, to: 8.0, colour: "#123456".into() }],
            ..Panel::default()
        };
        let curve = Curve { label: "P-14".into(), runs: seeds() };
        let svg = draw(&panel, &[curve]).unwrap();
        assert!(svg.starts_with("<svg") && svg.trim_end().ends_with("</svg>"));
        for text in [
            "Return &amp; more",
            "steps",
            "return",
            "optimum",
            "P-14 (2 runs)",
            COLOURS[0],
            "#123456",
        ] {
            assert!(svg.contains(text), "{text}");
        }
    }

    #[test]
    fn dots_are_drawn_where_they_are_finite() {
        let curve = |points| Curve { label: "peaks".into(), runs: vec![points] };
        let svg = scatter(&Panel::default(), &[curve(vec![(1.0, 2.0), (2.0, f64::NAN)])]).unwrap();
        assert!(svg.contains("peaks") && svg.contains(COLOURS[0]), "{svg}");
        assert_eq!(scatter(&Panel::default(), &[curve(vec![(2.0, f64::NAN)])]), None);
    }

    #[test]
    fn nothing_and_nan_draw_nothing() {
        assert_eq!(draw(&Panel::default(), &[]), None);
        let curve = Curve { label: "x".into(), runs: vec![vec![], vec![(0.0, f64::NAN)]] };
        assert_eq!(draw(&Panel::default(), &[curve]), None);
    }
}
