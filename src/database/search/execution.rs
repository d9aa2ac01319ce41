//! From a query to its answer.

use std::collections::BTreeMap;
use std::sync::Arc;
use std::time::Instant;

use rayon::prelude::*;

use super::from_disk;
use super::source::PointSource;
use super::{Answer, Combine, Example, Hit, Query};
use crate::database::handle::Database;
use crate::database::points::descriptors::{existing_descriptor, features};
use crate::database::quarantine::left_out;
use crate::error::{Error, ExampleKind};
use crate::index::{IdFilter, IndexMethod, KnnQuery, Neighbour};
use crate::space::{Descriptor, Space};
use crate::store::{Reads, Snapshot, StoreError};

impl Database {
    /// The textures most like the query's examples, exactly, ordered by (distance, id).
    ///
    /// The first query of a space is answered from the file, of which little is read; from the second on, the points are
    /// held in memory. The answers are the same to the bit.
    ///
    /// # Errors
    /// [`Error::Query`]: `k` is 0, the distance is negative or NaN, there is no example or no such space, or an example has
    /// none of the views that the space uses. [`Error::Store`] if the store cannot be read, or has no texture with the id of
    /// an example. An empty store has no hits: that is not an error.
    pub fn query(&self, query: &Query<'_>) -> Result<Answer, Error> {
        query.check()?;
        let source = |snapshot: &Snapshot| self.point_source(snapshot, query.space_name(), query.index, query.limit());
        match Execution::new(self, source).and_then(|execution| execution.answer(query)) {
            // Points in memory may not need what is damaged in the file: they can be recomputed.
            Err(error) if error.is_damage() => self.execute_in_memory(query, &[query.limit()])?.answer(query),
            answer => answer,
        }
    }

    /// Many queries at once, in parallel. Answers are in the order of the queries.
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
                self.execute_in_memory(first, &ks)?;
            }
        }
        queries.par_iter().map(|query| self.execute_in_memory(query, &[])?.answer(query)).collect()
    }

    /// The execution of a query on points in memory, made ready for queries for these numbers of neighbours.
    fn execute_in_memory(&self, query: &Query<'_>, ks: &[usize]) -> Result<Execution<'_>, Error> {
        Execution::new(self, |snapshot| {
            self.points_in_memory(snapshot, query.space_name(), query.index, ks).map(PointSource::Memory)
        })
    }
}

/// The most values of a tag that a warning lists.
const LISTED_VALUES: usize = 8;

/// A query at work: the state of the store that it is answered from, and its points.
struct Execution<'a> {
    database: &'a Database,
    snapshot: Snapshot,
    points: PointSource,
}

/// The point of an example, and its id if it is a stored texture.
struct ExamplePoint {
    point: Vec<f32>,
    id: Option<u64>,
}

impl<'a> Execution<'a> {
    fn new(database: &'a Database, source: impl Fn(&Snapshot) -> Result<PointSource, Error>) -> Result<Self, Error> {
        loop {
            let snapshot = database.store().read()?;
            let points = source(&snapshot)?;
            // Another thread may have seen a later commit: names and distances must be of one state.
            if points.revision().is_none_or(|revision| revision == snapshot.revision()) {
                return Ok(Self { database, snapshot, points });
            }
        }
    }

    fn space(&self) -> &Arc<Space> {
        self.points.space()
    }

    fn answer(&self, query: &Query<'_>) -> Result<Answer, Error> {
        let examples: Vec<ExamplePoint> =
            query.examples.iter().map(|example| self.example_point(example, query)).collect::<Result<_, _>>()?;
        let allowed = self.database.filters.matching_ids(&self.snapshot, &query.filters)?;
        let mut warnings = self.warnings(query, allowed.as_deref().map(Vec::as_slice))?;
        let began = Instant::now();
        let mut excluded: Vec<u64> =
            examples.iter().filter_map(|example| example.id).filter(|_| query.exclude_self).collect();
        excluded.extend(left_out(&self.snapshot, &mut warnings));
        if let PointSource::Memory(state) = &self.points {
            warnings.extend_from_slice(&state.owner.warnings);
        }
        let (hits, index, elapsed) = loop {
            excluded.sort_unstable();
            excluded.dedup();
            let filter = allowed.as_deref().map_or(IdFilter::All, |ids| IdFilter::Ids(ids));
            let (neighbours, index) = self.neighbours(query, &examples, filter, &excluded)?;
            let elapsed = began.elapsed();
            match self.hits(&neighbours) {
                // A texture whose record cannot be read is left out, and the next one takes its place.
                Err(Error::Store(StoreError::Damage(damage)))
                    if damage.texture().is_some_and(|id| !excluded.contains(&id)) =>
                {
                    warnings.push(format!("{damage}: the texture is left out"));
                    excluded.extend(damage.texture());
                }
                hits => break (hits?, index, elapsed),
            }
        };
        for warning in &warnings {
            tracing::debug!("{warning}");
        }
        Ok(Answer { space: query.space_name().to_owned(), index, epoch: self.space().epoch(), elapsed, warnings, hits })
    }

    /// The nearest neighbours of the examples but for those that are excluded, and the method that found them.
    fn neighbours(
        &self,
        query: &Query<'_>,
        examples: &[ExamplePoint],
        filter: IdFilter<'_>,
        excluded: &[u64],
    ) -> Result<(Vec<Neighbour>, &'static str), Error> {
        let k = query.limit();
        // The index can leave out one texture. If there are more, more neighbours are found and the excluded ones dropped.
        let (found, exclude) = match excluded {
            [] => (k, None),
            [id] => (k, Some(*id)),
            more => (k.saturating_add(more.len()), None),
        };
        let nearest =
            |point: &[f32]| self.search(&KnnQuery { point, k: found, within: query.within, filter, exclude }, query);
        let (mut neighbours, index) = match (examples, query.combine) {
            ([example], _) => nearest(&example.point)?,
            (examples, Combine::Mean) => nearest(&mean(examples))?,
            (examples, Combine::Min) => nearest_of(examples.iter().map(|example| nearest(&example.point)))?,
        };
        neighbours.retain(|hit| excluded.binary_search(&hit.id).is_err());
        neighbours.truncate(k);
        Ok((neighbours, index))
    }

