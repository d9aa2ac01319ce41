//! Requests that change the store: uploads, tags, removal, jobs; and following a store that another process changes.

use std::fs;

use hlacdb::serve::ServerOptions;
use hlacdb::{Database, Meta, OpenOptions};
use serde_json::json;

use super::server::{TestServer, names_a_path, npy};
use crate::support::{ball, stripes, write_npy};

#[test]
fn uploaded_files_are_listed_at_once() {
    let server = TestServer::new();
    let (new, old) = (npy(&ball(16, 9)), npy(&stripes(16, 1)));
    let parts = [
        ("file", Some("../../new ball.npy"), &new[..]),
        ("file", Some("old.npy"), &old),
        ("file", Some("notes.txt"), b"dear diary"),
        ("tag", None, b"kind=ball"),
        ("tag", None, b"site=a=b"),
    ];
    let answer = server.form("textures", &parts);
    assert_eq!(answer.status, 201);
    let report = answer.json();
    assert_eq!((&report["added"], &report["duplicates"]), (&json!(1), &json!(1)));
    assert_eq!(report["ids"], json!([9, 1]));
    let failed = &report["failed"][0];
    assert_eq!(failed["path"], "notes.txt");
    assert!(failed["error"].as_str().unwrap().starts_with("notes.txt: the file format is not recognised"), "{failed}");
    let texture = server.json("textures/9");
    assert_eq!((&texture["name"], &texture["file"]), (&json!("new ball.npy"), &json!("new ball.npy")));
    assert_eq!(texture["tags"], json!({"kind": "ball", "site": "a=b"}));
    assert_eq!(server.json("textures")["total"], 9);
    let again = server.form("textures", &[("file", Some("new.npy"), &new[..])]);
    assert_eq!((again.status, again.json()["ids"].clone()), (200, json!([9])));
    let cut = [("file", Some("blocks.npy"), &npy(&stripes(18, 5))[..]), ("block", None, b"9")];
    assert_eq!(server.form("textures", &cut).json()["added"], 8);
}

#[test]
fn hostile_uploads_are_refused_with_sentences() {
    let options = ServerOptions::new().max_body(20_000).max_voxels(1 << 20);
    let server = TestServer::filled(options);
    let huge = b"NRRD0004\ntype: uint8\ndimension: 3\nsizes: 4096 4096 4096\nencoding: gzip\n\n";
    let elsewhere =
        b"NRRD0004\ntype: uint8\ndimension: 3\nsizes: 16 16 16\nencoding: raw\ndata file: ../../../etc/passwd\n";
    for (name, bytes, words) in [
        ("torn.npy", &b"\x93NUMPY\x01\x00v\x00{'descr'"[..], "torn.npy: "),
        ("huge.nrrd", huge, "68719476736"),
        ("elsewhere.nhdr", elsewhere, "outside"),
        ("bomb.npz", b"PK\x03\x04", "bomb.npz: "),
        ("empty.tif", b"", "empty.tif: "),
    ] {
        let said = server.form("textures", &[("file", Some(name), bytes)]).problem(422);
        assert!(said.contains(words) && !names_a_path(&said, server.folder.path()), "{name}: {said}");
        let said = server.form("query", &[("file", Some(name), bytes)]).problem(422);
        assert!(said.contains(words) && !names_a_path(&said, server.folder.path()), "{name}: {said}");
    }
    let long = vec![7; 24_000];
    let said = server.form("textures", &[("file", Some("long.npy"), &long[..])]).problem(413);
    assert!(said.contains("20000 bytes"), "{said}");
    let said = server.post("query", &json!({"ids": [1], "where": ["x".repeat(24_000)]})).problem(413);
    assert!(said.contains("20000 bytes"), "{said}");
    for (parts, words) in [
        (vec![("tag", None, &b"a=b"[..])], "no file"),
        (vec![("file", Some("a.npy"), &b"x"[..]), ("tag", None, b"kind")], "KEY=VALUE"),
        (vec![("file", Some("a.npy"), &b"x"[..]), ("colour", None, b"red")], "'colour'"),
        (vec![("file", Some("a.npy"), &b"x"[..]), ("block", None, b"2")], "block"),
        (vec![("file", Some("a.npy"), &b"x"[..]), ("intensity", None, b"9..1")], "intensity"),
    ] {
        let said = server.form("textures", &parts).problem(400);
        assert!(said.contains(words), "{said}");
    }
    assert_eq!(server.json("textures")["total"], 8, "nothing was added");
}

