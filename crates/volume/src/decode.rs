//! Bytes from files that may lie: never more than was promised, never memory for a promise that is not kept.
//!
//! Memory grows with the bytes that really arrive, so a small file that promises a huge volume costs little before it
//! is found out. A compressed stream is read to its promise and one byte further: that byte makes the decoder check the
//! stream's checksum where the data end as promised; where more follows, it is ignored, in every format.

use std::fs::File;
use std::io::{self, BufRead, BufReader, ErrorKind, Read, Seek, SeekFrom};
use std::path::{Component, Path, PathBuf};

use bzip2::bufread::BzDecoder;
use flate2::bufread::GzDecoder;

use super::{SampleType, VolumeError};

/// The most memory that is taken ahead of the bytes that fill it.
const AHEAD: u64 = 16 << 20;

/// The longest number or word in a text file.
const LONGEST_WORD: usize = 64;

/// The longest header of the formats whose headers are text.
const LONGEST_HEADER: u64 = 1 << 20;

/// Opens a regular file: a pipe or a device has no end that could be checked.
pub(super) fn open(path: &Path) -> Result<File, VolumeError> {
    let io = |source| VolumeError::Io { doing: "opening the file", source };
    // Asked before opening: to open a pipe without a writer would wait for one.
    if !std::fs::metadata(path).map_err(io)?.is_file() {
        return Err(VolumeError::Unsupported {
            what: "a folder, pipe or device in place of a file".into(),
            supported: "regular files".into(),
        });
    }
    File::open(path).map_err(io)
}

/// What a compressed file of ordinary samples shrinks to at most: a sixteenth.
const ORDINARY: u64 = 16;

/// Checks, before memory is taken, that a compressed file of `length` bytes may become samples of `bytes` bytes.
pub(super) fn may_inflate(bytes: u128, length: u64, limit: u64) -> Result<(), VolumeError> {
    if bytes > u128::from(limit.max(length.saturating_mul(ORDINARY))) {
        return Err(VolumeError::Inflated { bytes, limit });
    }
    Ok(())
}

/// Exactly `expected` bytes. `what` names their encoding in an error, e.g. `the gzip data`.
pub(super) fn exactly(reader: impl Read, expected: u64, what: &'static str) -> Result<Vec<u8>, VolumeError> {
    let mut bytes = Vec::new();
    Promised::new(reader, expected, what).read(expected, &mut bytes)?;
    Ok(bytes)
}

/// A stream of a promised length, which may be read in pieces.
pub(super) struct Promised<R> {
    reader: R,
    expected: u64,
    found: u64,
    what: &'static str,
}

impl<R: Read> Promised<R> {
    /// `expected` bytes of `reader`. `what` names their encoding in an error, e.g. `the gzip data`.
    pub(super) fn new(reader: R, expected: u64, what: &'static str) -> Self {
        Self { reader, expected, found: 0, what }
    }

    /// Appends the next `count` bytes, which must not go beyond the promise. With the last of them the decoder has
    /// checked what it can check.
    pub(super) fn read(&mut self, count: u64, bytes: &mut Vec<u8>) -> Result<(), VolumeError> {
        let end = self.found.saturating_add(count);
        while self.found < end {
            // Doubling, so that the bytes are moved few times, but never beyond the promise.
            let more = (end - self.found).min((bytes.len() as u64).max(AHEAD));
            reserve(bytes, more)?;
            let before = bytes.len();
            let result = self.reader.by_ref().take(more).read_to_end(bytes);
            self.found += (bytes.len() - before) as u64;
            match result.map_err(|source| failed(source, self.what, self.expected, self.found))? {
                0 => return Err(VolumeError::Truncated { expected: self.expected, found: self.found }),
                _ => continue,
            }
        }
        if self.found == self.expected {
            let beyond = self.reader.by_ref().take(1).read_to_end(&mut Vec::new());
            beyond.map_err(|source| failed(source, self.what, self.expected, self.found))?;
        }
        Ok(())
    }
}

