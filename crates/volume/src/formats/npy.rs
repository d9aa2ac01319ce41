//! NumPy arrays, `.npy`.
//!
//! Every integer and float type of up to 64 bits, either byte order, C or Fortran order. Truth values become 0 and 255.
//! The array has the axes (Z, Y, X), or (Z, Y, X, 3) or (Z, Y, X, 4) for colour. Of more axes than that, those of length 1
//! are left out.

use std::io::BufReader;
use std::path::Path;

use super::{Format, FormatInfo, Head, VolumeReader};
use crate::layout::{Axes, Axis, DataLayout, Meaning, dense, open_file};
use crate::npy::NpyHeader;
use crate::{ReadOptions, VolumeError};

pub(super) struct Npy;

static INFO: FormatInfo = FormatInfo::new(
    "npy",
    "NumPy array",
    "An array of axes (Z, Y, X) or (Z, Y, X, colour), of integers or floating-point numbers of up to 64 bits.",
)
.extensions(&[".npy"]);

impl Format for Npy {
    fn info(&self) -> &'static FormatInfo {
        &INFO
    }

    fn sniff(&self, head: &Head) -> bool {
        NpyHeader::sniff(head.bytes())
    }

    fn open(&self, path: &Path, options: &ReadOptions) -> Result<Box<dyn VolumeReader>, VolumeError> {
        let header = NpyHeader::read(&mut BufReader::new(open_file(path)?))?;
        layout(&header, path, header.header_bytes(), options.max_voxels)?.open()
    }
}

/// The layout of a volume in an array whose values begin at a byte of a file.
pub(super) fn layout(header: &NpyHeader, path: &Path, start: u64, max_voxels: u64) -> Result<DataLayout, VolumeError> {
    let (samples, endian) = header.element_type()?;
    let axes = Axes::of_array(&axes(header), max_voxels)?;
    let meaning = if header.is_boolean() { Meaning::Truth } else { Meaning::Numbers };
    Ok(DataLayout { meaning, ..DataLayout::raw(path.into(), start, axes, samples, endian) })
}

fn axes(header: &NpyHeader) -> Vec<Axis> {
    if header.is_fortran_order() {
        return dense(header.shape().iter().copied());
    }
    let mut axes = dense(header.shape().iter().rev().copied());
    axes.reverse();
    axes
}

#[cfg(test)]
mod tests {
    use crate::testing::{Folder, encode, npy, npy_header, samples, transposed, versioned, volume};
    use crate::{Endian, SampleType, VolumeError};

    const MAGIC: &[u8] = b"\x93NUMPY";

    #[test]
    fn every_type_and_order() {
        let folder = Folder::new();
        for (code, ty) in [
            ("u1", SampleType::U8),
            ("u2", SampleType::U16),
            ("i2", SampleType::I16),
            ("u4", SampleType::U32),
            ("i4", SampleType::I32),
            ("u8", SampleType::U64),
            ("i8", SampleType::I64),
            ("f2", SampleType::F16),
            ("f4", SampleType::F32),
            ("f8", SampleType::F64),
        ] {
            for (order, endian) in [('<', Endian::Little), ('>', Endian::Big), ('=', Endian::NATIVE)] {
                for (fortran, values) in [(false, samples()), (true, transposed())] {
                    let bytes =
                        npy(&npy_header(&format!("{order}{code}"), fortran, "(3, 4, 5)"), &encode(&values, ty, endian));
                    let (found, source) = folder.read("array.npy", bytes).unwrap();
                    assert_eq!((found, source.samples), (volume(), ty), "{order}{code} {fortran}");
                }
            }
        }
        let halved: Vec<f64> = samples().iter().map(|v| (v - 255.0) / 2.0).collect();
        let (found, source) = folder
            .read(
                "i1.npy",
                npy(&npy_header("|i1", false, "(3, 4, 5)"), &encode(&halved, SampleType::I8, Endian::Little)),
            )
            .unwrap();
        assert_eq!((found.voxels()[59], source.samples), (255, SampleType::I8));
    }

