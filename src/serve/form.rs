//! What is sent as a form: files, into a private folder that is gone with the request, and fields.

use std::collections::{BTreeMap, HashSet};
use std::path::{Path, PathBuf};
use std::sync::Arc;

use axum::extract::multipart::{Field, Multipart, MultipartError};
use axum::http::StatusCode;
use tempfile::TempDir;
use tokio::io::AsyncWriteExt;

use super::auth::too_large;
use super::problem::Problem;
use super::routes::textures::parse_filter;
use super::settings::Settings;
use super::state::App;
use crate::ingest::Options;
use crate::volume::{self, ReadOptions};

/// So many files one form may hold, ...
const MOST_FILES: usize = 10_000;
/// ... and so many bytes one of its fields.
const LONGEST_FIELD: usize = 1 << 20;
/// So many bytes of a file's name are kept: file systems take 255.
const LONGEST_NAME: usize = 240;

/// The files and fields of a form.
pub(crate) struct Intake {
    /// Removed, with all that is in it, when this is dropped.
    folder: TempDir,
    /// The names of the files, in the order in which they came.
    names: Vec<String>,
    pub(crate) fields: Vec<(String, String)>,
}

impl Intake {
    /// Takes a form in, file by file, without holding one in memory.
    pub(crate) async fn receive(app: &Arc<App>, mut form: Multipart) -> Result<Self, Problem> {
        let _place = app.forms.place().await?;
        let broken = |error: MultipartError| refused(app, &error);
        let folder = tempfile::Builder::new().prefix("hlacdb-").tempdir().map_err(failed)?;
        let (mut names, mut fields, mut taken) = (Vec::new(), Vec::new(), HashSet::new());
        while let Some(field) = form.next_field().await.map_err(broken)? {
            let Some(given) = field.file_name() else {
                let name = field.name().unwrap_or_default().to_owned();
                let text = text(field).await.map_err(|error| refused_field(app, error))?;
                fields.push((name, text));
                continue;
            };
            if names.len() == MOST_FILES {
                let sentence = format!("a form holds at most {MOST_FILES} files: send them in several");
                return Err(Problem::new(StatusCode::PAYLOAD_TOO_LARGE, sentence));
            }
            let name = safe_name(given);
            // A second file of the same name gets a folder of its own.
            let mut place = folder.path().join(FILES);
            if !taken.insert(name.clone()) {
                place.push(untaken(&mut taken));
            }
            tokio::fs::create_dir_all(&place).await.map_err(failed)?;
            write(field, &place.join(&name)).await.map_err(|error| refused_field(app, error))?;
            names.push(name);
        }
        Ok(Self { folder, names, fields })
    }

    /// Where the volumes are that came, and the folder below which their paths mean something to the sender. Slices are
    /// one volume, called by what their names share.
    pub(crate) fn volumes(&self) -> Result<(Vec<PathBuf>, PathBuf), Problem> {
        if self.names.is_empty() {
            return Err(Problem::bad_request("the form has no file: send one or more as `file`"));
        }
        let files = self.folder.path().join(FILES);
        let found = volume::uploaded_volumes(&files).map_err(failed)?;
        if !found.contains(&files) {
            return Ok((found, files));
        }
        let stack = self.folder.path().join(stack_name(&self.names));
        std::fs::rename(&files, &stack).map_err(failed)?;
        Ok((volume::uploaded_volumes(&stack).map_err(failed)?, self.folder.path().to_path_buf()))
    }

    /// How the files are read and tagged, as the fields say: `tag` (`KEY=VALUE`, repeated), `intensity`, `block`.
    pub(crate) fn options(&self, app: &App) -> Result<Options, Problem> {
        let mut options = Options { reading: reading(app), ..Options::default() };
        for (key, value) in &self.fields {
            match key.as_str() {
                "tag" => options.tags.extend([tag(value)?]),
                "intensity" => options.reading.intensity = intensity(value)?,
                "block" => options.block = Some(block(value)?),
                _ => {
                    let sentence =
                        format!("'{}' is no field of this form: use file, tag, intensity, block", key.escape_debug());
                    return Err(Problem::bad_request(sentence));
                }
            }
        }
        Ok(options)
    }

