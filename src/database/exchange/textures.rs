//! Whole textures out and in: what a later version, and other programs, can read.
//!
//! A folder or a tar file holds `textures.jsonl`, one JSON object per line, and the arrays that the lines name: first a line
//! `{"format":"hlacdb textures","version":1}`, then a line per texture in id order. Voxels are numpy arrays of `u8`,
//! (Z, Y, X) or (Z, Y, X, 3). A texture without voxels comes with its moments, `f32`, one row of 251 per view. In a tar file
//! `textures.jsonl` comes first. Fields that are not known are passed over when reading; a higher version is refused.

use std::borrow::Cow;
use std::collections::BTreeMap;
use std::fs::{self, File};
use std::io::{self, BufRead, BufReader, BufWriter, Read, Write};
use std::path::Path;

use serde::{Deserialize, Serialize};

use super::arrays;
use crate::TextureId;
use crate::database::handle::Database;
use crate::database::points::descriptors::descriptor;
use crate::database::scheme::Scheme;
use crate::database::write::Added;
use crate::database::write::prepare::PreparedTexture;
use crate::error::{Error, ExchangeError};
use crate::hlac::{MASK_COUNT, Sums};
use crate::progress::Progress;
use crate::space::Descriptor;
use crate::store::{Content, Cut, NewTexture, Provenance, Reads, Record, Snapshot, StoreError, ViewCode, Volumes};
use crate::volume::display_path;

/// The name of the list.
const LIST: &str = "textures.jsonl";
const FORMAT: &str = "hlacdb textures";
const VERSION: u32 = 1;
/// Textures are committed together until they have so many bytes of voxels.
const BATCH_BYTES: u64 = 64 << 20;
/// ... or there are so many.
const BATCH: usize = 64;
/// No line of the list is longer.
const LONGEST_LINE: u64 = 1 << 24;

#[derive(Serialize, Deserialize)]
struct Heading {
    format: String,
    version: u32,
}

/// A texture in the list.
#[derive(Serialize, Deserialize)]
struct Line {
    id: u64,
    name: String,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    path: Option<String>,
    /// The path's bytes, where they are not UTF-8.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    path_bytes: Option<Vec<u8>>,
    #[serde(default)]
    tags: BTreeMap<String, String>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    provenance: Option<Provenance>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    cut: Option<Cut>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    content: Option<LineContent>,
    /// The array of voxels.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    voxels: Option<String>,
    /// The array of moments, where there are no voxels.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    moments: Option<String>,
    /// The views of its rows.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    views: Vec<String>,
    /// Windows and exact sums of full@1, where there are no voxels.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    sums: Option<(u64, Vec<u64>)>,
}

#[derive(Serialize, Deserialize)]
struct LineContent {
    shape: [u64; 3],
    channels: u8,
    /// BLAKE3 over shape, channels and voxels, hexadecimal.
    hash: String,
}

/// What [`Database::export_textures`] wrote.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct TexturesExportReport {
    /// Textures written.
    pub textures: u64,
    /// Of these, with voxels.
    pub with_voxels: u64,
    /// Textures that are damaged and were left out.
    pub damaged: Vec<TextureId>,
    /// The folder or file.
    pub file: String,
}

/// What [`Database::import_textures`] added.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize)]
pub struct TexturesImportReport {
    /// Textures added.
    pub added: u64,
    /// Textures whose content was in the store already.
    pub duplicates: u64,
    /// The ids of all of them, in the order of the list.
    pub ids: Vec<TextureId>,
}

/// Where an export goes.
enum Sink<'a> {
    Folder(&'a Path),
    Tar(Box<tar::Builder<BufWriter<File>>>),
}

impl Sink<'_> {
    /// Writes one file of the export.
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
                // No time: the same store makes the same file.
                header.set_mtime(0);
                tar.append_data(&mut header, name, content)
            }
        }
    }
}

