//! Reading archives.

use std::borrow::Cow;
use std::collections::BTreeMap;
use std::fs::File;
use std::io::{self, BufRead, BufReader, Read};
use std::path::Path;

use serde::Serialize;
use serde::de::DeserializeOwned;

use super::arrays::{moments_from_npy, volume_from_npy};
use super::list::{Heading, LIST, Line, LineContent, LineError, is_array_name, read_line};
use crate::TextureId;
use crate::database::handle::Database;
use crate::database::scheme::Scheme;
use crate::database::write::Added;
use crate::database::write::prepare::Preparation;
use crate::error::{Error, ExchangeError};
use crate::hlac::{MASK_COUNT, Sums};
use crate::progress::Progress;
use crate::store::{Content, NewTexture, Reads, ViewCode, Volumes};
use crate::volume::Volume;

/// Textures are committed when they have this number of bytes of voxels, ...
const BATCH_BYTES: u64 = 64 << 20;
/// ... or when there is this number of them.
const BATCH_TEXTURES: usize = 64;

/// What [`Database::import_textures`] added.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize)]
#[non_exhaustive]
pub struct ArchiveImportReport {
    /// The number of textures that were added.
    pub added: u64,
    /// The number of textures whose content was in the store already.
    pub duplicates: u64,
    /// The ids of all textures, in the order of the list.
    pub ids: Vec<TextureId>,
}

impl Database {
    /// Adds the textures of an archive that [`Database::export_textures`] wrote, in its order and with new ids. Content that
    /// is in the store already is left as it is. Voxels must have the hash that the list gives.
    ///
    /// Textures are added in transactions of a few dozen. If an error occurs or `progress` cancels, what was committed stays,
    /// and a second run adds the rest.
    ///
    /// # Errors
    /// [`ExchangeError::Archive`] if the list or an array is not valid; [`Error::Io`], [`Error::Store`].
    pub fn import_textures(&self, source: &Path, progress: &dyn Progress) -> Result<ArchiveImportReport, Error> {
        let mut import = Import {
            database: self,
            path: source,
            volumes: self.store().read()?.settings().volumes,
            batch: Vec::new(),
            bytes: 0,
            report: ArchiveImportReport::default(),
        };
        if source.is_dir() {
            import.folder(progress)?;
        } else {
            import.tar(progress)?;
        }
        import.commit()?;
        Ok(import.report)
    }
}

/// An archive that is being imported.
struct Import<'a> {
    database: &'a Database,
    path: &'a Path,
    volumes: Volumes,
    batch: Vec<Incoming>,
    bytes: u64,
    report: ArchiveImportReport,
}

/// A texture that is ready to be added.
enum Incoming {
    Volume(Box<Preparation<'static>>),
    Moments(Box<NewTexture>),
}

impl Import<'_> {
    fn invalid(&self, what: impl Into<String>) -> Error {
        ExchangeError::Archive { path: self.path.to_owned(), what: what.into() }.into()
    }

    fn failed(&self, source: io::Error) -> Error {
        Error::file("reading", self.path, source)
    }

    fn read_line<T: DeserializeOwned>(&self, list: &mut impl BufRead) -> Result<Option<T>, Error> {
        read_line(list).map_err(|error| match error {
            LineError::Io(source) => self.failed(source),
            LineError::Invalid(what) => self.invalid(what),
        })
    }

    fn check_heading(&self, list: &mut impl BufRead) -> Result<(), Error> {
        let heading: Option<Heading> = self.read_line(list)?;
        let heading = heading.ok_or_else(|| self.invalid(format!("{LIST} is empty")))?;
        heading.check().map_err(|what| self.invalid(what))
    }

