//! The program as a user runs it: answers, JSON, exit status, and one sentence for everything that is wrong.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::Output;

use assert_cmd::Command;
use hlacdb::hlac::Voxels;
use hlacdb::hlac::kernels::{self, Kernel};
use serde_json::Value;

use crate::support::{ball, stripes, write_npy};

/// A folder with a store's place in it.
struct Place {
    folder: tempfile::TempDir,
}

impl Place {
    fn new() -> Self {
        Self { folder: tempfile::tempdir().unwrap() }
    }

    fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    fn run(&self, arguments: &[&str]) -> Output {
        let mut command = Command::cargo_bin("hlacdb").unwrap();
        command.current_dir(self.folder.path()).env_remove("HLACDB_STORE").args(arguments).output().unwrap()
    }

    /// What a command that must succeed prints as JSON.
    fn json(&self, arguments: &[&str]) -> Value {
        let output = self.run(&[&["--json"], arguments].concat());
        assert!(output.status.success(), "{arguments:?}: {}", stderr(&output));
        serde_json::from_slice(&output.stdout).unwrap()
    }

    /// The words of a command that must fail with `status`, in one sentence and without an answer.
    fn refused(&self, status: i32, arguments: &[&str]) -> String {
        let output = self.run(arguments);
        assert_eq!(output.status.code(), Some(status), "{arguments:?}: {}", stderr(&output));
        let said = stderr(&output);
        assert!(!said.contains("panicked") && !said.contains("RUST_BACKTRACE"), "{said}");
        said
    }

    /// A folder of eight small textures of two kinds.
    fn textures(&self) -> PathBuf {
        let folder = self.path("textures");
        fs::create_dir_all(folder.join("balls")).unwrap();
        for step in 1..=4 {
            write_npy(&folder.join(format!("stripes{step}.npy")), &stripes(16, step));
            write_npy(&folder.join(format!("balls/ball{step}.npy")), &ball(16, 2 + step));
        }
        folder
    }
}

fn stderr(output: &Output) -> String {
    String::from_utf8_lossy(&output.stderr).into_owned()
}

fn text(path: &Path) -> &str {
    path.to_str().unwrap()
}

#[test]
fn a_folder_goes_in_and_the_ones_alike_are_found() {
    let place = Place::new();
    let folder = place.textures();
    let report = place.json(&["ingest", text(&folder), "--tag", "set=test"]);
    assert_eq!((report["added"].as_u64(), report["duplicates"].as_u64()), (Some(8), Some(0)));
    assert_eq!(report["ids"], serde_json::json!([1, 2, 3, 4, 5, 6, 7, 8]));

    let again = place.json(&["ingest", text(&folder)]);
    assert_eq!((again["added"].as_u64(), again["duplicates"].as_u64()), (Some(0), Some(8)));

    let list = place.json(&["list"]);
    let rows = list["textures"].as_array().unwrap();
    assert_eq!(rows.len(), 8);
    assert_eq!(rows[0]["name"], "ball1.npy", "folders and files in natural order");
    assert_eq!(rows[0]["shape"], serde_json::json!([16, 16, 16]));
    assert_eq!(rows[0]["tags"]["set"], "test");

    let answer = place.json(&["query", text(&folder.join("stripes2.npy")), "-k", "3"]);
    assert_eq!(answer["space"], "default");
    assert_eq!(answer["hits"][0]["name"], "stripes2.npy");
    assert_eq!(answer["hits"][0]["distance"], 0.0);
    assert_eq!(answer["hits"].as_array().unwrap().len(), 3);
    for space in ["paper", "zscore", "oriented", "invariant"] {
        let answer = place.json(&["query", "--id", "5", "--space", space, "--index", "kdtree", "--exclude-self"]);
        assert_eq!((&answer["space"], &answer["index"]), (&space.into(), &"kdtree".into()));
        assert!(answer["hits"].as_array().unwrap().iter().all(|hit| hit["id"] != 5));
    }
    let verified = place.json(&["verify", "--deep"]);
    assert_eq!((verified["ok"].as_bool(), verified["damage"].as_array().unwrap().len()), (Some(true), 0));
}

