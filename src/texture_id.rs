//! [`TextureId`].

use std::fmt;
use std::num::ParseIntError;
use std::str::FromStr;

use serde::{Deserialize, Serialize};

/// The id of a texture in its store. Ids start at 1, ascend in the order in which textures were added, and are never
/// reused.
///
/// ```
/// use hlacdb::TextureId;
/// let id: TextureId = "12".parse()?;
/// assert_eq!((id, id.get(), id.to_string().as_str()), (TextureId::from(12), 12, "12"));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[serde(transparent)]
pub struct TextureId(u64);

impl TextureId {
    /// The id as a number.
    pub const fn get(self) -> u64 {
        self.0
    }
}

impl From<u64> for TextureId {
    fn from(id: u64) -> Self {
        Self(id)
    }
}

impl From<&u64> for TextureId {
    fn from(id: &u64) -> Self {
        Self(*id)
    }
}

impl From<&TextureId> for TextureId {
    fn from(id: &TextureId) -> Self {
        *id
    }
}

impl From<TextureId> for u64 {
    fn from(id: TextureId) -> Self {
        id.0
    }
}

impl PartialEq<u64> for TextureId {
    fn eq(&self, other: &u64) -> bool {
        self.0 == *other
    }
}

impl fmt::Display for TextureId {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.0.fmt(f)
    }
}

impl FromStr for TextureId {
    type Err = ParseIntError;

    fn from_str(text: &str) -> Result<Self, ParseIntError> {
        text.parse().map(Self)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn json_has_the_number_alone() {
        let ids = [TextureId::from(3), TextureId::from(u64::MAX)];
        let json = serde_json::to_string(&ids).unwrap();
        assert_eq!(json, "[3,18446744073709551615]");
        assert_eq!(serde_json::from_str::<[TextureId; 2]>(&json).unwrap(), ids);
        assert!("".parse::<TextureId>().is_err() && "-1".parse::<TextureId>().is_err());
    }
}