    fn search(&self, knn: &KnnQuery<'_>, query: &Query<'_>) -> Result<(Vec<Neighbour>, &'static str), Error> {
        match &self.points {
            PointSource::Memory(state) => {
                let method = state.index.choose(knn, query.index);
                Ok((state.index.search(knn, query.index)?, method.name()))
            }
            PointSource::Disk(space) => {
                let neighbours = from_disk::search(&self.snapshot, query.space_name(), space, knn)?;
                Ok((neighbours, IndexMethod::Linear.name()))
            }
        }
    }

    /// The neighbours with their names and tags.
    fn hits(&self, neighbours: &[Neighbour]) -> Result<Vec<Hit>, Error> {
        let ids: Vec<u64> = neighbours.iter().map(|hit| hit.id).collect();
        let records = match &self.points {
            PointSource::Memory(state) => state.owner.records_of(&self.snapshot, &ids)?,
            PointSource::Disk(_) => {
                self.snapshot.records_of(&ids)?.into_iter().map(|record| record.map(Arc::new)).collect()
            }
        };
        let existing = neighbours.iter().zip(records).filter_map(|(hit, record)| Some((hit, record?)));
        Ok(existing
            .enumerate()
            .map(|(position, (hit, record))| Hit {
                rank: position + 1,
                id: hit.id.into(),
                name: record.name.clone(),
                distance: hit.distance,
                tags: record.tags.clone(),
            })
            .collect())
    }

    /// Why filters match no texture: a key or a value may be misspelt.
    fn warnings(&self, query: &Query<'_>, allowed: Option<&[u64]>) -> Result<Vec<String>, Error> {
        let mut warnings = Vec::new();
        if !allowed.is_some_and(<[u64]>::is_empty) {
            return Ok(warnings);
        }
        for filter in &query.filters {
            let (key, value) = (filter.key(), filter.value());
            if !self.snapshot.has_tag_key(key)? {
                let keys = self.snapshot.tag_keys()?;
                let keys = if keys.is_empty() { "none".into() } else { keys.join(", ") };
                warnings.push(format!("no texture has a tag '{key}', so there are no hits; the tags are: {keys}"));
                continue;
            }
            let values = self.snapshot.tag_values(key)?;
            if values.iter().all(|(other, _)| other != value) {
                let listed: Vec<&str> = values.iter().take(LISTED_VALUES).map(|(other, _)| other.as_str()).collect();
                let more = if values.len() > listed.len() { ", ..." } else { "" };
                warnings.push(format!(
                    "no texture has the tag {key}={value}, so there are no hits; the values of '{key}' are: {}{more}",
                    listed.join(", ")
                ));
            }
        }
        if warnings.is_empty() {
            warnings.push("no texture has all of these tags, so there are no hits".into());
        }
        Ok(warnings)
    }

    fn example_point(&self, example: &Example<'_>, query: &Query<'_>) -> Result<ExamplePoint, Error> {
        match example {
            Example::Texture(id) => {
                let id = id.get();
                let point = match &self.points {
                    PointSource::Memory(state) => state.index.points().point(id).map(<[f32]>::to_vec),
                    PointSource::Disk(space) => from_disk::point(&self.snapshot, query.space_name(), space, id)?,
                };
                let point = match point {
                    Some(point) => point,
                    None => {
                        let descriptor = existing_descriptor(&self.snapshot, id)?;
                        self.map(&descriptor, ExampleKind::Texture(id.into()))?
                    }
                };
                Ok(ExamplePoint { point, id: Some(id) })
            }
            Example::Volume(volume) => {
                let described = crate::describe(volume, self.space().feature_set().views());
                let point = self.map(&Descriptor::from_sums(&described)?, ExampleKind::Volume)?;
                let id = if query.exclude_self { self.snapshot.find(&volume.content_hash())? } else { None };
                Ok(ExamplePoint { point, id })
            }
            Example::Described(volume) => {
                let point = self.map(volume.descriptor(), ExampleKind::Volume)?;
                let id = if query.exclude_self { self.snapshot.find(&volume.content().0)? } else { None };
                Ok(ExamplePoint { point, id })
            }
            Example::Descriptor(descriptor) => {
                Ok(ExamplePoint { point: self.map(descriptor, ExampleKind::Descriptor)?, id: None })
            }
        }
    }

    fn map(&self, descriptor: &Descriptor, example: ExampleKind) -> Result<Vec<f32>, Error> {
        Ok(self.space().point(&features(self.space(), descriptor, example)?)?)
    }
}

/// The mean of the examples' points, coordinate by coordinate, in the order of the examples.
fn mean(examples: &[ExamplePoint]) -> Vec<f32> {
    let dims = examples.first().map_or(0, |example| example.point.len());
    let mean = |axis: usize| {
        let coordinates = examples.iter().filter_map(|example| example.point.get(axis));
        coordinates.map(|&coordinate| f64::from(coordinate)).sum::<f64>() / examples.len() as f64
    };
    (0..dims).map(|axis| mean(axis) as f32).collect()
}

/// The hits of several answers, each at its least distance.
///
/// A texture among the `k` nearest to any example is among the `k` nearest to the example that it is nearest to, so the
/// answers contain all hits.
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
