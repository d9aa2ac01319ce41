//! The list of an archive: a heading, and a line per texture.

use std::collections::BTreeMap;
use std::io::{BufRead, Read};
use std::path::Path;

use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};

use crate::error::Error;
use crate::store::{Cut, Provenance};

/// The name of the list.
pub(super) const LIST: &str = "textures.jsonl";
/// The format that the heading names.
const FORMAT: &str = "hlacdb textures";
const VERSION: u32 = 1;
/// The most bytes of a line.
const MAX_LINE: u64 = 1 << 24;

/// The folders of the arrays.
pub(super) const VOXELS: &str = "voxels";
pub(super) const MOMENTS: &str = "moments";

#[derive(Serialize, Deserialize)]
pub(super) struct Heading {
    format: String,
    version: u32,
}

impl Heading {
    /// The heading that this version writes.
    pub(super) fn current() -> Self {
        Self { format: FORMAT.into(), version: VERSION }
    }

    /// Refuses a format that this version does not read, with what is wrong.
    pub(super) fn check(&self) -> Result<(), String> {
        if self.format == FORMAT && self.version <= VERSION {
            return Ok(());
        }
        Err(format!(
            "{LIST} has format '{}' version {}, but this version of hlacdb reads '{FORMAT}' up to version {VERSION}",
            self.format.escape_debug(),
            self.version
        ))
    }
}

/// A texture in the list.
#[derive(Serialize, Deserialize)]
pub(super) struct Line {
    pub(super) id: u64,
    pub(super) name: String,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(super) path: Option<String>,
    /// The bytes of the path, if they are not UTF-8.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(super) path_bytes: Option<Vec<u8>>,
    #[serde(default)]
    pub(super) tags: BTreeMap<String, String>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(super) provenance: Option<Provenance>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(super) cut: Option<Cut>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(super) content: Option<LineContent>,
    /// The name of the array of voxels.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(super) voxels: Option<String>,
    /// The name of the array of moments, if there are no voxels.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(super) moments: Option<String>,
    /// The views of its rows.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub(super) views: Vec<String>,
    /// The windows and exact sums of `full@1`, if there are no voxels.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(super) sums: Option<(u64, Vec<u64>)>,
}

#[derive(Serialize, Deserialize)]
pub(super) struct LineContent {
    pub(super) shape: [u64; 3],
    pub(super) channels: u8,
    /// The hash of the content, in hexadecimal digits.
    pub(super) hash: String,
}

impl Line {
    /// The name of the texture's array, if it has one.
    pub(super) fn array(&self) -> Option<&String> {
        self.voxels.as_ref().or(self.moments.as_ref())
    }
}

/// Whether an archive at this path is a tar file.
pub(super) fn is_tar(path: &Path) -> bool {
    path.extension().is_some_and(|extension| extension.eq_ignore_ascii_case("tar"))
}

/// The name of a texture's array.
pub(super) fn array_name(folder: &str, id: u64) -> String {
    format!("{folder}/{id:08}.npy")
}

/// Whether this may be the name of an array: it must be where an export puts arrays.
pub(super) fn is_array_name(name: &str) -> bool {
    let is_plain = |part: &str| !part.is_empty() && !part.starts_with('.') && !part.contains(['/', '\\']);
    matches!(name.split_once('/'), Some((VOXELS | MOMENTS, file)) if is_plain(file))
}

/// A value as a line.
pub(super) fn to_line(value: &impl Serialize) -> Result<Vec<u8>, Error> {
    let mut line = serde_json::to_vec(value).map_err(|error| Error::io("writing the list", error.into()))?;
    line.push(b'\n');
    Ok(line)
}

/// Why a line cannot be read.
pub(super) enum LineError {
    Io(std::io::Error),
    /// What is wrong with it.
    Invalid(String),
}

/// Reads the next line; `None` at the end.
pub(super) fn read_line<T: DeserializeOwned>(list: &mut impl BufRead) -> Result<Option<T>, LineError> {
    let mut line = Vec::new();
    list.by_ref().take(MAX_LINE).read_until(b'\n', &mut line).map_err(LineError::Io)?;
    if line.is_empty() {
        return Ok(None);
    }
    let invalid = |error| LineError::Invalid(format!("a line of {LIST} cannot be read: {error}"));
    serde_json::from_slice(&line).map(Some).map_err(invalid)
}

/// For the fuzzer: the lines of a list, from any bytes.
#[cfg(feature = "fuzz")]
pub(super) fn fuzz(bytes: &[u8]) {
    for line in bytes.split(|&byte| byte == b'\n') {
        let _ = serde_json::from_slice::<Line>(line);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn arrays_are_only_where_an_export_puts_them() {
        assert!(is_array_name(&array_name(VOXELS, 7)) && is_array_name("moments/a.npy"));
        for bad in
            ["voxels/", "voxels/.npy", "voxels/../a", "voxels/a/b", "/voxels/a", "a.npy", "other/a.npy", "voxels/a\\b"]
        {
            assert!(!is_array_name(bad), "{bad}");
        }
    }
}
