//! Heat maps: one panel per force gain, cut-off to the right, stiffness upwards, the swing as colour.

use std::sync::Arc;

use kuva::backend::svg::SvgBackend;
use kuva::plot::{ColorMap, Heatmap, LinePlot};
use kuva::render::figure::Figure;
use kuva::render::layout::{Layout, TickFormat};
use kuva::render::plots::Plot;

/// log₁₀ of Hz at the edges of a panel.
pub(crate) const CUTOFFS: (f64, f64) = (0.3, 2.3);
/// The colour scale ends here; a swing of 2 or more means that contact opens.
const GREATEST: f64 = 4.0;

/// One force gain.
#[derive(Debug)]
pub(crate) struct Panel {
    pub(crate) title: String,
    /// log₁₀ of N/m at its edges.
    pub(crate) stiffnesses: (f64, f64),
    /// Swing; rows from soft to stiff, columns from low to high cut-off.
    pub(crate) swing: Vec<Vec<f64>>,
    /// Limits over the cut-off: name, colour, (log₁₀ Hz, log₁₀ N/m).
    pub(crate) lines: Vec<Line>,
}

#[derive(Debug)]
pub(crate) struct Line {
    pub(crate) name: &'static str,
    pub(crate) color: &'static str,
    pub(crate) dashed: bool,
    pub(crate) points: Vec<(f64, f64)>,
}

/// The figure as SVG.
pub(crate) fn draw(title: &str, panels: Vec<Panel>) -> String {
    let columns = panels.len();
    let (plots, layouts): (Vec<_>, Vec<_>) =
        panels.into_iter().enumerate().map(|(column, panel)| draw_panel(panel, column)).unzip();
    let figure = Figure::new(1, columns)
        .with_title(title)
        .with_plots(plots)
        .with_layouts(layouts)
        .with_cell_size(380.0, 330.0)
        .with_shared_legend_bottom();
    SvgBackend.render_scene(&figure.render())
}

fn draw_panel(panel: Panel, column: usize) -> (Vec<Plot>, Layout) {
    let (softest, stiffest) = panel.stiffnesses;
    let clipped: Vec<Vec<f64>> = panel
        .swing
        .iter()
        .map(|row| row.iter().map(|s| s.clamp(0.0, GREATEST)).collect())
        .collect();
    let all = || clipped.iter().flatten().copied();
    let (least, greatest) =
        (all().fold(f64::INFINITY, f64::min), all().fold(f64::NEG_INFINITY, f64::max));
    // The same swing has the same colour in every panel.
    let absolute =
        move |t: f64| ColorMap::YellowOrangeRed.map((least + t * (greatest - least)) / GREATEST);
    let heat = Heatmap::new()
        .with_data(clipped.clone())
        .with_color_map(ColorMap::Custom(Arc::new(absolute)))
        .with_x_range(CUTOFFS.0, CUTOFFS.1)
        .with_y_range(softest, stiffest)
        .with_cell_size(1.0);
    let mut plots = vec![Plot::Heatmap(heat)];
    for Line { name, color, dashed, points } in panel.lines {
        let inside = points.into_iter().filter(|(_, k)| (softest..=stiffest).contains(k));
        let line = LinePlot::new().with_data(inside).with_color(color).with_stroke_width(2.0);
        let line = if dashed { line.with_dashed() } else { line };
        plots.push(Plot::Line(line.with_legend(name)));
    }
    let power = |exponent: f64| match 10f64.powf(exponent) {
        x if x < 1e3 => format!("{x:.0}"),
        x => format!("{x:.0e}"),
    };
    let layout = Layout::auto_from_plots(&plots)
        .with_title(panel.title)
        .with_x_label("cut-off of the force filter, Hz")
        .with_x_axis_min(CUTOFFS.0)
        .with_x_axis_max(CUTOFFS.1)
        .with_y_axis_min(softest)
        .with_y_axis_max(stiffest)
        .with_y_tick_step(1.0)
        .with_x_tick_step(0.5)
        .with_x_tick_format(TickFormat::Custom(Arc::new(power)))
        .with_y_tick_format(TickFormat::Custom(Arc::new(power)));
    let layout =
        if column == 0 { layout.with_y_label("stiffness of the contact, N/m") } else { layout };
    (plots, layout)
}
