//! Real volumes, end to end.

use hlacdb::ingest::{IngestOptions, ingest};
use hlacdb::{Database, Query};

use hlacdb_testing::data;

/// The paper's promise on real scans: a block finds blocks of the same source.
#[test]
fn blocks_of_a_source_find_blocks_of_the_same_source() {
    let sources = ["ketton_microct.tif", "iguana_ct.nii.gz", "head_mr_gd.nii.gz"];
    let Some(paths) = sources.iter().map(|name| data(name)).collect::<Option<Vec<_>>>() else { return };
    let folder = tempfile::tempdir().unwrap();
    let database = Database::open(folder.path().join("real.hlacdb")).unwrap();
    for (name, path) in sources.iter().zip(&paths) {
        let options = IngestOptions::new().block(64).tag("source", *name);
        let report = ingest(&database, std::slice::from_ref(path), &options, &(), &mut |_| ()).unwrap();
        assert!(report.failed.is_empty(), "{:?}", report.failed);
        if name.starts_with("ketton") {
            assert_eq!(report.added, 64, "256^3 is 4 x 4 x 4 blocks of 64^3");
        }
    }
    let labels = database.labels("source").unwrap();
    let right = labels.iter().filter(|(id, source)| {
        let answer = database.query(&Query::texture(**id).k(1).exclude_self()).unwrap();
        answer.hits[0].tags["source"] == **source
    });
    let share = right.count() as f64 / labels.len() as f64;
    assert!(share >= 0.9, "{share}");
    assert!(database.verify(false, &()).unwrap().ok());
}
