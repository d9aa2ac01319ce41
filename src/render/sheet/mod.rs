//! Sheets: pictures of volumes as their slices, one panel a volume.
//!
//! A *panel* is a volume's slices in reading order with a caption below; a *sheet* is a grid of panels under an optional
//! title, the query first and marked (the paper's Figure 6). The slices of a panel are spread evenly over the axis: all of
//! them where they are few enough, else every n-th. Slices larger than [`Layout::slice_pixels`] are shown smaller by block
//! averages, smaller ones are enlarged by whole factors; no voxel is interpolated. Colour volumes are shown in colour.
//!
//! A sheet never exceeds [`MOST_PIXELS`]: where many panels would, slices become smaller, then fewer, and in the end
//! the last panels are left out and a line says how many. The same panels give the same picture to the bit.

mod bare;
mod canvas;
mod mosaic;
mod text;

use std::fmt;
use std::fs;
use std::io;
use std::path::Path;
use std::str::FromStr;

use image::codecs::png::{CompressionType, FilterType, PngEncoder};
use image::{ExtendedColorType, ImageEncoder, ImageError, RgbImage};

pub use self::bare::{Bare, Picture, bare, slice, thumbnail};
use self::canvas::{Canvas, Colours};
use self::mosaic::Mosaic;
use self::text::Face;
use crate::volume::Volume;

/// The most pixels of a sheet: 2^25, about 100 MB while it is drawn.
pub const MOST_PIXELS: u64 = 1 << 25;

/// Pixels around the sheet and around its panels, between panels, and between a panel's frame and what is in it.
const MARGIN: u32 = 16;
const GAP: u32 = 12;
const PADDING: u32 = 10;

/// The smallest inner width of a panel, so that a short name can be read below tiny slices.
const NARROWEST: u32 = 160;

/// What a layout may ask for: smaller slices show nothing, larger ones or more of them no sheet holds.
const SLICE_PIXELS: std::ops::RangeInclusive<u32> = 8..=4096;
const MOST_SLICES: usize = 1 << 16;

/// Down to what slices are made smaller and fewer, for the sake of more panels.
const ENOUGH_PIXELS: u32 = 16;
const ENOUGH_SLICES: usize = 16;

/// Width by height that a sheet comes as near to as its panels allow.
const ASPECT: f64 = 1.4;

/// The axis that slices are taken across.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default)]
pub enum Axis {
    /// A slice has Y downwards and X to the right.
    #[default]
    Z,
    /// A slice has Z downwards and X to the right.
    Y,
    /// A slice has Z downwards and Y to the right.
    X,
}

impl fmt::Display for Axis {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Z => "Z",
            Self::Y => "Y",
            Self::X => "X",
        })
    }
}

/// A text that names no axis.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("`{found}` is no axis: write Z, Y or X")]
pub struct AxisError {
    /// The text.
    pub found: String,
}

impl FromStr for Axis {
    type Err = AxisError;

    /// `Z`, `Y` or `X`, in either case.
    fn from_str(text: &str) -> Result<Self, AxisError> {
        match text {
            "Z" | "z" => Ok(Self::Z),
            "Y" | "y" => Ok(Self::Y),
            "X" | "x" => Ok(Self::X),
            _ => Err(AxisError { found: text.into() }),
        }
    }
}

/// What the slices stand on.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default)]
pub enum Ground {
    /// Light grey, for paper and pages.
    #[default]
    Light,
    /// Dark grey, for screens and bright textures.
    Dark,
}

/// A volume and what is written below it.
#[derive(Debug, Clone)]
pub struct Panel<'a> {
    /// What is shown.
    pub volume: &'a Volume,
    /// Lines: the first, the name, is bold. Characters outside Latin-1 become `?`; a line that is too long for the panel
    /// loses its middle.
    pub caption: Vec<String>,
}

/// How a sheet is laid out.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Layout {
    /// A line above all panels.
    pub title: Option<String>,
    /// Whether the first panel is the query, which is framed and labelled.
    pub query_first: bool,
    /// Panels in a row; `None`: as many as make the sheet a little wider than high.
    pub across: Option<usize>,
    /// Slices in a row of a panel; 0 counts as 1.
    pub columns: usize,
    /// The most slices of a panel; 0 counts as 1.
    pub slices: usize,
    /// The longest side of a slice in pixels; taken as 8 to 4096.
    pub slice_pixels: u32,
    /// The axis that slices are taken across.
    pub axis: Axis,
    /// What the slices stand on.
    pub ground: Ground,
}

