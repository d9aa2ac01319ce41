//! Multipart forms: their files are received into a private folder that is removed with the request.

use std::collections::HashSet;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use axum::extract::multipart::{Field, Multipart, MultipartError};
use axum::http::StatusCode;
use tempfile::TempDir;
use tokio::io::AsyncWriteExt;

use super::limits;
use super::parameters;
use super::paths::Roots;
use super::problem::Problem;
use super::state::App;
use crate::ingest::IngestOptions;
use crate::volume;

/// How many files a form may have.
const MAX_FILES: usize = 10_000;
/// How many bytes a field that is not a file may have.
const MAX_FIELD_BYTES: usize = 1 << 20;
/// How many bytes of a file name are kept; file systems take 255.
const MAX_NAME_BYTES: usize = 240;
/// The folder that files are received into.
const FILES: &str = "files";

/// The files and fields of a form.
pub(crate) struct UploadedForm {
    /// Removed with everything in it when this is dropped.
    folder: TempDir,
    /// The names of the files in the order of the form.
    names: Vec<String>,
    pub(crate) fields: Vec<(String, String)>,
}

/// The volumes of a form.
pub(crate) struct UploadedVolumes {
    /// Their files and folders.
    pub(crate) paths: Vec<PathBuf>,
    /// The folder below which their paths are those that the sender knows.
    pub(crate) root: PathBuf,
}

impl UploadedForm {
    /// Receives a form. Files go to disk as they arrive.
    pub(crate) async fn receive(app: &Arc<App>, mut form: Multipart) -> Result<Self, Problem> {
        let _permit = app.form_limit.acquire().await?;
        let max_body = app.options.max_body;
        let malformed = |error: MultipartError| malformed_form(max_body, &error);
        let folder = tempfile::Builder::new().prefix("hlacdb-").tempdir().map_err(disk_failure)?;
        let (mut names, mut fields, mut used) = (Vec::new(), Vec::new(), HashSet::new());
        while let Some(field) = form.next_field().await.map_err(malformed)? {
            let Some(given) = field.file_name() else {
                let name = field.name().unwrap_or_default().to_owned();
                let text = receive_text(field).await.map_err(|error| error.into_problem(max_body))?;
                fields.push((name, text));
                continue;
            };
            if names.len() == MAX_FILES {
                let detail = format!("a form may have at most {MAX_FILES} files: send several forms");
                return Err(Problem::new(StatusCode::PAYLOAD_TOO_LARGE, detail));
            }
            let name = safe_name(given);
            // A second file with the same name goes to a folder of its own.
            let mut parent = folder.path().join(FILES);
            if !used.insert(name.clone()) {
                parent.push(unused_name(&mut used));
            }
            tokio::fs::create_dir_all(&parent).await.map_err(disk_failure)?;
            let received = receive_file(field, &parent.join(&name)).await;
            received.map_err(|error| error.into_problem(max_body))?;
            names.push(name);
        }
        Ok(Self { folder, names, fields })
    }

    /// The volumes that were sent. Slices of one volume become a folder that is named by what their names share.
    pub(crate) fn volumes(&self) -> Result<UploadedVolumes, Problem> {
        if self.names.is_empty() {
            return Err(Problem::bad_request("the form has no file: send one or more as `file`"));
        }
        let files = self.folder.path().join(FILES);
        let paths = volume::uploaded_volumes(&files).map_err(disk_failure)?;
        if !paths.contains(&files) {
            return Ok(UploadedVolumes { paths, root: files });
        }
        let stack = self.folder.path().join(stack_name(&self.names));
        std::fs::rename(&files, &stack).map_err(disk_failure)?;
        let paths = volume::uploaded_volumes(&stack).map_err(disk_failure)?;
        Ok(UploadedVolumes { paths, root: self.folder.path().to_path_buf() })
    }

    /// How the files are read and tagged, from the fields `tag` (`KEY=VALUE`, repeated), `intensity` and `block`.
    pub(crate) fn ingest_options(&self, app: &App) -> Result<IngestOptions, Problem> {
        let (mut options, mut reading) = (IngestOptions::new(), parameters::read_options(&app.options));
        for (key, value) in &self.fields {
            match key.as_str() {
                "tag" => {
                    let (key, value) = parameters::tag(value)?;
                    options = options.tag(key, value);
                }
                "intensity" => reading.intensity = parameters::intensity(value)?,
                "block" => options = options.block(parameters::block_side(value)?),
                _ => return Err(unknown_field(key, "file, tag, intensity, block")),
            }
        }
        Ok(options.reading(reading))
    }

