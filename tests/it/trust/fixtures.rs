//! Stores of released versions: opened, searched, added to, removed from, verified, migrated.

use std::path::Path;

use hlacdb::internals::store::FORMAT_VERSION;
use hlacdb::{Database, Meta, MigrateOptions, Query, ReindexOptions, TagFilter};

use super::volume;

#[test]
fn a_store_of_every_released_version_is_read_changed_and_verified() {
    let fixtures = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/fixtures/stores");
    let folder = tempfile::tempdir().unwrap();
    for version in 1..=FORMAT_VERSION {
        let packed = std::fs::read(fixtures.join(format!("v{version}.hlacdb.zst"))).unwrap();
        let path = folder.path().join(format!("v{version}"));
        std::fs::write(&path, zstd::decode_all(&packed[..]).unwrap()).unwrap();
        let checked = Database::migrate(&path, &MigrateOptions::new().check_only(true)).unwrap();
        assert_eq!(checked.from, version);
        Database::migrate(&path, &MigrateOptions::new()).unwrap();

        let database = Database::open(&path).unwrap();
        assert!(database.verify(true, &()).unwrap().ok(), "{:?}", database.verify(true, &()).unwrap().damage);
        let textures = database.textures(&[TagFilter::equals("parity", "odd")]).unwrap();
        assert_eq!(textures.iter().map(|texture| texture.id).collect::<Vec<_>>(), [1, 5, 7]);
        assert_eq!(textures[0].name, "texture 1");
        let hits = database.query(&Query::texture(2).k(10)).unwrap().hits;
        assert_eq!((hits.len(), hits[0].id.get(), hits[0].distance), (6, 2, 0.0));
        assert_eq!(database.add(&volume(9, 9), Meta::named("new")).unwrap().id(), 8);
        database.remove([1]).unwrap();
        database.reindex(&ReindexOptions::new().reextract(true), &()).unwrap();
        database.compact(&()).unwrap();
        assert!(database.verify(true, &()).unwrap().ok());
    }
}
