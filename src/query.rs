//! A question and its hits.
//!
//! A [`Query`] names one or more examples (volumes, stored textures, descriptors), how many hits are wanted and what
//! may be a hit; [`Database::query`] answers with an [`Answer`]: the textures nearest in a space, ordered by
//! (distance, id), exactly.

use std::collections::BTreeMap;
use std::sync::Arc;
use std::time::{Duration, Instant};

use rayon::prelude::*;
use serde::Serialize;

use crate::database::{DEFAULT_SPACE, Database, SpaceState, known_moments, tagged_with_all};
use crate::error::Error;
use crate::hlac::{self, MASK_COUNT, View};
use crate::index::{Allowed, Method, Question};
use crate::store::{Reads, Snapshot};
use crate::volume::Volume;

/// What is looked for.
#[derive(Clone, Debug)]
enum Example<'a> {
    Volume(&'a Volume),
    Texture(u64),
    Moments(Vec<(View, [f32; MASK_COUNT])>),
}

/// A question: what is looked for, how many hits, and which textures may be hits.
///
/// ```
/// use hlacdb::Query;
/// let query = Query::texture(12).k(30).within(0.5).filter("family", "marble").exclude_self();
/// # let _ = query;
/// ```
#[derive(Clone, Debug)]
pub struct Query<'a> {
    example: Example<'a>,
    k: usize,
    within: Option<f64>,
    filters: Vec<(String, String)>,
    space: Option<String>,
    index: Method,
    exclude_self: bool,
}

impl<'a> Query<'a> {
    fn new(example: Example<'a>) -> Self {
        Self {
            example,
            k: 10,
            within: None,
            filters: Vec::new(),
            space: None,
            index: Method::Auto,
            exclude_self: false,
        }
    }

    /// Textures like this volume, which need not be in the store.
    pub fn volume(volume: &'a Volume) -> Self {
        Self::new(Example::Volume(volume))
    }

    /// Textures like a stored one.
    pub fn texture(id: u64) -> Self {
        Self::new(Example::Texture(id))
    }

    /// Textures like a descriptor: the 251 moments of each view that is known.
    pub fn moments(moments: Vec<(View, [f32; MASK_COUNT])>) -> Self {
        Self::new(Example::Moments(moments))
    }

    /// At most so many hits; 10 unless said, no ceiling, 0 is an error.
    #[must_use]
    pub fn k(mut self, k: usize) -> Self {
        self.k = k;
        self
    }

    /// Only hits at this distance or nearer.
    #[must_use]
    pub fn within(mut self, distance: f64) -> Self {
        self.within = Some(distance);
        self
    }

    /// Only textures that carry this tag; applied before `k`. Several filters must all hold.
    #[must_use]
    pub fn filter(mut self, key: impl Into<String>, value: impl Into<String>) -> Self {
        self.filters.push((key.into(), value.into()));
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
    pub fn index(mut self, index: Method) -> Self {
        self.index = index;
        self
    }

    /// Leaves out the example itself: the stored texture asked by id, or the one with the volume's content.
    #[must_use]
    pub fn exclude_self(mut self) -> Self {
        self.exclude_self = true;
        self
    }
}

/// One texture of an answer.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Hit {
    /// Place in the answer, from 1.
    pub rank: usize,
    /// The texture.
    pub id: u64,
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
    /// The index that found the hits: `linear` or `kdtree`.
    pub index: &'static str,
    /// Which fit of the space answered; it rises by one with every fit.
    pub epoch: u64,
    /// The time of the search alone: from the example's point to the ranked hits.
    #[serde(rename = "elapsed_us", serialize_with = "as_micros")]
    pub elapsed: Duration,
    /// The hits, ordered by (distance, id).
    pub hits: Vec<Hit>,
}

fn as_micros<S: serde::Serializer>(elapsed: &Duration, serializer: S) -> Result<S::Ok, S::Error> {
    serializer.serialize_u64(elapsed.as_micros() as u64)
}

impl Database {
    /// The textures most alike to the query's example, exactly, ordered by (distance, id).
    ///
    /// # Errors
    /// [`Error::ZeroK`], [`Error::BadDistance`], [`Error::NoSuchSpace`], [`Error::MissingViews`] where the example has
    /// none of the views that the space looks at, and whatever reading the store gives. An empty store has no hits: that
    /// is no error.
    pub fn query(&self, query: &Query<'_>) -> Result<Answer, Error> {
        Asked::new(self, query, 1)?.answer(query)
    }

