//! The database against a plain in-memory model, under random histories.

use std::collections::BTreeMap;
use std::sync::atomic::{AtomicBool, Ordering};

use hlacdb::volume::Volume;
use hlacdb::{Added, Database, Error, IndexMethod, Meta, Query, QueryError, ReindexOptions, TagEdit};
use proptest::prelude::*;

/// One step of a history. Numbers are reduced to what there is when the step is taken.
#[derive(Clone, Debug)]
enum Step {
    Add { texture: u8 },
    Remove { which: u8 },
    Tag { which: u8, value: u8 },
    Query { texture: u8, k: u8, filter: Option<u8> },
    ReindexOptions,
    Reopen,
    Compact,
}

fn step() -> impl Strategy<Value = Step> {
    prop_oneof![
        6 => (0..24_u8).prop_map(|texture| Step::Add { texture }),
        2 => any::<u8>().prop_map(|which| Step::Remove { which }),
        2 => (any::<u8>(), 0..3_u8).prop_map(|(which, value)| Step::Tag { which, value }),
        3 => (0..24_u8, 1..9_u8, proptest::option::of(0..3_u8)).prop_map(|(texture, k, filter)| Step::Query { texture, k, filter }),
        1 => Just(Step::ReindexOptions),
        1 => Just(Step::Reopen),
        1 => Just(Step::Compact),
    ]
}

/// Texture number `n`: small, and different from the others.
fn texture(n: u8) -> Volume {
    let n = usize::from(n);
    Volume::from_fn([9, 8 + n % 3, 9], |z, y, x| ((z * (n + 1) + y * (n / 3 + 2) + x * 5) * 13 % (50 + n * 7)) as u8)
        .unwrap()
}

/// What the model knows of a texture.
#[derive(Clone, Debug, Default, PartialEq)]
struct Known {
    number: u8,
    tag: Option<u8>,
}

struct Run {
    folder: tempfile::TempDir,
    database: Option<Database>,
    model: BTreeMap<u64, Known>,
    last_id: u64,
}

impl Run {
    fn new() -> Self {
        let folder = tempfile::tempdir().unwrap();
        let database = Some(Database::open(folder.path().join("t.hlacdb")).unwrap());
        Self { folder, database, model: BTreeMap::new(), last_id: 0 }
    }

    fn database(&self) -> &Database {
        self.database.as_ref().unwrap()
    }

    fn pick(&self, which: u8) -> Option<u64> {
        self.model.keys().nth(usize::from(which) % self.model.len().max(1)).copied()
    }

    fn take(&mut self, step: &Step) {
        match *step {
            Step::Add { texture: number } => self.add(number),
            Step::Remove { which } => match self.pick(which) {
                Some(id) => {
                    assert_eq!(self.database().remove([id]).unwrap(), [id]);
                    self.model.remove(&id);
                }
                None => assert!(self.database().remove([1]).is_err()),
            },
            Step::Tag { which, value } => {
                if let Some(id) = self.pick(which) {
                    let texture = self.database().tag(id, &TagEdit::new().set("t", value.to_string())).unwrap();
                    assert_eq!(texture.tags["t"], value.to_string());
                    self.model.get_mut(&id).unwrap().tag = Some(value);
                }
            }
            Step::Query { texture, k, filter } => self.query(texture, usize::from(k), filter),
            Step::ReindexOptions => {
                self.database().reindex(&ReindexOptions::default(), &()).unwrap();
            }
            Step::Reopen => {
                self.database = None;
                self.database = Some(Database::open(self.folder.path().join("t.hlacdb")).unwrap());
            }
            Step::Compact => {
                self.database().compact(&()).unwrap();
            }
        }
    }

    fn add(&mut self, number: u8) {
        let there = self.model.iter().find(|(_, known)| known.number == number).map(|(&id, _)| id);
        let added = self.database().add(&texture(number), Meta::named(format!("n{number}"))).unwrap();
        match there {
            Some(id) => assert_eq!(added, Added::Duplicate(id.into())),
            None => {
                assert_eq!(added, Added::New((self.last_id + 1).into()), "ids ascend and are never used again");
                self.last_id += 1;
                self.model.insert(self.last_id, Known { number, tag: None });
            }
        }
    }

    /// The answer must be what ranking every point gives; both indexes to the bit.
    fn query(&self, number: u8, k: usize, filter: Option<u8>) {
        let volume = texture(number);
        for space in ["default", "paper"] {
            let mut query = Query::volume(&volume).k(k).space(space);
            if let Some(value) = filter {
                query = query.filter("t", value.to_string());
            }
            let linear = self.database().query(&query.clone().index(IndexMethod::Linear)).unwrap();
            let tree = self.database().query(&query.index(IndexMethod::KdTree)).unwrap();
            assert_eq!(linear.hits, tree.hits);
            let all = self.database().query(&Query::volume(&volume).k(usize::MAX).space(space)).unwrap().hits;
            assert_eq!(all.len(), self.model.len());
            assert!(all.windows(2).all(|w| (w[0].distance, w[0].id) < (w[1].distance, w[1].id)));
            let allowed = |id: u64| filter.is_none() || self.model[&id].tag == filter;
            let expected: Vec<(u64, f64)> = all
                .iter()
                .filter(|hit| allowed(hit.id.get()))
                .take(k)
                .map(|hit| (hit.id.get(), hit.distance))
                .collect();
            let found: Vec<(u64, f64)> = linear.hits.iter().map(|hit| (hit.id.get(), hit.distance)).collect();
            assert_eq!(found, expected);
            if let Some((&id, _)) = self.model.iter().find(|(_, known)| known.number == number) {
                assert!(all.iter().any(|hit| hit.id == id && hit.distance == 0.0), "a texture is nearest to itself");
            }
        }
    }

