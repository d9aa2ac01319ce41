//! Spaces of the user's own, and nuisances that the user declares.

use hlacdb::Volumes;
use hlacdb::hlac::View;
use hlacdb::space::{Definition, FeatureForm, FeatureSet, SpaceKind};
use hlacdb::synth;
use hlacdb::{Database, Error, MaintenanceError, Meta, OpenOptions, Query, QueryError, ReindexOptions};

/// A store of a few families, described in all views; `kept` says whether voxels are kept.
fn store(folder: &std::path::Path, name: &str, kept: Volumes) -> Database {
    let groups =
        ["marble", "wood", "granite", "sponge"].map(|family| format!("[[group]]\nfamily = \"{family}\"\ncount = 4\n"));
    let recipe = format!("name = \"few\"\nseed = 5\nsize = 24\n{}", groups.concat());
    let database = OpenOptions::new().volumes(kept).open(folder.join(name)).unwrap();
    for specimen in synth::Recipe::parse(&recipe).unwrap().specimens() {
        database.add(&specimen.volume(), Meta::named(&specimen.name)).unwrap();
    }
    database
}

fn fine() -> Definition {
    Definition::likeness("fine", &[View::LIKENESS[0], View::LIKENESS[3]], true, 0.5, 12).unwrap()
}

#[test]
fn a_space_of_ones_own_answers_like_the_others_and_outlives_the_process() {
    let folder = tempfile::tempdir().unwrap();
    let database = store(folder.path(), "own.hlacdb", Volumes::Keep);
    let added = database.add_space(&fine(), &()).unwrap();
    assert_eq!((added.textures_at_fit(), added.dims()), (16, 12));
    let ask = |database: &Database| database.query(&Query::texture(3).k(5).space("fine")).unwrap().hits;
    let hits = ask(&database);
    assert_eq!((hits.len(), hits[0].id.get(), hits[0].distance), (5, 3, 0.0));
    drop(database);

    let database = Database::open(folder.path().join("own.hlacdb")).unwrap();
    assert_eq!(ask(&database), hits);
    // Its statistics are kept up like the others': added before or after, the fit is the same.
    let more = hlacdb::volume::Volume::from_fn([24; 3], |z, y, x| ((z * y + x * 5) % 200) as u8).unwrap();
    database.add(&more, Meta::named("more")).unwrap();
    database.reindex(&ReindexOptions::default(), &()).unwrap();
    let kept_up = database.space("fine").unwrap();
    let other = store(folder.path(), "other.hlacdb", Volumes::Keep);
    other.add(&more, Meta::named("more")).unwrap();
    other.add_space(&fine(), &()).unwrap();
    assert_eq!(other.space("fine").unwrap().encode().len(), kept_up.encode().len());
    let point = |database: &Database| database.points_of("fine", [17]).unwrap().1;
    assert_eq!(point(&other), point(&database));
    assert!(database.verify(true, &()).unwrap().ok());

    database.remove_space("fine").unwrap();
    assert!(matches!(
        database.query(&Query::texture(3).space("fine")),
        Err(Error::Query(QueryError::NoSuchSpace { .. }))
    ));
    assert!(database.verify(false, &()).unwrap().ok());
    assert!(matches!(database.remove_space("fine"), Err(Error::Maintenance(MaintenanceError::NotUserDefined { .. }))));
    assert!(matches!(
        database.remove_space("default"),
        Err(Error::Maintenance(MaintenanceError::NotUserDefined { .. }))
    ));
}

#[test]
fn spaces_that_cannot_be_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let database = OpenOptions::new().views(&[View::Full, View::LIKENESS[0]]).open(folder.path().join("s")).unwrap();
    let named = |name: &str| {
        let mut definition = fine();
        definition.name = name.into();
        definition
    };
    assert!(matches!(
        database.add_space(&named("default"), &()),
        Err(Error::Maintenance(MaintenanceError::SpaceExists { .. }))
    ));
    assert!(matches!(database.add_space(&named("a b"), &()), Err(Error::Space(_))));
    let refused = database.add_space(&named("fine"), &()).unwrap_err();
    assert!(
        matches!(&refused, Error::Maintenance(MaintenanceError::ViewsNotStored { needs, .. }) if needs.len() == 1),
        "{refused}"
    );
    let moments = FeatureSet::new(FeatureForm::Moments, &[View::Full]).unwrap();
    let histogram = Definition::new("hist", moments, SpaceKind::Intersection).unwrap();
    database.add_space(&histogram, &()).unwrap();
    assert!(matches!(
        database.add_space(&histogram, &()),
        Err(Error::Maintenance(MaintenanceError::SpaceExists { .. }))
    ));
    let names: Vec<String> = database.spaces().unwrap().into_iter().map(|space| space.name().to_owned()).collect();
    assert_eq!(names.last().map(String::as_str), Some("hist"));
}

#[test]
fn declared_nuisances_matter_less_afterwards() {
    let folder = tempfile::tempdir().unwrap();
    let database = store(folder.path(), "nuisance.hlacdb", Volumes::Keep);
    let noise: synth::Nuisance = "noise".parse().unwrap();
    let learn = |nuisance| ReindexOptions::new().nuisance(nuisance);
    let apart = || {
        // How far noisy copies are from their textures, by how far textures are from one another.
        let distance =
            |hits: &[hlacdb::Hit], id| hits.iter().find(|hit| hit.id == id).map_or(f64::NAN, |hit| hit.distance);
        let (mut own, mut others) = (0.0, 0.0);
        for id in 1..=16 {
            let noisy = noise.draw(1000 + id).apply(&database.volume(id).unwrap().unwrap());
            let hits = database.query(&Query::volume(&noisy).k(16).space("invariant")).unwrap().hits;
            own += distance(&hits, id);
            others += hits.iter().map(|hit| hit.distance).sum::<f64>() / 16.0;
        }
        own / others
    };
    let bytes = |database: &Database| database.space("invariant").unwrap().encode();
    database.reindex(&ReindexOptions::default(), &()).unwrap();
    let (before, with_prior) = (apart(), bytes(&database));
    let learned = database.reindex(&learn(hlacdb::NuisanceUpdate::Estimate(noise)), &()).unwrap();
    assert_eq!(learned.nuisance_pairs, 16 * 8);
    let after = apart();
    assert!(after < before, "{after} {before}");
    assert_eq!(database.statistics().unwrap().settings.nuisance.as_deref(), Some("noise"));
    // It stays in force for later fits, until it is forgotten.
    let kept = bytes(&database);
    database.reindex(&ReindexOptions::default(), &()).unwrap();
    assert_eq!(database.space("invariant").unwrap().axes(), hlacdb::space::Space::decode(&kept).unwrap().axes());
    assert!(database.verify(false, &()).unwrap().ok());
    database.reindex(&learn(hlacdb::NuisanceUpdate::Reset), &()).unwrap();
    let forgotten = database.space("invariant").unwrap();
    assert_eq!(forgotten.axes(), hlacdb::space::Space::decode(&with_prior).unwrap().axes());

    let bare = store(folder.path(), "bare.hlacdb", Volumes::None);
    assert!(matches!(
        bare.reindex(&learn(hlacdb::NuisanceUpdate::Estimate(noise)), &()),
        Err(Error::Maintenance(MaintenanceError::NoVoxels))
    ));
}
