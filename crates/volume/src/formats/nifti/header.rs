//! The header of a NIfTI file: NIfTI-1, NIfTI-2, or Analyze 7.5.

use crate::layout::{Axes, dense};
use crate::rescaling::Calibration;
use crate::{Endian, LengthUnit, ReadOptions, SampleType, VolumeError, VoxelSpacing};

/// Bytes of a NIfTI-1 (and Analyze) header.
pub(super) const SIZE_1: usize = 348;

/// Bytes of a NIfTI-2 header.
pub(super) const SIZE_2: usize = 540;

/// The variant of the format.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Form {
    Analyze,
    Nifti1 { pair: bool },
    Nifti2 { pair: bool },
}

impl Form {
    /// The form and byte order of a header, by its first number (its own size) and its magic.
    pub(super) fn of(header: &[u8]) -> Option<(Self, Endian)> {
        let size: [u8; 4] = *header.first_chunk()?;
        let sized = |size_of: usize| match size_of as u32 {
            expected if u32::from_le_bytes(size) == expected => Some(Endian::Little),
            expected if u32::from_be_bytes(size) == expected => Some(Endian::Big),
            _ => None,
        };
        if let Some(endian) = sized(SIZE_2) {
            return match header.get(4..8)? {
                b"n+2\0" => Some((Self::Nifti2 { pair: false }, endian)),
                b"ni2\0" => Some((Self::Nifti2 { pair: true }, endian)),
                _ => None,
            };
        }
        let endian = sized(SIZE_1)?;
        match header.get(SIZE_1 - 4..SIZE_1)? {
            b"n+1\0" => Some((Self::Nifti1 { pair: false }, endian)),
            b"ni1\0" => Some((Self::Nifti1 { pair: true }, endian)),
            _ => Some((Self::Analyze, endian)),
        }
    }

    /// Whether the samples are in a file of their own.
    pub(super) fn is_pair(self) -> bool {
        match self {
            Self::Analyze => true,
            Self::Nifti1 { pair } | Self::Nifti2 { pair } => pair,
        }
    }
}

/// What a header says of the samples.
pub(super) struct NiftiHeader {
    pub(super) form: Form,
    pub(super) endian: Endian,
    dim: [i64; 8],
    datatype: i16,
    /// Distances along i, j, k.
    steps: [f64; 3],
    /// The code of their unit.
    units: i32,
    offset: f64,
    pub(super) calibration: Option<Calibration>,
}

impl NiftiHeader {
    /// The header in the first bytes of a file; `None` if they are none.
    pub(super) fn parse(bytes: &[u8]) -> Option<Self> {
        let (form, endian) = Form::of(bytes)?;
        let field = Numbers { bytes, endian };
        let (dim, steps) = ([0; 8], [0.0; 3]);
        let mut header = Self { form, endian, dim, datatype: 0, steps, units: 0, offset: 0.0, calibration: None };
        if let Form::Nifti2 { .. } = form {
            for (axis, length) in header.dim.iter_mut().enumerate() {
                *length = i64::from_le_bytes(field.at(16 + 8 * axis)?);
            }
            for (axis, step) in header.steps.iter_mut().enumerate() {
                *step = f64::from_le_bytes(field.at(112 + 8 * axis)?);
            }
            header.datatype = i16::from_le_bytes(field.at(12)?);
            header.offset = i64::from_le_bytes(field.at(168)?) as f64;
            header.units = i32::from_le_bytes(field.at(500)?);
            header.calibration =
                Calibration::new(f64::from_le_bytes(field.at(176)?), f64::from_le_bytes(field.at(184)?));
        } else {
            for (axis, length) in header.dim.iter_mut().enumerate() {
                *length = i16::from_le_bytes(field.at(40 + 2 * axis)?).into();
            }
            for (axis, step) in header.steps.iter_mut().enumerate() {
                *step = field.float(80 + 4 * axis)?;
            }
            header.datatype = i16::from_le_bytes(field.at(70)?);
            header.offset = field.float(108)?;
            // Analyze keeps other things in these places.
            if form != Form::Analyze {
                header.units = bytes.get(123).copied()?.into();
                header.calibration = Calibration::new(field.float(112)?, field.float(116)?);
            }
        }
        Some(header)
    }