impl Database {
    /// Writes whole textures (voxels, tags, provenance) to `target`: a tar file where its name ends in `.tar`, else a folder.
    /// Nothing may be there, but an empty folder. What is written is of one moment, whoever writes meanwhile. Textures that
    /// are damaged are left out and named.
    ///
    /// # Errors
    /// [`Error::Io`], [`Error::Store`], [`Error::Cancelled`].
    pub fn export_textures(&self, target: &Path, progress: &dyn Progress) -> Result<TexturesExportReport, Error> {
        let failed = |source| Error::file("writing", target, source);
        let snapshot = self.store().read()?;
        let mut report =
            TexturesExportReport { textures: 0, with_voxels: 0, damaged: Vec::new(), file: display_path(target) };
        let mut sink = if is_tar(target) {
            let file = File::options().write(true).create_new(true).open(target).map_err(failed)?;
            Sink::Tar(Box::new(tar::Builder::new(BufWriter::new(file))))
        } else {
            fs::create_dir_all(target).map_err(failed)?;
            if fs::read_dir(target).map_err(failed)?.next().is_some() {
                return Err(failed(io::Error::new(io::ErrorKind::AlreadyExists, "the folder is not empty")));
            }
            for folder in ["voxels", "moments"] {
                fs::create_dir(target.join(folder)).map_err(failed)?;
            }
            Sink::Folder(target)
        };
        // Twice over the records, so that the list can come first and is never in memory as a whole.
        let mut bytes = 0;
        for line in lines(&snapshot, &mut report.damaged) {
            bytes += line?.len() as u64;
        }
        let mut again = Vec::new();
        let mut list = Lines { lines: lines(&snapshot, &mut again), held: Vec::new(), at: 0 };
        sink.put(LIST, bytes, &mut list).map_err(failed)?;
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
            report.with_voxels += u64::from(write_arrays(&snapshot, id, &mut sink, target)?);
        }
        if let Sink::Tar(mut tar) = sink {
            tar.finish().and_then(|()| tar.get_mut().flush()).map_err(failed)?;
        }
        Ok(report)
    }

    /// Adds the textures of a folder or tar file that [`Database::export_textures`] wrote, in its order; ids are given anew. What
    /// is in the store already, by content, is left as it is. Voxels must have the hash that the list says.
    ///
    /// The textures go in by transactions of a few dozen; where an error or cancelling stops it, what was committed stays,
    /// and a second run adds the rest.
    ///
    /// # Errors
    /// [`ExchangeError::Archive`] where the list or an array is not what it should be; [`Error::Io`], [`Error::Store`].
    pub fn import_textures(&self, source: &Path, progress: &dyn Progress) -> Result<TexturesImportReport, Error> {
        let mut import = Import {
            database: self,
            path: source,
            volumes: self.store().read()?.settings().volumes,
            batch: Vec::new(),
            bytes: 0,
            report: TexturesImportReport::default(),
        };
        let failed = |source_of: io::Error| Error::file("reading", source, source_of);
        if source.is_dir() {
            let mut list = BufReader::new(File::open(source.join(LIST)).map_err(failed)?);
            import.heading(&mut list)?;
            progress.begin("importing", None);
            while let Some(line) = import.line(&mut list)? {
                if progress.cancelled() {
                    break;
                }
                let array = match line.voxels.as_ref().or(line.moments.as_ref()) {
                    Some(name) => Some(File::open(source.join(import.plain(name)?)).map_err(failed)?),
                    None => None,
                };
                import.take(line, array)?;
                progress.advance(1);
            }
        } else {
            import.tar(File::open(source).map_err(failed)?, progress)?;
        }
        import.commit()?;
        Ok(import.report)
    }
}

fn is_tar(path: &Path) -> bool {
    path.extension().is_some_and(|extension| extension.eq_ignore_ascii_case("tar"))
}

/// The name of a texture's array.
fn array_name(folder: &str, id: u64) -> String {
    format!("{folder}/{id:08}.npy")
}

