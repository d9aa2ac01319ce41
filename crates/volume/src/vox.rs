//! MagicaVoxel models (`.vox`): colours on a grid.
//!
//! A model becomes a colour volume through its palette; where there is no voxel, the colour is (0, 0, 0). MagicaVoxel
//! counts x to the right, y into the depth and z upwards, and so do the axes here: voxel (x, y, z) of the model is voxel
//! `[z, y, x]` of the volume, shape (size z, size y, size x). The alpha of the palette is ignored, materials too.
//!
//! A file holds one model or is refused: several models are an animation or the parts of a scene, and neither is one
//! block of texture. Where the scene moves or turns the one model, it is read as it was drawn.
//!
//! The models are taken apart by the `dot_vox` crate, which descends into nested chunks as deep as a file says. So the
//! chunks are checked first, and it is given a copy that holds only those of one model: sizes, voxels, and palette.

use std::io::Read;
use std::path::Path;

use dot_vox::{DotVoxData, Model};

use super::{FileKind, ReadOptions, SampleType, Source, Volume, VolumeError, decode};

/// Coordinates are bytes.
const LONGEST_SIDE: u32 = 256;

/// A file larger than this is no single model: 256^3 voxels of 4 bytes, and 64 MiB for the rest.
const LARGEST_FILE: u64 = (1 << 26) + (1 << 26);

/// Whether a file that begins so is a MagicaVoxel file.
pub(super) fn sniff(head: &[u8]) -> bool {
    head.starts_with(b"VOX ")
}

/// The volume of the model in a MagicaVoxel file.
pub(super) fn read(path: &Path, options: &ReadOptions) -> Result<(Volume, Source), VolumeError> {
    let io = |source| VolumeError::Io { doing: "reading the model", source };
    let mut bytes = Vec::new();
    decode::open(path)?.take(LARGEST_FILE + 1).read_to_end(&mut bytes).map_err(io)?;
    if bytes.len() as u64 > LARGEST_FILE {
        let found = "the .vox file is larger than a model of 256^3 voxels can make it".into();
        return Err(malformed(found, "one model is read from a file: export it by itself"));
    }
    let volume = from_bytes(&bytes, options)?;
    Ok((volume, Source { kind: FileKind::Vox, samples: SampleType::U8, mapping: None, spacing: None }))
}

fn from_bytes(bytes: &[u8], options: &ReadOptions) -> Result<Volume, VolumeError> {
    let copy = only_one_model(bytes, options.max_voxels)?;
    let data = dot_vox::load_bytes(&copy)
        .map_err(|reason| VolumeError::Decode { what: "the model".into(), source: reason.into() })?;
    match data.models.as_slice() {
        [model] => paint(model, &data),
        models => Err(malformed(format!("the .vox file gives {} models beside its chunks", models.len()), DAMAGED)),
    }
}

/// A chunk without children.
struct Chunk<'a> {
    name: &'a [u8],
    content: &'a [u8],
    /// All of it, its header included.
    whole: &'a [u8],
}

/// Splits a chunk off the front; its children are left unread.
fn split_chunk(bytes: &[u8]) -> Option<(Chunk<'_>, &[u8])> {
    let (name, rest) = bytes.split_at_checked(4)?;
    let (content, rest) = rest.split_first_chunk::<4>()?;
    let (children, rest) = rest.split_first_chunk::<4>()?;
    let [content, children] = [content, children].map(|length| u32::from_le_bytes(*length) as usize);
    let (content, rest) = rest.split_at_checked(content)?;
    let (_, rest) = rest.split_at_checked(children)?;
    let whole = bytes.get(..12 + content.len()).filter(|_| children == 0).unwrap_or_default();
    Some((Chunk { name, content, whole }, rest))
}

