//! Retrieval measures of spaces, over textures that are labelled by a tag.
//!
//! Every labelled texture is a query against all other labelled ones (leave one out), ranked by (distance, id). A texture whose
//! label no other texture has is not a query, since it has nothing to find, but it may be a hit, which is then not relevant. The
//! measures are those of the retrieval literature:
//!
//! - *P@1*, *P@k*: the share of the first 1, k hits that have the label of the query;
//! - *mAP*: the mean over all queries of average precision, which is the mean of the precision at the rank of each relevant
//!   texture, over the whole ranking.

use std::collections::BTreeMap;

use rayon::prelude::*;
use serde::Serialize;

use crate::TextureId;
use crate::database::{Database, TexturePoint};
use crate::error::{Error, QueryError};
use crate::progress::Progress;
use crate::space::Metric;

/// The highest rank of [`SpaceMeasures::precision_at_rank`].
pub const CURVE_RANKS: usize = 50;

/// The number of values of [`SpaceMeasures::precision_at_recall`].
pub const CURVE_RECALLS: usize = 21;

/// Measures over a number of queries. Each is a mean from 0 to 1.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
#[non_exhaustive]
pub struct Measures {
    /// The number of queries.
    pub queries: usize,
    /// The share of first hits with the query's label.
    pub p_at_1: f64,
    /// The share of the first k hits with the query's label.
    pub p_at_k: f64,
    /// Mean average precision.
    pub map: f64,
}

/// The measures of one space.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[non_exhaustive]
pub struct SpaceMeasures {
    /// The space.
    pub space: String,
    /// Over all queries.
    #[serde(flatten)]
    pub all: Measures,
    /// The share of the first 1, 2, ... hits with the query's label, up to [`CURVE_RANKS`] or the number of other textures: the
    /// mean over all queries.
    pub precision_at_rank: Vec<f64>,
    /// Interpolated precision at recall 0, 1/20, ..., 1: the highest precision at that recall or a higher one; the mean over all
    /// queries.
    pub precision_at_recall: Vec<f64>,
    /// Over the queries of each label.
    pub per_class: BTreeMap<String, Measures>,
    /// The number of queries with a label (outer key) whose first hit has a label (inner key).
    pub confusion: BTreeMap<String, BTreeMap<String, usize>>,
}

/// The measures of several spaces over the same queries.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[non_exhaustive]
pub struct Evaluation {
    /// The tag whose values are the labels.
    pub label: String,
    /// The k of P@k.
    pub k: usize,
    /// The spaces, in the order in which the caller gave them.
    pub spaces: Vec<SpaceMeasures>,
}

/// Evaluates spaces by the values of a tag.
///
/// # Errors
/// [`QueryError::TooFewLabels`] where fewer than two textures carry the tag; [`QueryError::SingleLabel`] where all of them
/// have the same value, so that every hit would be correct; [`QueryError::UniqueLabels`] where no two have the same value,
/// so that no hit could be; [`QueryError::ZeroK`], [`QueryError::NoSuchSpace`]; [`Error::Cancelled`], [`Error::Store`].
pub fn evaluate(
    database: &Database,
    label: &str,
    k: usize,
    spaces: &[String],
    progress: &dyn Progress,
) -> Result<Evaluation, Error> {
    if k == 0 {
        return Err(QueryError::ZeroK.into());
    }
    let labels: BTreeMap<TextureId, String> = database.labels(label)?;
    if labels.len() < 2 {
        return Err(QueryError::TooFewLabels { key: label.to_owned() }.into());
    }
    check_classes(label, &labels)?;
    progress.begin("evaluating", Some((spaces.len() * labels.len()) as u64));
    let spaces = spaces.iter().map(|space| evaluate_space(database, space, &labels, k, progress));
    Ok(Evaluation { label: label.to_owned(), k, spaces: spaces.collect::<Result<_, _>>()? })
}

