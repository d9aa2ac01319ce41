//! Tags of textures: conditions on them and changes to them.

use std::fmt;
use std::str::FromStr;

/// A condition on the tags of a texture.
///
/// ```
/// use hlacdb::TagFilter;
/// let filter: TagFilter = "family=marble".parse()?;
/// assert_eq!(filter, TagFilter::equals("family", "marble"));
/// # Ok::<(), hlacdb::ParseTagFilterError>(())
/// ```
#[derive(Clone, Debug, PartialEq, Eq, Hash)]
pub struct TagFilter {
    key: String,
    value: String,
}

impl TagFilter {
    /// The texture has a tag with this key and value.
    pub fn equals(key: impl Into<String>, value: impl Into<String>) -> Self {
        Self { key: key.into(), value: value.into() }
    }

    /// The key of the tag.
    pub fn key(&self) -> &str {
        &self.key
    }

    /// The value that the tag must have.
    pub fn value(&self) -> &str {
        &self.value
    }
}

/// `KEY=VALUE`.
impl fmt::Display for TagFilter {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}={}", self.key, self.value)
    }
}

/// A text that is not `KEY=VALUE`.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("'{}' is not KEY=VALUE", .0.escape_debug())]
pub struct ParseTagFilterError(String);

/// Reads `KEY=VALUE`, split at the first `=`. The key must not be empty.
impl FromStr for TagFilter {
    type Err = ParseTagFilterError;

    fn from_str(text: &str) -> Result<Self, ParseTagFilterError> {
        match text.split_once('=') {
            Some((key, value)) if !key.is_empty() => Ok(Self::equals(key, value)),
            _ => Err(ParseTagFilterError(text.to_owned())),
        }
    }
}

/// A change to the tags of a texture, for [`Database::tag`](crate::Database::tag).
///
/// ```
/// use hlacdb::TagEdit;
/// let edit = TagEdit::new().set("family", "marble").unset("checked");
/// # let _ = edit;
/// ```
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct TagEdit {
    pub(crate) set: Vec<(String, String)>,
    pub(crate) unset: Vec<String>,
}

impl TagEdit {
    /// No change yet.
    pub fn new() -> Self {
        Self::default()
    }

    /// Sets a tag, in place of one with the same key.
    #[must_use]
    pub fn set(mut self, key: impl Into<String>, value: impl Into<String>) -> Self {
        self.set.push((key.into(), value.into()));
        self
    }

    /// Removes the tag with this key, if there is one. Tags are removed before others are set.
    #[must_use]
    pub fn unset(mut self, key: impl Into<String>) -> Self {
        self.unset.push(key.into());
        self
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_filter_is_split_at_the_first_equals_sign() {
        let parse = |text: &str| text.parse::<TagFilter>();
        assert_eq!(parse("a=b=c"), Ok(TagFilter::equals("a", "b=c")));
        assert_eq!(parse("a="), Ok(TagFilter::equals("a", "")));
        assert_eq!(parse("a=b").unwrap().to_string(), "a=b");
        assert_eq!(parse("=b\n").unwrap_err().to_string(), "'=b\\n' is not KEY=VALUE");
        assert!(parse("a").is_err());
    }
}