    /// Many queries at once, in parallel; answers in the order of the queries.
    ///
    /// # Errors
    /// As [`Database::query`]: the first that fails.
    pub fn query_all(&self, queries: &[Query<'_>]) -> Result<Vec<Answer>, Error> {
        // Queries of one call mostly share space and index: those are made once, before the threads begin.
        if let Some(query) = queries.first() {
            Asked::new(self, query, queries.len() as u64)?;
        }
        queries.par_iter().map(|query| Asked::new(self, query, 0)?.answer(query)).collect()
    }
}

/// A query and the state it is asked of.
struct Asked {
    snapshot: Snapshot,
    space: String,
    state: Arc<SpaceState>,
}

impl Asked {
    fn new(database: &Database, query: &Query<'_>, questions: u64) -> Result<Self, Error> {
        if query.k == 0 {
            return Err(Error::ZeroK);
        }
        if let Some(found) = query.within.filter(|distance| distance.is_nan() || *distance < 0.0) {
            return Err(Error::BadDistance { found });
        }
        let space = query.space.as_deref().unwrap_or(DEFAULT_SPACE).to_owned();
        loop {
            let snapshot = database.store().read()?;
            let state = database.state(&snapshot, &space)?;
            // Another thread may have seen a later commit in between: names and distances must be of one state.
            if state.revision() == snapshot.revision() {
                let state = database.with_tree(state, &space, query.index, questions);
                return Ok(Self { snapshot, space, state });
            }
        }
    }

    fn answer(&self, query: &Query<'_>) -> Result<Answer, Error> {
        let (point, own) = self.point(query)?;
        let allowed = tagged_with_all(&self.snapshot, &query.filters)?;
        let began = Instant::now();
        let question = Question {
            point: &point,
            k: query.k,
            within: query.within,
            allowed: allowed.as_deref().map_or(Allowed::All, Allowed::Ids),
            exclude: own.filter(|_| query.exclude_self),
        };
        let index = self.state.index.choose(&question, query.index).name();
        let neighbours = self.state.index.search(&question, query.index)?;
        let elapsed = began.elapsed();
        let mut hits = Vec::with_capacity(neighbours.len());
        for neighbour in neighbours {
            // A state may be newer than the snapshot: what was added since is nobody's hit yet.
            if let Some(record) = self.snapshot.record(neighbour.id)? {
                let rank = hits.len() + 1;
                hits.push(Hit {
                    rank,
                    id: record.id,
                    name: record.name,
                    distance: neighbour.distance,
                    tags: record.tags,
                });
            }
        }
        Ok(Answer { space: self.space.clone(), index, epoch: self.state.space.epoch(), elapsed, hits })
    }

    /// The example's point, and its id where it is a texture of the store.
    fn point(&self, query: &Query<'_>) -> Result<(Vec<f32>, Option<u64>), Error> {
        match &query.example {
            Example::Texture(id) => {
                if let Some(point) = self.state.index.points().point(*id) {
                    return Ok((point.to_vec(), Some(*id)));
                }
                let moments = known_moments(&self.snapshot, *id)?;
                Ok((self.map(&moments, || format!("texture {id}"))?, Some(*id)))
            }
            Example::Volume(volume) => {
                let described = hlac::describe(volume, self.state.space.recipe().views());
                let moments: Vec<_> =
                    described.iter().map(|(view, octants)| (*view, octants.total().descriptor())).collect();
                let own = if query.exclude_self { self.snapshot.find(&volume.content_hash())? } else { None };
                Ok((self.map(&moments, || "the volume".to_owned())?, own))
            }
            Example::Moments(moments) => Ok((self.map(moments, || "the descriptor".to_owned())?, None)),
        }
    }

    fn map(&self, moments: &[(View, [f32; MASK_COUNT])], what: impl Fn() -> String) -> Result<Vec<f32>, Error> {
        let space = &self.state.space;
        let of = |view: View| moments.iter().find(|(other, _)| *other == view).map(|(_, row)| row);
        if space.recipe().views().iter().all(|&view| of(view).is_none()) {
            let needs = space.recipe().views().iter().map(|view| view.name().to_owned()).collect();
            return Err(Error::MissingViews { space: self.space.clone(), needs, what: what() });
        }
        Ok(space.point(&space.recipe().features(of)?)?)
    }
}
