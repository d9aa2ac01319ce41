//! One model: its chunks, checked, and its voxels.

use std::fs::File;
use std::io::{Read, Seek, SeekFrom};
use std::ops::Range;
use std::path::Path;

use dot_vox::{DotVoxData, Model};

use super::super::{Access, VolumeHeader, VolumeReader};
use super::magic::MAGIC;
use crate::layout::open_file;
use crate::samples::within_limit;
use crate::text::{DecoderError, Listed};
use crate::{ReadOptions, SampleType, Shape, VolumeError};

/// The longest side of a model, whose coordinates are bytes.
const LONGEST_SIDE: u64 = 256;

/// The largest file of a single model: 256^3 voxels of 4 bytes, and 64 MiB for the rest.
const LARGEST_FILE: u64 = (1 << 26) + (1 << 26);

/// Reads a model, all of it with the first planes.
pub(super) struct ModelReader {
    header: VolumeHeader,
    file: File,
    /// The voxels, once they are read.
    voxels: Option<Vec<u8>>,
}

impl ModelReader {
    pub(super) fn open(path: &Path, options: &ReadOptions) -> Result<Self, VolumeError> {
        let mut file = open_file(path)?;
        let shape = OneModel::find(&read(&mut file)?, options.max_voxels)?.shape;
        Ok(Self { header: VolumeHeader::new(shape, 3, SampleType::U8), file, voxels: None })
    }
}

impl VolumeReader for ModelReader {
    fn header(&self) -> &VolumeHeader {
        &self.header
    }

    fn access(&self) -> Access {
        Access::Whole
    }

    fn read_planes(&mut self, planes: Range<usize>, out: &mut Vec<u8>) -> Result<(), VolumeError> {
        let plane = self.header.shape[1] * self.header.shape[2] * 3;
        let voxels = match &self.voxels {
            Some(voxels) => voxels,
            None => {
                let model = OneModel::find(&read(&mut self.file)?, u64::MAX)?;
                self.voxels.insert(model.voxels(self.header.shape)?)
            }
        };
        out.extend_from_slice(voxels.get(planes.start * plane..planes.end * plane).unwrap_or_default());
        Ok(())
    }
}

/// The bytes of a file that may hold one model.
fn read(file: &mut File) -> Result<Vec<u8>, VolumeError> {
    let io = |source| VolumeError::Io { doing: "reading the model", source };
    let mut bytes = Vec::new();
    file.seek(SeekFrom::Start(0)).map_err(io)?;
    file.take(LARGEST_FILE + 1).read_to_end(&mut bytes).map_err(io)?;
    if bytes.len() as u64 > LARGEST_FILE {
        let what = "a .vox file larger than a model of 256^3 voxels can make it".into();
        return Err(VolumeError::SeveralVolumes { what });
    }
    Ok(bytes)
}

/// The chunks of the one model of a file, as a file of their own.
struct OneModel {
    /// (Z, Y, X).
    shape: Shape,
    file: Vec<u8>,
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

impl OneModel {
    /// Finds the chunks of the model and checks them.
    fn find(bytes: &[u8], max_voxels: u64) -> Result<Self, VolumeError> {
        let cut = || VolumeError::malformed("a chunk of the .vox file is longer than what is left of it", WHOLE);
        let (head, main) = bytes.split_at_checked(8).filter(|(head, _)| head.starts_with(MAGIC)).ok_or_else(cut)?;
        let mut rest = match main.split_first_chunk::<12>() {
            Some((&[b'M', b'A', b'I', b'N', 0, 0, 0, 0, a, b, c, d], children)) => {
                children.get(..u32::from_le_bytes([a, b, c, d]) as usize).ok_or_else(cut)?
            }
            None => return Err(VolumeError::malformed("the .vox file ends within its header", WHOLE)),
            Some(_) => return Err(VolumeError::malformed("the .vox file does not begin with its MAIN chunk", SOUND)),
        };
        let (mut shape, mut sizes, mut voxels, mut kept) = ([0; 3], 0, 0, Vec::new());
        while !rest.is_empty() {
            let (chunk, tail) = split_chunk(rest).ok_or_else(cut)?;
            rest = tail;
            match chunk.name {
                b"SIZE" => {
                    shape = shape_of(chunk.content, max_voxels)?;
                    sizes += 1;
                }
                b"XYZI" => voxels += 1,
                b"RGBA" => {}
                _ => continue,
            }
            kept.extend_from_slice(chunk.whole);
        }
        match u32::max(sizes, voxels) {
            1 if (sizes, voxels) == (1, 1) => {}
            0 | 1 => {
                return Err(VolumeError::malformed(
                    format!("the .vox file has {sizes} sizes and {voxels} sets of voxels"),
                    "a model has one of each",
                ));
            }
            models => return Err(VolumeError::SeveralVolumes { what: format!("a .vox file of {models} models") }),
        }
        let length = u32::try_from(kept.len()).map_err(|_| cut())?.to_le_bytes();
        Ok(Self { shape, file: [head, b"MAIN", &[0; 4], &length, &kept].concat() })
    }

