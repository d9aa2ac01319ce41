//! The registry of formats, and how a file finds its own.

use std::path::Path;

use super::{Format, FormatInfo, Head, has_ending, metaimage, nifti, npy, npz, nrrd, raw, slices, tiff, vox};
use crate::text::excerpt_bytes;
use crate::{ReadOptions, VolumeError};

/// Every format. The first one that recognises the content of a file reads it.
static FORMATS: &[&dyn Format] = &[
    &npy::Npy,
    &npz::Npz,
    &nrrd::Nrrd,
    &metaimage::MetaImage,
    &nifti::Nifti,
    &tiff::Tiff,
    &vox::Vox,
    &slices::Slices,
    &raw::Raw,
];

/// Every format, those included that are compiled out of this build.
///
/// ```
/// for format in hlacdb_volume::formats::registry() {
///     let info = format.info();
///     println!("{}: {} {:?}", info.title, info.description, info.extensions);
/// }
/// ```
pub fn registry() -> &'static [&'static dyn Format] {
    FORMATS
}

/// What is known of every format, in the order of the [`registry`].
pub fn infos() -> impl Iterator<Item = &'static FormatInfo> {
    FORMATS.iter().map(|format| format.info())
}

/// The format of that name (see [`FormatInfo::name`]).
pub fn find(name: &str) -> Option<&'static dyn Format> {
    FORMATS.iter().copied().find(|format| format.info().name == name)
}

/// The titles of all formats that are recognised, as a sentence lists them.
fn titles() -> String {
    let titles: Vec<_> = infos().filter(|info| !info.needs_layout).map(|info| info.title).collect();
    match titles.split_last() {
        Some((last, [])) => (*last).to_owned(),
        Some((last, others)) => format!("{} and {last}", others.join(", ")),
        None => String::new(),
    }
}

/// The format of a file: by its content, else by its name. With a layout of raw samples, files that are called like raw
/// samples, and files that no format recognises, are raw.
///
/// # Errors
/// [`VolumeError::UnknownFormat`], [`VolumeError::Io`], [`VolumeError::NotAFile`].
pub(crate) fn identify(path: &Path, options: &ReadOptions) -> Result<&'static dyn Format, VolumeError> {
    let head = Head::read(path)?;
    let raw = FORMATS.iter().copied().find(|format| format.info().needs_layout).filter(|_| options.raw.is_some());
    // The content of raw samples may look like anything.
    if let Some(raw) = raw.filter(|raw| !head.is_folder() && has_ending(path, raw.info().extensions)) {
        return Ok(raw);
    }
    let formats = || FORMATS.iter().copied().filter(|format| !format.info().needs_layout);
    let by_content = formats().find(|format| format.sniff(&head));
    let by_name = || formats().find(|format| named(path, format.info()));
    let found = by_content.or_else(by_name).or(raw);
    found.ok_or_else(|| {
        let start = head.bytes().get(..head.bytes().len().min(8)).unwrap_or_default();
        VolumeError::UnknownFormat { start: excerpt_bytes(start), recognised: titles() }
    })
}

fn named(path: &Path, info: &FormatInfo) -> bool {
    has_ending(path, info.extensions) || has_ending(path, info.aliases)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_and_extensions_are_lower_case_and_each_formats_own() {
        let mut names: Vec<_> = infos().map(|info| info.name).collect();
        names.sort_unstable();
        assert!(names.windows(2).all(|pair| pair[0] != pair[1]), "{names:?}");
        for info in infos() {
            assert!(!info.title.is_empty() && info.description.ends_with('.'), "{}", info.name);
            assert!(info.name.bytes().all(|byte| byte.is_ascii_lowercase()), "{}", info.name);
            assert!(find(info.name).is_some_and(|found| found.info() == info));
            assert!(info.detached_headers.iter().all(|header| info.extensions.contains(header)), "{}", info.name);
            let lists = [info.extensions, info.aliases, info.detached_headers, info.data_files, info.slices].concat();
            for extension in lists {
                assert!(extension.starts_with('.') && extension.to_ascii_lowercase() == extension, "{extension}");
            }
            for other in infos().filter(|other| other.name != info.name) {
                let both = |extension: &&&str| other.extensions.contains(extension);
                assert_eq!(info.extensions.iter().find(both), None, "{} and {}", info.name, other.name);
            }
        }
    }

    #[test]
    fn the_sentence_of_an_unknown_file_lists_the_formats() {
        let text = VolumeError::UnknownFormat { start: "abc".into(), recognised: titles() }.to_string();
        for title in ["NumPy array", "NRRD", "NIfTI", "TIFF"] {
            assert!(text.contains(title), "{text}");
        }
        assert!(!text.contains("raw"), "{text}");
    }
}
