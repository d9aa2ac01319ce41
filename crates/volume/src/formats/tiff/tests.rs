//! Stacks by the encoder of the `tiff` crate, of any shape, compression and type; and hostile files.

use std::io::Cursor;

use ::tiff::encoder::colortype::{self, ColorType};
use ::tiff::encoder::{Compression, DeflateLevel, TiffEncoder, TiffKind, TiffValue};
use ::tiff::tags::Predictor;
use proptest::prelude::*;

use crate::testing::Folder;
use crate::{Intensity, ReadOptions, SampleType, Volume, VolumeError, VolumeSource};

/// How a stack is packed.
#[derive(Debug, Clone, Copy)]
struct Packing {
    /// Uncompressed, LZW, deflate or PackBits.
    compression: usize,
    predictor: bool,
    rows: u32,
    big: bool,
}

const COMPRESSIONS: [Compression; 4] =
    [Compression::Uncompressed, Compression::Lzw, Compression::Deflate(DeflateLevel::Balanced), Compression::Packbits];

fn packing() -> impl Strategy<Value = Packing> {
    (0..COMPRESSIONS.len(), any::<bool>(), 1..8_u32, any::<bool>())
        .prop_map(|(compression, predictor, rows, big)| Packing { compression, predictor, rows, big })
}

/// A stack of `samples`, in pages of the size given.
fn encode<C: ColorType>(height: usize, width: usize, samples: &[C::Inner], packing: Packing) -> Vec<u8>
where
    C::Inner: Copy,
    [C::Inner]: TiffValue,
{
    let mut file = Cursor::new(Vec::new());
    if packing.big {
        pages::<C, _>(TiffEncoder::new_big(&mut file).unwrap(), height, width, samples, packing);
    } else {
        pages::<C, _>(TiffEncoder::new(&mut file).unwrap(), height, width, samples, packing);
    }
    file.into_inner()
}

fn pages<C: ColorType, K: TiffKind>(
    encoder: TiffEncoder<&mut Cursor<Vec<u8>>, K>,
    height: usize,
    width: usize,
    samples: &[C::Inner],
    packing: Packing,
) where
    C::Inner: Copy,
    [C::Inner]: TiffValue,
{
    let predictor = if packing.predictor { Predictor::Horizontal } else { Predictor::None };
    let mut encoder = encoder.with_compression(COMPRESSIONS[packing.compression]).with_predictor(predictor);
    for page in samples.chunks(height * width * C::BITS_PER_SAMPLE.len()) {
        let mut image = encoder.new_image::<C>(width as u32, height as u32).unwrap();
        image.rows_per_strip(packing.rows).unwrap();
        image.write_data(page).unwrap();
    }
}

fn read_bytes(bytes: &[u8], intensity: Intensity) -> Result<(Volume, VolumeSource), VolumeError> {
    let folder = Folder::new();
    let path = folder.write("stack.tif", bytes);
    crate::read(&path, &ReadOptions::new().intensity(intensity)).map_err(|error| error.error)
}

fn grey(shape: [usize; 3], seed: u8) -> Vec<u8> {
    (0..shape.iter().product()).map(|i: usize| (i * i / 3 + i) as u8 ^ seed).collect()
}

proptest! {
    #![proptest_config(hlacdb_testing::cases(48))]
    #[test]
    fn bytes_come_back_as_they_were(shape in [3..6_usize, 3..20_usize, 3..20_usize], seed: u8, packing in packing()) {
        let voxels = grey(shape, seed);
        let file = encode::<colortype::Gray8>(shape[1], shape[2], &voxels, packing);
        let (volume, source) = read_bytes(&file, Intensity::Full).unwrap();
        prop_assert_eq!(volume, Volume::new(shape, 1, voxels).unwrap());
        prop_assert_eq!((source.samples, source.mapping), (SampleType::U8, None));
    }

    #[test]
    fn colours_come_back_as_they_were(shape in [3..6_usize, 3..9_usize, 3..9_usize], seed: u8, packing in packing()) {
        let voxels = grey([3 * shape[0], shape[1], shape[2]], seed);
        let file = encode::<colortype::RGB8>(shape[1], shape[2], &voxels, packing);
        prop_assert_eq!(read_bytes(&file, Intensity::Full).unwrap().0, Volume::new(shape, 3, voxels.clone()).unwrap());
        let opaque: Vec<u8> = voxels.as_chunks::<3>().0.iter().flat_map(|&[r, g, b]| [r, g, b, seed]).collect();
        let file = encode::<colortype::RGBA8>(shape[1], shape[2], &opaque, packing);
        prop_assert_eq!(read_bytes(&file, Intensity::Full).unwrap().0, Volume::new(shape, 3, voxels).unwrap());
    }

    #[test]
    fn deep_samples_keep_their_values(shape in [3..5_usize, 3..9_usize, 3..9_usize], seed: u8, packing in packing()) {
        let voxels = grey(shape, seed);
        let (height, width) = (shape[1], shape[2]);
        let [u16s, u32s] = [257, 16_843_009].map(|step| voxels.iter().map(|&v| u32::from(v) * step).collect::<Vec<_>>());
        let u16s: Vec<u16> = u16s.iter().map(|&v| v as u16).collect();
        let u64s: Vec<u64> = voxels.iter().map(|&v| u64::from(v)).collect();
        let i16s: Vec<i16> = voxels.iter().map(|&v| i16::from(v) - 1000).collect();
        let f64s: Vec<f64> = voxels.iter().map(|&v| f64::from(v) / 8.0).collect();
        // The encoder has no predictor for numbers of 64 bits.
        let simple = Packing { predictor: false, ..packing };
        let expected = Volume::new(shape, 1, voxels).unwrap();
        for (file, ty, lo, hi) in [
            (encode::<colortype::Gray16>(height, width, &u16s, packing), SampleType::U16, 0.0, 65_535.0),
            (encode::<colortype::Gray32>(height, width, &u32s, packing), SampleType::U32, 0.0, 4_294_967_295.0),
            (encode::<colortype::Gray64>(height, width, &u64s, simple), SampleType::U64, 0.0, 255.0),
            (encode::<colortype::GrayI16>(height, width, &i16s, packing), SampleType::I16, -1000.0, -745.0),
            (encode::<colortype::Gray64Float>(height, width, &f64s, simple), SampleType::F64, 0.0, 255.0 / 8.0),
        ] {
            let (volume, source) = read_bytes(&file, Intensity::Window { lo, hi }).unwrap();
            prop_assert_eq!(source.samples, ty);
            prop_assert_eq!(&volume, &expected, "{}", ty);
        }
    }

    #[test]
    fn no_bytes_panic(
        packing in packing(),
        changes in prop::collection::vec((any::<prop::sample::Index>(), any::<u8>()), 1..6),
        cut: Option<prop::sample::Index>,
    ) {
        let mut file = encode::<colortype::Gray8>(7, 9, &grey([4, 7, 9], 1), packing);
        for (place, byte) in changes {
            let place = place.index(file.len());
            file[place] = byte;
        }
        if let Some(cut) = cut {
            file.truncate(cut.index(file.len()));
        }
        let _ = read_bytes(&file, Intensity::Full);
    }
}