/// Memory for `more` bytes, or the error that there is none.
fn reserve(bytes: &mut Vec<u8>, more: u64) -> Result<(), VolumeError> {
    let none = || VolumeError::Io { doing: "taking memory for the samples", source: ErrorKind::OutOfMemory.into() };
    bytes.try_reserve_exact(usize::try_from(more).map_err(|_| none())?).map_err(|_| none())
}

/// Tells the end of the data, damage and a refusing system apart.
fn failed(source: io::Error, what: &'static str, expected: u64, found: u64) -> VolumeError {
    match source.kind() {
        ErrorKind::UnexpectedEof => VolumeError::Truncated { expected, found },
        ErrorKind::InvalidData | ErrorKind::InvalidInput => {
            VolumeError::Decode { what: what.into(), source: Box::new(source) }
        }
        _ => VolumeError::Io { doing: "reading the samples", source },
    }
}

/// Reads over `count` decoded bytes.
pub(super) fn skip(mut reader: impl Read, count: u64, what: &'static str) -> Result<(), VolumeError> {
    let passed = io::copy(&mut reader.by_ref().take(count), &mut io::sink());
    let passed = passed.map_err(|source| failed(source, what, count, 0))?;
    if passed < count { Err(VolumeError::Truncated { expected: count, found: passed }) } else { Ok(()) }
}

/// The data of compressed streams that follow one another in a file; what follows them and is none is ignored.
pub(super) struct Members<R: BufRead, D> {
    state: Option<Result<D, R>>,
    /// The byte that each stream begins with.
    magic: u8,
    begin: fn(R) -> D,
    end: fn(D) -> R,
}

impl<R: BufRead> Members<R, GzDecoder<R>> {
    /// Members of gzip.
    pub(super) fn gzip(reader: R) -> Self {
        Self { state: Some(Ok(GzDecoder::new(reader))), magic: 0x1f, begin: GzDecoder::new, end: GzDecoder::into_inner }
    }
}

impl<R: BufRead> Members<R, BzDecoder<R>> {
    /// Streams of bzip2.
    pub(super) fn bzip2(reader: R) -> Self {
        Self { state: Some(Ok(BzDecoder::new(reader))), magic: b'B', begin: BzDecoder::new, end: BzDecoder::into_inner }
    }
}

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

/// `count` samples written as text, apart by white space or commas: as little-endian bytes of their type.
pub(super) fn text(reader: impl Read, count: u64, ty: SampleType) -> Result<Vec<u8>, VolumeError> {
    let expected = count.saturating_mul(ty.size() as u64);
    let mut bytes = Vec::new();
    let mut words = Words { bytes: BufReader::new(reader).bytes() };
    while (bytes.len() as u64) < expected {
        let Some(word) = words.next()? else {
            return Err(VolumeError::Truncated { expected, found: bytes.len() as u64 });
        };
        if bytes.capacity() - bytes.len() < ty.size() {
            let more = (expected - bytes.len() as u64).min((bytes.len() as u64).max(AHEAD / 256));
            reserve(&mut bytes, more)?;
        }
        push_sample(&mut bytes, &word, ty).ok_or_else(|| VolumeError::Malformed {
            found: format!("the text sample \"{}\" was found", word.escape_debug()),
            expected: format!("the header promises numbers of type {ty}"),
        })?;
    }
    Ok(bytes)
}

/// Appends one number, little-endian; `None` where the word is none of that type.
fn push_sample(bytes: &mut Vec<u8>, word: &str, ty: SampleType) -> Option<()> {
    match ty {
        SampleType::U8 => bytes.push(word.parse().ok()?),
        SampleType::I8 => bytes.extend(word.parse::<i8>().ok()?.to_le_bytes()),
        SampleType::U16 => bytes.extend(word.parse::<u16>().ok()?.to_le_bytes()),
        SampleType::I16 => bytes.extend(word.parse::<i16>().ok()?.to_le_bytes()),
        SampleType::U32 => bytes.extend(word.parse::<u32>().ok()?.to_le_bytes()),
        SampleType::I32 => bytes.extend(word.parse::<i32>().ok()?.to_le_bytes()),
        SampleType::U64 => bytes.extend(word.parse::<u64>().ok()?.to_le_bytes()),
        SampleType::I64 => bytes.extend(word.parse::<i64>().ok()?.to_le_bytes()),
        SampleType::F16 => bytes.extend(half::f16::from_f64(word.parse().ok()?).to_le_bytes()),
        SampleType::F32 => bytes.extend(word.parse::<f32>().ok()?.to_le_bytes()),
        SampleType::F64 => bytes.extend(word.parse::<f64>().ok()?.to_le_bytes()),
    }
    Some(())
}

