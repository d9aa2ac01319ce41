//! Headers of text: their lines, the data files they name, and the lines that are skipped before samples.

use std::fs::File;
use std::io::{self, BufRead, BufReader, Read, Seek, SeekFrom};
use std::path::{Component, Path, PathBuf};

use super::open_file;
use crate::VolumeError;
use crate::text::excerpt;

/// The longest header that is read.
const LONGEST_HEADER: u64 = 1 << 20;

/// Reads the lines of a text header.
pub(crate) struct HeaderLines {
    reader: io::Take<BufReader<File>>,
    /// Bytes read. After the last line of a header, this is where its data begin.
    pub(crate) position: u64,
}

impl HeaderLines {
    /// The lines from the start of a file.
    pub(crate) fn open(path: &Path) -> Result<Self, VolumeError> {
        Ok(Self { reader: BufReader::new(open_file(path)?).take(LONGEST_HEADER), position: 0 })
    }

    /// The next line without the white space around it; `None` at the end of the file.
    pub(crate) fn next(&mut self) -> Result<Option<String>, VolumeError> {
        let mut line = Vec::new();
        let read = self.reader.read_until(b'\n', &mut line);
        self.position += read.map_err(|source| VolumeError::Io { doing: "reading the header", source })? as u64;
        if self.position >= LONGEST_HEADER {
            return Err(VolumeError::malformed(
                format!("the header has no end in its first {LONGEST_HEADER} bytes"),
                "headers are shorter",
            ));
        }
        Ok((!line.is_empty()).then(|| String::from_utf8_lossy(line.trim_ascii()).into_owned()))
    }
}

/// The position after `count` lines that follow `start`.
pub(crate) fn after_lines(path: &Path, start: u64, count: u64) -> Result<u64, VolumeError> {
    let io = |source| VolumeError::Io { doing: "skipping lines before the samples", source };
    let mut file = open_file(path)?;
    file.seek(SeekFrom::Start(start)).map_err(io)?;
    let (mut position, mut lines) = (start, 0);
    let mut reader = BufReader::new(file);
    while lines < count {
        let buffer = reader.fill_buf().map_err(io)?;
        if buffer.is_empty() {
            return Err(VolumeError::malformed(
                format!("the data file has {lines} lines"),
                format!("the header skips {count} lines before the samples"),
            ));
        }
        let used = buffer.iter().position(|&byte| byte == b'\n').map_or(buffer.len(), |end| end + 1);
        lines += u64::from(buffer.get(used - 1) == Some(&b'\n'));
        position += used as u64;
        reader.consume(used);
    }
    Ok(position)
}

/// The data file that a header names. With links followed, it must be in the folder of the header or below it.
///
/// # Errors
/// [`VolumeError::OutsideFolder`], [`VolumeError::DataFile`] if it cannot be reached.
pub(crate) fn beside(header: &Path, named: &Path) -> Result<PathBuf, VolumeError> {
    let shown = || excerpt(&named.to_string_lossy());
    let outside = || VolumeError::OutsideFolder { named: shown() };
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
    use crate::testing::Folder;

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
    fn a_header_without_end_is_refused() {
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
            assert!(matches!(named(outside), Err(VolumeError::OutsideFolder { .. })), "{outside}");
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
            assert!(matches!(named("out"), Err(VolumeError::OutsideFolder { .. })));
            assert!(named("in").is_ok());
            assert!(matches!(named("loop"), Err(VolumeError::DataFile { .. })));
        }
    }
}