impl Default for Layout {
    /// The paper's figures: 8 x 8 slices of 64 x 64 pixels across Z, on a light ground, no query.
    fn default() -> Self {
        Self {
            title: None,
            query_first: false,
            across: None,
            columns: 8,
            slices: 64,
            slice_pixels: 64,
            axis: Axis::Z,
            ground: Ground::Light,
        }
    }
}

/// A sheet that could not be written.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum SheetError {
    /// The encoder refused.
    #[error("the sheet cannot be encoded as PNG")]
    Encode {
        /// The encoder's own words.
        #[source]
        source: ImageError,
    },
    /// The operating system refused.
    #[error("the sheet cannot be written to {}: check that the folder exists and may be written to", path.display().to_string().escape_debug())]
    Write {
        /// Where it should have gone.
        path: std::path::PathBuf,
        /// The system's own words.
        #[source]
        source: io::Error,
    },
}

/// The sheet of these panels. Without panels it is the title on an empty ground.
///
/// ```
/// use hlacdb::{render::sheet::{self, Layout, Panel}, volume::Volume};
/// let volume = Volume::from_fn([9, 9, 9], |z, y, x| (z * y * x) as u8)?;
/// let query = Panel { volume: &volume, caption: vec!["ramp".into()] };
/// let hit = Panel { volume: &volume, caption: vec!["ramp".into(), "rank 1   distance 0.000".into()] };
/// let sheet = sheet::draw(&[query, hit], &Layout { query_first: true, ..Layout::default() });
/// assert!(sheet::encode_png(&sheet)?.starts_with(b"\x89PNG"));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn draw(panels: &[Panel<'_>], layout: &Layout) -> RgbImage {
    let plan = Plan::new(panels, layout);
    let mut canvas = Canvas::new(plan.width, plan.height, Colours::of(layout.ground));
    if let Some(title) = &layout.title {
        canvas.text(title, (MARGIN, MARGIN), Face::Title, plan.width - 2 * MARGIN, false);
    }
    for (index, panel) in panels.iter().take(plan.shown).enumerate() {
        plan.draw_panel(&mut canvas, index, panel, layout);
    }
    if plan.shown < panels.len() {
        let line = format!("... and {} more", panels.len() - plan.shown);
        let place = (MARGIN, plan.height - MARGIN - Face::Large.line());
        canvas.text(&line, place, Face::Large, plan.width - 2 * MARGIN, true);
    }
    canvas.into_image()
}

/// The sheet of one volume; two lines below its caption say how large it is, and which slices are shown and how large.
pub fn draw_one(panel: &Panel<'_>, layout: &Layout) -> RgbImage {
    let [z, y, x] = panel.volume.shape();
    let mut panel = panel.clone();
    panel.caption.extend([format!("{z} x {y} x {x} voxels"), String::new()]);
    let mosaic = Plan::new(std::slice::from_ref(&panel), layout).mosaic(&panel, layout);
    panel.caption.pop();
    panel.caption.push(mosaic.to_string());
    draw(&[panel], layout)
}

/// The PNG file of a sheet.
///
/// # Errors
/// [`SheetError::Encode`], which a sheet of [`draw`] does not cause.
pub fn encode_png(sheet: &RgbImage) -> Result<Vec<u8>, SheetError> {
    let mut bytes = Vec::new();
    PngEncoder::new_with_quality(&mut bytes, CompressionType::Default, FilterType::Adaptive)
        .write_image(sheet.as_raw(), sheet.width(), sheet.height(), ExtendedColorType::Rgb8)
        .map_err(|source| SheetError::Encode { source })?;
    Ok(bytes)
}

/// Writes a sheet as a PNG file, whatever the name's ending; a file of that name is replaced.
///
/// # Errors
/// [`SheetError::Encode`], [`SheetError::Write`].
pub fn write_png(sheet: &RgbImage, path: &Path) -> Result<(), SheetError> {
    fs::write(path, encode_png(sheet)?).map_err(|source| SheetError::Write { path: path.into(), source })
}