    /// The colours of the model of that shape.
    fn voxels(&self, shape: Shape) -> Result<Vec<u8>, VolumeError> {
        let data = dot_vox::load_bytes(&self.file).map_err(|reason| VolumeError::Decode {
            what: "the model".into(),
            source: Box::new(DecoderError::of_text(reason)),
        })?;
        match data.models.as_slice() {
            [model] if self.shape == shape => paint(model, &data, shape),
            models => {
                let found = format!("the .vox file gives {} models of another shape", models.len());
                Err(VolumeError::malformed(found, SOUND))
            }
        }
    }
}

/// The shape (Z, Y, X) in a size chunk.
fn shape_of(content: &[u8], max_voxels: u64) -> Result<Shape, VolumeError> {
    let sides: Vec<u64> = content.as_chunks().0.iter().map(|&side| u32::from_le_bytes(side).into()).collect();
    let [x, y, z] = match sides[..] {
        [x, y, z] if sides.iter().all(|&side| side <= LONGEST_SIDE) => [x, y, z],
        _ => {
            let found = format!("the size chunk of the .vox file says {}", Listed(&sides));
            return Err(VolumeError::malformed(found, "it should give three sides of at most 256 voxels"));
        }
    };
    within_limit([x, y, z].map(u128::from), max_voxels)?;
    Ok([z, y, x].map(|side| side as usize))
}

fn paint(model: &Model, data: &DotVoxData, shape: Shape) -> Result<Vec<u8>, VolumeError> {
    let [depth, height, width] = shape;
    let mut voxels = vec![0; 3 * depth * height * width];
    for voxel in &model.voxels {
        let [z, y, x] = [voxel.z, voxel.y, voxel.x].map(usize::from);
        let place = 3 * ((z * height + y) * width + x);
        let inside = z < depth && y < height && x < width;
        let target = voxels.get_mut(place..place + 3).filter(|_| inside);
        let (Some(target), Some(colour)) = (target, data.palette.get(usize::from(voxel.i))) else {
            let found = format!("voxel {x}, {y}, {z} of the model is outside it or has no colour");
            return Err(VolumeError::malformed(found, SOUND));
        };
        target.copy_from_slice(&[colour.r, colour.g, colour.b]);
    }
    Ok(voxels)
}

const SOUND: &str = "no writer of .vox files does that";
const WHOLE: &str = "a .vox file should be whole";

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::Volume;

    fn from_bytes(bytes: &[u8], max_voxels: u64) -> Result<Volume, VolumeError> {
        let model = OneModel::find(bytes, max_voxels)?;
        Volume::new(model.shape, 3, model.voxels(model.shape)?)
    }

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
    fn the_z_axis_of_a_model_points_up() {
        let volume = from_bytes(&small(), u64::MAX).unwrap();
        assert_eq!((volume.shape(), volume.channels()), ([6, 5, 4], 3));
        let mut expected = vec![[0; 3]; 6 * 5 * 4];
        expected[5 * 20 + 4 * 4 + 3] = [7, 14, 21];
        expected[0] = [255, 254, 253];
        expected[3 * 20 + 2 * 4 + 1] = [1, 2, 3];
        assert_eq!(volume.voxels(), expected.as_flattened());
    }

    #[test]
    fn a_model_without_palette_has_the_default_one() {
        let volume = from_bytes(&file(&[size(3, 3, 3), voxels(&[[0, 0, 0, 1]])]), u64::MAX).unwrap();
        assert_eq!(volume.voxels()[..6], [255, 255, 255, 0, 0, 0]);
    }

    fn sentence(bytes: &[u8]) -> String {
        from_bytes(bytes, 1000).unwrap_err().to_string()
    }

    #[test]
    fn files_that_are_wrong_get_a_sentence() {
        let two = file(&[size(3, 3, 3), voxels(&[]), size(3, 3, 3), voxels(&[])]);
        assert!(sentence(&two).contains("2 models"));
        assert!(sentence(&file(&[])).contains("0 sizes and 0 sets of voxels"));
        assert!(sentence(&file(&[size(11, 10, 10), voxels(&[])])).contains("limit of 1000"));
        assert!(sentence(&file(&[size(257, 3, 3), voxels(&[])])).contains("257"));
        assert!(sentence(&file(&[size(2, 3, 3), voxels(&[])])).contains("at least 3"));
        assert!(sentence(&file(&[size(3, 3, 3), voxels(&[[0, 3, 0, 1]])])).contains("outside"));
        assert!(sentence(&small()[..100]).contains("longer than what is left"));
        assert!(sentence(b"VOX ").contains("longer than"));
        assert!(sentence(b"VOX \x96\0\0\0MAIN").contains("ends within its header, but a .vox file should be whole"));
    }

    #[test]
    fn deep_nesting_is_not_followed() {
        let deep: Vec<u8> = (0..100_000_u32)
            .rev()
            .flat_map(|level| [&b"nGRP"[..], &[0; 4], &(level * 12).to_le_bytes()].concat())
            .collect();
        let volume = from_bytes(&file(&[deep, size(3, 3, 3), voxels(&[])]), u64::MAX).unwrap();
        assert_eq!(volume.shape(), [3, 3, 3]);
    }

    proptest! {
        #![proptest_config(hlacdb_testing::cases(128))]
        #[test]
        fn no_bytes_panic(changes in prop::collection::vec((0..1100_usize, any::<u8>()), 1..6), cut in 0..1200_usize) {
            let mut bytes = small();
            for (place, byte) in changes {
                let place = place % 120;
                bytes[place] = byte;
            }
            bytes.truncate(cut);
            let _ = from_bytes(&bytes, u64::MAX);
        }
    }
}