/// The lines of the list, heading first. Damaged textures are left out and noted.
fn lines<'a>(
    snapshot: &'a Snapshot,
    damaged: &'a mut Vec<TextureId>,
) -> impl Iterator<Item = Result<Vec<u8>, Error>> + 'a {
    let heading = to_line(&Heading { format: FORMAT.into(), version: VERSION });
    let ids: Vec<u64> = snapshot.rows().map(|rows| rows.live().map(|(_, id)| id).collect()).unwrap_or_default();
    std::iter::once(heading).chain(ids.into_iter().filter_map(move |id| match line_of(snapshot, id) {
        Err(Error::Store(StoreError::Damage(damage))) => {
            tracing::warn!("{damage}: texture {id} is left out of the export");
            damaged.push(id.into());
            None
        }
        Ok(None) => None,
        Ok(Some(line)) => Some(to_line(&line)),
        Err(error) => Some(Err(error)),
    }))
}

fn to_line(value: &impl Serialize) -> Result<Vec<u8>, Error> {
    let mut line = serde_json::to_vec(value).map_err(|error| Error::io("writing the list", error.into()))?;
    line.push(b'\n');
    Ok(line)
}

/// A texture's line. What its arrays need is read as well, so that what is named can be written.
fn line_of(snapshot: &Snapshot, id: u64) -> Result<Option<Line>, Error> {
    let Some(record) = snapshot.record(id)? else { return Ok(None) };
    let keeps = record.voxels.is_some();
    let (mut moments, mut sums) = (Descriptor::default(), None);
    if keeps {
        snapshot.check_voxels(id)?;
    } else {
        moments = descriptor(snapshot, id)?;
        sums = snapshot.sums(id)?.map(|sums| (sums.windows, sums.values.to_vec()));
    }
    let Record { name, path, content, provenance, cut, tags, .. } = record;
    let (text, bytes) = match path.map(String::from_utf8) {
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
        path: text,
        path_bytes: bytes,
        tags,
        provenance,
        cut,
        content,
        voxels: keeps.then(|| array_name("voxels", id)),
        moments: (!keeps && !moments.is_empty()).then(|| array_name("moments", id)),
        views: moments.views().map(|view| view.name().to_owned()).collect(),
        sums,
    }))
}

/// Writes the array of a texture; true where it is voxels.
fn write_arrays(snapshot: &Snapshot, id: u64, sink: &mut Sink<'_>, target: &Path) -> Result<bool, Error> {
    let failed = |source| Error::file("writing", target, source);
    if let Some(volume) = snapshot.voxels(id)? {
        let bytes = arrays::volume_to_npy(&volume).map_err(failed)?;
        sink.put(&array_name("voxels", id), bytes.len() as u64, &mut &bytes[..]).map_err(failed)?;
        return Ok(true);
    }
    let descriptor = descriptor(snapshot, id)?;
    if !descriptor.is_empty() {
        let rows: Vec<f32> = descriptor.iter().flat_map(|(_, moments)| *moments).collect();
        let bytes = arrays::to_npy(&[descriptor.len(), MASK_COUNT], &rows).map_err(failed)?;
        sink.put(&array_name("moments", id), bytes.len() as u64, &mut &bytes[..]).map_err(failed)?;
    }
    Ok(false)
}

/// Lines as one stream of bytes.
struct Lines<I> {
    lines: I,
    held: Vec<u8>,
    at: usize,
}

impl<I: Iterator<Item = Result<Vec<u8>, Error>>> Read for Lines<I> {
    fn read(&mut self, out: &mut [u8]) -> io::Result<usize> {
        while self.at >= self.held.len() {
            match self.lines.next() {
                None => return Ok(0),
                Some(line) => (self.held, self.at) = (line.map_err(io::Error::other)?, 0),
            }
        }
        let mut rest = self.held.get(self.at..).unwrap_or_default();
        let read = rest.read(out)?;
        self.at += read;
        Ok(read)
    }
}

/// Textures on their way in.
struct Import<'a> {
    database: &'a Database,
    path: &'a Path,
    volumes: Volumes,
    batch: Vec<Incoming>,
    bytes: u64,
    report: TexturesImportReport,
}