/// The words of a text.
struct Words<R: Read> {
    bytes: io::Bytes<BufReader<R>>,
}

impl<R: Read> Words<R> {
    fn next(&mut self) -> Result<Option<String>, VolumeError> {
        let mut word = String::new();
        for byte in self.bytes.by_ref() {
            let byte = byte.map_err(|source| VolumeError::Io { doing: "reading the samples", source })?;
            if byte.is_ascii_whitespace() || byte == b',' {
                if !word.is_empty() {
                    break;
                }
                continue;
            }
            word.push(char::from(byte));
            if word.len() > LONGEST_WORD {
                break;
            }
        }
        Ok((!word.is_empty()).then_some(word))
    }
}

/// `expected` bytes written as pairs of hexadecimal digits, with white space anywhere.
pub(super) fn hex(reader: impl Read, expected: u64) -> Result<Vec<u8>, VolumeError> {
    let mut bytes = Vec::new();
    let mut high = None;
    for byte in BufReader::new(reader).bytes() {
        if bytes.len() as u64 == expected {
            break;
        }
        let byte = byte.map_err(|source| VolumeError::Io { doing: "reading the samples", source })?;
        if byte.is_ascii_whitespace() {
            continue;
        }
        let digit = char::from(byte).to_digit(16).ok_or_else(|| VolumeError::Malformed {
            found: format!("the character '{}' was found among the samples", byte.escape_ascii()),
            expected: "the header promises hexadecimal digits".into(),
        })? as u8;
        match high.take() {
            None => high = Some(digit),
            Some(high) => bytes.push(high << 4 | digit),
        }
    }
    let found = bytes.len() as u64;
    if found < expected { Err(VolumeError::Truncated { expected, found }) } else { Ok(bytes) }
}

/// The lines of a text header, and where in the file they end.
pub(super) struct HeaderLines {
    reader: io::Take<BufReader<File>>,
    /// Bytes read: after the last line of a header, where its data begin.
    pub(super) position: u64,
}

impl HeaderLines {
    /// The lines from the start of a file.
    pub(super) fn open(path: &Path) -> Result<Self, VolumeError> {
        Ok(Self { reader: BufReader::new(open(path)?).take(LONGEST_HEADER), position: 0 })
    }

    /// The next line without its end and the white space around it; `None` at the end of the file.
    pub(super) fn next(&mut self) -> Result<Option<String>, VolumeError> {
        let mut line = Vec::new();
        let read = self.reader.read_until(b'\n', &mut line);
        self.position += read.map_err(|source| VolumeError::Io { doing: "reading the header", source })? as u64;
        if self.position >= LONGEST_HEADER {
            return Err(VolumeError::Malformed {
                found: format!("no end of the header was found in its first {LONGEST_HEADER} bytes"),
                expected: "headers are shorter: the file is damaged or of another kind".into(),
            });
        }
        Ok((!line.is_empty()).then(|| String::from_utf8_lossy(line.trim_ascii()).into_owned()))
    }
}

/// The position after `count` lines that follow `start`.
pub(super) fn after_lines(path: &Path, start: u64, count: u64) -> Result<u64, VolumeError> {
    let io = |source| VolumeError::Io { doing: "skipping lines before the samples", source };
    let mut file = open(path)?;
    file.seek(SeekFrom::Start(start)).map_err(io)?;
    let (mut position, mut lines) = (start, 0);
    let mut reader = BufReader::new(file);
    while lines < count {
        let buffer = reader.fill_buf().map_err(io)?;
        if buffer.is_empty() {
            return Err(VolumeError::Malformed {
                found: format!("the data file has {lines} lines"),
                expected: format!("the header skips {count} lines before the samples"),
            });
        }
        let used = buffer.iter().position(|&byte| byte == b'\n').map_or(buffer.len(), |end| end + 1);
        lines += u64::from(buffer[used - 1] == b'\n');
        position += used as u64;
        reader.consume(used);
    }
    Ok(position)
}

