//! Values of the command line that several commands take.

use std::path::{Path, PathBuf};

use clap::builder::{PathBufValueParser, TypedValueParser};

/// A whole number of 0 or more.
pub(crate) fn whole<T: TryFrom<u64>>(text: &str) -> Result<T, String> {
    let digits = !text.is_empty() && text.bytes().all(|byte| byte.is_ascii_digit());
    if !digits {
        return Err("a whole number of 0 or more is expected".into());
    }
    text.parse().ok().and_then(|number: u64| T::try_from(number).ok()).ok_or_else(|| "the number is too large".into())
}

/// Where a PNG picture goes.
pub(crate) fn png() -> impl TypedValueParser<Value = PathBuf> {
    PathBufValueParser::new().try_map(|path| named(path, "png"))
}

/// Where an SVG plot goes.
pub(crate) fn svg() -> impl TypedValueParser<Value = PathBuf> {
    PathBufValueParser::new().try_map(|path| named(path, "svg"))
}

/// Refuses a name that promises another kind of file; a name without an ending (`/dev/stdout`) promises nothing.
fn named(path: PathBuf, ending: &str) -> Result<PathBuf, String> {
    match Path::new(&path).extension() {
        Some(found) if !found.eq_ignore_ascii_case(ending) => {
            Err(format!("the file is written as {}: give it a name that ends in .{ending}", ending.to_uppercase()))
        }
        _ => Ok(path),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_whole() {
        assert_eq!(whole::<usize>("12"), Ok(12));
        assert!(whole::<usize>("-1").unwrap_err().contains("0 or more"));
        assert!(whole::<u64>("1e3").is_err() && whole::<u64>("").is_err() && whole::<u64>("+1").is_err());
        assert!(whole::<u64>("18446744073709551616").unwrap_err().contains("large"));
        assert!(whole::<u8>("256").unwrap_err().contains("large"));
    }

    #[test]
    fn a_name_keeps_its_promise() {
        assert!(named("a.png".into(), "png").is_ok() && named("a.PNG".into(), "png").is_ok());
        assert!(named("/dev/stdout".into(), "png").is_ok());
        assert!(named("a.jpg".into(), "png").unwrap_err().contains(".png"));
    }
}