    /// A text of the library without the folder that the files lie in for a moment.
    pub(crate) fn shown(&self, text: &str) -> String {
        let folder = self.folder.path();
        let inner = volume::display_path(&folder.join(FILES));
        let stack = volume::display_path(&folder.join(stack_name(&self.names)));
        let text = text.replace(&format!("{inner}/"), "").replace(&format!("{stack}/"), "");
        let folder = volume::display_path(folder);
        text.replace(&format!("{folder}/"), "").replace(&folder, "the upload")
    }
}

/// The folder in which files wait until all have come.
const FILES: &str = "files";

/// How files of strangers are read.
pub(crate) fn reading(app: &App) -> ReadOptions {
    let &Settings { max_voxels, max_inflated, .. } = &app.settings;
    ReadOptions::new().max_voxels(max_voxels).max_inflated(max_inflated)
}

/// `KEY=VALUE` with neither side empty.
fn tag(text: &str) -> Result<(String, String), Problem> {
    let pair = parse_filter(text)?;
    if pair.value().is_empty() {
        return Err(Problem::bad_request(format!("'{}' has no value", text.escape_debug())));
    }
    Ok((pair.key().to_owned(), pair.value().to_owned()))
}

pub(crate) fn tags(tags: BTreeMap<String, String>) -> Result<BTreeMap<String, String>, Problem> {
    match tags.iter().find(|(key, value)| key.is_empty() || value.is_empty()) {
        Some((key, value)) => {
            let sentence =
                format!("'{}={}' is no tag: neither side may be empty", key.escape_debug(), value.escape_debug());
            Err(Problem::bad_request(sentence))
        }
        None => Ok(tags),
    }
}

pub(crate) fn intensity(text: &str) -> Result<volume::Intensity, Problem> {
    text.parse().map_err(|error: volume::IntensityError| Problem::bad_request(error.to_string()))
}

fn block(text: &str) -> Result<usize, Problem> {
    let side = text.parse().ok().filter(|side| BLOCKS.contains(side));
    side.ok_or_else(|| Problem::bad_request(format!("'{}' is no side of a block: use 3 to 4096", text.escape_debug())))
}

/// The sides that a block may have.
pub(crate) const BLOCKS: std::ops::RangeInclusive<usize> = 3..=4096;

/// The last part of a name, without what could make it mean something else to the file system.
fn safe_name(given: &str) -> String {
    let last = given.rsplit(['/', '\\']).next().unwrap_or_default();
    let clean: String =
        last.chars().map(|letter| if letter.is_control() || letter == ':' { '_' } else { letter }).collect();
    let clean = clean.trim_start_matches('.').trim();
    // The end of a name says what the file is: of a long one, the beginning goes.
    let from = clean.ceil_char_boundary(clean.len().saturating_sub(LONGEST_NAME));
    let kept = clean.get(from..).unwrap_or_default().trim_start_matches('.').trim();
    if kept.is_empty() { "file".to_owned() } else { kept.to_owned() }
}

/// A name for a folder beside the files that no file among them has, or will have.
fn untaken(taken: &mut HashSet<String>) -> String {
    let mut number = taken.len();
    while !taken.insert(number.to_string()) {
        number += 1;
    }
    number.to_string()
}

