//! The plot of an evaluation: precision by recall and by rank in each space, and mean average precision by class.

use super::RenderError;
use super::bars::{Bars, MAX_ROWS};
use super::curves::{self, Curve, PlotAxes};
use super::page::{self, Anchor, FAINT, INK, font, shortened, text};
use crate::eval::{CURVE_RECALLS, Evaluation, SpaceMeasures};

/// The width of the page and the height of the two panels of curves, in pixels.
const WIDTH: f64 = 980.0;
const CURVES: f64 = 348.0;

/// The most spaces shown, and the number of legend entries in a row and the height of a row in pixels.
const MAX_SPACES: usize = 10;
const LEGEND_ACROSS: usize = 5;
const LEGEND_ROW: f64 = 20.0;

/// The plot of an evaluation as an SVG document.
///
/// The upper half shows precision by recall (interpolated) and by rank, each the mean over all queries, with the best
/// possible curve for comparison. The lower half shows the mean average precision of each class, sorted by the space with
/// the highest mean. At most ten spaces (the first) and sixty classes (the worst) are shown; the plot says so where
/// there are more.
///
/// # Errors
/// [`RenderError::NoData`] where no space or no query was evaluated.
pub fn evaluation_plot(evaluation: &Evaluation) -> Result<String, RenderError> {
    let spaces = evaluation.spaces.get(..MAX_SPACES).unwrap_or(&evaluation.spaces);
    let Some(first) = spaces.first() else {
        return Err(RenderError::NoData { missing: "no space was evaluated" });
    };
    if first.all.queries == 0 {
        return Err(RenderError::NoData { missing: "no texture shares its label with another" });
    }
    let bars = bars(evaluation, spaces);
    let legend = 62.0 + LEGEND_ROW * spaces.len().div_ceil(LEGEND_ACROSS) as f64;
    let size = (WIDTH as u32, (legend + CURVES + bars.height()).ceil() as u32);
    let title = format!("Retrieval by '{}'", evaluation.label);
    page::draw(&title, &description(evaluation, spaces), size, |area| {
        let (top, rest) = area.split_vertically(page::px(legend));
        let (middle, bottom) = rest.split_vertically(page::px(CURVES));
        draw_heading(&top, &title, evaluation, spaces)?;
        let (left, right) = middle.split_horizontally(page::px(WIDTH / 2.0));
        draw_by_recall(&left, spaces)?;
        draw_by_rank(&right, spaces)?;
        bars.draw(&bottom, WIDTH)
    })
}

/// The description of the plot for screen readers.
fn description(evaluation: &Evaluation, spaces: &[SpaceMeasures]) -> String {
    let measures: Vec<String> = spaces
        .iter()
        .map(|space| {
            format!("{}: P@1 {:.3}, mean average precision {:.3}", space.space, space.all.p_at_1, space.all.map)
        })
        .collect();
    format!(
        "Curves of precision by recall and by rank, and bars of the mean average precision of each value of the tag '{}'. {}.",
        evaluation.label,
        measures.join("; ")
    )
}

fn draw_heading(
    area: &page::Area<'_>,
    title: &str,
    evaluation: &Evaluation,
    spaces: &[SpaceMeasures],
) -> Result<(), RenderError> {
    text(area, &shortened(title, 80), (16.0, 22.0), &font(17.0, INK, Anchor::Left))?;
    let all = spaces.first().map(|space| space.all.queries).unwrap_or_default();
    // A class of one texture has nothing to find and makes no query.
    let asking = |space: &SpaceMeasures| space.per_class.values().filter(|class| class.queries > 0).count();
    let classes = spaces.first().map(asking).unwrap_or_default();
    let mut line = format!("{all} textures of {classes} classes, each asks for the others of its own");
    if evaluation.spaces.len() > spaces.len() {
        line.push_str(&format!("; the first {} of {} spaces", spaces.len(), evaluation.spaces.len()));
    }
    text(area, &line, (16.0, 43.0), &font(12.0, FAINT, Anchor::Left))?;
    for (number, space) in spaces.iter().enumerate() {
        let left = 16.0 + (number % LEGEND_ACROSS) as f64 * (WIDTH - 32.0) / LEGEND_ACROSS as f64;
        let middle = 64.0 + LEGEND_ROW * (number / LEGEND_ACROSS) as f64;
        curves::legend_mark(area, number, (left + 12.0, middle))?;
        let words = format!("{}  mAP {:.3}", shortened(&space.space, 16), space.all.map);
        text(area, &words, (left + 30.0, middle), &font(12.0, INK, Anchor::Left))?;
    }
    Ok(())
}

