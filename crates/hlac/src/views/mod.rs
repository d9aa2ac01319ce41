//! [`View`]: mapped copies of a volume, described by the same 251 masks.

mod maps;

use std::borrow::Cow;
use std::fmt;
use std::str::FromStr;

use self::maps::Contrast;
use crate::kernel::{self, Input};
use crate::{OctantSums, VoxelBuf, Voxels};

/// The shortest side, in voxels, that a volume may have after block averaging: four, so that every octant has a window.
pub const MIN_SCALED_SIDE: usize = 4;

/// The side of the blocks that are averaged before a view maps the voxels.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
#[non_exhaustive]
pub enum ViewScale {
    /// No averaging.
    One,
    /// Blocks of 2 x 2 x 2.
    Two,
    /// Blocks of 4 x 4 x 4.
    Four,
}

impl ViewScale {
    /// All scales, ascending.
    pub const ALL: [Self; 3] = [Self::One, Self::Two, Self::Four];

    /// The side of a block in voxels: 1, 2 or 4.
    pub const fn side(self) -> usize {
        match self {
            Self::One => 1,
            Self::Two => 2,
            Self::Four => 4,
        }
    }

    /// The shape (Z, Y, X) of the block averages of a volume of `shape`; `None` if a side would have fewer than
    /// [`MIN_SCALED_SIDE`] voxels (never at scale 1).
    pub fn shape_of(self, shape: [usize; 3]) -> Option<[usize; 3]> {
        let scaled = shape.map(|side| side / self.side());
        (self == Self::One || scaled.iter().all(|&side| side >= MIN_SCALED_SIDE)).then_some(scaled)
    }
}

/// A mapping from a grey volume to another one, which is described by the same 251 masks.
///
/// The *scale* `s` of a view (written `@s`) says that blocks of `s` x `s` x `s` voxels are averaged first. All mappings are
/// defined in integers (`detail@1` in exactly rounded `f64`), so a view has the same bits on every machine. With `//`
/// rounding down, `n` voxels, histogram `h` and cumulative histogram `C`:
///
/// | view | a voxel of level `v` becomes |
/// |---|---|
/// | `full@1` | itself: the paper's descriptor |
/// | `stretch@1` | `(510 (v-a) + (b-a)) // (2 (b-a))`, clamped to 0..=255, with `a` the lowest level where `100 C >= n` and `b` the lowest where `100 C >= 99 n`, at least `a + 1` |
/// | `stretch@2`, `@4` | `(sum + s^3/2) // s^3` over blocks of `stretch@1`, sides cut to a multiple of `s` |
/// | `sign@1`, `@2`, `@4` | 255 where `d > 0`, else 0; `d` is `27 v` minus the sum over the 3x3x3 neighbourhood in `stretch@s`, borders replicated |
/// | `detail@1` | `round(128 + 42 d / sd)`, half away from zero, clamped; `sd` is the standard deviation of the `d` of `stretch@1`; 128 everywhere if `sd = 0` |
/// | `rank@1`, `@2`, `@4` | `(255 (2 C(v) - h(v)) + n) // (2 n)`, of `full@1` at scale 1, otherwise of `stretch@s` |
///
/// A volume has every view of scale 1. It has a view of a larger scale if [`MIN_SCALED_SIDE`] voxels are left on every side.
///
/// Views are ordered by [`code`](View::code). Names and codes never change: they may be stored. With the feature `serde` a
/// view is serialised as its name.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(into = "String", try_from = "String"))]
#[non_exhaustive]
pub enum View {
    /// The volume itself.
    Full,
    /// Levels stretched between the 1st and 99th percentile.
    Stretch(ViewScale),
    /// Whether a voxel is lighter than the mean of its neighbourhood: fine structure without contrast.
    Sign(ViewScale),
    /// The difference from the neighbourhood, in units of its standard deviation.
    Detail,
    /// Levels replaced by their rank.
    Rank(ViewScale),
}

impl View {
    /// All views, by code.
    pub const ALL: [Self; 11] = [
        Self::Full,
        Self::Stretch(ViewScale::One),
        Self::Stretch(ViewScale::Two),
        Self::Stretch(ViewScale::Four),
        Self::Sign(ViewScale::One),
        Self::Sign(ViewScale::Two),
        Self::Sign(ViewScale::Four),
        Self::Detail,
        Self::Rank(ViewScale::One),
        Self::Rank(ViewScale::Two),
        Self::Rank(ViewScale::Four),
    ];

