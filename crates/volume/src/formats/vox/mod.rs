//! MagicaVoxel models, `.vox`: colours on a grid.
//!
//! A model becomes a colour volume through its palette; cells without a voxel are black. MagicaVoxel counts x to the
//! right, y into the depth and z upwards: voxel (x, y, z) of the model is voxel `[z, y, x]` of the volume, whose shape is
//! (size z, size y, size x). Alpha and materials are ignored.
//!
//! A file must hold one model: several are an animation or the parts of a scene. A scene that moves or turns the model is
//! ignored.
//!
//! The `dot_vox` crate parses the model. It descends into nested chunks as deep as a file says, so the chunks are
//! checked first, and it gets a copy that holds only those of one model: size, voxels and palette.
//!
//! Format: <https://github.com/ephtracy/voxel-model/blob/master/MagicaVoxel-file-format-vox.txt>

use std::path::Path;

use self::magic::MAGIC;
use super::{Format, FormatInfo, Head, VolumeReader};
use crate::{ReadOptions, VolumeError};

pub(super) struct Vox;

static INFO: FormatInfo =
    FormatInfo::new("vox", "MagicaVoxel", "A MagicaVoxel model as a volume of its colours; one model in a file.")
        .extensions(&[".vox"])
        .feature("vox", cfg!(feature = "vox"));

impl Format for Vox {
    fn info(&self) -> &'static FormatInfo {
        &INFO
    }

    fn sniff(&self, head: &Head) -> bool {
        head.bytes().starts_with(MAGIC)
    }

    #[cfg(feature = "vox")]
    fn open(&self, path: &Path, options: &ReadOptions) -> Result<Box<dyn VolumeReader>, VolumeError> {
        Ok(Box::new(model::ModelReader::open(path, options)?))
    }

    #[cfg(not(feature = "vox"))]
    fn open(&self, _: &Path, _: &ReadOptions) -> Result<Box<dyn VolumeReader>, VolumeError> {
        Err(INFO.disabled())
    }
}

mod magic;
#[cfg(feature = "vox")]
mod model;
