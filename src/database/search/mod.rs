//! Queries and their answers.
//!
//! A [`Query`] has one or more examples (volumes, stored textures, descriptors), a number of hits and conditions that hits must
//! meet. [`Database::query`](crate::Database::query) returns an [`Answer`]: the nearest textures in a space, ordered by
//! (distance, id), exactly.

mod described;
mod execution;
mod from_disk;
pub(crate) mod pairs;
mod source;
#[cfg(test)]
mod tests;

use std::collections::BTreeMap;
use std::fmt;
use std::str::FromStr;
use std::time::Duration;

use serde::Serialize;

pub use described::DescribedVolume;

use crate::database::scheme::DEFAULT_SPACE;
use crate::error::QueryError;
use crate::index::IndexMethod;
use crate::space::Descriptor;
use crate::volume::Volume;
use crate::{TagFilter, TextureId};

/// An example: textures like it are wanted.
#[derive(Clone, Debug)]
enum Example<'a> {
    Volume(&'a Volume),
    Described(&'a DescribedVolume),
    Texture(TextureId),
    Descriptor(Descriptor),
}

/// How several examples are combined.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub enum Combine {
    /// Distances are from the mean of the examples' points: hits are like all examples.
    #[default]
    Mean,
    /// Distances are from the nearest example: hits are like any example.
    Min,
}

impl Combine {
    /// `mean` or `min`.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Mean => "mean",
            Self::Min => "min",
        }
    }
}

impl fmt::Display for Combine {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(self.name())
    }
}

/// A text that is not the name of a [`Combine`].
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("'{}' is not a way to combine examples (mean, min)", .0.escape_debug())]
pub struct ParseCombineError(String);

impl FromStr for Combine {
    type Err = ParseCombineError;

    fn from_str(name: &str) -> Result<Self, ParseCombineError> {
        match name {
            "mean" => Ok(Self::Mean),
            "min" => Ok(Self::Min),
            _ => Err(ParseCombineError(name.to_owned())),
        }
    }
}

/// The number of hits where neither `k` nor a distance is given.
const DEFAULT_K: usize = 10;

/// A search for textures like one or more examples.
///
/// ```
/// use hlacdb::Query;
/// let query = Query::texture(12).k(30).within(0.5).filter("family", "marble").exclude_self();
/// # let _ = query;
/// ```
#[derive(Clone, Debug)]
pub struct Query<'a> {
    examples: Vec<Example<'a>>,
    combine: Combine,
    k: Option<usize>,
    within: Option<f64>,
    filters: Vec<TagFilter>,
    space: Option<String>,
    index: IndexMethod,
    exclude_self: bool,
}

impl<'a> Query<'a> {
    fn new(examples: Vec<Example<'a>>) -> Self {
        Self {
            examples,
            combine: Combine::Mean,
            k: None,
            within: None,
            filters: Vec::new(),
            space: None,
            index: IndexMethod::Auto,
            exclude_self: false,
        }
    }

    /// Refuses a query that has no answer.
    fn check(&self) -> Result<(), QueryError> {
        if self.k == Some(0) {
            return Err(QueryError::ZeroK);
        }
        if let Some(found) = self.within.filter(|distance| distance.is_nan() || *distance < 0.0) {
            return Err(QueryError::Distance { found });
        }
        if self.examples.is_empty() {
            return Err(QueryError::NoExample);
        }
        Ok(())
    }

    /// The most hits.
    fn limit(&self) -> usize {
        self.k.unwrap_or(if self.within.is_some() { usize::MAX } else { DEFAULT_K })
    }

    /// The name of the space.
    fn space_name(&self) -> &str {
        self.space.as_deref().unwrap_or(DEFAULT_SPACE)
    }

    /// Textures like this volume, which need not be in the store. It is described in the views that the space uses, each time
    /// the query is made; [`Query::described`] is faster for several queries with one volume.
    pub fn volume(volume: &'a Volume) -> Self {
        Self::new(vec![Example::Volume(volume)])
    }

    /// Textures like a volume that [`Database::describe`](crate::Database::describe) has described.
    pub fn described(volume: &'a DescribedVolume) -> Self {
        Self::new(vec![Example::Described(volume)])
    }

