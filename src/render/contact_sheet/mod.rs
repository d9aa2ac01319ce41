//! Contact sheets: several volumes as their slices, one panel per volume.
//!
//! A *panel* shows a volume's slices in reading order with a caption below. A *contact sheet* is a grid of panels under an
//! optional title; the first panel may be marked as the query (the paper's Figure 6). The slices of a panel are spread
//! evenly over the axis: all of them where they are few enough, else every n-th.
//!
//! A sheet has at most [`MAX_PIXELS`] pixels: where many panels would need more, slices become smaller, then fewer, and
//! finally the last panels are left out and a line says how many.

mod canvas;
mod text;
mod theme;

use self::canvas::{Canvas, Colors};
use self::text::Face;
use self::theme::SEAM;
use super::slice_grid::{GridRequest, SliceGrid};
use super::{Image, MAX_PIXELS, SliceAxis};
use crate::volume::Volume;

pub use self::theme::Theme;

/// Pixels around the sheet and around its panels, between panels, and between a panel's frame and its contents.
const MARGIN: u32 = 16;
const GAP: u32 = 12;
const PADDING: u32 = 10;

/// The smallest inner width of a panel, so that a short name is legible below tiny slices.
const MIN_INNER_WIDTH: u32 = 160;

/// The allowed sizes of a slice in pixels and the most slices of a panel.
const SLICE_PIXELS: std::ops::RangeInclusive<u32> = 8..=4096;
const MAX_SLICES: usize = 1 << 16;

/// Slices are not made smaller or fewer than this to make room for more panels.
const MIN_FITTED_PIXELS: u32 = 16;
const MIN_FITTED_SLICES: usize = 16;

/// The preferred ratio of a sheet's width to its height.
const ASPECT: f64 = 1.4;

/// A volume and its caption.
#[derive(Debug, Clone)]
pub struct Panel<'a> {
    /// The volume.
    pub volume: &'a Volume,
    /// Lines below the slices; the first is bold. Characters outside Latin-1 become `?`; the middle of a line that is too
    /// long for the panel is replaced by `...`.
    pub caption: Vec<String>,
}

/// How a contact sheet is laid out. The default follows the paper's figures: 8 x 8 slices of 64 x 64 pixels across Z, on a
/// light background, no query.
#[derive(Debug, Clone, PartialEq, Eq)]
#[non_exhaustive]
pub struct ContactSheetOptions {
    /// A line above all panels.
    pub title: Option<String>,
    /// Whether the first panel is the query, which is framed and labelled.
    pub query_first: bool,
    /// Panels in a row; `None` chooses the number that brings the sheet's shape nearest to 1.4 : 1.
    pub across: Option<usize>,
    /// Slices in a row of a panel; 0 counts as 1.
    pub columns: usize,
    /// The most slices of a panel; 0 counts as 1.
    pub slices: usize,
    /// The longest side of a slice in pixels; taken as 8 to 4096.
    pub slice_pixels: u32,
    /// The axis that slices are taken across.
    pub axis: SliceAxis,
    /// The colours.
    pub theme: Theme,
}

impl Default for ContactSheetOptions {
    fn default() -> Self {
        Self {
            title: None,
            query_first: false,
            across: None,
            columns: 8,
            slices: 64,
            slice_pixels: 64,
            axis: SliceAxis::Z,
            theme: Theme::Light,
        }
    }
}

impl ContactSheetOptions {
    /// The default options.
    pub fn new() -> Self {
        Self::default()
    }

    /// Writes a line above all panels.
    #[must_use]
    pub fn title(self, title: impl Into<String>) -> Self {
        Self { title: Some(title.into()), ..self }
    }

    /// Frames and labels the first panel as the query, or not.
    #[must_use]
    pub fn query_first(self, query_first: bool) -> Self {
        Self { query_first, ..self }
    }

    /// Puts so many panels in a row.
    #[must_use]
    pub fn across(self, panels: usize) -> Self {
        Self { across: Some(panels), ..self }
    }

    /// Puts at most so many slices in a row of a panel.
    #[must_use]
    pub fn columns(self, columns: usize) -> Self {
        Self { columns, ..self }
    }

    /// Draws at most so many slices of a volume.
    #[must_use]
    pub fn slices(self, slices: usize) -> Self {
        Self { slices, ..self }
    }

    /// Draws slices with no side longer than this.
    #[must_use]
    pub fn slice_pixels(self, slice_pixels: u32) -> Self {
        Self { slice_pixels, ..self }
    }

