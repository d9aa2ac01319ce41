//! [`LayoutReader`]: the samples of a data layout, by planes and boxes.

use std::ops::Range;

use super::bytes::{SampleBytes, zeros};
use super::data_layout::{DataLayout, Encoding, Meaning};
use super::region::Region;
use crate::formats::{Access, VolumeHeader, VolumeReader};
use crate::samples::make_little;
use crate::{Endian, Shape, VolumeError};

/// Reads the samples of a layout.
pub(super) struct LayoutReader {
    header: VolumeHeader,
    bytes: SampleBytes,
}

impl LayoutReader {
    pub(super) fn open(layout: DataLayout) -> Result<Self, VolumeError> {
        let mut header = VolumeHeader::new(layout.axes.shape, layout.axes.channels, layout.samples);
        header.calibration = layout.calibration;
        header.spacing = layout.spacing;
        Ok(Self { header, bytes: SampleBytes::open(layout)? })
    }

    /// Appends the samples of a box, in the byte order of the file.
    fn append_stored(&mut self, region: &Region, out: &mut Vec<u8>) -> Result<(), VolumeError> {
        let size = self.header.samples.size();
        let at = |samples: usize| samples as u64 * size as u64;
        if region.is_one_run() {
            return self.bytes.append(at(region.from), at(region.count()), out);
        }
        let mut target = zeros(region.count() * size)?;
        let mut span = Vec::new();
        region.parts(size, &mut |part| {
            span.clear();
            self.bytes.append(at(part.from), at(part.span()), &mut span)?;
            part.scatter(size, &span, &mut target);
            Ok(())
        })?;
        if out.is_empty() {
            *out = target;
        } else {
            out.append(&mut target);
        }
        Ok(())
    }
}

impl VolumeReader for LayoutReader {
    fn header(&self) -> &VolumeHeader {
        &self.header
    }

    fn access(&self) -> Access {
        match self.bytes.layout().axes.planes_in_order() {
            false => Access::Whole,
            true if self.bytes.is_direct() => Access::Direct,
            true => Access::Sequential,
        }
    }

    fn compressed_bytes(&self) -> Option<u64> {
        self.bytes.layout().encoding.is_compressed().then_some(self.bytes.length)
    }

    fn read_planes(&mut self, planes: Range<usize>, out: &mut Vec<u8>) -> Result<(), VolumeError> {
        let [_, height, width] = self.header.shape;
        self.read_block([planes.start, 0, 0], [planes.len(), height, width], out)
    }

    fn read_block(&mut self, origin: Shape, shape: Shape, out: &mut Vec<u8>) -> Result<(), VolumeError> {
        let DataLayout { axes, samples, endian, encoding, meaning, .. } = *self.bytes.layout();
        let start = out.len();
        self.append_stored(&Region::new(&axes, origin, shape), out)?;
        let appended = out.get_mut(start..).unwrap_or_default();
        // Numbers from text are little-endian whatever the header says.
        make_little(appended, samples, if encoding == Encoding::Text { Endian::Little } else { endian });
        match meaning {
            Meaning::Numbers => {}
            Meaning::Truth => appended.iter_mut().for_each(|byte| *byte = if *byte == 0 { 0 } else { 255 }),
            // The largest unsigned number less `v` is `v` with all bits inverted.
            #[cfg(feature = "tiff")]
            Meaning::Inverted => appended.iter_mut().for_each(|byte| *byte = !*byte),
        }
        Ok(())
    }
}

impl DataLayout {
    /// Opens the file of the samples; none of them are read.
    ///
    /// # Errors
    /// [`VolumeError::Truncated`] if the file is too short for samples that are not compressed,
    /// [`VolumeError::FeatureDisabled`], [`VolumeError::NotAFile`], [`VolumeError::Io`].
    pub(crate) fn open(self) -> Result<Box<dyn VolumeReader>, VolumeError> {
        Ok(Box::new(LayoutReader::open(self)?))
    }
}

#[cfg(test)]
mod tests {
    use super::super::{Axes, dense};
    use super::*;
    use crate::SampleType;
    use crate::testing::{Folder, SHAPE, encode, samples};

    #[test]
    fn boxes_are_read_where_they_lie() {
        let folder = Folder::new();
        let bytes = [&b"before"[..], &encode(&samples(), SampleType::U16, Endian::Big)].concat();
        let file = folder.write("bare", &bytes);
        let mut axes = dense(SHAPE.iter().rev().map(|&side| side as u64));
        axes.reverse();
        let axes = Axes::of_array(&axes, u64::MAX).unwrap();
        let mut reader = DataLayout::raw(file, 6, axes, SampleType::U16, Endian::Big).open().unwrap();
        assert_eq!((reader.access(), reader.compressed_bytes()), (Access::Direct, None));
        let mut read = |origin, shape| {
            let mut out = Vec::new();
            reader.read_block(origin, shape, &mut out).unwrap();
            out
        };
        let value =
            |z: usize, y: usize, x: usize| if (z, y, x) == (2, 3, 4) { 255 } else { (z * 67 + y * 31 + x * 7) as u8 };
        assert_eq!(read([1, 2, 3], [1, 1, 1]), [value(1, 2, 3), 0]);
        assert_eq!(read([2, 3, 3], [1, 1, 2]), [value(2, 3, 3), 0, 255, 0]);
        let column: Vec<u8> = (0..3).flat_map(|z| [value(z, 1, 4), 0]).collect();
        assert_eq!(read([0, 1, 4], [3, 1, 1]), column);
    }
}