/// Regression: a name of many multi-byte letters was longer than file systems allow, and the folder for a second file with the
/// same name could have the name of another file. Both were reported as a failure of the server.
#[test]
fn files_may_have_any_names() {
    let server = TestServer::new();
    let volumes = [5, 6, 7].map(|step| npy(&stripes(18, step)));
    let long = format!("{}.npy", "石".repeat(110));
    for (names, added) in [([&*long; 3], 3), (["1", "1", "2"], 0), (["a", "a", "1"], 0), (["1", "2", "2"], 0)] {
        let parts: Vec<_> =
            names.iter().zip(&volumes).map(|(&name, volume)| ("file", Some(name), &volume[..])).collect();
        let report = server.form("textures", &parts).json();
        assert_eq!(
            (&report["added"], &report["duplicates"]),
            (&json!(added), &json!(3 - added)),
            "{names:?}: {report}"
        );
    }
    assert_eq!(server.json("textures")["total"], 11);
}

#[test]
fn tags_are_set_and_removed_and_textures_removed() {
    let server = TestServer::new();
    let texture = server.put("textures/3/tags", &json!({"kind": "line", "a/b c": "ü&="})).json();
    assert_eq!(texture["tags"], json!({"a/b c": "ü&=", "kind": "line", "step": "2"}));
    assert_eq!(server.json("textures?where=a%2Fb%20c=%C3%BC%26%3D")["textures"][0]["id"], 3);
    let texture = server.delete("textures/3/tags/a%2Fb%20c").json();
    assert_eq!(texture["tags"], json!({"kind": "line", "step": "2"}));
    server.put("textures/99/tags", &json!({"a": "b"})).problem(404);
    server.put("textures/3/tags", &json!({"": "b"})).problem(422);
    server.put("textures/3/tags", &json!(["a"])).problem(422);
    assert_eq!(server.delete("textures/3").status, 204);
    server.get("textures/3").problem(404);
    server.delete("textures/3").problem(404);
    let list = server.json("textures");
    assert_eq!((&list["total"], &list["textures"][2]["id"]), (&json!(7), &json!(4)));
}

#[test]
fn a_reindex_reports_its_progress_until_it_ends() {
    let server = TestServer::new();
    let answer = server.post("jobs/reindex", &json!({"reextract": true}));
    assert_eq!((answer.status, answer.header("location")), (202, Some("/api/v1/jobs/1")));
    let job = answer.json();
    let events = server.events(&job);
    let (name, last) = events.last().unwrap();
    assert_eq!((name.as_str(), &last["state"]), ("end", &json!("done")));
    assert!(last["message"].as_str().unwrap().contains("8 textures"), "{last}");
    assert!(events.iter().rev().skip(1).all(|(name, _)| name == "progress"));
    assert_eq!(server.json("jobs")["jobs"][0]["id"], 1);
    assert_eq!(server.events(&job).len(), 1, "of a job that has ended only the end is sent");
    server.get("jobs/7").problem(404);
    server.get("jobs/7/events").problem(404);
}

#[test]
fn only_the_ingest_folder_can_be_ingested() {
    let folder = tempfile::tempdir().unwrap();
    let scans = folder.path().join("scans");
    fs::create_dir_all(scans.join("cores")).unwrap();
    fs::create_dir_all(scans.join("mixed")).unwrap();
    fs::write(folder.path().join("secret.npy"), npy(&ball(16, 2))).unwrap();
    for step in 1..=5 {
        write_npy(&scans.join(format!("cores/core {step}.npy")), &stripes(16, step));
    }
    fs::write(scans.join("mixed/torn.npy"), "no array").unwrap();
    write_npy(&scans.join("mixed/good.npy"), &ball(16, 7));
    let options = ServerOptions::new().ingest_folder(&scans);
    let server = TestServer::with(options, |_| {});
    assert_eq!(server.json("health")["ingest_folder"], true);

    let job = server.post("jobs/ingest", &json!({"path": "cores", "tags": {"site": "north"}})).json();
    assert_eq!(server.ended(&job)["message"], "5 added, 0 already in the store, 0 failed");
    let list = server.json("textures?where=site=north");
    assert_eq!((&list["total"], &list["textures"][0]["name"]), (&json!(5), &json!("core 1.npy")));
    let job = server.post("jobs/ingest", &json!({"path": "mixed"})).json();
    let report = server.ended(&job);
    let message = report["message"].as_str().unwrap();
    assert!(message.starts_with("1 added, 0 already in the store, 1 failed, the last: mixed/torn.npy: "), "{message}");
    assert!(!names_a_path(message, folder.path()));

    for (path, status) in [("../secret.npy", 403), ("/etc", 403), ("cores/../..", 403), ("a\0b", 403), ("none", 404)] {
        let said = server.post("jobs/ingest", &json!({"path": path})).problem(status);
        assert!(!names_a_path(&said, folder.path()), "{said}");
    }
    #[cfg(unix)]
    {
        std::os::unix::fs::symlink(folder.path(), scans.join("mixed/out")).unwrap();
        let said = server.post("jobs/ingest", &json!({"path": "mixed"})).problem(403);
        assert!(said.contains("mixed/out") && !names_a_path(&said, folder.path()), "{said}");
        server.post("jobs/ingest", &json!({"path": "mixed/out/secret.npy"})).problem(403);
    }
    server.post("jobs/ingest", &json!({"path": "cores", "tags": {"": "x"}})).problem(400);
    server.post("jobs/ingest", &json!({"path": "cores", "block": 1})).problem(400);
    let said = TestServer::new().post("jobs/ingest", &json!({"path": "cores"})).problem(403);
    assert!(said.contains("--ingest-folder"), "{said}");
}