enum Incoming {
    Whole(Box<PreparedTexture<'static>>),
    Described(Box<NewTexture>),
}

impl Import<'_> {
    fn wrong(&self, what: impl Into<String>) -> Error {
        ExchangeError::Archive { path: self.path.to_owned(), what: what.into() }.into()
    }

    fn heading(&self, list: &mut impl BufRead) -> Result<(), Error> {
        let heading: Heading = self.parse(list)?.ok_or_else(|| self.wrong(format!("{LIST} is empty")))?;
        if heading.format != FORMAT || heading.version > VERSION {
            let (found, version) = (heading.format.escape_debug().to_string(), heading.version);
            return Err(self.wrong(format!(
                "{LIST} has format '{found}' version {version}, but this version of hlacdb reads '{FORMAT}' up to version {VERSION}"
            )));
        }
        Ok(())
    }

    fn line(&self, list: &mut impl BufRead) -> Result<Option<Line>, Error> {
        self.parse(list)
    }

    fn parse<T: serde::de::DeserializeOwned>(&self, list: &mut impl BufRead) -> Result<Option<T>, Error> {
        let mut line = Vec::new();
        let read = list.by_ref().take(LONGEST_LINE).read_until(b'\n', &mut line);
        read.map_err(|source| Error::file("reading", self.path, source))?;
        if line.is_empty() {
            return Ok(None);
        }
        let parsed = serde_json::from_slice(&line);
        parsed.map(Some).map_err(|error| self.wrong(format!("a line of {LIST} cannot be read: {error}")))
    }