#[test]
fn filters_come_before_k_and_tags_can_be_changed() {
    let place = Place::new();
    let folder = place.textures();
    place.json(&["ingest", text(&folder.join("balls")), "--tag", "kind=ball"]);
    place.json(&["ingest", text(&folder), "--tag", "kind=stripes"]);
    let answer = place.json(&["query", text(&folder.join("stripes1.npy")), "-k", "2", "--where", "kind=ball"]);
    let hits = answer["hits"].as_array().unwrap();
    assert_eq!(hits.len(), 2);
    assert!(hits.iter().all(|hit| hit["tags"]["kind"] == "ball"));

    place.json(&["tag", "1", "kind=sphere", "size=small"]);
    assert_eq!(place.json(&["list", "--where", "kind=sphere"])["textures"][0]["id"], 1);
    place.json(&["tag", "1", "--unset", "kind"]);
    assert_eq!(place.json(&["list", "--where", "kind=sphere"])["textures"].as_array().unwrap().len(), 0);
    let near = place.json(&["query", "--id", "1", "--within", "0"]);
    assert_eq!(near["hits"].as_array().unwrap().len(), 1);
}

#[test]
fn removed_textures_are_gone_and_their_ids_never_come_back() {
    let place = Place::new();
    let folder = place.textures();
    place.json(&["ingest", text(&folder)]);
    place.json(&["remove", "3", "4"]);
    assert!(place.refused(1, &["show", "3"]).contains('3'));
    assert!(place.refused(1, &["remove", "1", "99"]).contains("99"));
    assert_eq!(
        place.json(&["list"])["textures"].as_array().unwrap().len(),
        6,
        "none is removed where one is not there"
    );
    place.json(&["compact"]);
    assert_eq!(place.json(&["ingest", text(&folder)])["added"], 2);
    let ids: Vec<u64> =
        place.json(&["list"])["textures"].as_array().unwrap().iter().map(|t| t["id"].as_u64().unwrap()).collect();
    assert_eq!(ids, [1, 2, 5, 6, 7, 8, 9, 10]);
    assert_eq!(place.json(&["verify"])["ok"], true);
}

#[test]
fn one_bad_file_among_good_ones_is_reported_and_the_good_ones_are_in() {
    let place = Place::new();
    let folder = place.textures();
    fs::write(folder.join("torn.npy"), b"\x93NUMPY\x01\x00\x76\x00{'descr': '|u1'").unwrap();
    fs::write(folder.join("notes.txt"), "not a volume").unwrap();
    let output = place.run(&["ingest", text(&folder), "--stream"]);
    assert_eq!(output.status.code(), Some(1));
    let lines: Vec<Value> =
        String::from_utf8(output.stdout).unwrap().lines().map(|line| serde_json::from_str(line).unwrap()).collect();
    assert_eq!(lines.len(), 9, "the text file is no volume and is passed over");
    let failed: Vec<&Value> = lines.iter().filter(|line| line["status"] == "failed").collect();
    assert_eq!(failed.len(), 1);
    assert!(failed[0]["path"].as_str().unwrap().ends_with("torn.npy"));
    assert!(failed[0]["error"].as_str().unwrap().contains("torn.npy"));
    assert_eq!(place.json(&["list"])["textures"].as_array().unwrap().len(), 8);
}

#[test]
fn everything_that_is_wrong_is_one_sentence() {
    let place = Place::new();
    let folder = place.textures();
    assert!(place.refused(1, &["query", "--id", "1"]).contains("hlacdb ingest"));
    place.json(&["ingest", text(&folder)]);
    assert!(place.refused(1, &["query", "--id", "1", "-k", "0"]).contains("k must be >= 1"));
    assert!(place.refused(1, &["query", "--id", "77"]).contains("77"));
    assert!(place.refused(1, &["query", "--id", "1", "--within=-1"]).contains("-1"));
    assert!(place.refused(1, &["query", "--id", "1", "--space", "hyper"]).contains("hyper"));
    assert!(place.refused(1, &["query", "nowhere.npy"]).contains("nowhere.npy"));
    assert!(place.refused(1, &["eval", "--label", "colour"]).contains("colour"));
    place.refused(2, &["query"]);
    place.refused(2, &["ingest"]);
    place.refused(2, &["frobnicate"]);
    place.refused(2, &["ingest", ".", "--intensity", "9..1"]);
    fs::write(place.path("notes.hlacdb"), "dear diary, this is no store at all").unwrap();
    let said = place.refused(1, &["-s", "notes.hlacdb", "list"]);
    assert!(said.contains("notes.hlacdb") && said.contains("not"), "{said}");
    assert_eq!(fs::read(place.path("notes.hlacdb")).unwrap().len(), 35, "what is no store is left alone");
}