/// Refuses labels with which every hit, or no hit, would be relevant.
fn check_classes(key: &str, labels: &BTreeMap<TextureId, String>) -> Result<(), QueryError> {
    let mut sizes: BTreeMap<&String, usize> = BTreeMap::new();
    for label in labels.values() {
        *sizes.entry(label).or_default() += 1;
    }
    if let (Some((value, &textures)), 1) = (sizes.first_key_value(), sizes.len()) {
        return Err(QueryError::SingleLabel { key: key.to_owned(), value: (*value).clone(), textures });
    }
    if sizes.values().all(|&size| size == 1) {
        return Err(QueryError::UniqueLabels { key: key.to_owned(), textures: labels.len() });
    }
    Ok(())
}

/// A labelled point.
struct Labelled {
    id: TextureId,
    class: usize,
    point: Vec<f32>,
}

/// The measures of one query.
struct Ranked {
    class: usize,
    first: usize,
    measures: Measures,
    at_rank: Vec<f64>,
    at_recall: Vec<f64>,
}

fn evaluate_space(
    database: &Database,
    space: &str,
    labels: &BTreeMap<TextureId, String>,
    k: usize,
    progress: &dyn Progress,
) -> Result<SpaceMeasures, Error> {
    let mut classes: Vec<&String> = labels.values().collect();
    classes.sort_unstable();
    classes.dedup();
    let (metric, points) = database.points_of(space, labels.keys().copied())?;
    let class =
        |id: TextureId| labels.get(&id).and_then(|label| classes.binary_search(&label).ok()).unwrap_or_default();
    let points: Vec<Labelled> =
        points.into_iter().map(|TexturePoint { id, point }| Labelled { id, class: class(id), point }).collect();
    let ranked: Vec<Ranked> = points
        .par_iter()
        .filter_map(|query| {
            progress.advance(1);
            if progress.cancelled() { None } else { rank(query, &points, metric, k) }
        })
        .collect();
    if progress.cancelled() {
        return Err(Error::Cancelled);
    }
    let mut per_class = BTreeMap::new();
    let mut confusion: BTreeMap<String, BTreeMap<String, usize>> = BTreeMap::new();
    for (number, name) in classes.iter().enumerate() {
        let of_class = || ranked.iter().filter(|query| query.class == number);
        per_class.insert((*name).clone(), mean(of_class()));
        let row = confusion.entry((*name).clone()).or_default();
        for query in of_class() {
            if let Some(first) = classes.get(query.first) {
                *row.entry((*first).clone()).or_default() += 1;
            }
        }
    }
    Ok(SpaceMeasures {
        space: space.to_owned(),
        all: mean(ranked.iter()),
        precision_at_rank: mean_curve(ranked.iter().map(|query| &query.at_rank)),
        precision_at_recall: mean_curve(ranked.iter().map(|query| &query.at_recall)),
        per_class,
        confusion,
    })
}

/// Ranks all other points by (distance, id); `None` if none of them has the query's class.
fn rank(query: &Labelled, points: &[Labelled], metric: Metric, k: usize) -> Option<Ranked> {
    let mut others: Vec<(f64, TextureId, usize)> = points
        .iter()
        .filter(|other| other.id != query.id)
        .map(|other| (metric.distance(&query.point, &other.point), other.id, other.class))
        .collect();
    others.sort_unstable_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
    let first = others.first()?.2;
    // The precision at the rank of each relevant texture.
    let mut precisions: Vec<f64> = Vec::new();
    let mut at_rank: Vec<f64> = Vec::with_capacity(CURVE_RANKS.min(others.len()));
    let mut in_top = 0;
    for (rank, hit) in (1_u32..).zip(&others) {
        if hit.2 == query.class {
            precisions.push((precisions.len() + 1) as f64 / f64::from(rank));
        }
        if at_rank.len() < CURVE_RANKS {
            at_rank.push(precisions.len() as f64 / f64::from(rank));
        }
        if rank as usize <= k {
            in_top = precisions.len();
        }
    }
    if precisions.is_empty() {
        return None;
    }
    let measures = Measures {
        queries: 1,
        p_at_1: f64::from(u8::from(first == query.class)),
        p_at_k: in_top as f64 / k.min(others.len()) as f64,
        map: precisions.iter().sum::<f64>() / precisions.len() as f64,
    };
    Some(Ranked { class: query.class, first, measures, at_rank, at_recall: interpolated(precisions) })
}

