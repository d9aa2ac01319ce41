//! [`IndexMethod`]: scan or tree.

use std::fmt;
use std::str::FromStr;

/// How neighbours are searched. The answer is the same to the bit; only the time differs.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default)]
#[non_exhaustive]
pub enum IndexMethod {
    /// The faster of the others.
    #[default]
    Auto,
    /// The linear scan: bounds every row.
    Linear,
    /// The k-d tree. The scan takes over if there is no tree, or if a filter makes it useless.
    KdTree,
}

impl IndexMethod {
    /// `auto`, `linear` or `kdtree`.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Auto => "auto",
            Self::Linear => "linear",
            Self::KdTree => "kdtree",
        }
    }
}

impl fmt::Display for IndexMethod {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(self.name())
    }
}

/// The name of no method.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("indexes are auto, linear and kdtree (got {0:?})")]
pub struct UnknownIndexMethod(String);

impl FromStr for IndexMethod {
    type Err = UnknownIndexMethod;

    fn from_str(name: &str) -> Result<Self, UnknownIndexMethod> {
        match name {
            "auto" => Ok(Self::Auto),
            "linear" => Ok(Self::Linear),
            "kdtree" => Ok(Self::KdTree),
            _ => Err(UnknownIndexMethod(name.to_owned())),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_parsed() {
        for method in [IndexMethod::Auto, IndexMethod::Linear, IndexMethod::KdTree] {
            assert_eq!(method.to_string().parse(), Ok(method));
        }
        let error = "ball".parse::<IndexMethod>().unwrap_err();
        assert_eq!(error.to_string(), "indexes are auto, linear and kdtree (got \"ball\")");
    }
}
