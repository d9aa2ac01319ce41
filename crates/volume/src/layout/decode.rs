//! Opening files, and decoding what is compressed in them.

use std::fs::File;
#[cfg(any(feature = "gzip", feature = "bzip2"))]
use std::io::{self, BufRead};
use std::io::{BufReader, Read};
use std::path::Path;

use super::data_layout::Encoding;
use super::text::{HexBytes, TextSamples};
use crate::{SampleType, VolumeError};

/// Opens a regular file: a pipe or a device has no end that could be checked.
pub(crate) fn open_file(path: &Path) -> Result<File, VolumeError> {
    let io = |source| VolumeError::Io { doing: "opening the file", source };
    // Before opening: to open a pipe that nobody writes to would block.
    if !std::fs::metadata(path).map_err(io)?.is_file() {
        return Err(VolumeError::NotAFile);
    }
    File::open(path).map_err(io)
}

/// Compressed files of ordinary samples have at least a sixteenth of their bytes.
const ORDINARY: u64 = 16;

/// Checks, before memory is taken, that a compressed file of `length` bytes may become samples of `bytes` bytes.
///
/// # Errors
/// [`VolumeError::Inflated`].
pub(crate) fn check_inflated(bytes: u128, length: u64, limit: u64) -> Result<(), VolumeError> {
    if bytes > u128::from(limit.max(length.saturating_mul(ORDINARY))) {
        return Err(VolumeError::Inflated { bytes, limit });
    }
    Ok(())
}

/// The first bytes of gzip data, decompressed: at most `limit` of them, fewer where the data end or are damaged.
#[cfg(feature = "gzip")]
pub(crate) fn gzip_start(data: impl BufRead, limit: u64) -> Vec<u8> {
    let mut start = Vec::new();
    // What was decompressed before an error is kept.
    let _ended = flate2::bufread::GzDecoder::new(data).take(limit).read_to_end(&mut start);
    start
}

/// The decoded bytes of samples of a type; `file` is positioned at the encoded ones.
pub(super) fn decoder(
    encoding: Encoding,
    file: BufReader<File>,
    samples: SampleType,
) -> Result<Box<dyn Read + Send>, VolumeError> {
    Ok(match encoding {
        Encoding::Raw => Box::new(file),
        #[cfg(feature = "gzip")]
        Encoding::Gzip => Box::new(Members::gzip(file)),
        #[cfg(feature = "gzip")]
        Encoding::Zlib => Box::new(flate2::bufread::ZlibDecoder::new(file)),
        #[cfg(not(feature = "gzip"))]
        Encoding::Gzip => return Err(VolumeError::FeatureDisabled { what: "gzip data", feature: "gzip" }),
        #[cfg(not(feature = "gzip"))]
        Encoding::Zlib => return Err(VolumeError::FeatureDisabled { what: "zlib data", feature: "gzip" }),
        #[cfg(feature = "bzip2")]
        Encoding::Bzip2 => Box::new(Members::bzip2(file)),
        #[cfg(not(feature = "bzip2"))]
        Encoding::Bzip2 => return Err(VolumeError::FeatureDisabled { what: "bzip2 data", feature: "bzip2" }),
        #[cfg(feature = "npz")]
        Encoding::Deflate(bytes) => Box::new(flate2::bufread::DeflateDecoder::new(file.take(bytes))),
        Encoding::Text => Box::new(TextSamples::new(file, samples)),
        Encoding::Hex => Box::new(HexBytes::new(file)),
    })
}

/// The data of compressed streams that follow one another in a file. Bytes after the last stream are ignored.
#[cfg(any(feature = "gzip", feature = "bzip2"))]
pub(super) struct Members<R: BufRead, D> {
    state: Option<Result<D, R>>,
    /// The first byte of each stream.
    magic: u8,
    begin: fn(R) -> D,
    end: fn(D) -> R,
}

#[cfg(feature = "gzip")]
impl<R: BufRead> Members<R, flate2::bufread::GzDecoder<R>> {
    /// The members of a gzip file.
    pub(super) fn gzip(reader: R) -> Self {
        use flate2::bufread::GzDecoder;
        Self { state: Some(Ok(GzDecoder::new(reader))), magic: 0x1f, begin: GzDecoder::new, end: GzDecoder::into_inner }
    }
}

