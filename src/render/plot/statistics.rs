//! The plot of a store's statistics: the 251 moments, and the share of variance along each axis of a space.

use super::RenderError;
use super::page::{self, Anchor, Area, FAINT, GRID, INK, color, fill, font, line, px, text};
use crate::database::StatisticsReport;
use crate::hlac::MASKS;
use plotters::style::RGBColor;

/// The width of the page and the heights of its panels, in pixels.
const WIDTH: f64 = 980.0;
const HEADING: f64 = 60.0;
const MOMENTS: f64 = 376.0;
const AXES: f64 = 270.0;
const NO_AXES: f64 = 54.0;

/// The left and right end of the data area.
const LEFT: f64 = 58.0;
const RIGHT: f64 = WIDTH - 16.0;

/// The colours of the range of values, of one standard deviation about the mean, and of the mean.
const RANGE: RGBColor = RGBColor(0xd6, 0xe6, 0xf2);
const DEVIATION: RGBColor = RGBColor(0x74, 0xae, 0xd6);
const MEAN: RGBColor = RGBColor(0x08, 0x30, 0x6b);

/// The plot of a report of [`Database::statistics`](crate::Database::statistics) as an SVG document.
///
/// The upper half shows the mean of each of the 251 moments of `full@1` in the order of the masks, with one standard
/// deviation to either side and the lowest and highest value. The lower half shows the share of the variance along each
/// axis of the report's space.
///
/// # Errors
/// [`RenderError::NoData`] where the store has no moments of `full@1`.
pub fn statistics_plot(report: &StatisticsReport) -> Result<String, RenderError> {
    let moments = &report.statistics;
    if moments.count == 0 {
        return Err(RenderError::NoData { missing: "the store has no textures" });
    }
    let title = "Statistics of a store of solid textures";
    let description = format!(
        "Mean, standard deviation, lowest and highest value of the 251 moments over {} textures, in the order of the masks; \
         shares of the variance of the {} axes of the space {}.",
        moments.count,
        report.space.variances.len(),
        report.space.name
    );
    let axes = if report.space.variances.is_empty() { NO_AXES } else { AXES };
    let size = (WIDTH as u32, (HEADING + MOMENTS + axes) as u32);
    page::draw(title, &description, size, |area| {
        let (top, rest) = area.split_vertically(px(HEADING));
        let (middle, bottom) = rest.split_vertically(px(MOMENTS));
        let textures = if moments.count == 1 { "texture" } else { "textures" };
        let heading = format!("The 251 moments of full@1 over {} {textures}", moments.count);
        text(&top, &heading, (16.0, 22.0), &font(17.0, INK, Anchor::Left))?;
        let key = [(MEAN, "mean"), (DEVIATION, "one standard deviation"), (RANGE, "lowest to highest")];
        let mut left = 16.0;
        for (ink, words) in key {
            fill(&top, (left, 40.0), (16.0, if ink == MEAN { 3.0 } else { 10.0 }), ink)?;
            text(&top, words, (left + 22.0, 45.0), &font(12.0, FAINT, Anchor::Left))?;
            left += 50.0 + 7.0 * words.len() as f64;
        }
        draw_moments(&middle, report)?;
        draw_axes(&bottom, report)
    })
}

/// A vertical axis from 0 to `top`, between two heights in pixels.
struct Scale {
    top: f64,
    high: f64,
    low: f64,
}

impl Scale {
    /// The height of a value; values outside the axis are drawn at its ends.
    fn at(&self, value: f64) -> f64 {
        self.low - (self.low - self.high) * (value / self.top).clamp(0.0, 1.0)
    }

    /// Draws grid lines and numbers.
    fn draw(&self, area: &Area<'_>, steps: u32, number: impl Fn(f64) -> String) -> Result<(), RenderError> {
        for step in 0..=steps {
            let value = self.top * f64::from(step) / f64::from(steps);
            line(area, (LEFT, self.at(value)), (RIGHT, self.at(value)), GRID, 1.0)?;
            text(area, &number(value), (LEFT - 6.0, self.at(value)), &font(11.0, INK, Anchor::Right))?;
        }
        Ok(())
    }
}

/// The least of 1, 2, 2.5 and 5 times a power of ten that is not below `value`, and a good number of steps for it.
fn round_up(value: f64) -> (f64, u32) {
    if value <= 0.0 || !value.is_finite() {
        return (1.0, 5);
    }
    let power = 10.0_f64.powi(libm::floor(libm::log10(value)) as i32);
    let steps = [(1.0, 5), (2.0, 4), (2.5, 5), (5.0, 5), (10.0, 5)];
    let fitting = steps.into_iter().find(|(step, _)| step * power >= value * (1.0 - 1e-9));
    fitting.map_or((value, 5), |(step, steps)| (step * power, steps))
}