    /// Textures like a stored texture.
    pub fn texture(id: impl Into<TextureId>) -> Self {
        Self::new(vec![Example::Texture(id.into())])
    }

    /// Textures like a descriptor: the moments of one or more views.
    pub fn descriptor(descriptor: Descriptor) -> Self {
        Self::new(vec![Example::Descriptor(descriptor)])
    }

    /// Textures like several stored textures, combined by [`Combine::Mean`] by default.
    pub fn textures(ids: impl IntoIterator<Item = impl Into<TextureId>>) -> Self {
        Self::new(ids.into_iter().map(|id| Example::Texture(id.into())).collect())
    }

    /// Adds a volume as an example.
    #[must_use]
    pub fn and_volume(mut self, volume: &'a Volume) -> Self {
        self.examples.push(Example::Volume(volume));
        self
    }

    /// Adds a stored texture as an example.
    #[must_use]
    pub fn and_texture(mut self, id: impl Into<TextureId>) -> Self {
        self.examples.push(Example::Texture(id.into()));
        self
    }

    /// How several examples are combined. For one example it makes no difference.
    #[must_use]
    pub fn combine(mut self, combine: Combine) -> Self {
        self.combine = combine;
        self
    }

    /// The most hits. The default is 10, or no limit if [`Query::within`] is set. 0 is an error.
    #[must_use]
    pub fn k(mut self, k: usize) -> Self {
        self.k = Some(k);
        self
    }

    /// Only hits at most this far away (inclusive): all of them, unless [`Query::k`] is set.
    #[must_use]
    pub fn within(mut self, distance: f64) -> Self {
        self.within = Some(distance);
        self
    }

    /// Only textures that have this tag. Filters apply before [`Query::k`], and all must match.
    #[must_use]
    pub fn filter(mut self, key: impl Into<String>, value: impl Into<String>) -> Self {
        self.filters.push(TagFilter::equals(key, value));
        self
    }

    /// Only textures that match all of these filters as well.
    #[must_use]
    pub fn filters(mut self, filters: impl IntoIterator<Item = TagFilter>) -> Self {
        self.filters.extend(filters);
        self
    }

    /// The space whose distance is used. The default is [`DEFAULT_SPACE`].
    #[must_use]
    pub fn space(mut self, name: impl Into<String>) -> Self {
        self.space = Some(name.into());
        self
    }

    /// How neighbours are searched. The answer is the same to the bit.
    #[must_use]
    pub fn index(mut self, index: IndexMethod) -> Self {
        self.index = index;
        self
    }

    /// Leaves out the examples themselves: stored textures that are examples, and those with the content of a volume that is
    /// one.
    #[must_use]
    pub fn exclude_self(mut self) -> Self {
        self.exclude_self = true;
        self
    }
}

/// A texture in an answer.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[non_exhaustive]
pub struct Hit {
    /// Its position in the answer, from 1.
    pub rank: usize,
    /// The texture.
    pub id: TextureId,
    /// Its name.
    pub name: String,
    /// The distance of its point from the example's; a smaller distance means more alike.
    pub distance: f64,
    /// Its tags.
    pub tags: BTreeMap<String, String>,
}

/// The answer to a [`Query`].
#[derive(Clone, Debug, Serialize)]
#[non_exhaustive]
pub struct Answer {
    /// The space whose distance was used.
    pub space: String,
    /// How the hits were found: `linear` (a scan of points in memory, or on disk for the first query) or `kdtree`.
    pub index: &'static str,
    /// The number of the fit of the space; it rises by one with every fit.
    pub epoch: u64,
    /// The time that the search took, from the example's point to the ranked hits.
    #[serde(rename = "elapsed_us", serialize_with = "as_micros")]
    pub elapsed: Duration,
    /// What the caller should know about the answer, one sentence each. Usually empty.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub warnings: Vec<String>,
    /// The hits, ordered by (distance, id).
    pub hits: Vec<Hit>,
}

fn as_micros<S: serde::Serializer>(elapsed: &Duration, serializer: S) -> Result<S::Ok, S::Error> {
    serializer.serialize_u64(elapsed.as_micros() as u64)
}
