//! Samples without a header, whose layout the caller gives.
//!
//! Nothing in such a file can be checked but its length, so the length must be exact: bytes left over mean that the
//! shape, the type or the offset is wrong, and the volume would be noise.

use std::path::Path;

use super::{Format, FormatInfo, Head, VolumeReader};
use crate::layout::{Axes, DataLayout, dense, open_file};
use crate::{RawLayout, ReadOptions, VolumeError};

pub(super) struct Raw;

static INFO: FormatInfo = FormatInfo::new(
    "raw",
    "raw samples",
    "Samples of one channel without a header, whose shape, type and offset the caller gives.",
)
.extensions(&[".raw", ".bin", ".dat"])
.needs_layout();

impl Format for Raw {
    fn info(&self) -> &'static FormatInfo {
        &INFO
    }

    fn sniff(&self, _: &Head) -> bool {
        false
    }

    fn open(&self, path: &Path, options: &ReadOptions) -> Result<Box<dyn VolumeReader>, VolumeError> {
        let Some(raw) = options.raw else {
            return Err(VolumeError::UnknownFormat { start: String::new(), recognised: String::new() });
        };
        let layout = layout(path, &raw, options.max_voxels)?;
        let io = |source| VolumeError::Io { doing: "reading the length of the file", source };
        let length = open_file(path)?.metadata().map_err(io)?.len();
        let RawLayout { shape, samples, offset, .. } = raw;
        if offset > 0 && offset >= length {
            return Err(VolumeError::RawOffset { length, offset });
        }
        let end = offset.saturating_add(layout.bytes());
        if length > end {
            return Err(VolumeError::RawLength { left_over: length - end, length, shape, samples, offset });
        }
        layout.open()
    }
}

fn layout(path: &Path, raw: &RawLayout, max_voxels: u64) -> Result<DataLayout, VolumeError> {
    let mut axes = dense(raw.shape.iter().rev().map(|&side| side as u64));
    axes.reverse();
    let axes = Axes::new(&axes, None, max_voxels)?;
    Ok(DataLayout::raw(path.into(), raw.offset, axes, raw.samples, raw.endian))
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
        let options = ReadOptions::new().raw(layout);
        let read =
            |name: &str, bytes: &[u8]| read_any(&folder.write(name, bytes), &options).map_err(|error| error.error);
        let bytes = [&b"ab"[..], &encode(&samples(), SampleType::I32, Endian::Big)].concat();
        for name in ["bare.raw", "bare", "bare.xyz"] {
            let (found, source) = read(name, &bytes).unwrap();
            assert_eq!((found, source.format), (volume(), "raw"));
        }
        let left_over = read("bare.raw", &[&bytes[..], &[0]].concat()).unwrap_err().to_string();
        assert!(left_over.starts_with("1 bytes are left over after the samples, but shape [3, 4, 5]"), "{left_over}");
        let short = read("bare.raw", &bytes[1..]).unwrap_err();
        assert!(matches!(short, VolumeError::Truncated { expected: 240, found: 239 }), "{short}");
        let beyond = read("bare.raw", b"").unwrap_err();
        assert!(matches!(beyond, VolumeError::RawOffset { length: 0, offset: 2 }), "{beyond}");
    }

    #[test]
    fn a_layout_is_checked_as_a_header_is() {
        let folder = Folder::new();
        let path = folder.write("bare.raw", b"");
        let refused = |shape, offset| {
            let layout = RawLayout { shape, samples: SampleType::F64, endian: Endian::Big, offset };
            read_any(&path, &ReadOptions::new().raw(layout)).unwrap_err().error
        };
        assert!(matches!(refused([usize::MAX; 3], 0), VolumeError::TooLarge { .. }));
        assert!(matches!(refused([2, 9, 9], 0), VolumeError::TooSmall { .. }));
        assert!(matches!(refused(SHAPE, u64::MAX), VolumeError::RawOffset { .. }));
    }
}
