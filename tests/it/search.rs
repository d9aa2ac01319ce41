//! Questions to a database: from the file or from memory, by scan or by tree, they have one answer, to the bit.

use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

use hlacdb::Volumes;
use hlacdb::hlac::{MASK_COUNT, View};
use hlacdb::{
    Answer, Combine, Database, Error, ExchangeError, IndexMethod, OpenOptions, Query, QueryError, TagEdit, arrays,
};
use proptest::prelude::*;

type Moments = [f32; MASK_COUNT];

/// Descriptor number `n` of its kind: kinds are far apart, numbers of one kind near one another, some of them equal.
fn moments(kind: u8, n: u8) -> Moments {
    let level = 0.2 + 0.1 * f32::from(kind % 6);
    // The last places of a few moments only: near-duplicates.
    let apart = if n < 8 { f32::from(n / 2) * 1e-6 } else { f32::from(n) * 2e-4 };
    std::array::from_fn(|mask| {
        let cells = if mask == 0 { 1 } else { 2 + i32::from(mask > 13) };
        let grain = ((mask * (7 + usize::from(kind)) + usize::from(n % 5)) % 11) as f32;
        (level.powi(cells) * (1.0 + 0.01 * grain) + apart * (mask % 3) as f32).clamp(0.0, 1.0)
    })
}

fn open(path: &Path, views: &[View]) -> Database {
    OpenOptions::new().views(views).volumes(Volumes::None).open(path).unwrap()
}

fn import(database: &Database, folder: &Path, rows: &[Moments], tag: &str) -> Vec<u64> {
    let array = folder.join("rows.npy");
    arrays::write_npy(&array, &[rows.len(), MASK_COUNT], rows.as_flattened()).unwrap();
    let tags = BTreeMap::from([("t".to_owned(), tag.to_owned())]);
    let report = database.import(&array, &[View::Full], None, &tags, &()).unwrap();
    report.ids.map_or(Vec::new(), |(first, last)| (first.get()..=last.get()).collect())
}

fn bits(answer: &Answer) -> Vec<(u64, u64)> {
    answer.hits.iter().map(|hit| (hit.id.get(), hit.distance.to_bits())).collect()
}

/// The answer by sorting everything.
fn brute(database: &Database, ids: &BTreeSet<u64>, query: &Asked, point: &[f32]) -> Vec<(u64, u64)> {
    let (metric, points) = database.points_of(query.space, ids.iter().copied()).unwrap();
    let mut all: Vec<(f64, u64)> =
        points.iter().map(|other| (metric.distance(point, &other.point), other.id.get())).collect();
    all.retain(|(distance, _)| query.within.is_none_or(|within| *distance <= within));
    all.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
    all.truncate(query.k);
    all.into_iter().map(|(distance, id)| (id, distance.to_bits())).collect()
}

/// A question in plain words.
#[derive(Clone, Debug)]
struct Asked {
    space: &'static str,
    k: usize,
    within: Option<f64>,
    tag: Option<&'static str>,
}

impl Asked {
    fn of(&self, id: u64) -> Query<'static> {
        let mut query = Query::texture(id).k(self.k).space(self.space);
        if let Some(within) = self.within {
            query = query.within(within);
        }
        if let Some(tag) = self.tag {
            query = query.filter("t", tag);
        }
        query
    }
}

fn rows() -> impl Strategy<Value = Vec<(u8, u8)>> {
    prop::collection::vec((0u8..6, 0u8..40), 1..120)
}

proptest! {
    #![proptest_config(ProptestConfig { max_shrink_iters: 60, ..hlacdb_testing::cases(10) })]

    #[test]
    fn file_scan_tree_and_brute_force_agree(
        first in rows(), second in rows(), removed in prop::collection::btree_set(1u64..200, 0..40),
        from in any::<prop::sample::Index>(), k in 1usize..60,
    ) {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("t.hlacdb");
        let writer = open(&path, &[View::Full]);
        let descriptors = |rows: &[(u8, u8)]| rows.iter().map(|&(kind, n)| moments(kind, n)).collect::<Vec<_>>();
        let mut tagged = BTreeMap::new();
        tagged.insert("a", import(&writer, folder.path(), &descriptors(&first), "a"));
        // A state that grows: what comes now is a tail, what goes leaves tombstones.
        writer.query(&Query::texture(1).index(IndexMethod::KdTree)).unwrap();
        tagged.insert("b", import(&writer, folder.path(), &descriptors(&second), "b"));
        let all: Vec<u64> = tagged.values().flatten().copied().collect();
        let removed: Vec<u64> = removed.into_iter().filter(|id| *id > 1 && all.contains(id)).collect();
        if !removed.is_empty() {
            writer.remove(&removed).unwrap();
        }
        let live: BTreeSet<u64> = all.iter().copied().filter(|id| !removed.contains(id)).collect();
        let id = *from.get(&live.iter().copied().collect::<Vec<_>>());
        for space in ["default", "paper"] {
            let point = writer.points_of(space, [id]).unwrap().1.remove(0).point;
            let far = writer.query(&Query::texture(id).k(1 + live.len() / 3).space(space)).unwrap();
            let radius = far.hits.last().map(|hit| hit.distance);
            for (within, tag) in [(None, None), (radius, None), (Some(0.0), None), (None, Some("b")), (radius, Some("a"))] {
                for k in [k, usize::MAX] {
                    let asked = Asked { space, k, within, tag };
                    let allowed = live.iter().copied().filter(|id| tag.is_none_or(|tag| tagged[tag].contains(id)));
                    let expected = brute(&writer, &allowed.collect(), &asked, &point);
                    // A database that was just opened answers from the file.
                    let cold = OpenOptions::new().read_only(true).open(&path).unwrap();
                    prop_assert_eq!(bits(&cold.query(&asked.of(id)).unwrap()), expected.clone(), "file: {:?}", asked);
                    for method in [IndexMethod::Auto, IndexMethod::Linear, IndexMethod::KdTree] {
                        let answer = writer.query(&asked.of(id).index(method)).unwrap();
                        prop_assert_eq!(bits(&answer), expected.clone(), "{}: {:?}", method, asked);
                    }
                }
            }
        }
        prop_assert!(writer.verify(true, &()).unwrap().ok());
    }
}

