//! A question and its hits.
//!
//! A [`Query`] names one or more examples (volumes, stored textures, descriptors), how many hits are wanted and what
//! may be a hit; [`Database::query`](crate::Database::query) answers with an [`Answer`]: the textures nearest in a space,
//! ordered by (distance, id), exactly.

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

use crate::database::scheme::DEFAULT_SPACE;
use crate::database::texture::ContentHash;
use crate::error::QueryError;
use crate::index::IndexMethod;
use crate::space::Descriptor;
use crate::volume::Volume;
use crate::{TagFilter, TextureId};

/// What is looked for.
#[derive(Clone, Debug)]
enum Example<'a> {
    Volume(&'a Volume),
    Texture(TextureId),
    Descriptor(Descriptor),
}

/// What several examples mean together.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Combine {
    /// Textures near the mean of the examples' points: like all of them.
    #[default]
    Mean,
    /// Textures near any of them: the distance of a texture is that from the nearest example.
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

/// A name that no way to combine examples has.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("examples are combined by their mean or their min, not by {0:?}: use mean or min")]
pub struct UnknownCombine(String);

impl FromStr for Combine {
    type Err = UnknownCombine;

    fn from_str(name: &str) -> Result<Self, UnknownCombine> {
        match name {
            "mean" => Ok(Self::Mean),
            "min" => Ok(Self::Min),
            _ => Err(UnknownCombine(name.to_owned())),
        }
    }
}

/// The number of hits where neither `k` nor a distance is given.
const DEFAULT_K: usize = 10;

/// A question: what is looked for, how many hits, and which textures may be hits.
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
    exclude_content: Option<[u8; 32]>,
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
            exclude_content: None,
        }
    }

    /// Refuses what has no answer.
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

    /// Textures like this volume, which need not be in the store.
    pub fn volume(volume: &'a Volume) -> Self {
        Self::new(vec![Example::Volume(volume)])
    }

    /// Textures like a stored one.
    pub fn texture(id: impl Into<TextureId>) -> Self {
        Self::new(vec![Example::Texture(id.into())])
    }

    /// Textures like a descriptor: the moments of one or more views.
    pub fn descriptor(descriptor: Descriptor) -> Self {
        Self::new(vec![Example::Descriptor(descriptor)])
    }

    /// Textures like several stored ones, by [`Combine::Mean`] unless said otherwise.
    pub fn textures(ids: impl IntoIterator<Item = impl Into<TextureId>>) -> Self {
        Self::new(ids.into_iter().map(|id| Example::Texture(id.into())).collect())
    }

    /// A further example: a volume.
    #[must_use]
    pub fn and_volume(mut self, volume: &'a Volume) -> Self {
        self.examples.push(Example::Volume(volume));
        self
    }

    /// A further example: a stored texture.
    #[must_use]
    pub fn and_texture(mut self, id: impl Into<TextureId>) -> Self {
        self.examples.push(Example::Texture(id.into()));
        self
    }

    /// What several examples mean together; of one example both mean the same.
    #[must_use]
    pub fn combine(mut self, combine: Combine) -> Self {
        self.combine = combine;
        self
    }

    /// At most so many hits: 10 unless said, or all where [`Query::within`] is. No ceiling; 0 is an error.
    #[must_use]
    pub fn k(mut self, k: usize) -> Self {
        self.k = Some(k);
        self
    }

    /// Only hits at this distance or nearer: all of them, unless [`Query::k`] bounds their number.
    #[must_use]
    pub fn within(mut self, distance: f64) -> Self {
        self.within = Some(distance);
        self
    }

    /// Only textures that carry this tag; applied before `k`. Several filters must all hold.
    #[must_use]
    pub fn filter(mut self, key: impl Into<String>, value: impl Into<String>) -> Self {
        self.filters.push(TagFilter::equals(key, value));
        self
    }

    /// Only textures for which all of these conditions hold as well.
    #[must_use]
    pub fn filters(mut self, filters: impl IntoIterator<Item = TagFilter>) -> Self {
        self.filters.extend(filters);
        self
    }

    /// In which space; `default` unless said.
    #[must_use]
    pub fn space(mut self, name: impl Into<String>) -> Self {
        self.space = Some(name.into());
        self
    }

    /// By which index; the answer is the same to the bit.
    #[must_use]
    pub fn index(mut self, index: IndexMethod) -> Self {
        self.index = index;
        self
    }

    /// Leaves out the examples themselves: the stored textures asked by id, and those with a volume's content.
    #[must_use]
    pub fn exclude_self(mut self) -> Self {
        self.exclude_self = true;
        self
    }

    /// Leaves out the stored texture with this content, if there is one. With [`Query::moments`] it does what
    /// [`Query::exclude_self`] does with [`Query::volume`], and the volume is not described again.
    #[must_use]
    pub fn exclude_content(mut self, content: ContentHash) -> Self {
        self.exclude_content = Some(content.0);
        self
    }
}

/// One texture of an answer.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Hit {
    /// Place in the answer, from 1.
    pub rank: usize,
    /// The texture.
    pub id: TextureId,
    /// Its name.
    pub name: String,
    /// How far its point is from the example's, in the units of the space; smaller is more alike.
    pub distance: f64,
    /// Its tags.
    pub tags: BTreeMap<String, String>,
}

/// The answer to a [`Query`].
#[derive(Clone, Debug, Serialize)]
pub struct Answer {
    /// The space the distances are in.
    pub space: String,
    /// The index that found the hits: `linear` (of points in memory, or, for the first question, on disk) or `kdtree`.
    pub index: &'static str,
    /// Which fit of the space answered; it rises by one with every fit.
    pub epoch: u64,
    /// The time of the search alone: from the example's point to the ranked hits.
    #[serde(rename = "elapsed_us", serialize_with = "as_micros")]
    pub elapsed: Duration,
    /// What was odd about the question, one sentence each; mostly nothing.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub warnings: Vec<String>,
    /// The hits, ordered by (distance, id).
    pub hits: Vec<Hit>,
}

fn as_micros<S: serde::Serializer>(elapsed: &Duration, serializer: S) -> Result<S::Ok, S::Error> {
    serializer.serialize_u64(elapsed.as_micros() as u64)
}