    /// The views that together describe how a texture looks, whatever its brightness and contrast, by code.
    pub const LIKENESS: [Self; 7] = [
        Self::Stretch(ViewScale::One),
        Self::Stretch(ViewScale::Two),
        Self::Stretch(ViewScale::Four),
        Self::Sign(ViewScale::One),
        Self::Sign(ViewScale::Two),
        Self::Sign(ViewScale::Four),
        Self::Detail,
    ];

    /// `full@1` and the views of [`View::LIKENESS`], by code.
    pub const STANDARD: [Self; 8] = [
        Self::Full,
        Self::Stretch(ViewScale::One),
        Self::Stretch(ViewScale::Two),
        Self::Stretch(ViewScale::Four),
        Self::Sign(ViewScale::One),
        Self::Sign(ViewScale::Two),
        Self::Sign(ViewScale::Four),
        Self::Detail,
    ];

    /// The view's number: its place in [`View::ALL`]. It never changes.
    pub const fn code(self) -> u8 {
        match self {
            Self::Full => 0,
            Self::Stretch(scale) => 1 + scale as u8,
            Self::Sign(scale) => 4 + scale as u8,
            Self::Detail => 7,
            Self::Rank(scale) => 8 + scale as u8,
        }
    }

    /// The view of a [`code`](Self::code), if there is one.
    pub fn from_code(code: u8) -> Option<Self> {
        Self::ALL.get(usize::from(code)).copied()
    }

    /// The name, e.g. `stretch@2`. It never changes.
    pub const fn name(self) -> &'static str {
        const NAMES: [&str; View::ALL.len()] = [
            "full@1",
            "stretch@1",
            "stretch@2",
            "stretch@4",
            "sign@1",
            "sign@2",
            "sign@4",
            "detail@1",
            "rank@1",
            "rank@2",
            "rank@4",
        ];
        NAMES[self.code() as usize]
    }

    /// The scale.
    pub const fn scale(self) -> ViewScale {
        match self {
            Self::Full | Self::Detail => ViewScale::One,
            Self::Stretch(scale) | Self::Sign(scale) | Self::Rank(scale) => scale,
        }
    }

    /// The shape (Z, Y, X) of the view of a volume of `shape`; `None` if the volume is too small for the scale.
    pub fn shape_of(self, shape: [usize; 3]) -> Option<[usize; 3]> {
        self.scale().shape_of(shape)
    }

    /// The mapped copy of a volume; `None` if the volume is too small for the view's scale.
    ///
    /// ```
    /// use hlac::{View, Voxels};
    ///
    /// let slice: Vec<u8> = (0..512).map(|i| (i / 64 + i / 8 % 8 + i % 8) as u8).collect();
    /// let voxels = Voxels::new(&slice, [8, 8, 8])?;
    /// let view = "stretch@2".parse::<View>()?.apply(voxels).ok_or("too small")?;
    /// assert_eq!((view.shape(), view.as_voxels().as_slice()[0]), ([4, 4, 4], 2));
    /// assert!("stretch@4".parse::<View>()?.apply(voxels).is_none());
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn apply(self, volume: Voxels<'_>) -> Option<VoxelBuf> {
        let mut copies = Copies::new(volume);
        let shape = self.shape_of(volume.shape())?;
        let voxels = match self {
            Self::Full => volume.as_slice().to_vec(),
            Self::Stretch(scale) => copies.stretch(scale)?.to_vec(),
            Self::Sign(scale) => copies.contrast(scale)?.signs(),
            Self::Detail => copies.contrast(ViewScale::One)?.detail(),
            Self::Rank(scale) => copies.rank(scale)?,
        };
        VoxelBuf::new(voxels, shape).ok()
    }
}

impl fmt::Display for View {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(self.name())
    }
}

/// There is no view of this name.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
#[error("there is no view {name:?}; the views are full@1, stretch@1, @2, @4, sign@1, @2, @4, detail@1, rank@1, @2, @4")]
pub struct UnknownView {
    /// The name given.
    pub name: String,
}

impl FromStr for View {
    type Err = UnknownView;