/// The file that a detached header names, which must lie in the header's own folder or below it, links followed.
pub(super) fn beside(header: &Path, named: &Path) -> Result<PathBuf, VolumeError> {
    let shown = || named.to_string_lossy().escape_debug().to_string();
    let outside = || VolumeError::Outside { named: shown() };
    if !named.components().all(|part| matches!(part, Component::Normal(_) | Component::CurDir)) {
        return Err(outside());
    }
    let missing = |source| VolumeError::DataFile { named: shown(), source };
    let folder = header.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
    let data = folder.join(named).canonicalize().map_err(missing)?;
    let folder = folder.canonicalize().map_err(missing)?;
    if data.starts_with(&folder) { Ok(data) } else { Err(outside()) }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::{Folder, gzip};

    fn bzip2(bytes: &[u8]) -> Vec<u8> {
        let mut encoder = bzip2::write::BzEncoder::new(Vec::new(), bzip2::Compression::fast());
        io::Write::write_all(&mut encoder, bytes).unwrap();
        encoder.finish().unwrap()
    }

    fn of_gzip(bytes: &[u8], expected: u64) -> Result<Vec<u8>, VolumeError> {
        exactly(Members::gzip(bytes), expected, "the gzip data")
    }

    #[test]
    fn members_follow_one_another_and_what_is_none_is_ignored() {
        let two = [gzip(b"first "), gzip(b"second")].concat();
        assert_eq!(of_gzip(&two, 12).unwrap(), b"first second");
        let padded = [&two[..], &[0; 512], b"rubbish"].concat();
        assert_eq!(of_gzip(&padded, 12).unwrap(), b"first second");
        let streams = [bzip2(b"first "), bzip2(b"second"), vec![0; 9]].concat();
        assert_eq!(exactly(Members::bzip2(&streams[..]), 12, "the bzip2 data").unwrap(), b"first second");
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
    fn what_ends_early_says_how_far_it_came() {
        let short = of_gzip(&gzip(&[1; 100]), 101);
        assert!(matches!(short, Err(VolumeError::Truncated { expected: 101, found: 100 })), "{short:?}");
        let noise: Vec<u8> = (0..10_000_u32).map(|i| (i.wrapping_mul(2_654_435_761) >> 24) as u8).collect();
        let packed = gzip(&noise);
        let cut = of_gzip(&packed[..packed.len() / 2], 10_000);
        assert!(matches!(cut, Err(VolumeError::Truncated { expected: 10_000, found: 1.. })), "{cut:?}");
    }

    #[test]
    fn a_bomb_stops_at_its_promise() {
        // 64 MiB of zeros in 64 KiB.
        let bomb = gzip(&vec![0; 64 << 20]);
        let bytes = of_gzip(&bomb, 1000).unwrap();
        assert_eq!((bytes.len(), bytes.capacity()), (1000, 1000));
    }

    #[test]
    fn memory_is_taken_as_bytes_arrive() {
        struct Meter(u64);
        impl Read for Meter {
            fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
                assert!(buffer.len() as u64 <= AHEAD.max(self.0), "no more ahead than what has come");
                let read = buffer.len().min(100_000).min((40 << 20) - self.0 as usize);
                self.0 += read as u64;
                Ok(read)
            }
        }
        let short = exactly(Meter(0), 1 << 50, "the data");
        assert!(matches!(short, Err(VolumeError::Truncated { found, .. }) if found == 40 << 20), "{short:?}");
    }

    #[test]
    fn text_and_hex() {
        let numbers = |text: &str, count, ty| super::text(text.as_bytes(), count, ty);
        assert_eq!(numbers(" 1 2,3\n\n255 rest", 4, SampleType::U8).unwrap(), [1, 2, 3, 255]);
        assert_eq!(numbers("-1 256", 2, SampleType::I16).unwrap(), [255, 255, 0, 1]);
        assert_eq!(
            numbers("0.5 1e3", 2, SampleType::F32).unwrap(),
            [0.5_f32.to_le_bytes(), 1e3_f32.to_le_bytes()].concat()
        );
        for bad in ["256", "x", "-1", "1.5", &"9".repeat(1000)] {
            assert!(matches!(numbers(bad, 1, SampleType::U8), Err(VolumeError::Malformed { .. })), "{bad}");
        }
        let short = numbers("1 2", 1 << 40, SampleType::F64);
        assert!(matches!(short, Err(VolumeError::Truncated { found: 16, .. })), "{short:?}");
        assert_eq!(hex(&b"00 fF\n1 0rest"[..], 3).unwrap(), [0, 255, 16]);
        assert!(matches!(hex(&b"00 f"[..], 2), Err(VolumeError::Truncated { expected: 2, found: 1 })));
        assert!(matches!(hex(&b"0g"[..], 1), Err(VolumeError::Malformed { .. })));
    }

    #[test]
    fn lines_are_counted_in_bytes() {
        let folder = Folder::new();
        let path = folder.write("lines", b"one\r\n two \n\nlast");
        let mut lines = HeaderLines::open(&path).unwrap();
        let mut found = Vec::new();
        while let Some(line) = lines.next().unwrap() {
            found.push((line, lines.position));
        }
        let expected = [("one", 5), ("two", 11), ("", 12), ("last", 16)];
        assert_eq!(found, expected.map(|(line, position)| (line.to_owned(), position)));
        assert_eq!(after_lines(&path, 0, 2).unwrap(), 11);
        assert_eq!(after_lines(&path, 5, 0).unwrap(), 5);
        assert!(matches!(after_lines(&path, 0, u64::MAX), Err(VolumeError::Malformed { .. })));
    }

    #[test]
    fn a_header_without_end_is_given_up() {
        let folder = Folder::new();
        for endless in [vec![b'a'; 3 << 20], b"a: b\n".repeat(1 << 19)] {
            let mut lines = HeaderLines::open(&folder.write("endless", endless)).unwrap();
            let error = loop {
                match lines.next() {
                    Ok(line) => assert!(line.is_some()),
                    Err(error) => break error,
                }
            };
            assert!(matches!(error, VolumeError::Malformed { .. }), "{error}");
        }
    }

    #[test]
    fn only_files_beside_the_header_or_below_are_found() {
        let folder = Folder::new();
        let inner = folder.path().join("inner");
        std::fs::create_dir_all(inner.join("below")).unwrap();
        folder.write("outside.raw", b"");
        folder.write("inner/data 1.raw", b"");
        folder.write("inner/below/data.raw", b"");
        let header = inner.join("header.nhdr");
        let named = |name: &str| beside(&header, Path::new(name));
        assert!(named("data 1.raw").is_ok());
        assert!(named("./below/data.raw").is_ok());
        let absolute = inner.join("data 1.raw");
        for outside in ["../outside.raw", "below/../data 1.raw", "..", "/etc/passwd", absolute.to_str().unwrap()] {
            assert!(matches!(named(outside), Err(VolumeError::Outside { .. })), "{outside}");
        }
        for missing in ["none.raw", "data 1.raw/more"] {
            assert!(matches!(named(missing), Err(VolumeError::DataFile { .. })), "{missing}");
        }
        #[cfg(unix)]
        {
            let link = |to: &str, name: &str| std::os::unix::fs::symlink(to, inner.join(name)).unwrap();
            link("../outside.raw", "out");
            link("below/data.raw", "in");
            link("loop", "loop");
            assert!(matches!(named("out"), Err(VolumeError::Outside { .. })));
            assert!(named("in").is_ok());
            assert!(matches!(named("loop"), Err(VolumeError::DataFile { .. })));
        }
    }
}