fn draw_by_recall(area: &page::Area<'_>, spaces: &[SpaceMeasures]) -> Result<(), RenderError> {
    let step = 1.0 / (CURVE_RECALLS - 1) as f64;
    let points: Vec<Vec<(f64, f64)>> = spaces
        .iter()
        .map(|space| (0..).map(|at| f64::from(at) * step).zip(space.precision_at_recall.iter().copied()).collect())
        .collect();
    let axes = PlotAxes { title: "Precision by recall", across: "recall", from: 0.0, to: 1.0, ticks: 6, decimals: 1 };
    curves::panel(area, &axes, &numbered(&points, 2), None)
}

fn draw_by_rank(area: &page::Area<'_>, spaces: &[SpaceMeasures]) -> Result<(), RenderError> {
    let points: Vec<Vec<(f64, f64)>> = spaces
        .iter()
        .map(|space| (1..).map(f64::from).zip(space.precision_at_rank.iter().copied()).collect())
        .collect();
    let ranks = points.iter().map(Vec::len).max().unwrap_or_default();
    let best: Vec<(f64, f64)> = (1..=ranks).map(|rank| (rank as f64, best_at(rank, spaces))).collect();
    let title = "Precision by rank (dashed: the best that can be)";
    let axes = PlotAxes { title, across: "rank", from: 1.0, to: ranks.max(2) as f64, ticks: 10, decimals: 0 };
    curves::panel(area, &axes, &numbered(&points, (ranks / 10).max(1)), Some(&best))
}

fn numbered(points: &[Vec<(f64, f64)>], mark_every: usize) -> Vec<Curve<'_>> {
    points.iter().enumerate().map(|(number, points)| Curve { number, points, mark_every }).collect()
}

/// The precision at a rank where every query ranks all others of its class first.
fn best_at(rank: usize, spaces: &[SpaceMeasures]) -> f64 {
    let (mut sum, mut queries) = (0.0, 0);
    for measures in spaces.first().into_iter().flat_map(|space| space.per_class.values()) {
        let others = measures.queries.saturating_sub(1);
        sum += measures.queries as f64 * others.min(rank) as f64 / rank as f64;
        queries += measures.queries;
    }
    sum / queries.max(1) as f64
}

/// The classes, sorted by mean average precision in the best space, highest first.
fn bars<'a>(evaluation: &Evaluation, spaces: &'a [SpaceMeasures]) -> Bars<'a> {
    let best = spaces.iter().enumerate().max_by(|(i, a), (j, b)| a.all.map.total_cmp(&b.all.map).then(j.cmp(i)));
    let best = best.map(|(number, _)| number).unwrap_or_default();
    let names = spaces.first().into_iter().flat_map(|space| space.per_class.iter());
    let mut rows: Vec<(&str, Vec<f64>)> = names
        .filter(|(_, measures)| measures.queries > 0)
        .map(|(class, _)| {
            let value = |space: &SpaceMeasures| space.per_class.get(class).map_or(0.0, |measures| measures.map);
            (class.as_str(), spaces.iter().map(value).collect())
        })
        .collect();
    let value = |row: &(&str, Vec<f64>)| row.1.get(best).copied().unwrap_or_default();
    rows.sort_by(|a, b| value(b).total_cmp(&value(a)).then(a.0.cmp(b.0)));
    let all = rows.len();
    let shown = rows.split_off(all.saturating_sub(MAX_ROWS));
    let label = shortened(&evaluation.label, 24);
    let space = spaces.get(best).map(|space| space.space.as_str()).unwrap_or_default();
    let title = if shown.len() < all {
        format!("Mean average precision by '{label}': the {} of {all} that are found worst in {space}", shown.len())
    } else {
        format!("Mean average precision by '{label}', in the order of {space}")
    };
    Bars { title, spaces: spaces.iter().map(|space| space.space.as_str()).collect(), rows: shown }
}