    /// The name of an array, which must lie where an export puts it.
    fn plain<'n>(&self, name: &'n str) -> Result<&'n str, Error> {
        let plain = |part: &str| !part.is_empty() && !part.starts_with('.') && !part.contains(['/', '\\']);
        match name.split_once('/') {
            Some(("voxels" | "moments", file)) if plain(file) => Ok(name),
            _ => Err(self.wrong(format!("the list names '{}', which is no array of an export", name.escape_debug()))),
        }
    }

    fn tar(&mut self, file: File, progress: &dyn Progress) -> Result<(), Error> {
        let path = self.path;
        let failed = |source| Error::file("reading", path, source);
        let mut tar = tar::Archive::new(BufReader::new(file));
        let mut expected: BTreeMap<String, Line> = BTreeMap::new();
        let mut begun = false;
        for entry in tar.entries().map_err(failed)? {
            let entry = entry.map_err(failed)?;
            let name = entry.path().map_err(failed)?.to_string_lossy().into_owned();
            if name == LIST && !begun {
                begun = true;
                let mut list = BufReader::new(entry);
                self.heading(&mut list)?;
                while let Some(line) = self.line(&mut list)? {
                    match line.voxels.as_ref().or(line.moments.as_ref()) {
                        Some(array) => drop(expected.insert(self.plain(array)?.to_owned(), line)),
                        None => self.take::<&[u8]>(line, None)?,
                    }
                }
                progress.begin("importing", Some(expected.len() as u64));
            } else if !begun {
                return Err(self.wrong(format!("it begins with '{}', not with {LIST}", name.escape_debug())));
            } else if let Some(line) = expected.remove(&name) {
                if progress.cancelled() {
                    return Ok(());
                }
                self.take(line, Some(entry))?;
                progress.advance(1);
            }
        }
        match (begun, expected.into_values().next()) {
            (false, _) => Err(self.wrong(format!("there is no {LIST} in it"))),
            (true, Some(line)) => Err(self.wrong(format!("the array of texture {} is missing", line.id))),
            (true, None) => Ok(()),
        }
    }

    /// Takes a texture with its array into the batch.
    fn take<R: Read>(&mut self, line: Line, array: Option<R>) -> Result<(), Error> {
        let id = line.id;
        let odd = |import: &Self, what: String| import.wrong(format!("texture {id}: {what}"));
        let path = line.path_bytes.or(line.path.map(String::into_bytes));
        let content = match &line.content {
            None => None,
            Some(content) => match blake3::Hash::from_hex(&content.hash) {
                Ok(hash) => Some(Content { shape: content.shape, channels: content.channels, hash: *hash.as_bytes() }),
                Err(error) => return Err(odd(self, format!("its hash cannot be read: {error}"))),
            },
        };
        match (line.voxels.is_some(), array) {
            (true, Some(array)) => {
                let volume = arrays::volume_from_npy(array).map_err(|what| odd(self, what))?;
                let found = Content::of(&volume);
                if content.is_some_and(|listed| listed.hash != found.hash) {
                    return Err(odd(self, "its voxels do not have the hash that the list says".into()));
                }
                let texture = NewTexture {
                    name: line.name,
                    path,
                    tags: line.tags,
                    provenance: line.provenance,
                    cut: line.cut,
                    ..NewTexture::default()
                };
                self.bytes += volume.voxels().len() as u64;
                let prepared = self.database.prepare_hashed(Cow::Owned(volume), found, texture, self.volumes)?;
                self.batch.push(Incoming::Whole(Box::new(prepared)));
            }
            (_, array) => {
                let descriptors = match array {
                    None => Vec::new(),
                    Some(array) => {
                        let rows = arrays::moments_from_npy(array).map_err(|what| odd(self, what))?;
                        if rows.len() != line.views.len() {
                            let what = format!("{} rows of moments for {} views", rows.len(), line.views.len());
                            return Err(odd(self, what));
                        }
                        let known = Scheme::of(&self.database.store().read()?);
                        let view = |name: &String| known.views().iter().copied().find(|view| view.name() == *name);
                        let each = line.views.iter().map(view).zip(rows);
                        each.filter_map(|(view, row)| Some((ViewCode(view?.code()), row))).collect()
                    }
                };
                let sums = match line.sums {
                    None => None,
                    Some((windows, values)) => match values.try_into() {
                        Ok(values) => Some(Sums { windows, values }),
                        Err(_) => return Err(odd(self, format!("its sums are not {MASK_COUNT}"))),
                    },
                };
                let texture = NewTexture {
                    name: line.name,
                    path,
                    content,
                    provenance: line.provenance,
                    cut: line.cut,
                    tags: line.tags,
                    voxels: None,
                    sums,
                    descriptors,
                };
                self.batch.push(Incoming::Described(Box::new(texture)));
            }
        }
        if self.batch.len() >= BATCH || self.bytes >= BATCH_BYTES {
            self.commit()?;
        }
        Ok(())
    }

    /// Adds the batch, textures of one kind at a time, in their order.
    fn commit(&mut self) -> Result<(), Error> {
        self.bytes = 0;
        let mut batch = std::mem::take(&mut self.batch).into_iter().peekable();
        while batch.peek().is_some() {
            let (mut whole, mut described) = (Vec::new(), Vec::new());
            while let Some(next) = batch.next_if(|next| match next {
                Incoming::Whole(_) => described.is_empty(),
                Incoming::Described(_) => whole.is_empty(),
            }) {
                match next {
                    Incoming::Whole(prepared) => whole.push(*prepared),
                    Incoming::Described(texture) => described.push(*texture),
                }
            }
            for added in self.database.commit_all(whole)? {
                self.count(added);
            }
            for texture in described {
                let known = match &texture.content {
                    Some(content) => self.database.store().read()?.find(&content.hash)?,
                    None => None,
                };
                match known {
                    Some(id) => self.count(Added::Duplicate(id.into())),
                    None => {
                        for id in self.database.add_described(vec![texture])? {
                            self.count(Added::New(id.into()));
                        }
                    }
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

/// For the fuzzer: the lines of a list, and their arrays.
#[cfg(feature = "fuzz")]
#[doc(hidden)]
pub fn fuzz_list(bytes: &[u8]) {
    for line in bytes.split(|&byte| byte == b'\n') {
        let _ = serde_json::from_slice::<Line>(line);
    }
    let _ = (arrays::volume_from_npy(bytes), arrays::moments_from_npy(bytes));
}
