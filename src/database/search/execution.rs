//! From a query to its answer.

use std::collections::BTreeMap;
use std::sync::Arc;
use std::time::Instant;

use rayon::prelude::*;

use super::from_disk;
use super::source::PointSource;
use super::{Answer, Combine, Example, Hit, Query};
use crate::database::handle::Database;
use crate::database::points::descriptors::{features, known_descriptor};
use crate::database::quarantine::left_out;
use crate::error::{Error, ExampleKind};
use crate::index::{IdFilter, KnnQuery, Neighbour};
use crate::space::{Descriptor, Space};
use crate::store::{Reads, Snapshot, StoreError};

impl Database {
    /// The textures most alike to the query's examples, exactly, ordered by (distance, id).
    ///
    /// The first question that a database is asked about a space is answered from the file, reading little of it; from the
    /// second on, the points are held in memory. The answers are the same to the bit.
    ///
    /// # Errors
    /// [`Error::Query`]: `k` is 0, the distance is negative or NaN, there is no example or no such space, or an example has
    /// none of the views that the space uses. [`Error::Store`] where the store cannot be read. An empty store has no
    /// hits: that is no error.
    pub fn query(&self, query: &Query<'_>) -> Result<Answer, Error> {
        query.check()?;
        let from_file_or_memory =
            |snapshot: &Snapshot| self.point_source(snapshot, query.space_name(), query.index, query.limit());
        match Execution::new(self, from_file_or_memory).and_then(|execution| execution.answer(query)) {
            // The points in memory may do without what is damaged in the file: where they must be, they are recomputed.
            Err(error) if error.is_damage() => self.from_memory(query, &[query.limit()])?.answer(query),
            answer => answer,
        }
    }

    /// Many queries at once, in parallel; answers in the order of the queries.
    ///
    /// # Errors
    /// As [`Database::query`]: the first that fails.
    pub fn query_all(&self, queries: &[Query<'_>]) -> Result<Vec<Answer>, Error> {
        if let [query] = queries {
            return Ok(vec![self.query(query)?]);
        }
        // Points are loaded, and trees built, before the threads begin.
        let mut batches: BTreeMap<(&str, &str), Vec<&Query<'_>>> = BTreeMap::new();
        for query in queries {
            query.check()?;
            batches.entry((query.space_name(), query.index.name())).or_default().push(query);
        }
        for batch in batches.values() {
            let ks: Vec<usize> = batch.iter().map(|query| query.limit()).collect();
            if let Some(first) = batch.first() {
                self.from_memory(first, &ks)?;
            }
        }
        queries.par_iter().map(|query| self.from_memory(query, &[])?.answer(query)).collect()
    }

    /// A query that is answered from points in memory, made ready for queries for these numbers of neighbours.
    fn from_memory(&self, query: &Query<'_>, ks: &[usize]) -> Result<Execution<'_>, Error> {
        Execution::new(self, |snapshot| {
            self.points_in_memory(snapshot, query.space_name(), query.index, ks).map(PointSource::Memory)
        })
    }
}

/// The most values of a tag that a warning lists.
const LISTED_VALUES: usize = 8;

/// The state that a query is answered from.
struct Execution<'a> {
    database: &'a Database,
    snapshot: Snapshot,
    points: PointSource,
}

/// The examples' points, with the id of each that is a texture.
type Points = Vec<(Vec<f32>, Option<u64>)>;

impl<'a> Execution<'a> {
    fn new(database: &'a Database, source: impl Fn(&Snapshot) -> Result<PointSource, Error>) -> Result<Self, Error> {
        loop {
            let snapshot = database.store().read()?;
            let points = source(&snapshot)?;
            // Another thread may have seen a later commit in between: names and distances must be of one state.
            if points.revision().is_none_or(|revision| revision == snapshot.revision()) {
                return Ok(Self { database, snapshot, points });
            }
        }
    }

    fn space(&self) -> &Arc<Space> {
        self.points.space()
    }