fn draw_moments(area: &Area<'_>, report: &StatisticsReport) -> Result<(), RenderError> {
    let moments = &report.statistics;
    let highest = moments.max.iter().copied().fold(0.0, f64::max);
    let (top, steps) = round_up(highest);
    let scale = Scale { top, high: 34.0, low: MOMENTS - 60.0 };
    scale.draw(area, steps, |value| format!("{value:.3}").trim_end_matches('0').trim_end_matches('.').to_owned())?;
    // A small gap separates masks of one, two and three cells.
    let gap = 14.0;
    let step = (RIGHT - LEFT - 3.0 * gap) / MASKS.len() as f64;
    let bar = step * 0.72;
    let columns = moments.mean.iter().zip(&moments.std).zip(moments.min.iter().zip(&moments.max));
    let mut ends: [Option<(f64, f64)>; 3] = [None; 3];
    for ((at, mask), ((&mean, &deviation), (&lowest, &highest))) in MASKS.iter().enumerate().zip(columns) {
        let left = LEFT + gap * mask.order() as f64 - gap / 2.0 + step * at as f64;
        let range = |from: f64, to: f64, ink| {
            let (from, to) = (scale.at(from), scale.at(to));
            fill(area, (left, to), (bar, from - to), ink)
        };
        range(lowest, highest, RANGE)?;
        range(mean - deviation, mean + deviation, DEVIATION)?;
        fill(area, (left, scale.at(mean) - 0.8), (bar, 1.6), MEAN)?;
        if let Some(end) = ends.get_mut(mask.order() - 1) {
            let begin = end.map_or(left, |(begin, _)| begin);
            *end = Some((begin, left + bar));
        }
    }
    let names = ["1 cell", "2 cells: 13 masks", "3 cells: 237 masks, in the paper's order"];
    for (name, end) in names.into_iter().zip(ends) {
        let Some((begin, end)) = end else { continue };
        line(area, (begin, scale.low + 7.0), (end, scale.low + 7.0), FAINT, 1.2)?;
        // The first two groups are narrow: their labels begin at the left end, the first one line lower.
        let (position, anchor) = match name.len() {
            0..10 => ((begin - 4.0, scale.low + 33.0), Anchor::Left),
            10..20 => ((begin, scale.low + 19.0), Anchor::Left),
            _ => (((begin + end) / 2.0, scale.low + 19.0), Anchor::Centre),
        };
        text(area, name, position, &font(11.0, FAINT, anchor))?;
    }
    text(area, "moment (0 to 1)", (16.0, 16.0), &font(12.0, FAINT, Anchor::Left))
}

fn draw_axes(area: &Area<'_>, report: &StatisticsReport) -> Result<(), RenderError> {
    let space = &report.space;
    let title = format!("Axes of the space {}", page::shortened(&space.name, 40));
    text(area, &title, (16.0, 12.0), &font(17.0, INK, Anchor::Left))?;
    if space.variances.is_empty() {
        let words =
            format!("{} has none of its own: its coordinates are the {} features themselves", space.name, space.dims);
        return text(area, &words, (16.0, 36.0), &font(12.0, FAINT, Anchor::Left));
    }
    let half = half_of(&space.variances);
    let words = format!(
        "share of the variance; {} of {} axes hold half of it{}",
        half,
        space.variances.len(),
        if space.epoch == 0 { " (as the prior has it: not fitted yet)" } else { "" }
    );
    text(area, &words, (16.0, 36.0), &font(12.0, FAINT, Anchor::Left))?;
    let (top, steps) = round_up(space.variances.iter().copied().fold(0.0, f64::max));
    let scale = Scale { top, high: 56.0, low: AXES - 44.0 };
    scale.draw(area, steps, |value| format!("{:.1} %", value * 100.0))?;
    let step = (RIGHT - LEFT) / space.variances.len() as f64;
    let bar = (step * 0.72).min(60.0);
    let every = space.variances.len().div_ceil(40);
    for (at, &share) in space.variances.iter().enumerate() {
        let middle = LEFT + step * (at as f64 + 0.5);
        fill(area, (middle - bar / 2.0, scale.at(share)), (bar, scale.low - scale.at(share)), color(0))?;
        if at % every == 0 {
            text(area, &(at + 1).to_string(), (middle, scale.low + 14.0), &font(11.0, INK, Anchor::Centre))?;
        }
    }
    text(area, "axis", ((LEFT + RIGHT) / 2.0, scale.low + 33.0), &font(11.0, FAINT, Anchor::Centre))
}

/// The number of leading shares that make up half.
fn half_of(shares: &[f64]) -> usize {
    let mut sum = 0.0;
    let before = shares.iter().take_while(|&&share| {
        sum += share;
        sum < 0.5
    });
    (before.count() + 1).min(shares.len())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn scales_end_at_round_numbers() {
        assert_eq!(round_up(0.83), (1.0, 5));
        assert_eq!(round_up(0.0), (1.0, 5));
        let (top, steps) = round_up(0.21);
        assert!((top - 0.25).abs() < 1e-12 && steps == 5);
        assert!((round_up(0.1).0 - 0.1).abs() < 1e-12);
    }

    #[test]
    fn values_outside_a_scale_are_drawn_at_its_ends() {
        let scale = Scale { top: 0.5, high: 30.0, low: 300.0 };
        assert_eq!([-1.0, 0.0, 0.25, 0.5, 9.0].map(|value| scale.at(value)), [300.0, 300.0, 165.0, 30.0, 30.0]);
    }

    #[test]
    fn half_of_the_variance_is_counted() {
        assert_eq!(half_of(&[0.6, 0.4]), 1);
        assert_eq!(half_of(&[0.3, 0.3, 0.4]), 2);
        assert_eq!(half_of(&[1.0]), 1);
    }
}