#[test]
fn what_a_cancelled_job_has_committed_stays() {
    let folder = tempfile::tempdir().unwrap();
    for step in 0..200 {
        let volume =
            hlacdb::volume::Volume::from_fn([24; 3], |z, y, x| (z * 5 + y * (step % 20) + x * (step / 20)) as u8);
        write_npy(&folder.path().join(format!("{step}.npy")), &volume.unwrap());
    }
    let options = ServerOptions::new().ingest_folder(folder.path());
    let mut server = TestServer::with(options, |_| {});
    let job = server.post("jobs/ingest", &json!({"path": ""})).json();
    assert_eq!(server.delete(&format!("jobs/{}", job["id"])).status, 202);
    let report = server.ended(&job);
    assert_eq!(report["state"], "cancelled");
    let added: u64 = report["message"].as_str().unwrap().split(' ').next().unwrap().parse().unwrap();
    assert!(added < 200, "{report}");
    assert_eq!(server.json("textures")["total"], added);
    // Stopping the server waits neither for the job nor for the client that watches it.
    let job = server.post("jobs/ingest", &json!({"path": ""})).json();
    std::thread::scope(|scope| {
        let watcher = scope.spawn(|| server.events(&job));
        std::thread::sleep(std::time::Duration::from_millis(100));
        drop(watcher);
    });
    server.stop();
}

#[test]
fn a_read_only_server_follows_another_writer() {
    let server = TestServer::read_only();
    assert_eq!(
        (server.json("health")["read_only"].clone(), server.json("textures")["total"].clone()),
        (json!(true), json!(8))
    );
    for reply in [
        server.put("textures/1/tags", &json!({"a": "b"})),
        server.delete("textures/1"),
        server.delete("textures/1/tags/kind"),
        server.form("textures", &[("file", Some("a.npy"), b"x")]),
        server.post("jobs/reindex", &json!({})),
        server.post("jobs/ingest", &json!({"path": ""})),
    ] {
        let said = reply.problem(403);
        assert!(said.contains("--read-only"), "{said}");
    }
    let writer = Database::open(server.path("textures.hlacdb")).unwrap();
    let id = writer.add(&ball(16, 12), Meta::named("late").tag("kind", "late")).unwrap().id().get();
    assert_eq!(server.json("textures?where=kind=late")["textures"][0]["id"], id);
    assert_eq!(server.post("query", &json!({"ids": [id], "k": 2})).json()["hits"].as_array().unwrap().len(), 2);
    writer.remove([id]).unwrap();
    assert_eq!(server.json("textures")["total"], 8);
    server.post("query", &json!({"ids": [id]})).problem(404);
}

#[test]
fn an_empty_store_is_served() {
    let folder = tempfile::tempdir().unwrap();
    let database = OpenOptions::new().open(folder.path().join("empty.hlacdb")).unwrap();
    let server = TestServer::serving(folder, database, ServerOptions::new());
    assert_eq!(server.json("textures"), json!({"total": 0, "offset": 0, "textures": []}));
    assert_eq!(server.json("tags"), json!({"tags": []}));
    assert_eq!(server.json("map")["ids"], json!([]));
    assert_eq!(server.json("statistics")["textures"], 0);
    let answer = server.form("query", &[("file", Some("a.npy"), &npy(&ball(16, 3)))]).json();
    assert_eq!(answer["hits"], json!([]));
}
