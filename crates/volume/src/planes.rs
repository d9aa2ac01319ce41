//! [`Planes`]: the samples of a file plane by plane, in the order of Z, whatever its kind.

use super::extent::{Extent, PlaneStream};
use super::levels::Scaling;
use super::{Endian, FileKind, SampleType, Shape, Source, VolumeError, slices, tiff};

/// A file whose header has been read and checked, and whose planes can be read one after the other.
pub(super) enum Planes {
    /// One stretch of samples: how they lie, and the stream once it is begun.
    Extent {
        extent: Box<Extent>,
        /// Samples are truth values.
        truth: bool,
        stream: Option<PlaneStream>,
    },
    /// Pages of a TIFF file.
    Tiff(Box<tiff::Pages>),
    /// Pictures in a folder.
    Slices(slices::Stack),
}

impl Planes {
    /// Those of an extent; `None` where its planes do not follow one another.
    pub(super) fn of_extent(extent: Extent, truth: bool) -> Option<Self> {
        extent.has_planes().then(|| Self::Extent { extent: Box::new(extent), truth, stream: None })
    }

    /// The volume's shape (Z, Y, X).
    pub(super) fn shape(&self) -> Shape {
        match self {
            Self::Extent { extent, .. } => extent.axes.shape,
            Self::Tiff(pages) => pages.shape(),
            Self::Slices(stack) => stack.shape(),
        }
    }

    /// Samples per voxel, an alpha among them: 1, 3 or 4.
    pub(super) fn channels(&self) -> usize {
        match self {
            Self::Extent { extent, .. } => extent.axes.channels,
            Self::Tiff(pages) => pages.format().channels,
            Self::Slices(stack) => stack.format().channels,
        }
    }

    /// The byte order of the samples that [`next`](Self::next) gives.
    pub(super) fn endian(&self) -> Endian {
        match self {
            Self::Extent { extent, .. } => extent.endian,
            Self::Tiff(_) | Self::Slices(_) => Endian::NATIVE,
        }
    }

    /// From stored samples to units.
    pub(super) fn scaling(&self) -> Scaling {
        match self {
            Self::Extent { extent, .. } => extent.scaling,
            Self::Tiff(_) | Self::Slices(_) => Scaling::IDENTITY,
        }
    }

    /// Whether samples are truth values, which become black and white.
    pub(super) fn truth(&self) -> bool {
        matches!(self, Self::Extent { truth: true, .. })
    }

    /// What is known of the origin before the samples are: no mapping yet.
    pub(super) fn source(&self) -> Source {
        let (kind, spacing) = match self {
            Self::Extent { extent, .. } => (extent.kind, extent.spacing),
            Self::Tiff(pages) => (FileKind::Tiff, pages.spacing()),
            Self::Slices(_) => (FileKind::Slices, None),
        };
        Source { kind, samples: self.samples(), mapping: None, spacing }
    }

    fn samples(&self) -> SampleType {
        match self {
            Self::Extent { extent, .. } => extent.samples,
            Self::Tiff(pages) => pages.format().ty,
            Self::Slices(stack) => stack.format().ty,
        }
    }

    /// Goes back to the first plane.
    pub(super) fn rewind(&mut self) {
        match self {
            Self::Extent { stream, .. } => *stream = None,
            Self::Tiff(pages) => pages.rewind(),
            Self::Slices(stack) => stack.rewind(),
        }
    }

    /// The samples of the next `count` planes, X fastest, channels interleaved; `buffer` is their memory. There must be
    /// as many planes left.
    ///
    /// # Errors
    /// Those of reading the file whole.
    pub(super) fn next(&mut self, count: usize, mut buffer: Vec<u8>) -> Result<Vec<u8>, VolumeError> {
        buffer.clear();
        match self {
            Self::Extent { extent, stream, .. } => match stream {
                Some(stream) => stream.next(count, buffer),
                None => stream.insert(extent.planes()?).next(count, buffer),
            },
            Self::Tiff(pages) => pages.next(count, &mut buffer).map(|()| buffer),
            Self::Slices(stack) => stack.next(count, &mut buffer).map(|()| buffer),
        }
    }
}