    /// The folders of the uploaded files: answers name them as the sender did.
    pub(crate) fn roots(&self) -> Roots {
        let folder = self.folder.path();
        Roots::new([folder.join(FILES), folder.join(stack_name(&self.names)), folder.to_owned()])
    }
}

/// The problem of a field that a form does not have.
pub(crate) fn unknown_field(key: &str, known: &str) -> Problem {
    Problem::bad_request(format!("this form has no field '{}'; its fields: {known}", key.escape_debug()))
}

/// The last component of a name, without characters that have a meaning to file systems.
fn safe_name(given: &str) -> String {
    let last = given.rsplit(['/', '\\']).next().unwrap_or_default();
    let clean: String =
        last.chars().map(|letter| if letter.is_control() || letter == ':' { '_' } else { letter }).collect();
    let clean = clean.trim_start_matches('.').trim();
    // Of a long name the end is kept, because the extension tells the format.
    let from = clean.ceil_char_boundary(clean.len().saturating_sub(MAX_NAME_BYTES));
    let kept = clean.get(from..).unwrap_or_default().trim_start_matches('.').trim();
    if kept.is_empty() { "file".to_owned() } else { kept.to_owned() }
}

/// A name for a folder beside the files that no file has or will have.
fn unused_name(used: &mut HashSet<String>) -> String {
    let mut number = used.len();
    while !used.insert(number.to_string()) {
        number += 1;
    }
    number.to_string()
}

/// What the names of slices share: `core` for `core_001.png`, `core_002.png`.
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

/// Why a field could not be received.
enum FieldError {
    Form(MultipartError),
    TooLong,
    Disk(std::io::Error),
}

impl FieldError {
    fn into_problem(self, max_body: u64) -> Problem {
        match self {
            Self::Form(error) => malformed_form(max_body, &error),
            Self::TooLong => {
                let detail = format!("a field may have at most {MAX_FIELD_BYTES} bytes");
                Problem::new(StatusCode::PAYLOAD_TOO_LARGE, detail)
            }
            Self::Disk(error) => disk_failure(error),
        }
    }
}

async fn receive_text(mut field: Field<'_>) -> Result<String, FieldError> {
    let mut bytes = Vec::new();
    while let Some(chunk) = field.chunk().await.map_err(FieldError::Form)? {
        if bytes.len() + chunk.len() > MAX_FIELD_BYTES {
            return Err(FieldError::TooLong);
        }
        bytes.extend_from_slice(&chunk);
    }
    Ok(String::from_utf8_lossy(&bytes).into_owned())
}

async fn receive_file(mut field: Field<'_>, path: &Path) -> Result<(), FieldError> {
    let mut file = tokio::fs::File::create_new(path).await.map_err(FieldError::Disk)?;
    while let Some(chunk) = field.chunk().await.map_err(FieldError::Form)? {
        file.write_all(&chunk).await.map_err(FieldError::Disk)?;
    }
    file.flush().await.map_err(FieldError::Disk)
}

fn malformed_form(max_body: u64, error: &MultipartError) -> Problem {
    match error.status() {
        StatusCode::PAYLOAD_TOO_LARGE => limits::body_too_long(max_body),
        status => Problem::new(status, error.body_text()),
    }
}

/// The problem of an upload that the server's disk did not take.
fn disk_failure(error: std::io::Error) -> Problem {
    tracing::error!(%error, "an upload could not be written to disk");
    let full = error.kind() == std::io::ErrorKind::StorageFull;
    let status = if full { StatusCode::INSUFFICIENT_STORAGE } else { StatusCode::INTERNAL_SERVER_ERROR };
    Problem::new(status, "the server could not write the upload to disk: its log has the details")
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
    fn a_stack_is_named_by_what_its_slices_share() {
        let name = |names: &[&str]| stack_name(&names.iter().map(|&name| name.to_owned()).collect::<Vec<_>>());
        assert_eq!(name(&["core_001.png", "core_002.png", "core_010.png"]), "core");
        assert_eq!(name(&["1.png", "2.png"]), "slices");
        assert_eq!(name(&["files.png"]), "slices");
        assert_eq!(name(&["ä1.png", "ä2.png"]), "ä");
        assert_eq!(name(&["a.png", "b.png"]), "slices");
    }
}