/// Enough rows for several blocks of keys, and for the nearest to be measured before all keys were read.
#[test]
fn many_rows_are_answered_from_the_file() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("t.hlacdb");
    let writer = open(&path, &[View::Full]);
    let rows: Vec<Moments> = (0..9000_u32).map(|n| moments((n % 6) as u8, (n * 7 % 251) as u8)).collect();
    import(&writer, folder.path(), &rows, "a");
    writer.tag(8999, &TagEdit::new().set("rare", "yes")).unwrap();
    for query in
        [Query::texture(4711).k(25), Query::texture(3).k(40).exclude_self(), Query::texture(9).filter("rare", "yes")]
    {
        let cold = OpenOptions::new().read_only(true).open(&path).unwrap();
        let (first, second) = (cold.query(&query).unwrap(), cold.query(&query).unwrap());
        assert!(!first.hits.is_empty());
        assert_eq!(first.hits, second.hits, "from the file, then from memory");
        assert_eq!(first.hits, writer.query(&query.clone().index(IndexMethod::KdTree)).unwrap().hits);
    }
}

/// Many rows at once and few at a time give the same statistics, spaces and answers, fits at doublings included.
#[test]
fn an_import_in_parts_is_an_import() {
    let folder = tempfile::tempdir().unwrap();
    let rows: Vec<Moments> = (0..70).map(|n| moments(n % 6, n)).collect();
    let [whole, parts] = ["whole", "parts"].map(|name| open(&folder.path().join(name), &[View::Full]));
    import(&whole, folder.path(), &rows, "a");
    for some in [&rows[..1], &rows[1..2], &rows[2..40], &rows[40..]] {
        import(&parts, folder.path(), some, "a");
    }
    assert_eq!(whole.covariance().unwrap(), parts.covariance().unwrap());
    for space in whole.space_names().unwrap() {
        assert_eq!(*whole.space(&space).unwrap(), *parts.space(&space).unwrap(), "{space}");
        let ask = |database: &Database| bits(&database.query(&Query::texture(3).space(&space)).unwrap());
        assert_eq!(ask(&whole), ask(&parts));
    }
    // An extreme that goes is looked for anew.
    let lowest = |database: &Database| database.statistics().unwrap().statistics.min;
    parts.remove([1, 7]).unwrap();
    assert!(parts.verify(false, &()).unwrap().ok() && lowest(&parts).len() == MASK_COUNT);
}

#[test]
fn views_side_by_side_are_imported_by_name() {
    let folder = tempfile::tempdir().unwrap();
    let views = [View::Detail, View::Full];
    let database = open(&folder.path().join("t"), &[View::Full, View::Detail]);
    let rows: Vec<Moments> = (0..6).flat_map(|n| [moments(n, 9), moments(n, 30)]).collect();
    let array = folder.path().join("rows.npy");
    arrays::write_npy(&array, &[6, 2 * MASK_COUNT], rows.as_flattened()).unwrap();
    assert_eq!(database.import(&array, &views, None, &BTreeMap::new(), &()).unwrap().added, 6);
    let stored = database.descriptor(3).unwrap();
    assert_eq!(stored.iter().collect::<Vec<_>>(), [(View::Full, &rows[5]), (View::Detail, &rows[4])]);
    assert_eq!(database.space_names().unwrap(), ["paper", "zscore", "default", "invariant"]);
    assert_eq!(database.query(&Query::texture(3).k(1)).unwrap().hits[0].id, 3);
    let one = database.import(&array, &[View::Full], None, &BTreeMap::new(), &());
    assert!(matches!(one, Err(Error::Exchange(ExchangeError::Views { .. }))));
    let other =
        open(&folder.path().join("other"), &[View::Full]).import(&array, &[View::Full], None, &BTreeMap::new(), &());
    assert!(matches!(other, Err(Error::Exchange(ExchangeError::Array { .. }))));
}

