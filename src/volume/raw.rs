//! Bare samples, whose layout the caller gives.
//!
//! Nothing in such a file can be checked but its length, so the length must be exact: what is left over says that shape,
//! type or offset are wrong, and the texture would be nonsense.

use std::path::Path;

use super::extent::{Axes, Encoding, Extent, Start, dense};
use super::levels::Scaling;
use super::{FileKind, RawLayout, ReadOptions, Source, Volume, VolumeError, decode};

/// The volume that a layout finds in a file.
pub(super) fn read(path: &Path, layout: &RawLayout, options: &ReadOptions) -> Result<(Volume, Source), VolumeError> {
    let extent = extent(path, layout, options)?;
    let io = |source| VolumeError::Io { doing: "asking for the length of the file", source };
    let length = decode::open(path)?.metadata().map_err(io)?.len();
    let end = layout.offset.saturating_add(extent.bytes());
    if length > end {
        return Err(VolumeError::Malformed {
            found: format!("{} bytes are left over after the samples", length - end),
            expected: format!(
                "shape {:?}, type {} and offset {} must use up all {length} bytes: check --raw-shape, --raw-type and --raw-offset",
                layout.shape, layout.samples, layout.offset
            ),
        });
    }
    extent.read(options)
}

fn extent(path: &Path, layout: &RawLayout, options: &ReadOptions) -> Result<Extent, VolumeError> {
    let mut axes = dense(layout.shape.iter().rev().map(|&side| side as u64));
    axes.reverse();
    Ok(Extent {
        kind: FileKind::Raw,
        file: path.into(),
        start: Start::At(layout.offset),
        encoding: Encoding::Raw,
        skip: 0,
        axes: Axes::new(&axes, options.max_voxels)?,
        samples: layout.samples,
        endian: layout.endian,
        scaling: Scaling::IDENTITY,
        spacing: None,
    })
}
