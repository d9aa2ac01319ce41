//! Arguments that several commands share, and how their values are parsed.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::str::FromStr;

use clap::Args;
use clap::builder::{PathBufValueParser, TypedValueParser};
use hlacdb::TagFilter;
use hlacdb::volume::formats::infos;
use hlacdb::volume::{Endian, Intensity, RawLayout, RawTypeError, ReadOptions, SampleType, Shape};

use super::context::Failure;

/// How files are read.
#[derive(Args, Clone)]
#[command(next_help_heading = "Reading files")]
pub(super) struct ReadArguments {
    /// How samples other than 8-bit unsigned map to 256 levels: `full` (lowest to highest sample), `auto` (0.1 to 99.9
    /// percentile), `LO..HI` (a fixed window), or `nonzero` (0 stays 0, everything else becomes 255)
    #[arg(long, value_name = "RULE", default_value = "full", allow_hyphen_values = true)]
    intensity: Intensity,

    /// Refuse files whose header states more voxels than this
    #[arg(long, value_name = "N", default_value_t = ReadOptions::MAX_VOXELS, value_parser = whole::<u64>)]
    max_voxels: u64,

    /// Decompression limit: a compressed file may expand to at most this, or to 16 times its size if that is more
    #[arg(long, value_name = "BYTES", default_value_t = ReadOptions::MAX_INFLATED, value_parser = whole::<u64>)]
    max_inflated: u64,

    #[arg(long, value_name = "Z,Y,X", requires = "raw_type", help = raw_shape_help())]
    raw_shape: Option<RawShape>,

    /// Sample type of raw files: u8, i8, u16le, u16be, i16le, ..., f32le, f64be
    #[arg(long, value_name = "TYPE", requires = "raw_shape")]
    raw_type: Option<RawType>,

    /// Bytes before the first sample of raw files
    #[arg(long, value_name = "BYTES", default_value_t = 0, requires = "raw_shape", value_parser = whole::<u64>)]
    raw_offset: u64,
}

impl ReadArguments {
    /// The library's options.
    pub(super) fn options(&self) -> ReadOptions {
        let options =
            ReadOptions::new().intensity(self.intensity).max_voxels(self.max_voxels).max_inflated(self.max_inflated);
        match (self.raw_shape, self.raw_type) {
            (Some(RawShape(shape)), Some(RawType(samples, endian))) => {
                options.raw(RawLayout::new(shape, samples, endian).offset(self.raw_offset))
            }
            _ => options,
        }
    }
}

fn raw_shape_help() -> String {
    let raw = infos().filter(|format| format.needs_layout).flat_map(|format| format.extensions);
    let extensions: Vec<&str> = raw.copied().collect();
    format!("Shape of raw files: those named {}, and files of an unrecognised format", extensions.join(", "))
}

#[derive(Clone, Copy)]
struct RawShape(Shape);

impl FromStr for RawShape {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let sides: Option<Vec<usize>> = text.split(',').map(|side| side.trim().parse().ok()).collect();
        let shape = sides.and_then(|sides| Shape::try_from(sides).ok());
        shape.map(Self).ok_or_else(|| "expected three whole numbers Z,Y,X".to_owned())
    }
}

/// A sample type and byte order, e.g. `u16be`; little-endian by default.
#[derive(Clone, Copy)]
struct RawType(SampleType, Endian);

impl FromStr for RawType {
    type Err = RawTypeError;

    fn from_str(text: &str) -> Result<Self, RawTypeError> {
        RawLayout::parse_type(text).map(|(samples, endian)| Self(samples, endian))
    }
}

/// Tags for every texture that a command adds.
#[derive(Args, Clone)]
pub(super) struct TagArguments {
    /// Tag every added texture (repeatable)
    #[arg(long = "tag", value_name = "KEY=VALUE")]
    tags: Vec<KeyValue>,
}

impl TagArguments {
    pub(super) fn is_empty(&self) -> bool {
        self.tags.is_empty()
    }

    /// The tags; a key has one value.
    pub(super) fn map(self) -> Result<BTreeMap<String, String>, Failure> {
        tag_map(self.tags)
    }
}

/// Which textures a command considers.
#[derive(Args, Clone)]
pub(super) struct FilterArguments {
    /// Only textures with this tag (repeatable: all must match)
    #[arg(long = "where", value_name = "KEY=VALUE")]
    filters: Vec<KeyValue>,
}

impl FilterArguments {
    pub(super) fn filters(&self) -> Vec<TagFilter> {
        self.filters.iter().cloned().map(KeyValue::into_filter).collect()
    }
}