#[test]
fn several_examples_mean_their_mean_or_any_of_them() {
    let folder = tempfile::tempdir().unwrap();
    let database = open(&folder.path().join("t"), &[View::Full]);
    let rows: Vec<Moments> = (0..60).map(|n| moments(n % 6, 10 + n / 6)).collect();
    import(&database, folder.path(), &rows, "a");
    let all = |id| database.query(&Query::texture(id).k(100)).unwrap().hits;
    let distances =
        |id| -> BTreeMap<u64, f64> { all(id).into_iter().map(|hit| (hit.id.get(), hit.distance)).collect() };
    let (one, other) = (distances(1), distances(2));
    let mut expected: Vec<(f64, u64)> =
        one.iter().map(|(id, distance)| (distance.min(other[id]), *id)).filter(|(_, id)| *id > 2).collect();
    expected.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
    let any = database.query(&Query::textures([1, 2]).combine(Combine::Min).k(20).exclude_self()).unwrap();
    let found: Vec<(f64, u64)> = any.hits.iter().map(|hit| (hit.distance, hit.id.get())).collect();
    assert_eq!(found, expected[..20]);

    let (metric, points) = database.points_of("default", [1, 2, 9]).unwrap();
    let mean: Vec<f32> = (0..points[0].point.len())
        .map(|at| ((f64::from(points[0].point[at]) + f64::from(points[1].point[at])) / 2.0) as f32)
        .collect();
    let both = database.query(&Query::texture(1).and_texture(2).k(100)).unwrap();
    let nine = both.hits.iter().find(|hit| hit.id == 9).unwrap();
    assert_eq!(nine.distance, metric.distance(&mean, &points[2].point));
    assert!(matches!(database.query(&Query::textures([0_u64; 0])), Err(Error::Query(QueryError::NoExample))));
}

#[test]
fn a_distance_alone_has_no_ceiling_and_a_slip_of_the_pen_is_told() {
    let folder = tempfile::tempdir().unwrap();
    let database = open(&folder.path().join("t"), &[View::Full]);
    let rows: Vec<Moments> = (0..40).map(|n| moments(1, n % 2 * 5)).collect();
    import(&database, folder.path(), &rows, "a");
    assert_eq!(database.query(&Query::texture(1)).unwrap().hits.len(), 10);
    assert_eq!(database.query(&Query::texture(1).within(10.0)).unwrap().hits.len(), 40);
    assert_eq!(database.query(&Query::texture(1).within(10.0).k(3)).unwrap().hits.len(), 3);
    let slip = database.query(&Query::texture(1).filter("tt", "a")).unwrap();
    assert!(slip.hits.is_empty() && slip.warnings[0].contains("'tt'") && slip.warnings[0].contains("the tags are: t"));
    let none = database.query(&Query::texture(1).filter("t", "b")).unwrap();
    assert!(
        none.hits.is_empty()
            && none.warnings[0].contains("no texture has the tag t=b")
            && none.warnings[0].ends_with(": a")
    );

    // Twenty lie at each of two places: every pair of equal ones is found once.
    let pairs = database.near_pairs(None, Some(0.0)).unwrap();
    assert_eq!(pairs.len(), 2 * (20 * 19 / 2));
    assert_eq!((pairs[0].first.get(), pairs[0].second.get(), pairs[0].first_name.as_str()), (1, 3, "rows-000000"));
    assert!(matches!(database.near_pairs(None, Some(f64::NAN)), Err(Error::Query(QueryError::Distance { .. }))));
}

#[test]
fn the_graph_is_everybodys_answer() {
    let folder = tempfile::tempdir().unwrap();
    let database = open(&folder.path().join("t"), &[View::Full]);
    let rows: Vec<Moments> = (0..7).map(|n| moments(n % 3, 10 + n)).collect();
    import(&database, folder.path(), &rows, "a");
    database.remove([2]).unwrap();
    let out = folder.path().join("out");
    let report = database.export(&out, Some(8), &()).unwrap();
    assert_eq!((report.textures, report.files.len()), (6, 5));
    let file = |name: &str| hlacdb::volume::npy::NpyReader::open(&out.join(name)).unwrap();
    assert_eq!(file("graph.npy").header().shape(), [6, 8]);
    let ids: Vec<i64> = file("graph.npy").read_all(48).unwrap();
    let distances: Vec<f64> = file("graph_distances.npy").read_all(48).unwrap();
    let answer = database.query(&Query::texture(4).exclude_self()).unwrap();
    let third: Vec<(i64, f64)> = ids.into_iter().zip(distances).skip(2 * 8).take(8).collect();
    for (hit, (id, distance)) in answer.hits.iter().zip(&third) {
        assert_eq!((hit.id.get() as i64, hit.distance), (*id, *distance));
    }
    assert!(third[5].0 == -1 && third[5].1.is_nan());
    assert!(matches!(database.export(&out, Some(0), &()), Err(Error::Query(QueryError::ZeroK))));
}