    #[test]
    fn truth_values_become_0_and_255() {
        let bytes: Vec<u8> = (0..60).map(|i| i % 3).collect();
        let (found, source) = Folder::new().read("b.npy", npy(&npy_header("|b1", false, "(3, 4, 5)"), &bytes)).unwrap();
        assert_eq!(&found.voxels()[..4], [0, 255, 255, 0]);
        assert_eq!((source.samples, source.mapping), (SampleType::U8, None));
    }

    #[test]
    fn headers_of_every_version_and_writer() {
        let folder = Folder::new();
        let data = encode(&samples(), SampleType::U8, Endian::Little);
        for major in 1..=3 {
            let bytes = versioned(major, &npy_header("|u1", false, "(3, 4, 5)"), &data);
            assert_eq!(folder.read("array.npy", bytes).unwrap().0, volume());
        }
        for text in [
            "{'shape': (3L, 4L, 5L), 'fortran_order': False, 'descr': '|u1'}",
            r#"{"descr": "|u1", "fortran_order": False, "shape": (3,4,5), "more": [(1, "}"), 2]}"#,
            "{ 'descr' : '|u1' , 'fortran_order' : False , 'shape' : ( 1 , 3 , 4 , 5 , ) , }",
        ] {
            assert_eq!(folder.read("array.npy", npy(text, &data)).unwrap().0, volume(), "{text}");
        }
    }

    #[test]
    fn arrays_that_are_no_volume_are_refused_in_a_sentence() {
        let folder = Folder::new();
        let refused = |bytes: Vec<u8>| folder.read("array.npy", bytes).unwrap_err();
        let sentence = |text: &str| refused(npy(text, &[0; 1000])).to_string();
        for descr in ["<c8", "|O", "<U3", "<f16", "<M8[ns]", "", "f4", "<"] {
            let found = sentence(&npy_header(descr, false, "(3, 4, 5)"));
            assert!(found.starts_with(&format!("an array of type {descr} is not supported")), "{found}");
        }
        let record = "{'descr': [('a', '<f4'), ('b', '|u1')], 'fortran_order': False, 'shape': (3, 4, 5), }";
        assert!(
            sentence(record).contains("[('a', '<f4'), ('b', '|u1')]") || sentence(record).contains("is not supported")
        );
        for (shape, expected) in
            [("()", "0 axes"), ("(5,)", "1 axes"), ("(30, 40)", "2 axes"), ("(2, 3, 4, 5)", "4 axes")]
        {
            assert!(sentence(&npy_header("|u1", false, shape)).contains(expected));
        }
        for broken in
            ["", "{", "{}", "{'descr': '|u1'}", "[1]", "{'descr': '|u1', 'fortran_order': 0, 'shape': (3, 4, 5)}"]
        {
            assert!(matches!(refused(npy(broken, &[])), VolumeError::Malformed { .. }), "{broken}");
        }
        for shape in ["(3, -4, 5)", "(3, 4, 1e9)", "3, 4, 5", &format!("(3, 4, {}0)", u64::MAX)] {
            let error = refused(npy(&npy_header("|u1", false, shape), &[]));
            assert!(matches!(error, VolumeError::Malformed { .. }), "{shape}");
        }
        let large = refused(npy(&npy_header("<f8", false, "(65536, 65536, 65536)"), &[]));
        assert!(matches!(large, VolumeError::TooLarge { .. }), "{large}");
        let short = refused(npy(&npy_header("<u2", false, "(3, 4, 5)"), &[0; 119]));
        assert!(matches!(short, VolumeError::Truncated { expected: 120, found: 119 }), "{short}");
        assert!(matches!(refused(MAGIC.to_vec()), VolumeError::Malformed { .. }));
        assert!(matches!(refused(b"not an array".to_vec()), VolumeError::Malformed { .. }));
        let long = [MAGIC, &[2, 0], &u32::MAX.to_le_bytes(), b"{"].concat();
        assert!(matches!(refused(long), VolumeError::Unsupported { .. }));
        // A parser of all of Python would descend into this.
        let deep = refused(npy(&"(".repeat(60_000), &[]));
        assert!(matches!(deep, VolumeError::Malformed { .. }));
    }
}