/// The chunks of the one model, after checking them, as a file of their own.
fn only_one_model(bytes: &[u8], max_voxels: u64) -> Result<Vec<u8>, VolumeError> {
    let cut = || malformed("a chunk of the .vox file is longer than what is left of it".into(), CUT);
    let (head, main) = bytes.split_at_checked(8).filter(|(head, _)| sniff(head)).ok_or_else(cut)?;
    let mut rest = match main.split_first_chunk::<12>() {
        Some((&[b'M', b'A', b'I', b'N', 0, 0, 0, 0, a, b, c, d], children)) => {
            children.get(..u32::from_le_bytes([a, b, c, d]) as usize).ok_or_else(cut)?
        }
        None => return Err(malformed("the .vox file ends within its header".into(), CUT)),
        Some(_) => return Err(malformed("the .vox file does not begin with its MAIN chunk".into(), DAMAGED)),
    };
    let (mut sizes, mut voxels, mut kept) = (0, 0, Vec::new());
    while !rest.is_empty() {
        let (chunk, tail) = split_chunk(rest).ok_or_else(cut)?;
        rest = tail;
        match chunk.name {
            b"SIZE" => {
                check_size(chunk.content, max_voxels)?;
                sizes += 1;
            }
            b"XYZI" => voxels += 1,
            b"RGBA" => {}
            _ => continue,
        }
        kept.extend_from_slice(chunk.whole);
    }
    if (sizes, voxels) != (1, 1) {
        return Err(VolumeError::Unsupported {
            what: format!("a .vox file of {} models", u32::max(sizes, voxels)),
            supported: "files of one model: export the others one by one".into(),
        });
    }
    let length = u32::try_from(kept.len()).map_err(|_| cut())?.to_le_bytes();
    Ok([head, b"MAIN", &[0; 4], &length, &kept].concat())
}

fn check_size(content: &[u8], max_voxels: u64) -> Result<(), VolumeError> {
    let sides: Vec<u32> = content.as_chunks().0.iter().map(|&side| u32::from_le_bytes(side)).collect();
    if sides.len() != 3 || sides.iter().any(|&side| side > LONGEST_SIDE) {
        let found = format!("the size chunk of the .vox file says {sides:?}");
        return Err(malformed(found, "it should give three sides of at most 256 voxels: the file is damaged"));
    }
    let voxels = sides.iter().map(|&side| u128::from(side)).product();
    if voxels > u128::from(max_voxels) {
        return Err(VolumeError::TooLarge { voxels, limit: max_voxels });
    }
    Ok(())
}

fn paint(model: &Model, data: &DotVoxData) -> Result<Volume, VolumeError> {
    let shape = [model.size.z, model.size.y, model.size.x].map(|side| side as usize);
    let [depth, height, width] = shape;
    let mut voxels = vec![0; 3 * depth * height * width];
    for voxel in &model.voxels {
        let [z, y, x] = [voxel.z, voxel.y, voxel.x].map(usize::from);
        let place = 3 * ((z * height + y) * width + x);
        let inside = z < depth && y < height && x < width;
        let target = voxels.get_mut(place..place + 3).filter(|_| inside);
        let (Some(target), Some(colour)) = (target, data.palette.get(usize::from(voxel.i))) else {
            let found = format!("voxel {x}, {y}, {z} of the model is outside it or has no colour");
            return Err(malformed(found, DAMAGED));
        };
        target.copy_from_slice(&[colour.r, colour.g, colour.b]);
    }
    Volume::new(shape, 3, voxels)
}

const DAMAGED: &str = "no writer of .vox files does that: the file is damaged, save it again with MagicaVoxel";
const CUT: &str = "it should be whole: the file is truncated or damaged, fetch or write it again";

