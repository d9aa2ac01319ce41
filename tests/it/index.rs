//! Every method gives the answer of sorting everything, to the bit.

use std::collections::{BTreeMap, BTreeSet};

use hlacdb::internals::index::{IdFilter, Index, IndexMethod, KnnQuery, Neighbour, Points};
use hlacdb::space::Metric;
use proptest::prelude::*;

/// Rows as a plain map, and what is done to them.
#[derive(Debug, Clone)]
struct Scene {
    metric: Metric,
    dims: usize,
    /// Rows given at once, then a tree, then rows added one by one.
    base: Vec<Vec<f32>>,
    tail: Vec<Vec<f32>>,
    /// Rows (by number) removed before and after the tree is built.
    removed_before: BTreeSet<usize>,
    removed_after: BTreeSet<usize>,
    /// Ids are not row numbers: they leave gaps.
    stride: u64,
}

impl Scene {
    fn id(&self, row: usize) -> u64 {
        1 + row as u64 * self.stride
    }

    fn index(&self) -> Index {
        let ids: Vec<u64> = (0..self.base.len()).map(|row| self.id(row)).collect();
        let points = Points::from_rows(self.metric, self.dims, &ids, &self.base.concat()).unwrap();
        let mut index = Index::from_points(points);
        for &row in self.removed_before.iter().filter(|&&row| row < self.base.len()) {
            assert!(index.remove(self.id(row)));
        }
        index.rebuild();
        for (at, point) in self.tail.iter().enumerate() {
            index.push(self.id(self.base.len() + at), point).unwrap();
        }
        for &row in &self.removed_after {
            index.remove(self.id(row));
        }
        index
    }

    /// Live rows, by id.
    fn live(&self) -> BTreeMap<u64, &[f32]> {
        let rows = self.base.iter().chain(&self.tail).enumerate();
        let gone = |row: usize| {
            (row < self.base.len() && self.removed_before.contains(&row)) || self.removed_after.contains(&row)
        };
        rows.filter(|&(row, _)| !gone(row)).map(|(row, point)| (self.id(row), point.as_slice())).collect()
    }

    /// The answer by sorting everything.
    fn brute(&self, query: &KnnQuery<'_>) -> Vec<(u64, u64)> {
        let mut all: Vec<Neighbour> = self
            .live()
            .into_iter()
            .filter(|&(id, _)| query.exclude != Some(id) && query.filter.allows(id))
            .map(|(id, point)| Neighbour { id, distance: self.metric.distance(query.point, point) })
            .filter(|hit| query.within.is_none_or(|radius| hit.distance <= radius))
            .collect();
        all.sort_by(|a, b| a.distance.total_cmp(&b.distance).then(a.id.cmp(&b.id)));
        all.truncate(query.k);
        bits(&all)
    }
}

/// Ids and the bits of their distances.
fn bits(hits: &[Neighbour]) -> Vec<(u64, u64)> {
    hits.iter().map(|hit| (hit.id, hit.distance.to_bits())).collect()
}

/// Coordinates that make ties, duplicates and near-duplicates likely, or unlikely, or differ wildly in magnitude.
fn point(dims: usize, kind: u8) -> BoxedStrategy<Vec<f32>> {
    let coordinate = match kind {
        0 => (-2i8..=2).prop_map(f32::from).boxed(),
        1 => (-1.0f32..1.0).boxed(),
        // Near-duplicates, so near that the norm of many coordinates rounds away the whole distance.
        2 => (0u32..3).prop_map(|ulps| f32::from_bits(0.3f32.to_bits() + ulps)).boxed(),
        3 => prop_oneof![-1e7f32..1e7, -1e-3f32..1e-3, Just(0.0f32), Just(-0.0f32)].boxed(),
        4 => prop_oneof![Just(f32::MAX), Just(-f32::MAX), -1e30f32..1e30, Just(1e-40f32), Just(-3e-39f32)].boxed(),
        _ => Just(0.5f32).boxed(),
    };
    prop::collection::vec(coordinate, dims).boxed()
}

fn dims() -> impl Strategy<Value = usize> {
    prop_oneof![6 => 1usize..=20, 3 => 21usize..=64, 1 => Just(251usize)]
}

fn scene() -> impl Strategy<Value = (Scene, Vec<f32>)> {
    (prop::bool::ANY, dims(), 0u8..6, 0usize..400, 0usize..60, 1u64..4).prop_flat_map(
        |(l1, dims, kind, base, tail, stride)| {
            let rows = |n: usize| prop::collection::vec(point(dims, kind), n);
            let some = || prop::collection::btree_set(0usize..460, 0..40);
            (rows(base), rows(tail), some(), some(), point(dims, kind), Just((l1, dims, stride))).prop_map(
                |(base, tail, removed_before, removed_after, query, (l1, dims, stride))| {
                    let metric = if l1 { Metric::L1 } else { Metric::L2 };
                    (Scene { metric, dims, base, tail, removed_before, removed_after, stride }, query)
                },
            )
        },
    )
}

/// Every shape of query that the scene can be asked.
fn queries<'a>(
    query: &'a [f32],
    k: usize,
    ids: &'a [u64],
    odd: &'a (dyn Fn(u64) -> bool + Sync),
    radii: [f64; 2],
) -> Vec<KnnQuery<'a>> {
    let mut all = vec![];
    for k in [k, 1, usize::MAX] {
        for allowed in [IdFilter::All, IdFilter::Ids(ids), IdFilter::Predicate(odd)] {
            for within in [None, Some(radii[0]), Some(radii[1]), Some(0.0)] {
                let query = KnnQuery { point: query, k, within, filter: allowed, exclude: None };
                all.push(query);
                all.push(query.exclude(1));
            }
        }
    }
    all
}

proptest! {
    #![proptest_config(hlacdb_testing::cases(160))]

    #[test]
    fn linear_kdtree_and_brute_force_agree(
        (scene, free) in scene(),
        at_a_row in prop::option::of(0usize..400),
        k in 1usize..80,
        share in 1u64..12,
    ) {
        let query = at_a_row.and_then(|row| scene.base.get(row)).cloned().unwrap_or(free);
        let index = scene.index();
        let ids: Vec<u64> = (0..500).filter(|id: &u64| id.is_multiple_of(share)).collect();
        let odd = |id: u64| id % share == 1;
        // One radius at the very distance of a row, where inclusive shows.
        let mut distances: Vec<f64> = scene.live().values().map(|row| scene.metric.distance(&query, row)).collect();
        distances.sort_by(f64::total_cmp);
        let at = |part: usize| distances.get(distances.len() * part / 10).copied().unwrap_or(1.0);
        for query in queries(&query, k, &ids, &odd, [at(1), at(6)]) {
            let expected = scene.brute(&query);
            for method in [IndexMethod::Linear, IndexMethod::KdTree, IndexMethod::Auto] {
                let found = index.search(&query, method).unwrap();
                prop_assert_eq!(bits(&found), expected.clone(), "{} {:?}", method, query);
            }
        }
    }
}
