//! [`FormatInfo`]: what people and programs may know of a format without reading a file.

use std::path::Path;

/// A format by its name, its extensions, and what is read of it.
///
/// Extensions are lower case and begin with the dot; file names are compared without regard to case.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub struct FormatInfo {
    /// The name in records and output: lower case, stable, e.g. `nrrd`.
    pub name: &'static str,
    /// The name as people write it, e.g. `NRRD`.
    pub title: &'static str,
    /// What is read of it, in one sentence.
    pub description: &'static str,
    /// The extensions of files that are volumes, e.g. `.nii.gz`.
    pub extensions: &'static [&'static str],
    /// Further extensions by which a volume may be named, of files that a header in `extensions` describes.
    pub aliases: &'static [&'static str],
    /// Those of `extensions` that may be headers with their samples in another file of the same name.
    pub detached_headers: &'static [&'static str],
    /// The extensions of such files of samples, without `.gz` and `.bz2`. Beside their header they are not volumes.
    pub data_files: &'static [&'static str],
    /// The extensions of the pictures that make up a folder of slices; empty for other formats.
    pub slices: &'static [&'static str],
    /// How samples may be compressed.
    pub compressions: &'static [&'static str],
    /// Whether files are read only with a [`RawLayout`](crate::RawLayout).
    pub needs_layout: bool,
    /// The feature of this crate that compiles the format; `None` if it is always there.
    pub feature: Option<&'static str>,
    /// Whether this build reads the format.
    pub available: bool,
}

impl FormatInfo {
    /// A format without extensions that is always compiled.
    pub const fn new(name: &'static str, title: &'static str, description: &'static str) -> Self {
        Self {
            name,
            title,
            description,
            extensions: &[],
            aliases: &[],
            detached_headers: &[],
            data_files: &[],
            slices: &[],
            compressions: &[],
            needs_layout: false,
            feature: None,
            available: true,
        }
    }

    /// Sets [`extensions`](Self#structfield.extensions).
    #[must_use]
    pub const fn extensions(self, extensions: &'static [&'static str]) -> Self {
        Self { extensions, ..self }
    }

    /// Sets [`aliases`](Self#structfield.aliases).
    #[must_use]
    pub const fn aliases(self, aliases: &'static [&'static str]) -> Self {
        Self { aliases, ..self }
    }

    /// Sets [`detached_headers`](Self#structfield.detached_headers) and [`data_files`](Self#structfield.data_files).
    #[must_use]
    pub const fn detached(
        self,
        detached_headers: &'static [&'static str],
        data_files: &'static [&'static str],
    ) -> Self {
        Self { detached_headers, data_files, ..self }
    }

    /// Sets [`slices`](Self#structfield.slices).
    #[must_use]
    pub const fn slices(self, slices: &'static [&'static str]) -> Self {
        Self { slices, ..self }
    }

    /// Sets [`compressions`](Self#structfield.compressions).
    #[must_use]
    pub const fn compressions(self, compressions: &'static [&'static str]) -> Self {
        Self { compressions, ..self }
    }

    /// Marks a format whose files are read only with a [`RawLayout`](crate::RawLayout).
    #[must_use]
    pub const fn needs_layout(self) -> Self {
        Self { needs_layout: true, ..self }
    }

    /// Sets the feature of this crate that compiles the format, and whether it is on.
    #[must_use]
    pub const fn feature(self, feature: &'static str, available: bool) -> Self {
        Self { feature: Some(feature), available, ..self }
    }
}

/// Whether a file name ends with one of some extensions.
pub(crate) fn has_ending(path: &Path, extensions: &[&str]) -> bool {
    let name = path.file_name().map(|name| name.to_string_lossy().to_ascii_lowercase()).unwrap_or_default();
    extensions.iter().any(|extension| name.ends_with(extension))
}