/// The space that a command works in.
#[derive(Args, Clone)]
pub(super) struct SpaceArgument {
    /// Space: default, oriented, invariant, paper, zscore, or one added with `hlacdb space add`
    #[arg(long = "space", value_name = "NAME")]
    pub(super) name: Option<String>,
}

/// `KEY=VALUE`: split at the first `=`, neither side empty.
#[derive(Clone, Debug)]
pub(super) struct KeyValue {
    key: String,
    value: String,
}

impl KeyValue {
    /// The textures that have this tag.
    pub(super) fn into_filter(self) -> TagFilter {
        TagFilter::equals(self.key, self.value)
    }
}

impl FromStr for KeyValue {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        match text.split_once('=') {
            Some((key, value)) if !key.is_empty() && !value.is_empty() => {
                Ok(Self { key: key.to_owned(), value: value.to_owned() })
            }
            _ => Err(format!("'{text}' is not KEY=VALUE")),
        }
    }
}

/// Tags to set. A key has one value, so two values for one key are refused.
pub(super) fn tag_map(pairs: Vec<KeyValue>) -> Result<BTreeMap<String, String>, Failure> {
    let mut tags = BTreeMap::new();
    for KeyValue { key, value } in pairs {
        match tags.get(&key) {
            Some(other) if *other != value => {
                let sentence = format!("the tag '{key}' has two values, '{other}' and '{value}'; a tag has one value");
                return Err(Failure::Usage(sentence));
            }
            _ => tags.insert(key, value),
        };
    }
    Ok(tags)
}

/// Parses a whole number of 0 or more.
pub(super) fn whole<T: TryFrom<u64>>(text: &str) -> Result<T, String> {
    let digits = !text.is_empty() && text.bytes().all(|byte| byte.is_ascii_digit());
    if !digits {
        return Err("expected a whole number of 0 or more".into());
    }
    text.parse().ok().and_then(|number: u64| T::try_from(number).ok()).ok_or_else(|| "the number is too large".into())
}

/// Parses the path of a PNG picture to write.
pub(super) fn png() -> impl TypedValueParser<Value = PathBuf> {
    PathBufValueParser::new().try_map(|path| with_extension(path, "png"))
}

/// Parses the path of an SVG plot to write.
pub(super) fn svg() -> impl TypedValueParser<Value = PathBuf> {
    PathBufValueParser::new().try_map(|path| with_extension(path, "svg"))
}

/// Refuses a path with another extension. A path without one (`/dev/stdout`) is accepted.
fn with_extension(path: PathBuf, extension: &str) -> Result<PathBuf, String> {
    match Path::new(&path).extension() {
        Some(found) if !found.eq_ignore_ascii_case(extension) => {
            Err(format!("the file is written as {}: use the extension .{extension}", extension.to_uppercase()))
        }
        _ => Ok(path),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_raw_shape_is_three_numbers() {
        assert!("1,2".parse::<RawShape>().is_err());
        assert!("1,2,x".parse::<RawShape>().is_err());
        assert!("4, 5,6".parse::<RawShape>().is_ok_and(|shape| shape.0 == [4, 5, 6]));
    }

    #[test]
    fn numbers_are_whole() {
        assert_eq!(whole::<usize>("12"), Ok(12));
        assert!(whole::<usize>("-1").unwrap_err().contains("0 or more"));
        assert!(whole::<u64>("1e3").is_err() && whole::<u64>("").is_err() && whole::<u64>("+1").is_err());
        assert!(whole::<u64>("18446744073709551616").unwrap_err().contains("large"));
        assert!(whole::<u8>("256").unwrap_err().contains("large"));
    }

    #[test]
    fn extensions_match_the_format() {
        assert!(with_extension("a.png".into(), "png").is_ok() && with_extension("a.PNG".into(), "png").is_ok());
        assert!(with_extension("/dev/stdout".into(), "png").is_ok());
        assert!(with_extension("a.jpg".into(), "png").unwrap_err().contains(".png"));
    }

    #[test]
    fn a_tag_has_one_value() {
        let tags = |pairs: &[&str]| tag_map(pairs.iter().map(|pair| pair.parse().unwrap()).collect());
        assert_eq!(tags(&["a=1", "b=2", "a=1"]).unwrap().len(), 2);
        assert!(matches!(tags(&["a=1", "a=2"]), Err(Failure::Usage(_))));
    }

    #[test]
    fn a_value_may_contain_an_equals_sign_but_no_side_may_be_empty() {
        let pair = "a=b=c".parse::<KeyValue>().unwrap();
        assert_eq!((pair.key.as_str(), pair.value.as_str()), ("a", "b=c"));
        for bad in ["a", "=b", "a=", ""] {
            assert!(bad.parse::<KeyValue>().is_err(), "{bad}");
        }
    }
}