    /// Takes slices across this axis.
    #[must_use]
    pub fn axis(self, axis: SliceAxis) -> Self {
        Self { axis, ..self }
    }

    /// Uses these colours.
    #[must_use]
    pub fn theme(self, theme: Theme) -> Self {
        Self { theme, ..self }
    }
}

/// The contact sheet of these panels. Without panels it is the title on an empty background.
///
/// ```
/// use hlacdb::{render::{ContactSheetOptions, Panel, PngEffort, contact_sheet}, volume::Volume};
/// let volume = Volume::from_fn([9, 9, 9], |z, y, x| (z * y * x) as u8)?;
/// let query = Panel { volume: &volume, caption: vec!["ramp".into()] };
/// let hit = Panel { volume: &volume, caption: vec!["ramp".into(), "rank 1   distance 0.000".into()] };
/// let sheet = contact_sheet(&[query, hit], &ContactSheetOptions::new().query_first(true));
/// assert!(sheet.encode_png(PngEffort::Small)?.starts_with(b"\x89PNG"));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn contact_sheet(panels: &[Panel<'_>], options: &ContactSheetOptions) -> Image {
    let layout = Layout::new(panels, options);
    let mut canvas = Canvas::new(layout.width, layout.height, Colors::of(options.theme));
    if let Some(title) = &options.title {
        canvas.text(title, (MARGIN, MARGIN), Face::Title, layout.width - 2 * MARGIN, false);
    }
    for (index, panel) in panels.iter().take(layout.shown).enumerate() {
        layout.draw_panel(&mut canvas, index, panel, options);
    }
    if layout.shown < panels.len() {
        let line = format!("... and {} more", panels.len() - layout.shown);
        let position = (MARGIN, layout.height - MARGIN - Face::Large.line());
        canvas.text(&line, position, Face::Large, layout.width - 2 * MARGIN, true);
    }
    canvas.into_image()
}

/// The contact sheet of one volume. Two lines are added to its caption: the volume's shape, and which slices are shown at
/// which scale.
pub(super) fn single_sheet(panel: &Panel<'_>, options: &ContactSheetOptions) -> Image {
    let [z, y, x] = panel.volume.shape();
    let mut panel = panel.clone();
    panel.caption.push(format!("{z} x {y} x {x} voxels"));
    // The height of the caption decides how large slices may be, so the last line is counted before it is known.
    panel.caption.push(String::new());
    let grid = Layout::new(std::slice::from_ref(&panel), options).grid(&panel, options);
    panel.caption.pop();
    panel.caption.push(grid.to_string());
    contact_sheet(&[panel], options)
}

/// Sizes and positions of everything on a sheet.
struct Layout {
    width: u32,
    height: u32,
    /// How many panels are shown.
    shown: usize,
    across: usize,
    /// The largest size of a panel's slices.
    slice_pixels: u32,
    /// The most slices of a panel.
    slices: usize,
    /// Width and height of the widest and the highest slice grid.
    inner: (u32, u32),
    /// Lines of the longest caption.
    lines: u32,
    face: Face,
    /// The top of the first row of panels.
    top: u32,
}