    fn check(&self) {
        let textures = self.database().textures(&[]).unwrap();
        let found: BTreeMap<u64, Known> = textures
            .into_iter()
            .map(|texture| {
                let number = texture.name[1..].parse().unwrap();
                (texture.id.get(), Known { number, tag: texture.tags.get("t").map(|value| value.parse().unwrap()) })
            })
            .collect();
        assert_eq!(found, self.model);
        let report = self.database().verify(true, &()).unwrap();
        assert!(report.ok(), "{:?}", report.damage);
    }
}

proptest! {
    #![proptest_config(ProptestConfig { max_shrink_iters: 40, ..hlacdb_testing::cases(12) })]

    #[test]
    fn random_histories_match_the_model(steps in proptest::collection::vec(step(), 1..40)) {
        let mut run = Run::new();
        for step in &steps {
            run.take(step);
        }
        run.check();
    }
}

/// The statistics, spaces and answers of one batch, of single adds, and of single adds in a fresh handle each.
#[test]
fn one_by_one_or_all_at_once_gives_the_same_bits() {
    let folder = tempfile::tempdir().unwrap();
    let numbers: Vec<u8> = (0..11).collect();
    let whole = Database::open(folder.path().join("whole")).unwrap();
    let prepare = |n: &u8| whole.prepare(texture(*n), Meta::named("t"), Default::default()).unwrap();
    whole.commit(numbers.iter().map(prepare).collect()).unwrap();
    let single = Database::open(folder.path().join("single")).unwrap();
    for &n in &numbers {
        single.add(&texture(n), Meta::named("t")).unwrap();
        Database::open(folder.path().join("reopened")).unwrap().add(&texture(n), Meta::named("t")).unwrap();
    }
    let reopened = Database::open(folder.path().join("reopened")).unwrap();
    for other in [&single, &reopened] {
        assert_eq!(whole.covariance().unwrap(), other.covariance().unwrap());
        for space in whole.space_names().unwrap() {
            assert_eq!(*whole.space(&space).unwrap(), *other.space(&space).unwrap(), "{space}");
            let ask = |database: &Database| database.query(&Query::texture(3).space(&space)).unwrap().hits;
            assert_eq!(ask(&whole), ask(other));
        }
    }
}

/// Removing takes a texture out of the statistics without a trace.
#[test]
fn removing_leaves_no_trace_in_the_statistics() {
    let folder = tempfile::tempdir().unwrap();
    let [plain, visited] = ["plain", "visited"].map(|name| Database::open(folder.path().join(name)).unwrap());
    for n in 0..6 {
        plain.add(&texture(n), Meta::named("t")).unwrap();
        visited.add(&texture(n), Meta::named("t")).unwrap();
    }
    let guests: Vec<u64> =
        (10..14).map(|n| visited.add(&texture(n), Meta::named("guest")).unwrap().id().get()).collect();
    visited.remove(&guests).unwrap();
    assert_eq!(plain.covariance().unwrap(), visited.covariance().unwrap());
    let of = |database: &Database| database.statistics().unwrap().statistics;
    assert_eq!((of(&plain).min, of(&plain).max), (of(&visited).min, of(&visited).max));
    for database in [&plain, &visited] {
        database.reindex(&ReindexOptions::default(), &()).unwrap();
    }
    let hits = |database: &Database| -> Vec<(u64, f64)> {
        database.query(&Query::texture(2)).unwrap().hits.iter().map(|hit| (hit.id.get(), hit.distance)).collect()
    };
    assert_eq!(hits(&plain), hits(&visited));
}

/// A store is shared by threads: queries see whole states while one thread adds.
#[test]
fn queries_beside_an_ingest_see_whole_states() {
    let folder = tempfile::tempdir().unwrap();
    let database = Database::open(folder.path().join("t")).unwrap();
    database.add(&texture(0), Meta::named("first")).unwrap();
    let done = AtomicBool::new(false);
    std::thread::scope(|scope| {
        scope.spawn(|| {
            for n in 1..16 {
                database.add(&texture(n), Meta::named("t")).unwrap();
            }
            done.store(true, Ordering::SeqCst);
        });
        for _ in 0..2 {
            scope.spawn(|| {
                let mut seen = 0;
                while !done.load(Ordering::SeqCst) {
                    let hits = database.query(&Query::texture(1).k(100)).unwrap().hits;
                    assert!(hits.len() >= seen && hits[0].id == 1);
                    let mut ids: Vec<u64> = hits.iter().map(|hit| hit.id.get()).collect();
                    ids.sort_unstable();
                    assert_eq!(ids, (1..=hits.len() as u64).collect::<Vec<_>>());
                    seen = hits.len();
                }
            });
        }
    });
    assert_eq!(database.query(&Query::texture(1).k(100)).unwrap().hits.len(), 16);
}

#[test]
fn a_question_that_is_none_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let database = Database::open(folder.path().join("t")).unwrap();
    assert!(matches!(database.query(&Query::texture(1).k(0)), Err(Error::Query(QueryError::ZeroK))));
    assert!(matches!(
        database.query(&Query::texture(1).within(f64::NAN)),
        Err(Error::Query(QueryError::Distance { .. }))
    ));
    assert!(matches!(database.query(&Query::texture(1).space("x")), Err(Error::Query(QueryError::NoSuchSpace { .. }))));
    assert!(matches!(database.query(&Query::texture(1)), Err(Error::Store(_))));
    assert!(database.query(&Query::volume(&texture(1))).unwrap().hits.is_empty());
}
