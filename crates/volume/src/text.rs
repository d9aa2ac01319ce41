//! Text that comes from files and paths, made fit to be shown: escaped, on one line, and of bounded length.

use std::fmt;
use std::path::Path;

/// Characters of a quoted text before it is cut.
const EXCERPT: usize = 80;

/// Numbers of a quoted list before it is cut.
const LISTED: usize = 16;

/// The beginning of a text of unknown length, escaped, with `...` where it is cut.
pub(crate) fn excerpt(text: &str) -> String {
    let mut characters = text.chars();
    let start: String = characters.by_ref().take(EXCERPT).collect();
    let cut = if characters.next().is_some() { "..." } else { "" };
    format!("{}{cut}", start.escape_debug())
}

/// As [`excerpt`], of bytes that may be no text.
pub(crate) fn excerpt_bytes(bytes: &[u8]) -> String {
    let cut = if bytes.len() > EXCERPT { "..." } else { "" };
    format!("{}{cut}", bytes.get(..EXCERPT).unwrap_or(bytes).escape_ascii())
}

/// The name of a file, as [`excerpt`] shows it.
pub(crate) fn excerpt_name(path: &Path) -> String {
    excerpt(&path.file_name().unwrap_or_default().to_string_lossy())
}

/// A list of numbers of unknown length, cut as [`excerpt`] cuts a text: `[3, 4, 5]`, `[1, 2, ...]`.
pub(crate) struct Listed<'a>(pub(crate) &'a [u64]);

impl fmt::Display for Listed<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("[")?;
        for (index, number) in self.0.iter().take(LISTED).enumerate() {
            let comma = if index > 0 { ", " } else { "" };
            write!(f, "{comma}{number}")?;
        }
        f.write_str(if self.0.len() > LISTED { ", ...]" } else { "]" })
    }
}

/// An error of a decoder from another crate: the sentences of it and of its causes, bounded as [`excerpt`] bounds them.
#[derive(Debug)]
pub(crate) struct DecoderError(String);

impl DecoderError {
    pub(crate) fn new(error: &dyn std::error::Error) -> Self {
        let mut text = error.to_string();
        let mut cause = error.source();
        while let Some(error) = cause {
            let sentence = error.to_string();
            // Many errors repeat their cause in their own sentence.
            if !text.contains(&sentence) {
                text = format!("{text}: {sentence}");
            }
            cause = error.source();
        }
        Self::of_text(&text)
    }

    pub(crate) fn of_text(text: &str) -> Self {
        Self(excerpt(text))
    }
}

impl fmt::Display for DecoderError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.0)
    }
}

impl std::error::Error for DecoderError {}

/// A path as it is shown to people and in JSON: bytes that are not UTF-8 and control characters are escaped.
///
/// ```
/// use hlacdb_volume::display_path;
/// assert_eq!(display_path("scans/a\n.npy".as_ref()), "scans/a\\n.npy");
/// ```
pub fn display_path(path: &Path) -> String {
    let mut shown = String::new();
    for chunk in path.as_os_str().as_encoded_bytes().utf8_chunks() {
        for character in chunk.valid().chars() {
            if character.is_control() {
                shown.extend(character.escape_default());
            } else {
                shown.push(character);
            }
        }
        for byte in chunk.invalid() {
            shown.push_str(&format!("\\x{byte:02x}"));
        }
    }
    shown
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn long_texts_are_cut_and_escaped() {
        assert_eq!(excerpt("a\n\u{7f}b"), "a\\n\\u{7f}b");
        assert_eq!(excerpt(&"[".repeat(80)), "[".repeat(80));
        assert_eq!(excerpt(&"[".repeat(81)), format!("{}...", "[".repeat(80)));
        assert_eq!(excerpt_bytes(&[0xff; 3]), "\\xff\\xff\\xff");
        assert!(excerpt_bytes(&[0; 1000]).ends_with("..."));
        assert_eq!(Listed(&[]).to_string(), "[]");
        assert_eq!(Listed(&[3, 4]).to_string(), "[3, 4]");
        assert!(Listed(&[7; 1000]).to_string().ends_with("7, ...]"));
        assert!(DecoderError::new(&std::io::Error::other("x".repeat(9000))).to_string().len() < 100);
    }
}
