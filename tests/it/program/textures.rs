//! Textures are added, listed, found, tagged and removed.

use std::fs;

use serde_json::Value;

use super::{Sandbox, stderr, text};
use crate::support::{ball, stripes, write_npy};

#[test]
fn a_folder_is_ingested_and_queried() {
    let sandbox = Sandbox::new();
    let folder = sandbox.textures();
    let report = sandbox.json(&["ingest", text(&folder), "--tag", "set=test"]);
    assert_eq!((report["added"].as_u64(), report["duplicates"].as_u64()), (Some(8), Some(0)));
    assert_eq!(report["ids"], serde_json::json!([1, 2, 3, 4, 5, 6, 7, 8]));

    let again = sandbox.json(&["ingest", text(&folder)]);
    assert_eq!((again["added"].as_u64(), again["duplicates"].as_u64()), (Some(0), Some(8)));

    let list = sandbox.json(&["list"]);
    let rows = list["textures"].as_array().unwrap();
    assert_eq!(rows.len(), 8);
    assert_eq!(rows[0]["name"], "ball1.npy", "folders and files in natural order");
    assert_eq!(rows[0]["shape"], serde_json::json!([16, 16, 16]));
    assert_eq!(rows[0]["tags"]["set"], "test");

    let answer = sandbox.json(&["query", text(&folder.join("stripes2.npy")), "-k", "3"]);
    assert_eq!(answer["space"], "default");
    assert_eq!(answer["hits"][0]["name"], "stripes2.npy");
    assert_eq!(answer["hits"][0]["distance"], 0.0);
    assert_eq!(answer["hits"].as_array().unwrap().len(), 3);
    for space in ["paper", "zscore", "oriented", "invariant"] {
        let answer = sandbox.json(&["query", "--id", "5", "--space", space, "--index", "kdtree", "--exclude-self"]);
        assert_eq!((&answer["space"], &answer["index"]), (&space.into(), &"kdtree".into()));
        assert!(answer["hits"].as_array().unwrap().iter().all(|hit| hit["id"] != 5));
    }
    let verified = sandbox.json(&["verify", "--deep"]);
    assert_eq!((verified["ok"].as_bool(), verified["damage"].as_array().unwrap().len()), (Some(true), 0));
}

#[test]
fn filters_apply_before_k_and_tags_can_be_changed() {
    let sandbox = Sandbox::new();
    let folder = sandbox.textures();
    sandbox.json(&["ingest", text(&folder.join("balls")), "--tag", "kind=ball"]);
    sandbox.json(&["ingest", text(&folder), "--tag", "kind=stripes"]);
    let answer = sandbox.json(&["query", text(&folder.join("stripes1.npy")), "-k", "2", "--where", "kind=ball"]);
    let hits = answer["hits"].as_array().unwrap();
    assert_eq!(hits.len(), 2);
    assert!(hits.iter().all(|hit| hit["tags"]["kind"] == "ball"));

    sandbox.json(&["tag", "1", "kind=sphere", "size=small"]);
    assert_eq!(sandbox.json(&["list", "--where", "kind=sphere"])["textures"][0]["id"], 1);
    sandbox.json(&["tag", "1", "--unset", "kind"]);
    assert_eq!(sandbox.json(&["list", "--where", "kind=sphere"])["textures"].as_array().unwrap().len(), 0);
    let near = sandbox.json(&["query", "--id", "1", "--within", "0"]);
    assert_eq!(near["hits"].as_array().unwrap().len(), 1);
}

#[test]
fn removed_textures_are_gone_and_ids_are_not_reused() {
    let sandbox = Sandbox::new();
    let folder = sandbox.textures();
    sandbox.json(&["ingest", text(&folder)]);
    sandbox.json(&["remove", "3", "4"]);
    assert!(sandbox.fails(1, &["show", "3"]).contains('3'));
    assert!(sandbox.fails(1, &["remove", "1", "99"]).contains("99"));
    assert_eq!(
        sandbox.json(&["list"])["textures"].as_array().unwrap().len(),
        6,
        "if one id is missing, none is removed"
    );
    sandbox.json(&["compact"]);
    assert_eq!(sandbox.json(&["ingest", text(&folder)])["added"], 2);
    let ids: Vec<u64> =
        sandbox.json(&["list"])["textures"].as_array().unwrap().iter().map(|t| t["id"].as_u64().unwrap()).collect();
    assert_eq!(ids, [1, 2, 5, 6, 7, 8, 9, 10]);
    assert_eq!(sandbox.json(&["verify"])["ok"], true);
}

#[test]
fn a_bad_file_is_reported_and_the_others_are_added() {
    let sandbox = Sandbox::new();
    let folder = sandbox.textures();
    fs::write(folder.join("torn.npy"), b"\x93NUMPY\x01\x00\x76\x00{'descr': '|u1'").unwrap();
    fs::write(folder.join("notes.txt"), "not a volume").unwrap();
    let output = sandbox.run(&["ingest", text(&folder), "--stream"]);
    assert_eq!(output.status.code(), Some(1));
    let lines: Vec<Value> =
        String::from_utf8(output.stdout).unwrap().lines().map(|line| serde_json::from_str(line).unwrap()).collect();
    assert_eq!(lines.len(), 9, "the text file is not a volume and is skipped");
    let failed: Vec<&Value> = lines.iter().filter(|line| line["status"] == "failed").collect();
    assert_eq!(failed.len(), 1);
    assert!(failed[0]["path"].as_str().unwrap().ends_with("torn.npy"));
    assert!(failed[0]["error"].as_str().unwrap().contains("torn.npy"));
    assert_eq!(sandbox.json(&["list"])["textures"].as_array().unwrap().len(), 8);
}

