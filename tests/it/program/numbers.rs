//! Sums, masks, moments, statistics, pictures and plots.

use std::fs;
use std::path::Path;

use assert_cmd::Command;
use hlacdb::hlac::Voxels;
use hlacdb::hlac::kernels::{self, Kernel};

use super::{Sandbox, text};
use crate::support::stripes;

#[test]
fn extract_prints_the_exact_sums() {
    let sandbox = Sandbox::new();
    let folder = sandbox.textures();
    let path = folder.join("stripes3.npy");
    let document = sandbox.json(&["extract", text(&path), "--out", "moments.npy"]);
    let file = &document["files"][0];
    let volume = stripes(16, 3);
    let reference = Kernel::Scalar.octants(Voxels::new(volume.voxels(), volume.shape()).unwrap()).total();
    let sums: Vec<u64> = file["sums"].as_array().unwrap().iter().map(|sum| sum.as_u64().unwrap()).collect();
    assert_eq!(sums, reference.values);
    assert_eq!((file["windows"].as_u64(), file["channels"].as_u64()), (Some(2744), Some(1)));
    assert!(file["elapsed_us"].is_u64());
    let moments = hlacdb::arrays::read_moments(&sandbox.path("moments.npy")).unwrap();
    assert_eq!(moments, [reference.descriptor()]);

    let sampled = |seed| {
        sandbox.json(&["extract", text(&path), "--variant", "sampled", "--seed", seed])["files"][0]["sums"].clone()
    };
    assert_eq!(sampled("1"), sampled("1"));
    assert_ne!(sampled("1"), sampled("2"));
    assert_ne!(sandbox.json(&["extract", text(&path), "--variant", "hit-sum"])["files"][0]["sums"], file["sums"]);
}

#[test]
fn the_environment_selects_a_kernel() {
    let sandbox = Sandbox::new();
    let version = |kernel: &str| {
        let mut command = Command::cargo_bin("hlacdb").unwrap();
        command.current_dir(sandbox.folder.path()).env("HLACDB_KERNEL", kernel).arg("--version").output().unwrap()
    };
    for kernel in kernels::available() {
        let printed = String::from_utf8(version(kernel.name()).stdout).unwrap();
        assert!(printed.trim_end().ends_with(&format!("(kernel {kernel})")), "{printed}");
    }
    let output = version("mmx");
    let error = String::from_utf8(output.stderr).unwrap();
    assert_eq!(output.status.code(), Some(2), "{error}");
    assert!(error.starts_with("hlacdb: HLACDB_KERNEL: there is no kernel \"mmx\"; this CPU runs scalar"), "{error}");
    if let Some(missing) = Kernel::ALL.into_iter().find(|kernel| !kernel.is_available()) {
        let output = version(missing.name());
        assert_eq!(output.status.code(), Some(2), "{missing}");
    }
}

#[test]
fn the_masks_are_those_of_the_paper() {
    let sandbox = Sandbox::new();
    let output = sandbox.run(&["masks", "--letters"]);
    let printed = String::from_utf8(output.stdout).unwrap();
    assert_eq!(printed.lines().count(), 251);
    assert!(printed.starts_with("a\nab\nak\nam\n"));
    let masks = Path::new(env!("CARGO_MANIFEST_DIR")).join("crates/hlac/tests/fixtures/masks.txt");
    assert_eq!(printed, fs::read_to_string(masks).unwrap());
    assert_eq!(sandbox.json(&["masks"])["masks"][13]["offsets"], serde_json::json!([[1, 1, 1], [2, 0, 0]]));
}