fn malformed(found: String, expected: &str) -> VolumeError {
    VolumeError::Malformed { found, expected: expected.into() }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn chunk(name: &[u8; 4], content: &[u8]) -> Vec<u8> {
        [name, &(content.len() as u32).to_le_bytes()[..], &[0; 4], content].concat()
    }

    fn size(x: u32, y: u32, z: u32) -> Vec<u8> {
        chunk(b"SIZE", &[x, y, z].map(u32::to_le_bytes).concat())
    }

    fn voxels(voxels: &[[u8; 4]]) -> Vec<u8> {
        chunk(b"XYZI", &[&(voxels.len() as u32).to_le_bytes()[..], &voxels.concat()].concat())
    }

    /// Colour `i` (counted from 1, as voxels do) is (i, 2 i, 3 i).
    fn palette() -> Vec<u8> {
        let colours = (1..=256_u32).flat_map(|i| [i as u8, (2 * i) as u8, (3 * i) as u8, 255]);
        chunk(b"RGBA", &colours.collect::<Vec<_>>())
    }

    fn file(chunks: &[Vec<u8>]) -> Vec<u8> {
        let children = chunks.concat();
        let length = (children.len() as u32).to_le_bytes();
        [&b"VOX "[..], &150_u32.to_le_bytes(), b"MAIN", &[0; 4], &length, &children].concat()
    }

    fn small() -> Vec<u8> {
        file(&[size(4, 5, 6), voxels(&[[3, 4, 5, 7], [0, 0, 0, 255], [1, 2, 3, 1]]), palette()])
    }

    #[test]
    fn a_model_stands_upright() {
        let volume = from_bytes(&small(), &ReadOptions::default()).unwrap();
        assert_eq!((volume.shape(), volume.channels()), ([6, 5, 4], 3));
        let mut expected = vec![[0; 3]; 6 * 5 * 4];
        expected[5 * 20 + 4 * 4 + 3] = [7, 14, 21];
        expected[0] = [255, 254, 253];
        expected[3 * 20 + 2 * 4 + 1] = [1, 2, 3];
        assert_eq!(volume.voxels(), expected.as_flattened());
    }

    #[test]
    fn the_default_palette_stands_where_there_is_none() {
        let volume = from_bytes(&file(&[size(3, 3, 3), voxels(&[[0, 0, 0, 1]])]), &ReadOptions::default()).unwrap();
        assert_eq!(volume.voxels()[..6], [255, 255, 255, 0, 0, 0]);
    }

    fn sentence(bytes: &[u8]) -> String {
        from_bytes(bytes, &ReadOptions { max_voxels: 1000, ..ReadOptions::default() }).unwrap_err().to_string()
    }

    #[test]
    fn bad_files_get_a_sentence() {
        let two = file(&[size(3, 3, 3), voxels(&[]), size(3, 3, 3), voxels(&[])]);
        assert!(sentence(&two).contains("2 models"));
        assert!(sentence(&file(&[])).contains("0 models"));
        assert!(sentence(&file(&[size(11, 10, 10), voxels(&[])])).contains("limit of 1000"));
        assert!(sentence(&file(&[size(257, 3, 3), voxels(&[])])).contains("257"));
        assert!(sentence(&file(&[size(2, 3, 3), voxels(&[])])).contains("at least 3"));
        assert!(sentence(&file(&[size(3, 3, 3), voxels(&[[0, 3, 0, 1]])])).contains("outside"));
        assert!(sentence(&small()[..100]).contains("longer than what is left"));
        assert!(sentence(b"VOX ").contains("longer than"));
        assert!(sentence(b"VOX \x96\0\0\0MAIN").contains("ends within its header, but it should be whole"));
    }

    #[test]
    fn nesting_without_end_is_not_followed() {
        let deep: Vec<u8> = (0..100_000_u32)
            .rev()
            .flat_map(|level| [&b"nGRP"[..], &[0; 4], &(level * 12).to_le_bytes()].concat())
            .collect();
        let volume = from_bytes(&file(&[deep, size(3, 3, 3), voxels(&[])]), &ReadOptions::default()).unwrap();
        assert_eq!(volume.shape(), [3, 3, 3]);
    }

    proptest! {
        #[test]
        fn no_bytes_panic(changes in prop::collection::vec((0..1100_usize, any::<u8>()), 1..6), cut in 0..1200_usize) {
            let mut bytes = small();
            for (place, byte) in changes {
                let place = place % 120;
                bytes[place] = byte;
            }
            bytes.truncate(cut);
            let _ = from_bytes(&bytes, &ReadOptions::default());
        }
    }
}
