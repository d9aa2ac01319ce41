//! Arrays written and read back, the exact bytes of headers, and hostile headers.

use super::*;
use crate::testing::{npy, npy_header, versioned};
use crate::{SampleType, VolumeError};

fn written<T: NpyElement>(shape: &[usize], values: &[T]) -> Vec<u8> {
    let mut bytes = Vec::new();
    NpyWriter::new(&mut bytes, shape).unwrap().finish_with(values).unwrap();
    bytes
}

fn round_trip<T: NpyElement + PartialEq + std::fmt::Debug>(descr: &str, values: [T; 6]) {
    let bytes = written(&[2, 3], &values);
    let mut reader = NpyReader::new(&bytes[..]).unwrap();
    assert_eq!(reader.header().shape(), [2, 3]);
    assert_eq!(reader.element_type().unwrap(), T::TYPE);
    assert!(String::from_utf8_lossy(&bytes).contains(&format!("'{descr}'")));
    assert_eq!(reader.read_all::<T>(6).unwrap(), values);
    assert!(matches!(reader.read::<T>(1), Err(VolumeError::Truncated { .. })));
}

#[test]
fn every_type_comes_back() {
    round_trip("|u1", [0_u8, 1, 2, 3, 254, 255]);
    round_trip("|i1", [i8::MIN, -1, 0, 1, 2, i8::MAX]);
    round_trip("<u2", [0_u16, 1, 2, 3, 4, u16::MAX]);
    round_trip("<i2", [i16::MIN, -1, 0, 1, 2, i16::MAX]);
    round_trip("<u4", [0_u32, 1, 2, 3, 4, u32::MAX]);
    round_trip("<i4", [i32::MIN, -1, 0, 1, 2, i32::MAX]);
    round_trip("<u8", [0_u64, 1, 2, 3, 4, u64::MAX]);
    round_trip("<i8", [i64::MIN, -1, 0, 1, 2, i64::MAX]);
    round_trip("<f4", [f32::MIN, -0.5, 0.0, 1e-40, 2.0, f32::INFINITY]);
    round_trip("<f8", [f64::MIN, -0.5, 0.0, 1e-310, 2.0, f64::INFINITY]);
}

#[test]
fn the_bytes_of_a_header_are_fixed() {
    let bytes = written(&[2, 3], &[0.0_f32; 6]);
    let text = "{'descr': '<f4', 'fortran_order': False, 'shape': (2, 3, ), }";
    let header = format!("{text:<117}\n");
    assert_eq!(bytes[..10], *b"\x93NUMPY\x01\x00\x76\x00");
    assert_eq!(bytes[10..128], *header.as_bytes());
    assert_eq!(bytes.len(), 128 + 24);
    // Headers of any length end at a multiple of 64 bytes.
    for axes in 0..=32 {
        let bytes = written(&vec![1; axes], &[7_u8]);
        assert_eq!((bytes.len() - 1) % 64, 0, "{axes}");
        let header = NpyHeader::read(&mut &bytes[..]).unwrap();
        assert_eq!((header.shape().len(), header.header_bytes() as usize), (axes, bytes.len() - 1));
    }
    assert!(NpyWriter::<u8, _>::new(Vec::new(), &[1; 33]).is_err());
}

#[test]
fn big_endian_and_fortran_order_are_told() {
    let bytes = npy(&npy_header(">i4", true, "(2, 1)"), &[0, 0, 1, 2, 255, 255, 255, 255]);
    let mut reader = NpyReader::new(&bytes[..]).unwrap();
    assert!(reader.header().is_fortran_order());
    assert_eq!(reader.read::<i32>(2).unwrap(), [258, -1]);
}

#[test]
fn another_type_than_expected_is_refused() {
    let bytes = written(&[2], &[1.0_f64, 2.0]);
    let error = NpyReader::new(&bytes[..]).unwrap().read::<f32>(1).unwrap_err();
    assert_eq!(error.to_string(), "an array of f64 is not supported; supported: f32");
    let truth = npy(&npy_header("|b1", false, "(2,)"), &[0, 1]);
    assert!(NpyReader::new(&truth[..]).unwrap().read::<u8>(2).is_err());
    let text = npy(&npy_header("<U3", false, "(2,)"), &[0; 24]);
    assert!(NpyReader::new(&text[..]).unwrap().element_type().is_err());
}

#[test]
fn promises_are_checked_before_memory_is_taken() {
    let huge = npy(&npy_header("<f8", false, "(4294967295, 4294967295, 9)"), &[0; 16]);
    let mut reader = NpyReader::new(&huge[..]).unwrap();
    assert_eq!(reader.header().count(), None);
    assert!(matches!(reader.read_all::<f64>(1 << 30), Err(VolumeError::Unsupported { .. })));
    assert!(matches!(reader.read::<f64>(1 << 40), Err(VolumeError::Truncated { .. })));
    let short = npy(&npy_header("<u2", false, "(5,)"), &[0; 9]);
    let error = NpyReader::new(&short[..]).unwrap().read_all::<u16>(5).unwrap_err();
    assert!(matches!(error, VolumeError::Truncated { expected: 10, found: 9 }), "{error}");
}

#[test]
fn a_writer_takes_as_many_values_as_its_shape_holds() {
    let mut writer = NpyWriter::new(Vec::new(), &[2, 2]).unwrap();
    writer.push(&[1_u8, 2, 3]).unwrap();
    assert_eq!(writer.missing(), 1);
    assert!(writer.push(&[4, 5]).is_err());
    let short = NpyWriter::new(Vec::new(), &[2]).unwrap().finish_with(&[1_i16]);
    assert!(short.is_err());
}

/// Parsers of all Python literals descend into brackets, and quote what they do not understand.
#[test]
fn hostile_headers_give_short_errors() {
    let nested = "[".repeat(60_000);
    let texts = [
        nested.clone(),
        format!("{{'descr': {nested}, 'fortran_order': False, 'shape': (3, 4, 5), }}"),
        format!("{{'descr': '|u1', 'fortran_order': {nested}, 'shape': (3, 4, 5), }}"),
        format!("{{'descr': '|u1', 'fortran_order': False, 'shape': {nested}, }}"),
        format!("{{'descr': '{}', 'fortran_order': False, 'shape': (3, 4, 5), }}", "\n\u{7f}".repeat(20_000)),
        format!("{{'descr': '|u1', 'fortran_order': False, 'shape': ({}), }}", "1,".repeat(30_000)),
    ];
    for text in texts {
        let bytes = versioned(2, &text, &[0; 1000]);
        let mut reader = match NpyReader::new(&bytes[..]) {
            Ok(reader) => reader,
            Err(error) => {
                assert_short(&error);
                continue;
            }
        };
        match reader.read::<f32>(1) {
            Ok(_) => panic!("{} values were read", SampleType::F32),
            Err(error) => assert_short(&error),
        }
    }
}

fn assert_short(error: &VolumeError) {
    let text = error.to_string();
    assert!(text.len() < 1000 && !text.contains('\n'), "{} bytes: {text}", text.len());
}