/// Where everything goes.
struct Plan {
    width: u32,
    height: u32,
    /// Panels that are shown.
    shown: usize,
    across: usize,
    /// The largest size of a panel's slices.
    slice_pixels: u32,
    /// The most slices of a panel.
    slices: usize,
    /// The inside of every panel: the widest and the highest mosaic.
    inner: (u32, u32),
    /// Lines below every mosaic.
    lines: u32,
    face: Face,
    /// Where the panels begin.
    top: u32,
}

impl Plan {
    fn new(panels: &[Panel<'_>], layout: &Layout) -> Self {
        let mut slice_pixels = layout.slice_pixels.clamp(*SLICE_PIXELS.start(), *SLICE_PIXELS.end());
        let mut slices = layout.slices.clamp(1, MOST_SLICES);
        loop {
            let plan = Self::of(panels, panels.len(), layout, slice_pixels, slices);
            if plan.pixels() <= MOST_PIXELS {
                return plan;
            }
            if slice_pixels > ENOUGH_PIXELS {
                slice_pixels = (slice_pixels / 2).max(ENOUGH_PIXELS);
            } else if slices > ENOUGH_SLICES {
                slices = (slices / 2).max(ENOUGH_SLICES);
            } else {
                return Self::of_some(panels, layout, slice_pixels, slices);
            }
        }
    }

    /// The most panels that fit, at this size.
    fn of_some(panels: &[Panel<'_>], layout: &Layout, slice_pixels: u32, slices: usize) -> Self {
        let fits = |shown: &usize| Self::of(panels, *shown, layout, slice_pixels, slices).pixels() <= MOST_PIXELS;
        let mut shown = panels.len();
        while shown > 1 && !fits(&shown) {
            shown -= shown.div_ceil(8);
        }
        Self::of(panels, shown, layout, slice_pixels, slices)
    }

    fn of(panels: &[Panel<'_>], shown: usize, layout: &Layout, slice_pixels: u32, slices: usize) -> Self {
        let mosaics = panels
            .iter()
            .map(|panel| Mosaic::new(panel.volume, layout.axis, slices, layout.columns, slice_pixels).size());
        let inner = mosaics.fold((NARROWEST, 1), |(width, height), size| (width.max(size.0), height.max(size.1)));
        let face = Face::for_width(inner.0);
        let lines = panels.iter().map(|panel| panel.caption.len()).max().unwrap_or(0) as u32;
        let top = MARGIN + if layout.title.is_some() { Face::Title.line() + GAP } else { 0 };
        let mut plan = Self { width: 0, height: 0, shown, across: 1, slice_pixels, slices, inner, lines, face, top };
        plan.across = match layout.across {
            Some(across) => across.clamp(1, shown.max(1)),
            None => plan.best_across(),
        };
        (plan.width, plan.height) = plan.size(plan.across);
        if shown < panels.len() {
            plan.height = plan.height.saturating_add(Face::Large.line() + GAP);
        }
        plan
    }

    fn mosaic(&self, panel: &Panel<'_>, layout: &Layout) -> Mosaic {
        Mosaic::new(panel.volume, layout.axis, self.slices, layout.columns, self.slice_pixels)
    }

    fn pixels(&self) -> u64 {
        u64::from(self.width) * u64::from(self.height)
    }

    /// Outer size of a panel.
    fn outer(&self) -> (u32, u32) {
        let caption = if self.lines == 0 { 0 } else { PADDING + self.lines * self.face.line() };
        (self.inner.0 + 2 * PADDING, self.inner.1 + 2 * PADDING + caption)
    }

    /// Size of the sheet with so many panels in a row.
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

    fn draw_panel(&self, canvas: &mut Canvas, index: usize, panel: &Panel<'_>, layout: &Layout) {
        let (width, height) = self.outer();
        let column = (index % self.across) as u32;
        let row = (index / self.across) as u32;
        let (left, top) = (MARGIN + column * (width + GAP), self.top + row * (height + GAP));
        let query = layout.query_first && index == 0;
        canvas.frame((left, top), (width, height), query);
        let mosaic = self.mosaic(panel, layout);
        let aside = (self.inner.0 - mosaic.size().0) / 2;
        let seam = canvas.colours.seam;
        mosaic.draw(panel.volume, seam, |x, y, colour| {
            canvas.pixel(left + PADDING + aside + x, top + PADDING + y, colour)
        });
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

#[cfg(test)]
mod tests;
