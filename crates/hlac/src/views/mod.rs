//! Views: mapped copies of a volume that are described by the same 251 masks.
//!
//! Vocabulary: a *view* is a mapping from a grey volume to a `u8` volume; its *scale* `s` (written `@s`) says that
//! blocks of `s` x `s` x `s` voxels are averaged first. All mappings are defined in integers (one, `detail@1`, in
//! exactly rounded `f64`), so that a view has the same bits on every machine. With `//` rounding down, `n` voxels,
//! histogram `h` and cumulative histogram `C`:
//!
//! | view | a voxel becomes |
//! |---|---|
//! | `full@1` | itself: the paper's descriptor |
//! | `stretch@1` | `(510 (v-a) + (b-a)) // (2 (b-a))`, clamped to 0..=255, with `a` the lowest level where `100 C >= n` and `b` the lowest where `100 C >= 99 n`, at least `a + 1` |
//! | `stretch@2`, `@4` | `(sum + s^3/2) // s^3` over blocks of `stretch@1`, sides cut to a multiple of `s` |
//! | `sign@1`, `@2`, `@4` | 255 where `d > 0`, else 0; `d` is 27 v minus the sum over the 3x3x3 neighbourhood in `stretch@s`, borders replicated |
//! | `detail@1` | `round(128 + 42 d / sd)`, half away from zero, clamped; `sd` the standard deviation of the `d` of `stretch@1`; 128 everywhere when `sd = 0` |
//! | `rank@1`, `@2`, `@4` | `(255 (2 C(v) - h(v)) + n) // (2 n)`, of `full@1` at scale 1, of `stretch@s` else |
//!
//! A scale above 1 that leaves fewer than [`MIN_SCALED_SIDE`] voxels on a side is left out: such a volume does not
//! have that view. Every volume has every view of scale 1.
//!
//! Names and codes are stored: they are frozen.

mod maps;

use std::borrow::Cow;
use std::fmt;
use std::str::FromStr;

use serde::{Deserialize, Serialize};

use self::maps::Contrast;
use crate::{OctantSums, VoxelBuf, Voxels, kernel};

/// The shortest side that a block average may leave: four voxels give every octant a window.
pub const MIN_SCALED_SIDE: usize = 4;

/// The side of the blocks that are averaged before a view is mapped.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Scale {
    /// Voxels as they are.
    One,
    /// Blocks of 2 x 2 x 2.
    Two,
    /// Blocks of 4 x 4 x 4.
    Four,
}

impl Scale {
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

    /// The shape that block averages leave of `shape`; `None` where a side would have fewer than
    /// [`MIN_SCALED_SIDE`] voxels (never at scale 1).
    pub fn of(self, shape: [usize; 3]) -> Option<[usize; 3]> {
        let scaled = shape.map(|side| side / self.side());
        (self == Self::One || scaled.iter().all(|&side| side >= MIN_SCALED_SIDE)).then_some(scaled)
    }
}

/// A mapped copy of a volume. Ordered by [`View::code`].
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[serde(into = "String", try_from = "String")]
pub enum View {
    /// The volume as stored.
    Full,
    /// Levels stretched between the 1st and 99th percentile.
    Stretch(Scale),
    /// Lighter than its neighbourhood, or not: fine grain without contrast.
    Sign(Scale),
    /// The difference from the neighbourhood in units of its own deviation.
    Detail,
    /// Levels replaced by their rank.
    Rank(Scale),
}

impl View {
    /// All views, by code.
    pub const ALL: [Self; 11] = [
        Self::Full,
        Self::Stretch(Scale::One),
        Self::Stretch(Scale::Two),
        Self::Stretch(Scale::Four),
        Self::Sign(Scale::One),
        Self::Sign(Scale::Two),
        Self::Sign(Scale::Four),
        Self::Detail,
        Self::Rank(Scale::One),
        Self::Rank(Scale::Two),
        Self::Rank(Scale::Four),
    ];

    /// The seven views of the default space, by code.
    pub const LIKENESS: [Self; 7] = [
        Self::Stretch(Scale::One),
        Self::Stretch(Scale::Two),
        Self::Stretch(Scale::Four),
        Self::Sign(Scale::One),
        Self::Sign(Scale::Two),
        Self::Sign(Scale::Four),
        Self::Detail,
    ];

    /// What a store keeps unless told otherwise: `full@1` and the seven of [`View::LIKENESS`], by code.
    pub const DEFAULT_STORED: [Self; 8] = [
        Self::Full,
        Self::Stretch(Scale::One),
        Self::Stretch(Scale::Two),
        Self::Stretch(Scale::Four),
        Self::Sign(Scale::One),
        Self::Sign(Scale::Two),
        Self::Sign(Scale::Four),
        Self::Detail,
    ];