    fn answer(&self, query: &Query<'_>) -> Result<Answer, Error> {
        let points: Points =
            query.examples.iter().map(|example| self.point(example, query)).collect::<Result<_, _>>()?;
        let allowed = self.database.filters.tagged(&self.snapshot, &query.filters)?;
        let mut warnings = self.warnings(query, allowed.as_deref().map(Vec::as_slice))?;
        let began = Instant::now();
        let k = query.limit();
        let mut own: Vec<u64> = points.iter().filter_map(|(_, id)| *id).filter(|_| query.exclude_self).collect();
        if let Some(content) = &query.exclude_content {
            own.extend(self.snapshot.find(content)?);
        }
        own.extend(left_out(&self.snapshot, &mut warnings));
        if let PointSource::Memory(state) = &self.points {
            warnings.extend_from_slice(&state.owner.warnings);
        }
        let (hits, index, elapsed) = loop {
            own.sort_unstable();
            own.dedup();
            let ask = |point: &[f32]| {
                let question = KnnQuery {
                    point,
                    // One example is left out by the index, more are taken out of the answer.
                    k: if own.len() > 1 { k.saturating_add(own.len()) } else { k },
                    within: query.within,
                    filter: allowed.as_deref().map_or(IdFilter::All, |ids| IdFilter::Ids(ids)),
                    exclude: own.first().copied().filter(|_| own.len() == 1),
                };
                self.search(&question, query)
            };
            let (mut neighbours, index) = match (&points[..], query.combine) {
                ([(point, _)], _) => ask(point)?,
                (points, Combine::Mean) => ask(&mean(points))?,
                (points, Combine::Min) => nearest_of(points.iter().map(|(point, _)| ask(point)))?,
            };
            neighbours.retain(|hit| own.binary_search(&hit.id).is_err());
            neighbours.truncate(k);
            let elapsed = began.elapsed();
            match self.hits(&neighbours) {
                // A texture whose record cannot be read is nobody's hit: the next one takes its place.
                Err(Error::Store(StoreError::Damage(damage)))
                    if damage.texture().is_some_and(|id| !own.contains(&id)) =>
                {
                    warnings.push(format!("{damage}: the texture is left out"));
                    own.extend(damage.texture());
                }
                hits => break (hits?, index, elapsed),
            }
        };
        for warning in &warnings {
            // Whoever asked is told by the answer.
            tracing::debug!("{warning}");
        }
        Ok(Answer { space: query.space_name().to_owned(), index, epoch: self.space().epoch(), elapsed, warnings, hits })
    }

    fn search(&self, question: &KnnQuery<'_>, query: &Query<'_>) -> Result<(Vec<Neighbour>, &'static str), Error> {
        match &self.points {
            PointSource::Memory(state) => {
                let method = state.index.choose(question, query.index);
                Ok((state.index.search(question, query.index)?, method.name()))
            }
            PointSource::Disk(space) => {
                let neighbours = from_disk::search(&self.snapshot, query.space_name(), space, question)?;
                Ok((neighbours, crate::index::IndexMethod::Linear.name()))
            }
        }
    }

    /// Names and tags.
    fn hits(&self, neighbours: &[Neighbour]) -> Result<Vec<Hit>, Error> {
        let ids: Vec<u64> = neighbours.iter().map(|hit| hit.id).collect();
        let records = match &self.points {
            PointSource::Memory(state) => state.owner.records_of(&self.snapshot, &ids)?,
            PointSource::Disk(_) => {
                self.snapshot.records_of(&ids)?.into_iter().map(|record| record.map(Arc::new)).collect()
            }
        };
        let known = neighbours.iter().zip(records).filter_map(|(hit, record)| Some((hit, record?)));
        Ok(known
            .enumerate()
            .map(|(at, (hit, record))| Hit {
                rank: at + 1,
                id: hit.id.into(),
                name: record.name.clone(),
                distance: hit.distance,
                tags: record.tags.clone(),
            })
            .collect())
    }

