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
    extent(path, layout, options)?.read(options)
}

/// Where a layout finds the samples of a file, all of which it must use up.
pub(super) fn extent(path: &Path, layout: &RawLayout, options: &ReadOptions) -> Result<Extent, VolumeError> {
    let extent = laid_out(path, layout, options)?;
    let io = |source| VolumeError::Io { doing: "asking for the length of the file", source };
    let length = decode::open(path)?.metadata().map_err(io)?.len();
    if layout.offset > 0 && layout.offset >= length {
        return Err(VolumeError::Malformed {
            found: format!("the file has {length} bytes, and --raw-offset {} is at or beyond its end", layout.offset),
            expected: "the samples should begin within it: check --raw-offset".into(),
        });
    }
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
    Ok(extent)
}

fn laid_out(path: &Path, layout: &RawLayout, options: &ReadOptions) -> Result<Extent, VolumeError> {
    let mut axes = dense(layout.shape.iter().rev().map(|&side| side as u64));
    axes.reverse();
    Ok(Extent {
        kind: FileKind::Raw,
        file: path.into(),
        start: Start::At(layout.offset),
        encoding: Encoding::Raw,
        skip: 0,
        axes: Axes::new(&axes, None, options.max_voxels)?,
        samples: layout.samples,
        endian: layout.endian,
        scaling: Scaling::IDENTITY,
        spacing: None,
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::{Folder, SHAPE, encode, samples, volume};
    use crate::{Endian, SampleType, read as read_any};

    #[test]
    fn a_layout_must_use_up_the_file() {
        let folder = Folder::new();
        let layout = RawLayout { shape: SHAPE, samples: SampleType::I32, endian: Endian::Big, offset: 2 };
        let options = ReadOptions { raw: Some(layout), ..ReadOptions::default() };
        let read =
            |name: &str, bytes: &[u8]| read_any(&folder.write(name, bytes), &options).map_err(|error| error.error);
        let bytes = [&b"ab"[..], &encode(&samples(), SampleType::I32, Endian::Big)].concat();
        for name in ["bare.raw", "bare", "bare.xyz"] {
            let (found, source) = read(name, &bytes).unwrap();
            assert_eq!((found, source.kind), (volume(), FileKind::Raw));
        }
        let left_over = read("bare.raw", &[&bytes[..], &[0]].concat()).unwrap_err().to_string();
        assert!(left_over.starts_with("1 bytes are left over after the samples, but shape [3, 4, 5]"), "{left_over}");
        let short = read("bare.raw", &bytes[1..]).unwrap_err();
        assert!(matches!(short, VolumeError::Truncated { expected: 240, found: 239 }), "{short}");
        let beyond = read("bare.raw", b"").unwrap_err().to_string();
        assert!(beyond.contains("--raw-offset 2 is at or beyond its end"), "{beyond}");
    }

    #[test]
    fn a_layout_is_checked_as_a_header_is() {
        let folder = Folder::new();
        let path = folder.write("bare.raw", b"");
        let refused = |shape, offset| {
            let layout = RawLayout { shape, samples: SampleType::F64, endian: Endian::Big, offset };
            read_any(&path, &ReadOptions { raw: Some(layout), ..ReadOptions::default() }).unwrap_err().error
        };
        assert!(matches!(refused([usize::MAX; 3], 0), VolumeError::TooLarge { .. }));
        assert!(matches!(refused([2, 9, 9], 0), VolumeError::TooSmall { .. }));
        assert!(matches!(refused(SHAPE, u64::MAX), VolumeError::Malformed { .. }));
    }
}