/// A little-endian directory entry of one LONG.
fn entry(tag: u16, value: u32) -> Vec<u8> {
    [&tag.to_le_bytes()[..], &4_u16.to_le_bytes(), &1_u32.to_le_bytes(), &value.to_le_bytes()].concat()
}

/// A file of one directory at offset 8 with these entries and this next one.
fn directory(entries: &[(u16, u32)], next: u32) -> Vec<u8> {
    let entries_bytes = entries.iter().flat_map(|&(tag, value)| entry(tag, value));
    let mut file = b"II*\0\x08\0\0\0".to_vec();
    file.extend((entries.len() as u16).to_le_bytes());
    file.extend(entries_bytes);
    file.extend(next.to_le_bytes());
    file
}

/// The tags of an uncompressed page in one strip at offset 0.
fn page(width: u32, height: u32) -> Vec<(u16, u32)> {
    vec![(256, width), (257, height), (258, 8), (262, 1), (273, 0), (278, height), (279, width.wrapping_mul(height))]
}

fn sentence(bytes: &[u8]) -> String {
    read_bytes(bytes, Intensity::Full).unwrap_err().to_string()
}

#[test]
fn loops_of_directories_are_refused() {
    assert!(sentence(&directory(&page(3, 3), 8)).contains("overlap, loop"));
    // Directories without entries are no pages, but could follow one another for ever.
    assert!(sentence(&directory(&[], 8)).contains("no width"));
    let thumbnail = [page(3, 3), vec![(254, 1)]].concat();
    assert!(sentence(&directory(&thumbnail, 8)).contains("overlap, loop"));
}

#[test]
fn wrong_sizes_are_refused_before_memory_is_taken() {
    let huge = directory(&page(u32::MAX, u32::MAX), 0);
    assert!(sentence(&huge).contains("the data ends after"));
    let mut packed = page(u32::MAX, u32::MAX);
    packed.push((259, 8));
    assert!(sentence(&directory(&packed, 0)).contains("the data ends after"));
    let mut tiles = page(9, 9);
    tiles.retain(|&(tag, _)| !matches!(tag, 273 | 278 | 279));
    tiles.extend([(322, u32::MAX), (323, 16), (324, 0), (325, 256)]);
    assert!(sentence(&directory(&tiles, 0)).contains("tiles of a TIFF page"));
    let mut planes = page(3, u32::MAX);
    planes.retain(|&(tag, _)| tag != 278);
    planes.extend([(277, 65_535), (278, 1), (284, 2)]);
    assert!(sentence(&directory(&planes, 0)).contains("cover the page"));
    let mut wide = directory(&[], 0);
    wide[8..10].copy_from_slice(&u16::MAX.to_le_bytes());
    assert!(sentence(&wide).contains("larger than the file"));
}

#[test]
fn what_the_decoder_cannot_handle_is_refused() {
    // 8-bit floating point with a floating-point predictor.
    let mut odd = page(3, 3);
    odd.extend([(317, 3), (339, 3)]);
    assert!(sentence(&directory(&odd, 0)).contains("8-bit floating point"));
    for (tag, value, word) in
        [(262, 5, "CMYK"), (258, 12, "12-bit"), (259, 7, "JPEG"), (317, 2, "2 axes"), (277, 2, "2 samples")]
    {
        let mut tags = page(3, 3);
        tags.retain(|&(other, _)| other != tag);
        tags.push((tag, value));
        let text = sentence(&directory(&tags, 0));
        assert!(text.contains(word), "{text}");
    }
}

#[test]
fn an_imagej_stack_promises_no_more_than_the_file_has() {
    let text = b"ImageJ=1.54f\nimages=4294967295\nslices=4294967295\n\0";
    let mut tags = page(3, 3);
    let end = 8 + 2 + 12 * (tags.len() as u32 + 1) + 4;
    tags.push((270, end));
    tags.sort_unstable();
    let mut file = directory(&tags, 0);
    // The description is text of that length, not a number.
    let place = 10 + 12 * tags.iter().position(|&(tag, _)| tag == 270).unwrap();
    file[place + 2] = 2;
    file[place + 4..place + 8].copy_from_slice(&(text.len() as u32).to_le_bytes());
    file.extend(text);
    assert!(sentence(&file).contains("the data ends after"), "{}", sentence(&file));
}