    /// An answer that a filter leaves empty may be a slip of the pen.
    fn warnings(&self, query: &Query<'_>, allowed: Option<&[u64]>) -> Result<Vec<String>, Error> {
        let mut warnings = Vec::new();
        if allowed.is_some_and(<[u64]>::is_empty) {
            for filter in &query.filters {
                let (key, value) = (filter.key(), filter.value());
                if !self.snapshot.has_tag_key(key)? {
                    let known = self.snapshot.tag_keys()?;
                    let known = if known.is_empty() { "there are no tags".into() } else { known.join(", ") };
                    warnings
                        .push(format!("no texture carries a tag '{key}', so nothing can be a hit; the tags: {known}"));
                    continue;
                }
                let known = self.snapshot.tag_values(key)?;
                if known.iter().all(|(one, _)| one != value) {
                    let some: Vec<&str> = known.iter().take(LISTED_VALUES).map(|(one, _)| one.as_str()).collect();
                    let more = if known.len() > some.len() { ", ..." } else { "" };
                    warnings.push(format!(
                        "no texture carries {key}={value}, so nothing can be a hit; the values of '{key}': {}{more}",
                        some.join(", ")
                    ));
                }
            }
            if warnings.is_empty() {
                warnings.push("no texture carries all of these tags, so nothing can be a hit".into());
            }
        }
        Ok(warnings)
    }

    /// An example's point, and its id where it is a texture of the store.
    fn point(&self, example: &Example<'_>, query: &Query<'_>) -> Result<(Vec<f32>, Option<u64>), Error> {
        match example {
            Example::Texture(id) => {
                let kept = match &self.points {
                    PointSource::Memory(state) => state.index.points().point(id.get()).map(<[f32]>::to_vec),
                    PointSource::Disk(space) => from_disk::point(&self.snapshot, query.space_name(), space, id.get())?,
                };
                if let Some(point) = kept {
                    return Ok((point, Some(id.get())));
                }
                let descriptor = known_descriptor(&self.snapshot, id.get())?;
                Ok((self.map(&descriptor, ExampleKind::Texture(*id))?, Some(id.get())))
            }
            Example::Volume(volume) => {
                let described = crate::describe(volume, self.space().feature_set().views());
                let descriptor = Descriptor::from_sums(&described)?;
                let own = if query.exclude_self { self.snapshot.find(&volume.content_hash())? } else { None };
                Ok((self.map(&descriptor, ExampleKind::Volume)?, own))
            }
            Example::Descriptor(descriptor) => Ok((self.map(descriptor, ExampleKind::Descriptor)?, None)),
        }
    }

    fn map(&self, descriptor: &Descriptor, example: ExampleKind) -> Result<Vec<f32>, Error> {
        Ok(self.space().point(&features(self.space(), descriptor, example)?)?)
    }
}

/// The mean of points, coordinate by coordinate, in the order of the examples.
fn mean(points: &[(Vec<f32>, Option<u64>)]) -> Vec<f32> {
    let dims = points.first().map_or(0, |(point, _)| point.len());
    let coordinate =
        |at: usize| points.iter().filter_map(|(point, _)| point.get(at)).map(|&c| f64::from(c)).sum::<f64>();
    (0..dims).map(|at| (coordinate(at) / points.len() as f64) as f32).collect()
}

/// The hits of several answers, each at its least distance.
///
/// A hit among the `k` nearest to any example is among the `k` nearest to the example it is nearest to: so the answers
/// hold all that is asked for.
fn nearest_of(
    answers: impl Iterator<Item = Result<(Vec<Neighbour>, &'static str), Error>>,
) -> Result<(Vec<Neighbour>, &'static str), Error> {
    let mut nearest: BTreeMap<u64, f64> = BTreeMap::new();
    let mut index = "";
    for answer in answers {
        let (neighbours, by) = answer?;
        index = by;
        for hit in neighbours {
            nearest.entry(hit.id).and_modify(|least| *least = least.min(hit.distance)).or_insert(hit.distance);
        }
    }
    let mut hits: Vec<Neighbour> = nearest.into_iter().map(|(id, distance)| Neighbour { id, distance }).collect();
    hits.sort_unstable();
    Ok((hits, index))
}