#[test]
fn an_empty_store_has_no_hits_and_that_is_no_error() {
    let place = Place::new();
    let folder = place.textures();
    fs::create_dir(place.path("nothing")).unwrap();
    place.json(&["ingest", "nothing"]);
    let answer = place.json(&["query", text(&folder.join("stripes1.npy"))]);
    assert_eq!(answer["hits"], serde_json::json!([]));
    let stats = place.json(&["stats"]);
    assert_eq!((stats["textures"].as_u64(), stats["statistics"]["count"].as_u64()), (Some(0), Some(0)));
    assert_eq!(stats["statistics"]["mean"].as_array().unwrap().len(), 251);
    assert_eq!(place.json(&["verify"])["ok"], true);
}

#[test]
fn exactly_the_sums_of_the_definition_are_printed() {
    let place = Place::new();
    let folder = place.textures();
    let path = folder.join("stripes3.npy");
    let document = place.json(&["extract", text(&path), "--out", "moments.npy"]);
    let file = &document["files"][0];
    let volume = stripes(16, 3);
    let reference = Kernel::Scalar.octants(Voxels::new(volume.voxels(), volume.shape()).unwrap()).total();
    let sums: Vec<u64> = file["sums"].as_array().unwrap().iter().map(|sum| sum.as_u64().unwrap()).collect();
    assert_eq!(sums, reference.values);
    assert_eq!((file["windows"].as_u64(), file["channels"].as_u64()), (Some(2744), Some(1)));
    assert!(file["elapsed_us"].is_u64());
    let moments = hlacdb::arrays::read_moments(&place.path("moments.npy")).unwrap();
    assert_eq!(moments, [reference.descriptor()]);

    let sampled = |seed| {
        place.json(&["extract", text(&path), "--variant", "sampled", "--seed", seed])["files"][0]["sums"].clone()
    };
    assert_eq!(sampled("1"), sampled("1"));
    assert_ne!(sampled("1"), sampled("2"));
    assert_ne!(place.json(&["extract", text(&path), "--variant", "hit-sum"])["files"][0]["sums"], file["sums"]);
}