impl Layout {
    fn new(panels: &[Panel<'_>], options: &ContactSheetOptions) -> Self {
        let mut slice_pixels = options.slice_pixels.clamp(*SLICE_PIXELS.start(), *SLICE_PIXELS.end());
        let mut slices = options.slices.clamp(1, MAX_SLICES);
        loop {
            let layout = Self::of(panels, panels.len(), options, slice_pixels, slices);
            if layout.pixels() <= MAX_PIXELS {
                return layout;
            }
            if slice_pixels > MIN_FITTED_PIXELS {
                slice_pixels = (slice_pixels / 2).max(MIN_FITTED_PIXELS);
            } else if slices > MIN_FITTED_SLICES {
                slices = (slices / 2).max(MIN_FITTED_SLICES);
            } else {
                return Self::of_some(panels, options, slice_pixels, slices);
            }
        }
    }

    /// As many panels as fit at this size of slices.
    fn of_some(panels: &[Panel<'_>], options: &ContactSheetOptions, slice_pixels: u32, slices: usize) -> Self {
        let fits = |shown: &usize| Self::of(panels, *shown, options, slice_pixels, slices).pixels() <= MAX_PIXELS;
        let mut shown = panels.len();
        while shown > 1 && !fits(&shown) {
            shown -= shown.div_ceil(8);
        }
        Self::of(panels, shown, options, slice_pixels, slices)
    }

    fn of(panels: &[Panel<'_>], shown: usize, options: &ContactSheetOptions, slice_pixels: u32, slices: usize) -> Self {
        let sizes = panels.iter().map(|panel| grid_size(&grid(panel, options, slices, slice_pixels)));
        let inner = sizes.fold((MIN_INNER_WIDTH, 1), |(width, height), size| (width.max(size.0), height.max(size.1)));
        let face = Face::for_width(inner.0);
        let lines = panels.iter().map(|panel| panel.caption.len()).max().unwrap_or(0) as u32;
        let top = MARGIN + if options.title.is_some() { Face::Title.line() + GAP } else { 0 };
        let mut layout = Self { width: 0, height: 0, shown, across: 1, slice_pixels, slices, inner, lines, face, top };
        layout.across = match options.across {
            Some(across) => across.clamp(1, shown.max(1)),
            None => layout.best_across(),
        };
        (layout.width, layout.height) = layout.size(layout.across);
        if shown < panels.len() {
            layout.height = layout.height.saturating_add(Face::Large.line() + GAP);
        }
        layout
    }

    fn grid(&self, panel: &Panel<'_>, options: &ContactSheetOptions) -> SliceGrid {
        grid(panel, options, self.slices, self.slice_pixels)
    }

    fn pixels(&self) -> u64 {
        u64::from(self.width) * u64::from(self.height)
    }

    /// Outer size of a panel.
    fn outer(&self) -> (u32, u32) {
        let caption = if self.lines == 0 { 0 } else { PADDING + self.lines * self.face.line() };
        (self.inner.0 + 2 * PADDING, self.inner.1 + 2 * PADDING + caption)
    }

    /// Width and height of the sheet with `across` panels in a row.
    fn size(&self, across: usize) -> (u32, u32) {
        let (width, height) = self.outer();
        let side = |count: usize, one: u32| {
            let all = count as u64 * u64::from(one + GAP);
            u32::try_from(all).unwrap_or(u32::MAX).saturating_sub(GAP)
        };
        let rows = self.shown.div_ceil(across);
        let width = side(across.min(self.shown.max(1)), width).saturating_add(2 * MARGIN);
        (width, side(rows, height).saturating_add(self.top + MARGIN))
    }

    /// The number of panels in a row that brings the sheet nearest to [`ASPECT`].
    fn best_across(&self) -> usize {
        let distance = |across: usize| {
            let (width, height) = self.size(across);
            (f64::from(width) / f64::from(height) / ASPECT).ln().abs()
        };
        (1..=self.shown.max(1)).min_by(|&a, &b| distance(a).total_cmp(&distance(b))).unwrap_or(1)
    }

    fn draw_panel(&self, canvas: &mut Canvas, index: usize, panel: &Panel<'_>, options: &ContactSheetOptions) {
        let (width, height) = self.outer();
        let column = (index % self.across) as u32;
        let row = (index / self.across) as u32;
        let (left, top) = (MARGIN + column * (width + GAP), self.top + row * (height + GAP));
        let query = options.query_first && index == 0;
        canvas.frame((left, top), (width, height), query);
        let grid = self.grid(panel, options);
        let centred = (self.inner.0 - grid_size(&grid).0) / 2;
        canvas.slices((left + PADDING + centred, top + PADDING), &grid, panel.volume);
        let mut line = top + 2 * PADDING + self.inner.1;
        for (number, text) in panel.caption.iter().enumerate() {
            let label =
                if query && number == 0 { canvas.label("QUERY", (left + width - PADDING, line), self.face) } else { 0 };
            let face = if number == 0 { self.face.bold() } else { self.face };
            canvas.text(text, (left + PADDING, line), face, self.inner.0.saturating_sub(label), number > 0);
            line += self.face.line();
        }
    }
}

/// The grid of a panel's slices.
fn grid(panel: &Panel<'_>, options: &ContactSheetOptions, slices: usize, slice_pixels: u32) -> SliceGrid {
    let request = GridRequest {
        axis: options.axis,
        slices,
        columns: options.columns,
        pixels: slice_pixels,
        gap: SEAM as usize,
        border: SEAM as usize,
    };
    SliceGrid::new(panel.volume.shape(), &request).balanced()
}

/// Width and height of a grid; sizes beyond `u32` are far over the limit either way.
fn grid_size(grid: &SliceGrid) -> (u32, u32) {
    let (width, height) = grid.size();
    let side = |pixels: usize| u32::try_from(pixels).unwrap_or(u32::MAX);
    (side(width), side(height))
}

#[cfg(test)]
mod tests;
