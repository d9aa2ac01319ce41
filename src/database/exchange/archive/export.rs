//! Writing archives.

use std::fs::{self, File};
use std::io::{self, BufWriter, Read, Write};
use std::path::Path;

use serde::Serialize;

use super::arrays::{to_npy, volume_to_npy};
use super::list::{Heading, LIST, Line, LineContent, MOMENTS, VOXELS, array_name, is_tar, to_line};
use crate::TextureId;
use crate::database::handle::Database;
use crate::database::points::descriptors::descriptor;
use crate::error::Error;
use crate::hlac::MASK_COUNT;
use crate::progress::Progress;
use crate::space::Descriptor;
use crate::store::{Reads, Record, Snapshot, StoreError};
use crate::volume::display_path;

/// What [`Database::export_textures`] wrote.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
#[non_exhaustive]
pub struct ArchiveExportReport {
    /// The number of textures that were written.
    pub textures: u64,
    /// The number of textures that were written with voxels.
    pub with_voxels: u64,
    /// Textures that were left out because they are damaged.
    pub damaged: Vec<TextureId>,
    /// The path of the folder or file.
    pub file: String,
}

impl Database {
    /// Writes whole textures (voxels, tags, provenance) to an archive at `target`: a tar file if its name ends in `.tar`,
    /// otherwise a folder. Nothing may exist there but an empty folder. The archive is of one state of the store, even if
    /// others write meanwhile. Damaged textures are left out and listed.
    ///
    /// # Errors
    /// [`Error::Io`], [`Error::Store`], [`Error::Cancelled`].
    pub fn export_textures(&self, target: &Path, progress: &dyn Progress) -> Result<ArchiveExportReport, Error> {
        let failed = |source| Error::file("writing", target, source);
        let snapshot = self.store().read()?;
        let mut report =
            ArchiveExportReport { textures: 0, with_voxels: 0, damaged: Vec::new(), file: display_path(target) };
        let mut archive = Archive::create(target).map_err(failed)?;
        // The lines are made twice, so that the list comes first in a tar file and is never in memory as a whole.
        let mut bytes = 0;
        for line in lines(&snapshot, &mut report.damaged) {
            bytes += line?.len() as u64;
        }
        let mut again = Vec::new();
        let mut list = Lines { lines: lines(&snapshot, &mut again), line: Vec::new(), position: 0 };
        archive.put(LIST, bytes, &mut list).map_err(failed)?;
        drop(list);
        progress.begin("exporting", Some(snapshot.counts().textures));
        for id in snapshot.rows()?.live().map(|(_, id)| id) {
            if progress.cancelled() {
                return Err(Error::Cancelled);
            }
            progress.advance(1);
            if report.damaged.contains(&id.into()) {
                continue;
            }
            report.textures += 1;
            report.with_voxels += u64::from(write_array(&snapshot, id, &mut archive, target)?);
        }
        archive.finish().map_err(failed)?;
        Ok(report)
    }
}

/// An archive that is written.
enum Archive<'a> {
    Folder(&'a Path),
    Tar(Box<tar::Builder<BufWriter<File>>>),
}

impl<'a> Archive<'a> {
    fn create(target: &'a Path) -> io::Result<Self> {
        if is_tar(target) {
            let file = File::options().write(true).create_new(true).open(target)?;
            return Ok(Self::Tar(Box::new(tar::Builder::new(BufWriter::new(file)))));
        }
        fs::create_dir_all(target)?;
        if fs::read_dir(target)?.next().is_some() {
            return Err(io::Error::new(io::ErrorKind::AlreadyExists, "the folder is not empty"));
        }
        for folder in [VOXELS, MOMENTS] {
            fs::create_dir(target.join(folder))?;
        }
        Ok(Self::Folder(target))
    }

    /// Writes one file of the archive.
    fn put(&mut self, name: &str, bytes: u64, content: &mut dyn Read) -> io::Result<()> {
        match self {
            Self::Folder(folder) => {
                let mut file = BufWriter::new(File::create(folder.join(name))?);
                io::copy(content, &mut file)?;
                file.flush()
            }
            Self::Tar(tar) => {
                let mut header = tar::Header::new_gnu();
                header.set_size(bytes);
                header.set_mode(0o644);
                // No time, so that the same store gives the same file.
                header.set_mtime(0);
                tar.append_data(&mut header, name, content)
            }
        }
    }