    /// The number that stands for the view in files: its place in [`View::ALL`]. Frozen.
    pub const fn code(self) -> u8 {
        match self {
            Self::Full => 0,
            Self::Stretch(scale) => 1 + scale as u8,
            Self::Sign(scale) => 4 + scale as u8,
            Self::Detail => 7,
            Self::Rank(scale) => 8 + scale as u8,
        }
    }

    /// The view of a code; `None` for numbers that stand for none.
    pub fn from_code(code: u8) -> Option<Self> {
        Self::ALL.get(usize::from(code)).copied()
    }

    /// The name, e.g. `stretch@2`. Frozen.
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
    pub const fn scale(self) -> Scale {
        match self {
            Self::Full | Self::Detail => Scale::One,
            Self::Stretch(scale) | Self::Sign(scale) | Self::Rank(scale) => scale,
        }
    }

    /// The shape of the view of a volume of `shape`; `None` where the volume is too small for the scale.
    pub fn shape_of(self, shape: [usize; 3]) -> Option<[usize; 3]> {
        self.scale().of(shape)
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
            Self::Detail => copies.contrast(Scale::One)?.detail(),
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

/// A name that no view has.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error(
    "there is no view {found:?}; the views are full@1, stretch@1, @2, @4, sign@1, @2, @4, detail@1, rank@1, @2, @4"
)]
pub struct UnknownView {
    /// What was found.
    pub found: String,
}

impl FromStr for View {
    type Err = UnknownView;

    fn from_str(name: &str) -> Result<Self, UnknownView> {
        let known = Self::ALL.into_iter().find(|view| view.name() == name);
        known.ok_or_else(|| UnknownView { found: name.to_owned() })
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

/// The octant sums of several views of one volume, in the order asked for. Views that the volume is too small for are
/// left out.
///
/// What views have in common (the stretched volume, its block averages, the differences from the neighbourhood) is
/// made once. The sums of `full@1` are those of
/// [`extract`](super::extract).
///
/// ```
/// use hlac::{View, Voxels};
///
/// let slice: Vec<u8> = (0..9 * 10 * 11).map(|i| (i * i % 251) as u8).collect();
/// let voxels = Voxels::new(&slice, [9, 10, 11])?;
/// let described = hlac::describe(voxels, &View::DEFAULT_STORED);
/// let views: Vec<&str> = described.iter().map(|(view, _)| view.name()).collect();
/// assert_eq!(views, ["full@1", "stretch@1", "stretch@2", "sign@1", "sign@2", "detail@1"]);
/// assert_eq!(described[0].1, hlac::extract(voxels));
/// # Ok::<(), hlac::ExtractError>(())
/// ```
pub fn describe(volume: Voxels<'_>, views: &[View]) -> Vec<(View, OctantSums)> {
    let mut copies = Copies::new(volume);
    views.iter().filter_map(|&view| Some((view, copies.octants(view)?))).collect()
}

/// One grey volume and the copies that its views share, each made when first asked for.
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
    fn stretch(&mut self, scale: Scale) -> Option<&[u8]> {
        let at = scale as usize;
        if self.stretch[at].is_none() {
            let shape = self.grey.shape();
            scale.of(shape)?;
            let made = match scale {
                Scale::One => maps::stretch(self.grey.as_slice()),
                Scale::Two => Cow::Owned(maps::block_average::<2>(shape, self.stretch(Scale::One)?)),
                Scale::Four => Cow::Owned(maps::block_average::<4>(shape, self.stretch(Scale::One)?)),
            };
            self.stretch[at] = Some(made);
        }
        self.stretch[at].as_deref()
    }

    /// The differences from the neighbourhood in `stretch@scale`.
    fn contrast(&mut self, scale: Scale) -> Option<&Contrast> {
        let at = scale as usize;
        if self.contrast[at].is_none() {
            let shape = scale.of(self.grey.shape())?;
            self.contrast[at] = Some(Contrast::of(shape, self.stretch(scale)?));
        }
        self.contrast[at].as_ref()
    }

    /// The voxels of `rank@scale`.
    fn rank(&mut self, scale: Scale) -> Option<Vec<u8>> {
        match scale {
            Scale::One => Some(maps::rank(self.grey.as_slice())),
            _ => self.stretch(scale).map(maps::rank),
        }
    }

    fn octants(&mut self, view: View) -> Option<OctantSums> {
        let shape = view.shape_of(self.grey.shape())?;
        Some(match view {
            View::Full => kernel::octants(shape, self.grey.as_slice()),
            View::Sign(scale) => kernel::octants_binary(shape, &self.contrast(scale)?.signs()),
            View::Stretch(scale) => kernel::octants(shape, self.stretch(scale)?),
            View::Detail => kernel::octants(shape, &self.contrast(Scale::One)?.detail()),
            View::Rank(scale) => kernel::octants(shape, &self.rank(scale)?),
        })
    }
}

#[cfg(test)]
mod tests;