    fn from_str(name: &str) -> Result<Self, UnknownView> {
        let known = Self::ALL.into_iter().find(|view| view.name() == name);
        known.ok_or_else(|| UnknownView { name: name.to_owned() })
    }
}

impl From<View> for String {
    fn from(view: View) -> Self {
        view.name().to_owned()
    }
}

impl TryFrom<String> for View {
    type Error = UnknownView;

    fn try_from(name: String) -> Result<Self, UnknownView> {
        name.parse()
    }
}

/// The octant sums of several views of one volume, in the order given, on the calling thread.
///
/// Views that the volume is too small for are left out. Intermediate volumes that views share (the stretched volume, its
/// block averages, the differences from the neighbourhood) are computed once. The sums of `full@1` are those of
/// [`extract`](crate::extract).
///
/// ```
/// use hlac::{View, Voxels};
///
/// let slice: Vec<u8> = (0..9 * 10 * 11).map(|i| (i * i % 251) as u8).collect();
/// let voxels = Voxels::new(&slice, [9, 10, 11])?;
/// let described = hlac::describe(voxels, &View::STANDARD);
/// let views: Vec<&str> = described.iter().map(|(view, _)| view.name()).collect();
/// assert_eq!(views, ["full@1", "stretch@1", "stretch@2", "sign@1", "sign@2", "detail@1"]);
/// assert_eq!(described[0].1, hlac::extract(voxels));
/// # Ok::<(), hlac::ExtractError>(())
/// ```
pub fn describe(volume: Voxels<'_>, views: &[View]) -> Vec<(View, OctantSums)> {
    let mut copies = Copies::new(volume);
    views.iter().filter_map(|&view| Some((view, copies.octants(view)?))).collect()
}

/// A grey volume and the intermediate volumes that its views share, each computed at its first use.
struct Copies<'a> {
    grey: Voxels<'a>,
    stretch: [Option<Cow<'a, [u8]>>; 3],
    contrast: [Option<Contrast>; 3],
}

impl<'a> Copies<'a> {
    fn new(grey: Voxels<'a>) -> Self {
        Self { grey, stretch: [const { None }; 3], contrast: [const { None }; 3] }
    }

    /// The voxels of `stretch@scale`.
    fn stretch(&mut self, scale: ViewScale) -> Option<&[u8]> {
        let at = scale as usize;
        if self.stretch[at].is_none() {
            let shape = self.grey.shape();
            scale.shape_of(shape)?;
            let stretched = match scale {
                ViewScale::One => maps::stretch(self.grey.as_slice()),
                ViewScale::Two => Cow::Owned(maps::block_average::<2>(shape, self.stretch(ViewScale::One)?)),
                ViewScale::Four => Cow::Owned(maps::block_average::<4>(shape, self.stretch(ViewScale::One)?)),
            };
            self.stretch[at] = Some(stretched);
        }
        self.stretch[at].as_deref()
    }

    /// The differences from the neighbourhood in `stretch@scale`.
    fn contrast(&mut self, scale: ViewScale) -> Option<&Contrast> {
        let at = scale as usize;
        if self.contrast[at].is_none() {
            let shape = scale.shape_of(self.grey.shape())?;
            self.contrast[at] = Some(Contrast::of(shape, self.stretch(scale)?));
        }
        self.contrast[at].as_ref()
    }

    /// The voxels of `rank@scale`.
    fn rank(&mut self, scale: ViewScale) -> Option<Vec<u8>> {
        match scale {
            ViewScale::One => Some(maps::rank(self.grey.as_slice())),
            _ => self.stretch(scale).map(maps::rank),
        }
    }

    fn octants(&mut self, view: View) -> Option<OctantSums> {
        let shape = view.shape_of(self.grey.shape())?;
        let sums = |voxels: &[u8]| kernel::sums(&Input::whole(shape, 1, voxels));
        Some(match view {
            View::Full => sums(self.grey.as_slice()),
            View::Sign(scale) => kernel::binary_sums(&Input::whole(shape, 1, &self.contrast(scale)?.signs())),
            View::Stretch(scale) => sums(self.stretch(scale)?),
            View::Detail => sums(&self.contrast(ViewScale::One)?.detail()),
            View::Rank(scale) => sums(&self.rank(scale)?),
        })
    }
}

#[cfg(test)]
mod tests;