#[test]
fn the_environment_forces_a_kernel() {
    let place = Place::new();
    let version = |kernel: &str| {
        let mut command = Command::cargo_bin("hlacdb").unwrap();
        command.current_dir(place.folder.path()).env("HLACDB_KERNEL", kernel).arg("--version").output().unwrap()
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
fn the_masks_are_the_papers() {
    let place = Place::new();
    let output = place.run(&["masks", "--letters"]);
    let printed = String::from_utf8(output.stdout).unwrap();
    assert_eq!(printed.lines().count(), 251);
    assert!(printed.starts_with("a\nab\nak\nam\n"));
    let masks = Path::new(env!("CARGO_MANIFEST_DIR")).join("crates/hlac/tests/fixtures/masks.txt");
    assert_eq!(printed, fs::read_to_string(masks).unwrap());
    assert_eq!(place.json(&["masks"])["masks"][13]["offsets"], serde_json::json!([[1, 1, 1], [2, 0, 0]]));
}

#[test]
fn descriptors_come_out_and_go_in() {
    let place = Place::new();
    place.json(&["ingest", text(&place.textures()), "--tag", "set=a"]);
    place.json(&["export", "out"]);
    let moments = hlacdb::arrays::read_moments(&place.path("out/moments.npy")).unwrap();
    assert_eq!(moments.len(), 8);
    let table = fs::read_to_string(place.path("out/textures.csv")).unwrap();
    assert!(table.starts_with("row,id,name,shape,path,tag:set\n0,1,ball1.npy,16x16x16,"), "{table}");

    let arguments = ["-s", "imported.hlacdb", "import", "out/moments.npy", "--tag", "from=array"];
    assert_eq!(place.json(&arguments)["added"], 8);
    let answer = place.json(&["-s", "imported.hlacdb", "query", "--moments", "out/moments.npy", "-k", "1"]);
    let queries = answer["queries"].as_array().unwrap();
    assert_eq!(queries.len(), 8);
    for (row, query) in queries.iter().enumerate() {
        assert_eq!(query["hits"][0]["distance"], 0.0, "row {row}");
    }
    assert_eq!(place.json(&["-s", "imported.hlacdb", "verify"])["ok"], true);
    let said = place.refused(1, &["import", "out/moments.npy"]);
    assert!(said.contains("stretch@1"), "a store of eight views is not mixed with rows of one: {said}");
}

#[test]
fn a_current_store_needs_no_migration_and_statistics_come_out_as_an_array() {
    let place = Place::new();
    place.json(&["ingest", text(&place.textures())]);
    let plan = place.json(&["migrate"]);
    assert_eq!((&plan["from"], &plan["hops"]), (&plan["to"], &serde_json::json!([])));
    place.json(&["stats", "--covariance", "cov.npy"]);
    let mut file = hlacdb::volume::npy::NpyReader::open(&place.path("cov.npy")).unwrap();
    assert_eq!(file.header().shape(), [251, 251]);
    let covariance: Vec<f64> = file.read_all(251 * 251).unwrap();
    assert_eq!(covariance[7], covariance[7 * 251]);
    assert!(covariance[0] > 0.0);
}

#[test]
fn pictures_are_drawn() {
    let place = Place::new();
    place.json(&["ingest", text(&place.textures())]);
    place.json(&["sheet", "1", "--out", "one.png", "--axis", "y"]);
    place.json(&["query", "--id", "1", "-k", "3", "--sheet", "alike.png"]);
    for name in ["one.png", "alike.png"] {
        let bytes = fs::read(place.path(name)).unwrap();
        assert!(bytes.starts_with(b"\x89PNG"), "{name}");
    }
}

#[test]
fn plots_are_drawn_as_svg() {
    let place = Place::new();
    place.json(&["ingest", text(&place.textures().join("balls")), "--tag", "kind=ball"]);
    assert!(place.refused(1, &["eval", "--label", "kind"]).contains("'ball'"), "one class measures nothing");
    place.json(&["ingest", text(&place.textures()), "--tag", "kind=stripes"]);
    place.json(&["eval", "--label", "kind", "--plot", "eval.svg"]);
    place.json(&["stats", "--plot", "stats.svg"]);
    place.json(&["stats", "--space", "paper", "--plot", "paper.svg"]);
    for name in ["eval.svg", "stats.svg", "paper.svg"] {
        let drawn = fs::read_to_string(place.path(name)).unwrap();
        let document = roxmltree::Document::parse(&drawn).unwrap();
        assert_eq!(document.root_element().tag_name().name(), "svg", "{name}");
    }
    let first = fs::read(place.path("eval.svg")).unwrap();
    place.json(&["eval", "--label", "kind", "--plot", "eval.svg"]);
    assert!(first == fs::read(place.path("eval.svg")).unwrap(), "the same store gives the same plot");
    assert!(place.refused(2, &["eval", "--label", "kind", "--plot", "eval.png"]).contains(".svg"));
    assert!(place.refused(1, &["stats", "--space", "hyper"]).contains("paper"));
    assert!(
        place.json(&["stats", "--space", "zscore"])["space"]["formula"].as_str().unwrap().contains("(x - mean) / sd")
    );
    fs::create_dir(place.path("nothing")).unwrap();
    place.json(&["-s", "empty.hlacdb", "ingest", "nothing"]);
    let said = place.refused(1, &["-s", "empty.hlacdb", "stats", "--plot", "no.svg"]);
    assert!(said.contains("no textures") && !place.path("no.svg").exists(), "{said}");
}

#[test]
fn wrong_numbers_and_names_are_told_as_what_they_are() {
    let place = Place::new();
    place.json(&["ingest", text(&place.textures())]);
    for arguments in
        [&["query", "--id", "1", "-k", "-1"][..], &["query", "--id", "-1"], &["show", "-3"], &["sheet", "1e3"]]
    {
        let said = place.refused(2, arguments);
        assert!(said.contains("whole number of 0 or more") && !said.contains("tip:"), "{said}");
    }
    assert!(place.refused(2, &["sheet", "1", "--out", "one.jpg"]).contains(".png"));
    assert!(place.refused(2, &["query", "--id", "1", "--sheet", "one.jpg"]).contains(".png"));
    let volume = place.path("textures/stripes1.npy");
    let sampled = ["extract", text(&volume), "--variant", "sampled"];
    assert!(place.refused(1, &[&sampled[..], &["--windows", "2745"]].concat()).contains("2744"));
    assert_eq!(place.json(&sampled)["files"][0]["windows"], 2744, "as many as there are, unless said");
}

#[test]
fn what_is_shown_stays_on_its_line_and_tags_hold_one_value() {
    let place = Place::new();
    let folder = place.textures();
    place.json(&["ingest", text(&folder), "--tag", "note=a\nb\u{1b}[31m"]);
    let listed = String::from_utf8(place.run(&["list"]).stdout).unwrap();
    assert_eq!(listed.lines().count(), 9);
    assert!(listed.contains("note=a\\nb\\u{1b}[31m") && !listed.contains('\u{1b}'), "{listed}");
    assert_eq!(place.json(&["list", "--where", "note=a\nb\u{1b}[31m"])["textures"].as_array().unwrap().len(), 8);
    assert!(place.refused(2, &["tag", "1", "a=1", "a=2"]).contains("two values"));
    assert!(place.refused(2, &["ingest", text(&folder), "--tag", "a=1", "--tag", "a=2"]).contains("two values"));
    assert!(place.refused(2, &["--json", "completions", "bash"]).contains("--json"));
    let mut unset = Command::cargo_bin("hlacdb").unwrap();
    let output = unset.current_dir(place.folder.path()).env("HLACDB_STORE", "").args(["show", "1"]).output().unwrap();
    assert!(output.status.success(), "an empty variable names no store: {}", stderr(&output));
}

#[cfg(target_os = "linux")]
#[test]
fn an_answer_that_cannot_be_written_is_a_failure() {
    let full = fs::OpenOptions::new().write(true).open("/dev/full").unwrap();
    let mut child = std::process::Command::new(assert_cmd::cargo::cargo_bin("hlacdb"));
    let output = child.arg("masks").stdout(full).output().unwrap();
    assert_eq!(output.status.code(), Some(1));
    assert!(stderr(&output).contains("the answer could not be written"), "{}", stderr(&output));
}

#[test]
fn files_of_unknown_kinds_are_counted() {
    let place = Place::new();
    let folder = place.textures();
    fs::write(folder.join("notes.txt"), "not a volume").unwrap();
    fs::write(folder.join(".hidden"), "not to be seen").unwrap();
    fs::write(folder.join("balls/data.raw"), [0; 27]).unwrap();
    fs::write(
        folder.join("balls/data.mhd"),
        "NDims = 3\nDimSize = 3 3 3\nElementType = MET_UCHAR\nElementDataFile = data.raw\n",
    )
    .unwrap();
    let report = place.json(&["ingest", text(&folder)]);
    assert_eq!((&report["added"], &report["skipped"]), (&9.into(), &1.into()));
    assert!(stderr(&place.run(&["ingest", text(&folder)])).contains("1 file of unknown kinds skipped"));
}

#[test]
fn volumes_may_be_left_out() {
    let place = Place::new();
    place.json(&["ingest", text(&place.textures()), "--volumes", "none"]);
    assert_eq!(place.json(&["show", "1"])["stored_bytes"], Value::Null);
    assert!(place.refused(1, &["sheet", "1"]).contains("--volumes keep"));
    assert_eq!(place.json(&["query", "--id", "1", "-k", "2"])["hits"][0]["id"], 1);
    place.json(&["remove", "1"]);
    place.json(&["reindex", "--reextract"]);
    assert_eq!(place.json(&["verify", "--deep"])["ok"], true);
}

#[test]
fn a_large_volume_is_cut_into_blocks() {
    let place = Place::new();
    write_npy(&place.path("large.npy"), &stripes(20, 3));
    let report = place.json(&["ingest", "large.npy", "--block", "8"]);
    assert_eq!(report["added"], 8);
    let shown = place.json(&["show", "8"]);
    assert_eq!(shown["name"], "large.npy[8,8,8]");
    assert_eq!(shown["block"]["origin"], serde_json::json!([8, 8, 8]));
    assert!(place.refused(1, &["ingest", "large.npy", "--block", "32"]).contains("--block"));
}

#[test]
fn recipes_become_files_or_textures() {
    let place = Place::new();
    fs::write(
        place.path("two.toml"),
        "name = \"two\"\nseed = 7\nsize = 16\n[[group]]\nfamily = \"marble\"\ncount = 2\n[[group]]\nfamily = \"checker\"\ncount = 2\n",
    )
    .unwrap();
    place.json(&["synth", "two.toml", "--out", "files"]);
    let report = place.json(&["synth", "two.toml"]);
    assert_eq!(report["added"], 4);
    assert_eq!(place.json(&["ingest", "files"])["duplicates"], 4, "files and store have the same voxels");
    let table = place.json(&["eval", "--label", "family", "--space", "paper,default"]);
    assert_eq!(table["spaces"][1]["space"], "default");
    assert_eq!(table["spaces"][0]["queries"], 4);
    assert!(place.refused(1, &["synth", "nothing.toml"]).contains("paper600"));
}

#[cfg(unix)]
#[test]
fn odd_names_and_looping_links_are_survived() {
    use std::os::unix::ffi::OsStrExt;
    let place = Place::new();
    let folder = place.path("odd");
    fs::create_dir(&folder).unwrap();
    let name = std::ffi::OsStr::from_bytes(b"caf\xe9\n.npy");
    write_npy(&folder.join(name), &ball(16, 4));
    std::os::unix::fs::symlink(&folder, folder.join("loop")).unwrap();
    let output = place.run(&["--json", "ingest", text(&folder)]);
    let report: Value = serde_json::from_slice(&output.stdout).unwrap();
    assert_eq!(report["added"], 1);
    assert_eq!(place.json(&["list"])["textures"][0]["name"], "caf\\xe9\\n.npy");
}

#[test]
fn a_second_writer_is_refused_and_readers_go_on() {
    let place = Place::new();
    place.json(&["ingest", text(&place.textures())]);
    let holder = hlacdb::Database::open(place.path("textures.hlacdb")).unwrap();
    let said = place.refused(1, &["tag", "1", "a=b"]);
    assert!(said.contains("open for writing") && said.contains("--read-only"), "{said}");
    assert_eq!(place.json(&["list"])["textures"].as_array().unwrap().len(), 8);
    holder.tag(1, &hlacdb::TagEdit::new().set("a", "b")).unwrap();
    assert_eq!(place.json(&["show", "1"])["tags"]["a"], "b", "readers follow the writer's commits");
}

/// What a command says whose answer nobody reads.
fn into_a_closed_pipe(arguments: &[&str]) -> Output {
    let mut child = std::process::Command::new(assert_cmd::cargo::cargo_bin("hlacdb"))
        .args(arguments)
        .stdout(std::process::Stdio::piped())
        .stderr(std::process::Stdio::piped())
        .spawn()
        .unwrap();
    drop(child.stdout.take());
    child.wait_with_output().unwrap()
}

#[test]
fn a_closed_pipe_is_no_failure() {
    let output = into_a_closed_pipe(&["masks"]);
    assert!(output.stderr.is_empty(), "{}", stderr(&output));
}

/// Regression: the completion script's generator panicked where its output was cut off.
#[test]
fn completions_into_a_closed_pipe_are_no_panic() {
    let output = into_a_closed_pipe(&["completions", "bash"]);
    assert!(!stderr(&output).contains("panicked"), "{}", stderr(&output));
    assert_ne!(output.status.code(), Some(101));
}

/// Regression: a command that could do nothing left an empty store behind, and later questions found nothing in it.
#[test]
fn a_command_that_finds_nothing_to_add_makes_no_store() {
    let place = Place::new();
    assert!(place.refused(1, &["ingest", "nowhere"]).contains("nowhere"));
    fs::write(place.path("wrong.npy"), "not an array").unwrap();
    place.refused(1, &["import", "wrong.npy"]);
    assert!(!place.path("textures.hlacdb").exists());
}
