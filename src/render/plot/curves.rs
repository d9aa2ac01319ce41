//! A panel of curves over shared axes.

use plotters::coord::types::RangedCoordf64;
use plotters::prelude::*;

use super::RenderError;
use super::page::{Anchor, Area, FAINT, GRID, INK, color, font, plot_error, px, text};

/// One curve of a panel.
pub(super) struct Curve<'a> {
    /// The number of the space, which decides colour and mark.
    pub(super) number: usize,
    /// Points (x, y).
    pub(super) points: &'a [(f64, f64)],
    /// Every n-th point carries a mark.
    pub(super) mark_every: usize,
}

/// The axes of a panel. Y always runs from 0 to 1.
pub(super) struct PlotAxes<'a> {
    pub(super) title: &'a str,
    pub(super) across: &'a str,
    pub(super) from: f64,
    pub(super) to: f64,
    pub(super) ticks: usize,
    pub(super) decimals: usize,
}

/// Draws the curves, the first one on top, and a dashed line for the best possible values.
pub(super) fn panel(
    area: &Area<'_>,
    axes: &PlotAxes<'_>,
    curves: &[Curve<'_>],
    best: Option<&[(f64, f64)]>,
) -> Result<(), RenderError> {
    text(area, axes.title, (40.0, 12.0), &font(13.0, INK, Anchor::Left))?;
    let small = ("sans-serif", f64::from(px(11.0)) * 1.24);
    let mut chart = ChartBuilder::on(area)
        .margin_top(px(28.0))
        .margin_right(px(16.0))
        .margin_bottom(px(18.0))
        .x_label_area_size(px(38.0))
        .y_label_area_size(px(40.0))
        .build_cartesian_2d(axes.from..axes.to, 0.0..1.0)
        .map_err(plot_error)?;
    chart
        .configure_mesh()
        .x_labels(axes.ticks)
        .y_labels(6)
        .max_light_lines(0)
        .bold_line_style(GRID.stroke_width(px(1.0).unsigned_abs()))
        .axis_style(FAINT.stroke_width(px(1.0).unsigned_abs()))
        .set_all_tick_mark_size(px(4.0))
        .label_style(small.into_font().color(&INK))
        .axis_desc_style(small.into_font().color(&FAINT))
        .x_desc(axes.across)
        .x_label_formatter(&|x| format!("{x:.*}", axes.decimals))
        .y_label_formatter(&|y| format!("{y:.1}"))
        .draw()
        .map_err(plot_error)?;
    if let Some(best) = best {
        let dashes = DashedLineSeries::new(best.iter().copied(), px(4.0), px(4.0), FAINT.stroke_width(px(1.2) as u32));
        chart.draw_series(dashes).map_err(plot_error)?;
    }
    for curve in curves.iter().rev() {
        let ink = color(curve.number);
        let line = LineSeries::new(curve.points.iter().copied(), ink.stroke_width(px(1.8).unsigned_abs()));
        chart.draw_series(line).map_err(plot_error)?;
        marks(&mut chart, curve)?;
    }
    Ok(())
}

type Chart<'a, 'b> = ChartContext<'a, SVGBackend<'b>, Cartesian2d<RangedCoordf64, RangedCoordf64>>;

/// Marks some points of a curve by a shape of its own, for readers who cannot tell the colours apart.
fn marks(chart: &mut Chart<'_, '_>, curve: &Curve<'_>) -> Result<(), RenderError> {
    let points = curve.points.iter().copied().step_by(curve.mark_every.max(1)).map(EmptyElement::at);
    let ink = color(curve.number).filled();
    let drawn = match curve.number % 5 {
        0 => chart.draw_series(points.map(|at| at + disc(ink))).map(|_| ()),
        1 => chart.draw_series(points.map(|at| at + polygon(&TRIANGLE, ink))).map(|_| ()),
        2 => chart.draw_series(points.map(|at| at + polygon(&SQUARE, ink))).map(|_| ()),
        3 => chart.draw_series(points.map(|at| at + polygon(&DIAMOND, ink))).map(|_| ()),
        _ => chart.draw_series(points.map(|at| at + polygon(&WEDGE, ink))).map(|_| ()),
    };
    drawn.map_err(plot_error)
}

/// The corners of marks, in pixels from the point.
const TRIANGLE: [(f64, f64); 3] = [(0.0, -4.4), (4.0, 3.0), (-4.0, 3.0)];
const WEDGE: [(f64, f64); 3] = [(0.0, 4.4), (4.0, -3.0), (-4.0, -3.0)];
const SQUARE: [(f64, f64); 4] = [(-3.0, -3.0), (3.0, -3.0), (3.0, 3.0), (-3.0, 3.0)];
const DIAMOND: [(f64, f64); 4] = [(0.0, -4.4), (4.4, 0.0), (0.0, 4.4), (-4.4, 0.0)];

fn disc(ink: ShapeStyle) -> Circle<(i32, i32), i32> {
    Circle::new((0, 0), px(3.2), ink)
}

fn polygon(corners: &[(f64, f64)], ink: ShapeStyle) -> Polygon<(i32, i32)> {
    Polygon::new(corners.iter().map(|&(x, y)| (px(x), px(y))).collect::<Vec<_>>(), ink)
}

/// Draws the line and mark of a space, for the legend.
pub(super) fn legend_mark(area: &Area<'_>, number: usize, at: (f64, f64)) -> Result<(), RenderError> {
    super::page::line(area, (at.0 - 11.0, at.1), (at.0 + 11.0, at.1), color(number), 1.8)?;
    let centre = EmptyElement::at((px(at.0), px(at.1)));
    let ink = color(number).filled();
    let drawn = match number % 5 {
        0 => area.draw(&(centre + disc(ink))),
        1 => area.draw(&(centre + polygon(&TRIANGLE, ink))),
        2 => area.draw(&(centre + polygon(&SQUARE, ink))),
        3 => area.draw(&(centre + polygon(&DIAMOND, ink))),
        _ => area.draw(&(centre + polygon(&WEDGE, ink))),
    };
    drawn.map_err(plot_error)
}