    fn finish(self) -> io::Result<()> {
        match self {
            Self::Folder(_) => Ok(()),
            Self::Tar(mut tar) => tar.finish().and_then(|()| tar.get_mut().flush()),
        }
    }
}

/// The lines of the list, heading first. Damaged textures are left out and noted.
fn lines<'a>(
    snapshot: &'a Snapshot,
    damaged: &'a mut Vec<TextureId>,
) -> impl Iterator<Item = Result<Vec<u8>, Error>> + 'a {
    let heading = to_line(&Heading::current());
    let ids: Vec<u64> = snapshot.rows().map(|rows| rows.live().map(|(_, id)| id).collect()).unwrap_or_default();
    std::iter::once(heading).chain(ids.into_iter().filter_map(move |id| match line_of(snapshot, id) {
        Err(Error::Store(StoreError::Damage(damage))) => {
            tracing::warn!("{damage}: texture {id} is left out of the archive");
            damaged.push(id.into());
            None
        }
        Ok(None) => None,
        Ok(Some(line)) => Some(to_line(&line)),
        Err(error) => Some(Err(error)),
    }))
}

/// The line of a texture. What its array needs is read as well, so that every array that is named can be written.
fn line_of(snapshot: &Snapshot, id: u64) -> Result<Option<Line>, Error> {
    let Some(record) = snapshot.record(id)? else { return Ok(None) };
    let has_voxels = record.voxels.is_some();
    let (mut moments, mut sums) = (Descriptor::default(), None);
    if has_voxels {
        snapshot.check_voxels(id)?;
    } else {
        moments = descriptor(snapshot, id)?;
        sums = snapshot.sums(id)?.map(|sums| (sums.windows, sums.values.to_vec()));
    }
    let Record { name, path, content, provenance, cut, tags, .. } = record;
    let (path, path_bytes) = match path.map(String::from_utf8) {
        None => (None, None),
        Some(Ok(text)) => (Some(text), None),
        Some(Err(error)) => (None, Some(error.into_bytes())),
    };
    let content = content.map(|content| LineContent {
        shape: content.shape,
        channels: content.channels,
        hash: blake3::Hash::from_bytes(content.hash).to_string(),
    });
    Ok(Some(Line {
        id,
        name,
        path,
        path_bytes,
        tags,
        provenance,
        cut,
        content,
        voxels: has_voxels.then(|| array_name(VOXELS, id)),
        moments: (!has_voxels && !moments.is_empty()).then(|| array_name(MOMENTS, id)),
        views: moments.views().map(|view| view.name().to_owned()).collect(),
        sums,
    }))
}

/// Writes the array of a texture. True if it has voxels.
fn write_array(snapshot: &Snapshot, id: u64, archive: &mut Archive<'_>, target: &Path) -> Result<bool, Error> {
    let failed = |source| Error::file("writing", target, source);
    if let Some(volume) = snapshot.voxels(id)? {
        let bytes = volume_to_npy(&volume).map_err(failed)?;
        archive.put(&array_name(VOXELS, id), bytes.len() as u64, &mut &bytes[..]).map_err(failed)?;
        return Ok(true);
    }
    let moments = descriptor(snapshot, id)?;
    if !moments.is_empty() {
        let rows: Vec<f32> = moments.iter().flat_map(|(_, row)| *row).collect();
        let bytes = to_npy(&[moments.len(), MASK_COUNT], &rows).map_err(failed)?;
        archive.put(&array_name(MOMENTS, id), bytes.len() as u64, &mut &bytes[..]).map_err(failed)?;
    }
    Ok(false)
}

/// Lines as one stream of bytes.
struct Lines<I> {
    lines: I,
    line: Vec<u8>,
    position: usize,
}

impl<I: Iterator<Item = Result<Vec<u8>, Error>>> Read for Lines<I> {
    fn read(&mut self, out: &mut [u8]) -> io::Result<usize> {
        while self.position >= self.line.len() {
            match self.lines.next() {
                None => return Ok(0),
                Some(line) => (self.line, self.position) = (line.map_err(io::Error::other)?, 0),
            }
        }
        let mut rest = self.line.get(self.position..).unwrap_or_default();
        let read = rest.read(out)?;
        self.position += read;
        Ok(read)
    }
}