    /// The name of an array, which must be where an export puts it.
    fn array_name<'n>(&self, name: &'n str) -> Result<&'n str, Error> {
        if is_array_name(name) {
            return Ok(name);
        }
        Err(self.invalid(format!("the list names '{}', which is not an array of an archive", name.escape_debug())))
    }

    fn folder(&mut self, progress: &dyn Progress) -> Result<(), Error> {
        let list = File::open(self.path.join(LIST)).map_err(|source| match source.kind() {
            io::ErrorKind::NotFound => self.invalid(format!("it contains no {LIST}")),
            _ => self.failed(source),
        })?;
        let mut list = BufReader::new(list);
        self.check_heading(&mut list)?;
        progress.begin("importing", None);
        while let Some(line) = self.read_line::<Line>(&mut list)? {
            if progress.cancelled() {
                break;
            }
            let array = match line.array() {
                Some(name) => {
                    let path = self.path.join(self.array_name(name)?);
                    Some(File::open(path).map_err(|source| self.failed(source))?)
                }
                None => None,
            };
            self.add(line, array)?;
            progress.advance(1);
        }
        Ok(())
    }

    fn tar(&mut self, progress: &dyn Progress) -> Result<(), Error> {
        let path = self.path;
        let failed = |source| Error::file("reading", path, source);
        let mut tar = tar::Archive::new(BufReader::new(File::open(path).map_err(failed)?));
        let mut expected: BTreeMap<String, Line> = BTreeMap::new();
        let mut has_list = false;
        for entry in tar.entries().map_err(failed)? {
            let entry = entry.map_err(failed)?;
            let name = entry.path().map_err(failed)?.to_string_lossy().into_owned();
            if name == LIST && !has_list {
                has_list = true;
                let mut list = BufReader::new(entry);
                self.check_heading(&mut list)?;
                while let Some(line) = self.read_line::<Line>(&mut list)? {
                    match line.array() {
                        Some(array) => drop(expected.insert(self.array_name(array)?.to_owned(), line)),
                        None => self.add::<&[u8]>(line, None)?,
                    }
                }
                progress.begin("importing", Some(expected.len() as u64));
            } else if !has_list {
                return Err(self.invalid(format!("it begins with '{}', not with {LIST}", name.escape_debug())));
            } else if let Some(line) = expected.remove(&name) {
                if progress.cancelled() {
                    return Ok(());
                }
                self.add(line, Some(entry))?;
                progress.advance(1);
            }
        }
        match (has_list, expected.into_values().next()) {
            (false, _) => Err(self.invalid(format!("it contains no {LIST}"))),
            (true, Some(line)) => Err(self.invalid(format!("the array of texture {} is missing", line.id))),
            (true, None) => Ok(()),
        }
    }

    /// Adds a texture with its array to the batch.
    fn add<R: Read>(&mut self, line: Line, array: Option<R>) -> Result<(), Error> {
        let id = line.id;
        let incoming = match (line.voxels.is_some(), array) {
            (true, Some(array)) => self.with_voxels(line, array),
            (_, array) => self.with_moments(line, array),
        };
        let incoming = incoming.map_err(|problem| match problem {
            Problem::Invalid(what) => self.invalid(format!("texture {id}: {what}")),
            Problem::Failed(error) => error,
        })?;
        self.batch.push(incoming);
        if self.batch.len() >= BATCH_TEXTURES || self.bytes >= BATCH_BYTES { self.commit() } else { Ok(()) }
    }

    fn with_voxels(&mut self, line: Line, array: impl Read) -> Result<Incoming, Problem> {
        let volume: Volume = volume_from_npy(array)?;
        let content = Content::of(&volume);
        if listed_content(line.content.as_ref())?.is_some_and(|listed| listed.hash != content.hash) {
            return Err(Problem::Invalid("its voxels do not have the hash that the list gives".into()));
        }
        self.bytes += volume.voxels().len() as u64;
        let texture = NewTexture {
            name: line.name,
            path: line.path_bytes.or(line.path.map(String::into_bytes)),
            tags: line.tags,
            provenance: line.provenance,
            cut: line.cut,
            ..NewTexture::default()
        };
        let prepared = self.database.prepare_hashed(Cow::Owned(volume), content, texture, self.volumes)?;
        Ok(Incoming::Volume(Box::new(prepared)))
    }

    fn with_moments(&self, line: Line, array: Option<impl Read>) -> Result<Incoming, Problem> {
        let descriptors = match array {
            None => Vec::new(),
            Some(array) => {
                let rows = moments_from_npy(array)?;
                if rows.len() != line.views.len() {
                    let what = format!("{} rows of moments for {} views", rows.len(), line.views.len());
                    return Err(Problem::Invalid(what));
                }
                // Views that the store does not keep are dropped.
                let scheme = Scheme::of(&self.database.store().read().map_err(Error::from)?);
                let view = |name: &String| scheme.views().iter().copied().find(|view| view.name() == *name);
                let each = line.views.iter().map(view).zip(rows);
                each.filter_map(|(view, row)| Some((ViewCode(view?.code()), row))).collect()
            }
        };
        let sums = match line.sums {
            None => None,
            Some((windows, values)) => {
                let values = values.try_into().map_err(|_| format!("it does not have {MASK_COUNT} sums"))?;
                Some(Sums { windows, values })
            }
        };
        Ok(Incoming::Moments(Box::new(NewTexture {
            name: line.name,
            path: line.path_bytes.or(line.path.map(String::into_bytes)),
            content: listed_content(line.content.as_ref())?,
            provenance: line.provenance,
            cut: line.cut,
            tags: line.tags,
            voxels: None,
            sums,
            descriptors,
        })))
    }

    /// Adds the batch in order; consecutive textures of one kind are added in one transaction.
    fn commit(&mut self) -> Result<(), Error> {
        self.bytes = 0;
        let mut volumes = Vec::new();
        for incoming in std::mem::take(&mut self.batch) {
            match incoming {
                Incoming::Volume(prepared) => volumes.push(*prepared),
                Incoming::Moments(texture) => {
                    self.commit_volumes(&mut volumes)?;
                    self.commit_moments(*texture)?;
                }
            }
        }
        self.commit_volumes(&mut volumes)
    }

    fn commit_volumes(&mut self, volumes: &mut Vec<Preparation<'static>>) -> Result<(), Error> {
        for added in self.database.commit_all(std::mem::take(volumes))? {
            self.count(added);
        }
        Ok(())
    }

    fn commit_moments(&mut self, texture: NewTexture) -> Result<(), Error> {
        let duplicate = match &texture.content {
            Some(content) => self.database.store().read()?.find(&content.hash)?,
            None => None,
        };
        match duplicate {
            Some(id) => self.count(Added::Duplicate(id.into())),
            None => {
                for id in self.database.add_described(vec![texture])? {
                    self.count(Added::New(id.into()));
                }
            }
        }
        Ok(())
    }

    fn count(&mut self, added: Added) {
        match added {
            Added::New(_) => self.report.added += 1,
            Added::Duplicate(_) => self.report.duplicates += 1,
        }
        self.report.ids.push(added.id());
    }
}

/// Why a texture of an archive cannot be added.
enum Problem {
    /// What is wrong with it.
    Invalid(String),
    Failed(Error),
}

impl From<String> for Problem {
    fn from(what: String) -> Self {
        Self::Invalid(what)
    }
}

impl From<Error> for Problem {
    fn from(error: Error) -> Self {
        Self::Failed(error)
    }
}

/// The content that the list gives.
fn listed_content(content: Option<&LineContent>) -> Result<Option<Content>, Problem> {
    let Some(content) = content else { return Ok(None) };
    match blake3::Hash::from_hex(&content.hash) {
        Ok(hash) => Ok(Some(Content { shape: content.shape, channels: content.channels, hash: *hash.as_bytes() })),
        Err(error) => Err(Problem::Invalid(format!("its hash cannot be read: {error}"))),
    }
}