#[test]
fn descriptors_are_exported_and_imported() {
    let sandbox = Sandbox::new();
    sandbox.json(&["ingest", text(&sandbox.textures()), "--tag", "set=a"]);
    sandbox.json(&["export", "out"]);
    let moments = hlacdb::arrays::read_moments(&sandbox.path("out/moments.npy")).unwrap();
    assert_eq!(moments.len(), 8);
    let table = fs::read_to_string(sandbox.path("out/textures.csv")).unwrap();
    assert!(table.starts_with("row,id,name,shape,path,tag:set\n0,1,ball1.npy,16x16x16,"), "{table}");

    let arguments = ["-s", "imported.hlacdb", "import", "out/moments.npy", "--tag", "from=array"];
    assert_eq!(sandbox.json(&arguments)["added"], 8);
    let answer = sandbox.json(&["-s", "imported.hlacdb", "query", "--moments", "out/moments.npy", "-k", "1"]);
    let queries = answer["queries"].as_array().unwrap();
    assert_eq!(queries.len(), 8);
    for (row, query) in queries.iter().enumerate() {
        assert_eq!(query["hits"][0]["distance"], 0.0, "row {row}");
    }
    assert_eq!(sandbox.json(&["-s", "imported.hlacdb", "verify"])["ok"], true);
    let error = sandbox.fails(1, &["import", "out/moments.npy"]);
    assert!(error.contains("stretch@1"), "rows of one view do not fit a store of eight: {error}");
}

#[test]
fn a_current_store_needs_no_migration_and_its_covariance_is_written() {
    let sandbox = Sandbox::new();
    sandbox.json(&["ingest", text(&sandbox.textures())]);
    let plan = sandbox.json(&["migrate"]);
    assert_eq!((&plan["from"], &plan["hops"]), (&plan["to"], &serde_json::json!([])));
    sandbox.json(&["stats", "--covariance", "cov.npy"]);
    let mut file = hlacdb::volume::npy::NpyReader::open(&sandbox.path("cov.npy")).unwrap();
    assert_eq!(file.header().shape(), [251, 251]);
    let covariance: Vec<f64> = file.read_all(251 * 251).unwrap();
    assert_eq!(covariance[7], covariance[7 * 251]);
    assert!(covariance[0] > 0.0);
}

#[test]
fn pictures_are_drawn() {
    let sandbox = Sandbox::new();
    sandbox.json(&["ingest", text(&sandbox.textures())]);
    sandbox.json(&["sheet", "1", "--out", "one.png", "--axis", "y"]);
    sandbox.json(&["query", "--id", "1", "-k", "3", "--sheet", "alike.png"]);
    for name in ["one.png", "alike.png"] {
        let bytes = fs::read(sandbox.path(name)).unwrap();
        assert!(bytes.starts_with(b"\x89PNG"), "{name}");
    }
}

#[test]
fn plots_are_drawn_as_svg() {
    let sandbox = Sandbox::new();
    sandbox.json(&["ingest", text(&sandbox.textures().join("balls")), "--tag", "kind=ball"]);
    assert!(sandbox.fails(1, &["eval", "--label", "kind"]).contains("'ball'"), "one class cannot be evaluated");
    sandbox.json(&["ingest", text(&sandbox.textures()), "--tag", "kind=stripes"]);
    sandbox.json(&["eval", "--label", "kind", "--plot", "eval.svg"]);
    sandbox.json(&["stats", "--plot", "stats.svg"]);
    sandbox.json(&["stats", "--space", "paper", "--plot", "paper.svg"]);
    for name in ["eval.svg", "stats.svg", "paper.svg"] {
        let drawn = fs::read_to_string(sandbox.path(name)).unwrap();
        let document = roxmltree::Document::parse(&drawn).unwrap();
        assert_eq!(document.root_element().tag_name().name(), "svg", "{name}");
    }
    let first = fs::read(sandbox.path("eval.svg")).unwrap();
    sandbox.json(&["eval", "--label", "kind", "--plot", "eval.svg"]);
    assert!(first == fs::read(sandbox.path("eval.svg")).unwrap(), "the same store gives the same plot");
    assert!(sandbox.fails(2, &["eval", "--label", "kind", "--plot", "eval.png"]).contains(".svg"));
    assert!(sandbox.fails(1, &["stats", "--space", "hyper"]).contains("paper"));
    assert!(
        sandbox.json(&["stats", "--space", "zscore"])["space"]["formula"].as_str().unwrap().contains("(x - mean) / sd")
    );
    fs::create_dir(sandbox.path("nothing")).unwrap();
    sandbox.json(&["-s", "empty.hlacdb", "ingest", "nothing"]);
    let error = sandbox.fails(1, &["-s", "empty.hlacdb", "stats", "--plot", "no.svg"]);
    assert!(error.contains("no textures") && !sandbox.path("no.svg").exists(), "{error}");
}