/// What the names of a stack's slices share: `core` for `core_001.png`, `core_002.png`.
fn stack_name(names: &[String]) -> String {
    let first = names.first().map_or("", String::as_str);
    let stem = first.split('.').next().unwrap_or_default();
    let shared = names.iter().fold(stem, |shared, name| {
        let same = shared.char_indices().zip(name.chars()).take_while(|((_, a), b)| a == b);
        same.last().map_or("", |((at, letter), _)| shared.get(..at + letter.len_utf8()).unwrap_or_default())
    });
    let shared = shared.trim_end_matches(|letter: char| letter.is_ascii_digit() || "-_. ".contains(letter));
    if shared.is_empty() || shared == FILES { "slices".to_owned() } else { shared.to_owned() }
}

/// Why a field was not taken in.
enum Refused {
    Form(MultipartError),
    TooLong,
    Disk(std::io::Error),
}

async fn text(mut field: Field<'_>) -> Result<String, Refused> {
    let mut bytes = Vec::new();
    while let Some(chunk) = field.chunk().await.map_err(Refused::Form)? {
        if bytes.len() + chunk.len() > LONGEST_FIELD {
            return Err(Refused::TooLong);
        }
        bytes.extend_from_slice(&chunk);
    }
    Ok(String::from_utf8_lossy(&bytes).into_owned())
}

async fn write(mut field: Field<'_>, path: &Path) -> Result<(), Refused> {
    let mut file = tokio::fs::File::create_new(path).await.map_err(Refused::Disk)?;
    while let Some(chunk) = field.chunk().await.map_err(Refused::Form)? {
        file.write_all(&chunk).await.map_err(Refused::Disk)?;
    }
    file.flush().await.map_err(Refused::Disk)
}

fn refused_field(app: &App, error: Refused) -> Problem {
    match error {
        Refused::Form(error) => refused(app, &error),
        Refused::TooLong => {
            Problem::new(StatusCode::PAYLOAD_TOO_LARGE, format!("a field holds at most {LONGEST_FIELD} bytes"))
        }
        Refused::Disk(error) => failed(error),
    }
}

fn refused(app: &App, error: &MultipartError) -> Problem {
    match error.status() {
        StatusCode::PAYLOAD_TOO_LARGE => Problem::new(StatusCode::PAYLOAD_TOO_LARGE, too_large(app)),
        status => Problem::new(status, error.body_text()),
    }
}

/// Our own disk's fault.
fn failed(error: std::io::Error) -> Problem {
    tracing::error!(%error, "an upload could not be kept");
    let full = error.kind() == std::io::ErrorKind::StorageFull;
    let status = if full { StatusCode::INSUFFICIENT_STORAGE } else { StatusCode::INTERNAL_SERVER_ERROR };
    Problem::new(status, "the server could not keep the upload: its log says more")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_lead_nowhere() {
        for (given, kept) in [
            ("../../etc/passwd", "passwd"),
            ("C:\\scans\\a.npy", "a.npy"),
            ("/etc/cron.d/x.tif", "x.tif"),
            (".hidden.npy", "hidden.npy"),
            ("..", "file"),
            ("", "file"),
            ("a\n\0b.npy", "a__b.npy"),
            ("Marmor, weiß.nii.gz", "Marmor, weiß.nii.gz"),
        ] {
            assert_eq!(safe_name(given), kept, "{given:?}");
        }
        for letter in ["ß", "石", "🪨", "."] {
            let long = safe_name(&format!("{}a.nii.gz", letter.repeat(500)));
            assert!(long.ends_with("a.nii.gz") && long.len() < 255 && !long.starts_with('.'), "{long}");
        }
    }

    #[test]
    fn a_stack_is_called_by_what_its_names_share() {
        let name = |names: &[&str]| stack_name(&names.iter().map(|&name| name.to_owned()).collect::<Vec<_>>());
        assert_eq!(name(&["core_001.png", "core_002.png", "core_010.png"]), "core");
        assert_eq!(name(&["1.png", "2.png"]), "slices");
        assert_eq!(name(&["files.png"]), "slices");
        assert_eq!(name(&["ä1.png", "ä2.png"]), "ä");
        assert_eq!(name(&["a.png", "b.png"]), "slices");
    }
}