#[test]
fn an_empty_store_has_no_hits() {
    let sandbox = Sandbox::new();
    let folder = sandbox.textures();
    fs::create_dir(sandbox.path("nothing")).unwrap();
    sandbox.json(&["ingest", "nothing"]);
    let answer = sandbox.json(&["query", text(&folder.join("stripes1.npy"))]);
    assert_eq!(answer["hits"], serde_json::json!([]));
    let stats = sandbox.json(&["stats"]);
    assert_eq!((stats["textures"].as_u64(), stats["statistics"]["count"].as_u64()), (Some(0), Some(0)));
    assert_eq!(stats["statistics"]["mean"].as_array().unwrap().len(), 251);
    assert_eq!(sandbox.json(&["verify"])["ok"], true);
}

#[test]
fn files_of_unrecognised_formats_are_counted() {
    let sandbox = Sandbox::new();
    let folder = sandbox.textures();
    fs::write(folder.join("notes.txt"), "not a volume").unwrap();
    fs::write(folder.join(".hidden"), "not to be seen").unwrap();
    fs::write(folder.join("balls/data.raw"), [0; 27]).unwrap();
    fs::write(
        folder.join("balls/data.mhd"),
        "NDims = 3\nDimSize = 3 3 3\nElementType = MET_UCHAR\nElementDataFile = data.raw\n",
    )
    .unwrap();
    let report = sandbox.json(&["ingest", text(&folder)]);
    assert_eq!((&report["added"], &report["skipped"]), (&9.into(), &1.into()));
    assert!(stderr(&sandbox.run(&["ingest", text(&folder)])).contains("1 file of unrecognised formats skipped"));
}

#[test]
fn voxels_need_not_be_stored() {
    let sandbox = Sandbox::new();
    sandbox.json(&["ingest", text(&sandbox.textures()), "--volumes", "none"]);
    assert_eq!(sandbox.json(&["show", "1"])["stored_bytes"], Value::Null);
    assert!(sandbox.fails(1, &["sheet", "1"]).contains("--volumes keep"));
    assert_eq!(sandbox.json(&["query", "--id", "1", "-k", "2"])["hits"][0]["id"], 1);
    sandbox.json(&["remove", "1"]);
    sandbox.json(&["reindex", "--reextract"]);
    assert_eq!(sandbox.json(&["verify", "--deep"])["ok"], true);
}

#[test]
fn a_large_volume_is_cut_into_blocks() {
    let sandbox = Sandbox::new();
    write_npy(&sandbox.path("large.npy"), &stripes(20, 3));
    let report = sandbox.json(&["ingest", "large.npy", "--block", "8"]);
    assert_eq!(report["added"], 8);
    let shown = sandbox.json(&["show", "8"]);
    assert_eq!(shown["name"], "large.npy[8,8,8]");
    assert_eq!(shown["block"]["origin"], serde_json::json!([8, 8, 8]));
    assert!(sandbox.fails(1, &["ingest", "large.npy", "--block", "32"]).contains("--block"));
}

#[test]
fn recipes_become_files_or_textures() {
    let sandbox = Sandbox::new();
    fs::write(
        sandbox.path("two.toml"),
        "name = \"two\"\nseed = 7\nsize = 16\n[[group]]\nfamily = \"marble\"\ncount = 2\n[[group]]\nfamily = \"checker\"\ncount = 2\n",
    )
    .unwrap();
    sandbox.json(&["synth", "two.toml", "--out", "files"]);
    let report = sandbox.json(&["synth", "two.toml"]);
    assert_eq!(report["added"], 4);
    assert_eq!(sandbox.json(&["ingest", "files"])["duplicates"], 4, "files and store have the same voxels");
    let table = sandbox.json(&["eval", "--label", "family", "--space", "paper,default"]);
    assert_eq!(table["spaces"][1]["space"], "default");
    assert_eq!(table["spaces"][0]["queries"], 4);
    assert!(sandbox.fails(1, &["synth", "nothing.toml"]).contains("paper600"));
}

#[cfg(unix)]
#[test]
fn odd_names_and_link_loops_are_handled() {
    use std::os::unix::ffi::OsStrExt;
    let sandbox = Sandbox::new();
    let folder = sandbox.path("odd");
    fs::create_dir(&folder).unwrap();
    let name = std::ffi::OsStr::from_bytes(b"caf\xe9\n.npy");
    write_npy(&folder.join(name), &ball(16, 4));
    std::os::unix::fs::symlink(&folder, folder.join("loop")).unwrap();
    let output = sandbox.run(&["--json", "ingest", text(&folder)]);
    let report: Value = serde_json::from_slice(&output.stdout).unwrap();
    assert_eq!(report["added"], 1);
    assert_eq!(sandbox.json(&["list"])["textures"][0]["name"], "caf\\xe9\\n.npy");
}

#[test]
fn a_second_writer_is_refused_and_readers_continue() {
    let sandbox = Sandbox::new();
    sandbox.json(&["ingest", text(&sandbox.textures())]);
    let holder = hlacdb::Database::open(sandbox.path("textures.hlacdb")).unwrap();
    let error = sandbox.fails(1, &["tag", "1", "a=b"]);
    assert!(error.contains("open for writing") && error.contains("--read-only"), "{error}");
    assert_eq!(sandbox.json(&["list"])["textures"].as_array().unwrap().len(), 8);
    holder.tag(1, &hlacdb::TagEdit::new().set("a", "b")).unwrap();
    assert_eq!(sandbox.json(&["show", "1"])["tags"]["a"], "b", "readers follow the writer's commits");
}
