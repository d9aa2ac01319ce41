//! What the tests of readers share: samples as bytes, a volume that no wrong reader yields, files in a folder.

use std::path::{Path, PathBuf};

use half::f16;
use tempfile::TempDir;

use crate::{Endian, ReadOptions, SampleType, Shape, Volume, VolumeError, VolumeSource};

/// The shape of [`volume`]: no two sides are alike.
pub(crate) const SHAPE: Shape = [3, 4, 5];

/// A volume without mirror symmetry along any axis, with levels from 0 to 255.
pub(crate) fn volume() -> Volume {
    Volume::from_fn(SHAPE, |z, y, x| if (z, y, x) == (2, 3, 4) { 255 } else { (z * 67 + y * 31 + x * 7) as u8 })
        .unwrap()
}

/// The samples of [`volume`].
pub(crate) fn samples() -> Vec<f64> {
    volume().voxels().iter().map(|&voxel| f64::from(voxel)).collect()
}

/// Samples in memory, cast to a type as `as` does.
pub(crate) fn encode(samples: &[f64], ty: SampleType, endian: Endian) -> Vec<u8> {
    let mut bytes = Vec::new();
    for &v in samples {
        let at = bytes.len();
        match ty {
            SampleType::U8 => bytes.extend((v as u8).to_le_bytes()),
            SampleType::I8 => bytes.extend((v as i8).to_le_bytes()),
            SampleType::U16 => bytes.extend((v as u16).to_le_bytes()),
            SampleType::I16 => bytes.extend((v as i16).to_le_bytes()),
            SampleType::U32 => bytes.extend((v as u32).to_le_bytes()),
            SampleType::I32 => bytes.extend((v as i32).to_le_bytes()),
            SampleType::U64 => bytes.extend((v as u64).to_le_bytes()),
            SampleType::I64 => bytes.extend((v as i64).to_le_bytes()),
            SampleType::F16 => bytes.extend(f16::from_f64(v).to_le_bytes()),
            SampleType::F32 => bytes.extend((v as f32).to_le_bytes()),
            SampleType::F64 => bytes.extend(v.to_le_bytes()),
        }
        if endian == Endian::Big {
            bytes[at..].reverse();
        }
    }
    bytes
}

/// The value of one sample.
pub(crate) fn value(bytes: &[u8], ty: SampleType, endian: Endian) -> f64 {
    let mut le = bytes.to_vec();
    if endian == Endian::Big {
        le.reverse();
    }
    match ty {
        SampleType::U8 => f64::from(le[0]),
        SampleType::I8 => f64::from(le[0] as i8),
        SampleType::U16 => f64::from(u16::from_le_bytes(le.try_into().unwrap())),
        SampleType::I16 => f64::from(i16::from_le_bytes(le.try_into().unwrap())),
        SampleType::U32 => f64::from(u32::from_le_bytes(le.try_into().unwrap())),
        SampleType::I32 => f64::from(i32::from_le_bytes(le.try_into().unwrap())),
        SampleType::U64 => u64::from_le_bytes(le.try_into().unwrap()) as f64,
        SampleType::I64 => i64::from_le_bytes(le.try_into().unwrap()) as f64,
        SampleType::F16 => f16::from_le_bytes(le.try_into().unwrap()).to_f64(),
        SampleType::F32 => f64::from(f32::from_le_bytes(le.try_into().unwrap())),
        SampleType::F64 => f64::from_le_bytes(le.try_into().unwrap()),
    }
}

/// A folder that goes away with the test.
pub(crate) struct Folder(TempDir);

impl Folder {
    pub(crate) fn new() -> Self {
        Self(TempDir::new().unwrap())
    }

    pub(crate) fn path(&self) -> &Path {
        self.0.path()
    }

    /// Writes a file into the folder.
    pub(crate) fn write(&self, name: &str, bytes: impl AsRef<[u8]>) -> PathBuf {
        let path = self.path().join(name);
        std::fs::write(&path, bytes).unwrap();
        path
    }

    /// Writes a file and reads it.
    pub(crate) fn read(&self, name: &str, bytes: impl AsRef<[u8]>) -> Result<(Volume, VolumeSource), VolumeError> {
        read(&self.write(name, bytes))
    }
}

/// Reads a file with the default options.
pub(crate) fn read(path: &Path) -> Result<(Volume, VolumeSource), VolumeError> {
    crate::read(path, &ReadOptions::default()).map_err(|error| error.error)
}

/// Bytes as gzip writes them.
pub(crate) fn gzip(bytes: &[u8]) -> Vec<u8> {
    let mut encoder = flate2::write::GzEncoder::new(Vec::new(), flate2::Compression::fast());
    std::io::Write::write_all(&mut encoder, bytes).unwrap();
    encoder.finish().unwrap()
}

/// An array in version 1 of the npy format.
pub(crate) fn npy(header: &str, data: &[u8]) -> Vec<u8> {
    versioned(1, header, data)
}

/// An array in a version of the npy format.
pub(crate) fn versioned(major: u8, header: &str, data: &[u8]) -> Vec<u8> {
    let length = header.len() as u32;
    let length = if major == 1 { (length as u16).to_le_bytes().to_vec() } else { length.to_le_bytes().to_vec() };
    [b"\x93NUMPY", &[major, 0][..], &length, header.as_bytes(), data].concat()
}

/// The header of an array as numpy writes it.
pub(crate) fn npy_header(descr: &str, fortran: bool, shape: &str) -> String {
    let fortran = if fortran { "True" } else { "False" };
    format!("{{'descr': '{descr}', 'fortran_order': {fortran}, 'shape': {shape}, }}          \n")
}

/// The samples of [`volume`] in Fortran order.
pub(crate) fn transposed() -> Vec<f64> {
    let (samples, [depth, height, width]) = (samples(), volume().shape());
    let at = |i: usize| samples[(i % depth * height + i / depth % height) * width + i / depth / height];
    (0..samples.len()).map(at).collect()
}
