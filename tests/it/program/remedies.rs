//! Errors say what to do about them, in commands and flags of the program.

use std::fs;
use std::io::Write;

use flate2::Compression;
use flate2::write::GzEncoder;

use super::{Sandbox, text};
use crate::support::{stripes, write_npy};

/// Every command line fails, and its error contains the text.
fn check(sandbox: &Sandbox, status: i32, cases: &[(&str, &str)]) {
    for (arguments, remedy) in cases {
        let error = sandbox.fails(status, &arguments.split(' ').collect::<Vec<_>>());
        assert!(error.contains(remedy), "`hlacdb {arguments}` lacks '{remedy}': {error}");
    }
}

#[test]
fn errors_about_stores_and_queries_name_a_remedy() {
    let sandbox = Sandbox::new();
    check(
        &sandbox,
        1,
        &[
            ("list", "with --store"),
            ("list", "`hlacdb ingest`"),
            ("repair", "with --store"),
            ("migrate", "with --store"),
        ],
    );
    sandbox.json(&["ingest", text(&sandbox.textures()), "--tag", "set=one"]);
    sandbox.json(&["tag", "1", "name=a"]);
    sandbox.json(&["tag", "2", "name=b"]);
    sandbox.json(&["extract", "textures/stripes1.npy", "--out", "moments.npy"]);
    sandbox.json(&["-s", "blind.hlacdb", "ingest", "textures", "--volumes", "none"]);
    check(
        &sandbox,
        1,
        &[
            ("show 99", "`hlacdb list`"),
            ("query --id 1 -k 0", "-k 1"),
            ("query --moments moments.npy --space default", "with --space"),
            ("eval --label colour", "--label"),
            ("eval --label colour", "`hlacdb tag"),
            ("eval --label set", "--label"),
            ("eval --label name", "--label"),
            ("space add default", "`hlacdb space remove`"),
            ("import textures", "`hlacdb export --textures`"),
            ("-s blind.hlacdb sheet 1", "--volumes keep"),
        ],
    );
    let _writer = hlacdb::Database::open(sandbox.path("textures.hlacdb")).unwrap();
    check(&sandbox, 1, &[("tag 1 a=b", "--read-only")]);
}

#[test]
fn errors_about_files_name_a_remedy() {
    let sandbox = Sandbox::new();
    write_npy(&sandbox.path("cube.npy"), &stripes(8, 3));
    fs::write(sandbox.path("notes.txt"), "not a volume").unwrap();
    fs::write(sandbox.path("samples.raw"), [7; 30]).unwrap();
    let header = "NRRD0004\ntype: uint8\ndimension: 3\nsizes: 64 64 64\nencoding: gzip\n\n";
    let mut zeros = GzEncoder::new(header.as_bytes().to_vec(), Compression::best());
    zeros.write_all(&[0; 64 * 64 * 64]).unwrap();
    fs::write(sandbox.path("zeros.nrrd"), zeros.finish().unwrap()).unwrap();
    check(
        &sandbox,
        1,
        &[
            ("extract cube.npy --max-voxels 511", "--max-voxels"),
            ("extract zeros.nrrd --max-inflated 1000", "--max-inflated"),
            ("extract notes.txt", "--raw-shape and --raw-type"),
            ("extract samples.raw --raw-shape 3,3,3 --raw-type u8", "--raw-shape, --raw-type and --raw-offset"),
            ("extract samples.raw --raw-shape 3,3,3 --raw-type u8 --raw-offset 99", "--raw-offset"),
            ("extract cube.npy --spacing 4", "--spacing"),
            ("extract cube.npy --variant sampled --windows 999", "--windows"),
            ("ingest cube.npy --max-voxels 511", "--max-voxels"),
            ("ingest cube.npy --block 32", "--block"),
            ("query cube.npy cube.npy --max-voxels 511", "--max-voxels"),
            ("query cube.npy --max-voxels 511", "--max-voxels"),
        ],
    );
    check(
        &sandbox,
        2,
        &[
            ("extract cube.npy --spacing 2 --variant hit-sum", "--variant"),
            ("query cube.npy cube.npy --sheet one.png", "--sheet"),
            ("tag 1", "--unset"),
            ("sheet 1 --out picture.jpg", ".png"),
            ("--json completions bash", "--json"),
        ],
    );
}

#[cfg(feature = "serve")]
#[test]
fn errors_about_the_server_name_a_remedy() {
    let sandbox = Sandbox::new();
    sandbox.json(&["ingest", text(&sandbox.textures())]);
    check(
        &sandbox,
        1,
        &[
            ("serve --addr 0.0.0.0:0", "--token"),
            ("serve --addr 203.0.113.1:1 --token 0123456789abcdef", "--addr"),
            ("serve --addr 127.0.0.1:0 --ingest-folder nowhere", "--ingest-folder"),
        ],
    );
}