/// Precision at even steps of recall, from the precisions at the ranks of the relevant textures, of which there is at least
/// one.
fn interpolated(mut precisions: Vec<f64>) -> Vec<f64> {
    let found = precisions.len();
    let mut best = 0.0_f64;
    for precision in precisions.iter_mut().rev() {
        best = best.max(*precision);
        *precision = best;
    }
    let steps = CURVE_RECALLS - 1;
    // The first relevant texture by which this share of them is found.
    let at = |step: usize| (step * found).div_ceil(steps).max(1) - 1;
    (0..=steps).map(|step| precisions.get(at(step)).copied().unwrap_or_default()).collect()
}

/// The mean of curves of the same length.
fn mean_curve<'a>(curves: impl Iterator<Item = &'a Vec<f64>>) -> Vec<f64> {
    let mut sum: Vec<f64> = Vec::new();
    let mut count = 0.0;
    for curve in curves {
        sum.resize(curve.len(), 0.0);
        sum.iter_mut().zip(curve).for_each(|(sum, value)| *sum += value);
        count += 1.0;
    }
    sum.into_iter().map(|sum| sum / count).collect()
}

fn mean<'a>(ranked: impl Iterator<Item = &'a Ranked>) -> Measures {
    let mut sum = Measures::default();
    for Ranked { measures, .. } in ranked {
        sum.queries += 1;
        sum.p_at_1 += measures.p_at_1;
        sum.p_at_k += measures.p_at_k;
        sum.map += measures.map;
    }
    let count = sum.queries.max(1) as f64;
    Measures { p_at_1: sum.p_at_1 / count, p_at_k: sum.p_at_k / count, map: sum.map / count, ..sum }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn point(id: u64, class: usize, x: f32) -> Labelled {
        Labelled { id: id.into(), class, point: vec![x] }
    }

    #[test]
    fn average_precision_is_that_of_the_textbook() {
        // Ranking of the query at 0: classes 1 0 0 1 0 -> relevant at ranks 2, 3, 5.
        let points = [
            point(1, 0, 0.0),
            point(2, 1, 1.0),
            point(3, 0, 2.0),
            point(4, 0, 3.0),
            point(5, 1, 4.0),
            point(6, 0, 5.0),
        ];
        let ranked = rank(&points[0], &points, Metric::L2, 2).unwrap();
        assert_eq!((ranked.measures.p_at_1, ranked.measures.p_at_k), (0.0, 0.5));
        assert!((ranked.measures.map - (1.0 / 2.0 + 2.0 / 3.0 + 3.0 / 5.0) / 3.0).abs() < 1e-12);
        assert_eq!(ranked.at_rank, [0.0, 1.0 / 2.0, 2.0 / 3.0, 2.0 / 4.0, 3.0 / 5.0]);
        // Up to two thirds of recall the best is 2 of 3; beyond, 3 of 5.
        let expected: Vec<f64> = (0..=20).map(|step| if step <= 13 { 2.0 / 3.0 } else { 3.0 / 5.0 }).collect();
        assert_eq!(ranked.at_recall, expected);
    }

    #[test]
    fn labels_with_which_all_or_no_hits_are_relevant_are_refused() {
        let labels =
            |values: &[&str]| (1_u64..).zip(values).map(|(id, value)| (id.into(), (*value).to_owned())).collect();
        let check = |values: &[&str]| check_classes("kind", &labels(values));
        assert!(matches!(check(&["a", "a"]), Err(QueryError::SingleLabel { textures: 2, .. })));
        assert!(matches!(check(&["a", "b", "c"]), Err(QueryError::UniqueLabels { textures: 3, .. })));
        assert!(check(&["a", "b", "a"]).is_ok());
    }

    #[test]
    fn a_texture_with_a_unique_label_is_not_a_query() {
        assert!(rank(&point(1, 7, 0.0), &[point(1, 7, 0.0), point(2, 1, 1.0)], Metric::L2, 3).is_none());
    }

    #[test]
    fn equal_distances_rank_by_id() {
        let points = [point(1, 0, 0.0), point(3, 0, 1.0), point(2, 1, 1.0)];
        assert_eq!(rank(&points[0], &points, Metric::L2, 1).unwrap().first, 1);
    }
}