    /// The axes (Z, Y, X) and colour.
    pub(super) fn axes(&self, options: &ReadOptions) -> Result<Axes, VolumeError> {
        let bad = || {
            let found = format!("the header's dimensions are {:?}", self.dim);
            VolumeError::malformed(found, "the first should count the axes, 1 to 7, and as many lengths should follow")
        };
        let count = usize::try_from(self.dim[0]).ok().filter(|count| (1..=7).contains(count)).ok_or_else(bad)?;
        let lengths = self.dim[1..=count].iter().map(|&length| u64::try_from(length).map_err(|_| bad()));
        let lengths = lengths.collect::<Result<Vec<_>, _>>()?;
        if let Some(&volumes) = lengths.get(3).filter(|&&volumes| volumes > 1) {
            return Err(VolumeError::SeveralVolumes { what: format!("a series of {volumes} volumes over time") });
        }
        // (i, j, k, time, vector, ...): at most one of the last ones may be longer than 1, and it is the colour axis.
        let mut axes = dense(lengths);
        let others = axes.split_off(axes.len().min(3)).into_iter().filter(|axis| axis.length != 1);
        axes.reverse();
        let axes = match others.collect::<Vec<_>>()[..] {
            [] => Axes::new(&axes, None, options.max_voxels)?,
            [channel] => Axes::new(&axes, Some(channel), options.max_voxels)?,
            _ => {
                return Err(VolumeError::Dimensions { found: self.dim[1..=count].iter().map(|&n| n as u64).collect() });
            }
        };
        match self.datatype {
            128 | 2304 if axes.channels != 1 => Err(bad()),
            128 => Ok(axes.interleaved(3)),
            2304 => Ok(axes.interleaved(4)),
            _ => Ok(axes),
        }
    }

    /// The type of the samples.
    pub(super) fn samples(&self) -> Result<SampleType, VolumeError> {
        Ok(match self.datatype {
            2 | 128 | 2304 => SampleType::U8,
            4 => SampleType::I16,
            8 => SampleType::I32,
            16 => SampleType::F32,
            64 => SampleType::F64,
            256 => SampleType::I8,
            512 => SampleType::U16,
            768 => SampleType::U32,
            1024 => SampleType::I64,
            1280 => SampleType::U64,
            other => {
                return Err(VolumeError::Unsupported {
                    what: format!("NIfTI data of type {other}"),
                    supported: "integers of 8 to 64 bits, 32 and 64 bit floats, RGB24 and RGBA32".into(),
                });
            }
        })
    }

    /// Where the samples begin in their file.
    pub(super) fn offset(&self) -> Result<u64, VolumeError> {
        if !(0.0..=i64::MAX as f64).contains(&self.offset) {
            let found = format!("the samples begin at byte {}", self.offset);
            return Err(VolumeError::malformed(found, "vox_offset should be 0 or more"));
        }
        // In a single file they follow the header and 4 bytes about extensions. Some writers leave the offset at 0.
        let least = match self.form {
            Form::Nifti1 { pair: false } => SIZE_1 + 4,
            Form::Nifti2 { pair: false } => SIZE_2 + 4,
            _ => 0,
        };
        Ok((self.offset as u64).max(least as u64))
    }

    /// The spacing, if the header gives it for all axes.
    pub(super) fn spacing(&self) -> Option<VoxelSpacing> {
        let [x, y, z] = self.steps.map(f64::abs);
        // The low bits are the unit of space, the others that of time.
        let unit = match self.units & 7 {
            1 => Some(LengthUnit::Meter),
            2 => Some(LengthUnit::Millimeter),
            3 => Some(LengthUnit::Micrometer),
            _ => None,
        };
        Some(VoxelSpacing::new([z, y, x])?.unit(unit))
    }
}

/// The numbers of a header, by their place.
struct Numbers<'a> {
    bytes: &'a [u8],
    endian: Endian,
}

impl Numbers<'_> {
    /// The bytes of a number, little-endian.
    fn at<const N: usize>(&self, place: usize) -> Option<[u8; N]> {
        let mut bytes: [u8; N] = *self.bytes.get(place..)?.first_chunk()?;
        if self.endian == Endian::Big {
            bytes.reverse();
        }
        Some(bytes)
    }

    fn float(&self, place: usize) -> Option<f64> {
        Some(f32::from_le_bytes(self.at(place)?).into())
    }
}

/// The size that a header says it has, if there are fewer bytes.
pub(super) fn cut_short(bytes: &[u8]) -> Option<usize> {
    let said: [u8; 4] = *bytes.first_chunk()?;
    let said = [u32::from_le_bytes(said), u32::from_be_bytes(said)];
    [SIZE_1, SIZE_2].into_iter().find(|&size| said.contains(&(size as u32)) && bytes.len() < size)
}