#[cfg(feature = "bzip2")]
impl<R: BufRead> Members<R, bzip2::bufread::BzDecoder<R>> {
    /// The streams of a bzip2 file.
    pub(super) fn bzip2(reader: R) -> Self {
        use bzip2::bufread::BzDecoder;
        Self { state: Some(Ok(BzDecoder::new(reader))), magic: b'B', begin: BzDecoder::new, end: BzDecoder::into_inner }
    }
}

#[cfg(any(feature = "gzip", feature = "bzip2"))]
impl<R: BufRead, D: Read> Read for Members<R, D> {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        if buffer.is_empty() {
            return Ok(0);
        }
        loop {
            match self.state.take() {
                Some(Ok(mut member)) => match member.read(buffer)? {
                    0 => self.state = Some(Err((self.end)(member))),
                    read => {
                        self.state = Some(Ok(member));
                        return Ok(read);
                    }
                },
                Some(Err(mut reader)) => {
                    if reader.fill_buf()?.first() != Some(&self.magic) {
                        return Ok(0);
                    }
                    self.state = Some(Ok((self.begin)(reader)));
                }
                None => return Ok(0),
            }
        }
    }
}

#[cfg(all(feature = "gzip", feature = "bzip2"))]
#[cfg(test)]
mod tests {
    use super::super::bytes::exactly;
    use super::*;
    use crate::testing::gzip;

    fn bzip2(bytes: &[u8]) -> Vec<u8> {
        let mut encoder = bzip2::write::BzEncoder::new(Vec::new(), bzip2::Compression::fast());
        io::Write::write_all(&mut encoder, bytes).unwrap();
        encoder.finish().unwrap()
    }

    fn of_gzip(bytes: &[u8], expected: u64) -> Result<Vec<u8>, VolumeError> {
        exactly(Members::gzip(bytes), expected, true)
    }

    #[test]
    fn streams_follow_one_another_and_other_bytes_are_ignored() {
        let two = [gzip(b"first "), gzip(b"second")].concat();
        assert_eq!(of_gzip(&two, 12).unwrap(), b"first second");
        let padded = [&two[..], &[0; 512], b"rubbish"].concat();
        assert_eq!(of_gzip(&padded, 12).unwrap(), b"first second");
        let streams = [bzip2(b"first "), bzip2(b"second"), vec![0; 9]].concat();
        assert_eq!(exactly(Members::bzip2(&streams[..]), 12, true).unwrap(), b"first second");
    }

    #[test]
    fn a_wrong_checksum_is_damage() {
        let mut bytes = gzip(b"first second");
        let checksum = bytes.len() - 8;
        bytes[checksum] ^= 1;
        assert!(matches!(of_gzip(&bytes, 12), Err(VolumeError::Decode { .. })));
        assert!(matches!(of_gzip(b"no gzip at all", 12), Err(VolumeError::Decode { .. })));
    }

    #[test]
    fn truncated_data_are_measured() {
        let short = of_gzip(&gzip(&[1; 100]), 101);
        assert!(matches!(short, Err(VolumeError::Truncated { expected: 101, found: 100 })), "{short:?}");
        let noise: Vec<u8> = (0..10_000_u32).map(|i| (i.wrapping_mul(2_654_435_761) >> 24) as u8).collect();
        let packed = gzip(&noise);
        let cut = of_gzip(&packed[..packed.len() / 2], 10_000);
        assert!(matches!(cut, Err(VolumeError::Truncated { expected: 10_000, found: 1.. })), "{cut:?}");
    }

    #[test]
    fn no_more_is_decoded_than_promised() {
        // 64 MiB of zeros in 64 KiB.
        let bomb = gzip(&vec![0; 64 << 20]);
        let bytes = of_gzip(&bomb, 1000).unwrap();
        assert_eq!((bytes.len(), bytes.capacity()), (1000, 1000));
    }
}
