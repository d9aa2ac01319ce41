//! Queries by id, file, upload and block.

use serde_json::{Value, json};

use super::server::{TestServer, npy};
use crate::support::{ball, stripes};

fn ids(answer: &Value) -> Vec<u64> {
    answer["hits"].as_array().unwrap().iter().map(|hit| hit["id"].as_u64().unwrap()).collect()
}

#[test]
fn a_texture_finds_similar_ones() {
    let server = TestServer::new();
    let answer = server.post("query", &json!({"ids": [1], "k": 3})).json();
    assert_eq!((&answer["space"], ids(&answer).len()), (&json!("default"), 3));
    assert!(!ids(&answer).contains(&1) && answer["upload"].is_null());
    let hit = &answer["hits"][0];
    assert_eq!((&hit["rank"], &hit["shape"], &hit["voxels"]), (&json!(1), &json!([16, 16, 16]), &json!(true)));
    let with_self = server.post("query", &json!({"ids": [1], "exclude_self": false, "space": "paper"})).json();
    assert_eq!((ids(&with_self)[0], with_self["hits"][0]["distance"].as_f64()), (1, Some(0.0)));
    let balls = server.post("query", &json!({"ids": [1], "where": ["kind=ball"]})).json();
    assert_eq!(ids(&balls).len(), 4);
    let near = server.post("query", &json!({"ids": [1], "within": 0, "exclude_self": false})).json();
    assert_eq!(ids(&near), [1]);
}

#[test]
fn an_uploaded_file_can_be_queried_again() {
    let server = TestServer::new();
    let file = npy(&stripes(16, 3));
    let answer = server.form("query", &[("file", Some("mine.npy"), &file), ("options", None, br#"{"k":2}"#)]).json();
    assert_eq!((ids(&answer)[0], ids(&answer).len()), (5, 2));
    assert_eq!((&answer["upload"]["name"], &answer["upload"]["shape"]), (&json!("mine.npy"), &json!([16, 16, 16])));
    let token = answer["upload"]["token"].as_str().unwrap();
    let again = server.post("query", &json!({"upload": token, "space": "oriented", "exclude_self": true})).json();
    assert!(ids(&again).len() == 7 && !ids(&again).contains(&5), "the texture with the same content is left out");
    assert_eq!(again["upload"]["token"].as_str(), Some(token));
    assert_eq!(server.get(&format!("uploads/{token}/voxels")).bytes, stripes(16, 3).voxels());
    assert_eq!(server.get(&format!("uploads/{token}/slices.png?gap=0")).picture().width(), 128);
    assert_eq!(server.get(&format!("uploads/{token}/thumbnail.png")).picture().width(), 96);
    assert_eq!(server.get(&format!("uploads/{token}/slice.png")).picture().width(), 16);
    assert_eq!(server.json("health")["textures"], 8, "a query adds nothing");
}

/// The number of volumes that the server has described for queries.
fn descriptions(server: &TestServer) -> u64 {
    let metrics = String::from_utf8(server.get("/metrics").bytes).unwrap();
    let line = metrics.lines().find_map(|line| line.strip_prefix("hlacdb_descriptions_total "));
    line.expect("descriptions are counted").parse().unwrap()
}

/// Regression: a query by upload token that leaves out the upload itself described the volume again.
#[test]
fn an_upload_is_described_once_for_all_queries_and_spaces() {
    let server = TestServer::new();
    let file = npy(&stripes(16, 3));
    let first = server.form("query", &[("file", Some("mine.npy"), &file)]).json();
    let token = first["upload"]["token"].as_str().unwrap();
    assert_eq!(descriptions(&server), 1);
    let spaces = server.json("spaces");
    let spaces: Vec<&str> =
        spaces["spaces"].as_array().unwrap().iter().map(|space| space["name"].as_str().unwrap()).collect();
    assert!(spaces.len() >= 5, "{spaces:?}");
    for space in spaces {
        let query = |exclude: bool| {
            server.post("query", &json!({"upload": token, "space": space, "exclude_self": exclude})).json()
        };
        let (with, without) = (query(false), query(true));
        // The texture with the same content is texture 5; everything else is the same.
        assert_eq!((ids(&with)[0], with["hits"][0]["distance"].as_f64()), (5, Some(0.0)), "{space}");
        let distances = |answer: &Value| -> Vec<(u64, f64)> {
            let hits = answer["hits"].as_array().unwrap().iter();
            hits.map(|hit| (hit["id"].as_u64().unwrap(), hit["distance"].as_f64().unwrap())).collect()
        };
        assert_eq!(distances(&with)[1..], distances(&without)[..], "{space}");
    }
    assert_eq!(descriptions(&server), 1, "the description is kept beside the upload");
    server.post("query", &json!({"block": {"id": 1, "origin": [0, 0, 0], "size": [8, 8, 8]}})).json();
    assert_eq!(descriptions(&server), 2, "a block is described for its query");
}

/// The counter above counts every description: nothing else in the server describes a volume.
#[test]
fn the_server_describes_volumes_in_two_places_only() {
    let routes = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("src/serve/routes");
    let mut calls = 0;
    for entry in std::fs::read_dir(routes).unwrap() {
        let text = std::fs::read_to_string(entry.unwrap().path()).unwrap();
        calls += text.matches("Query::volume(").count() + text.matches(".describe(").count();
        assert_eq!(text.matches("and_volume(").count(), 0);
    }
    assert_eq!(calls, 2);
}

#[test]
fn slices_and_detached_headers_are_one_volume() {
    let server = TestServer::new();
    let volume = ball(16, 4);
    let slices: Vec<(String, Vec<u8>)> = (0..16)
        .map(|z| {
            let mut png = std::io::Cursor::new(Vec::new());
            let pixels = volume.voxels()[z * 256..(z + 1) * 256].to_vec();
            image::GrayImage::from_raw(16, 16, pixels).unwrap().write_to(&mut png, image::ImageFormat::Png).unwrap();
            (format!("core_{z}.png"), png.into_inner())
        })
        .collect();
    let parts: Vec<_> = slices.iter().map(|(name, png)| ("file", Some(name.as_str()), &png[..])).collect();
    let answer = server.form("query", &parts).json();
    assert_eq!((ids(&answer)[0], &answer["upload"]["name"]), (4, &json!("core")));

    let header = b"NRRD0004\ntype: uint8\ndimension: 3\nsizes: 16 16 16\nencoding: raw\ndata file: ball.raw\n";
    let parts = [("file", Some("ball.raw"), volume.voxels()), ("file", Some("ball.nhdr"), &header[..])];
    assert_eq!(ids(&server.form("query", &parts).json())[0], 4);
}

#[test]
fn a_block_of_a_texture_is_an_example() {
    let server = TestServer::new();
    let block = |origin, size| json!({"block": {"id": 1, "origin": origin, "size": size}, "k": 1});
    let answer = server.post("query", &block([0, 0, 0], [16, 16, 16])).json();
    assert_ne!(ids(&answer), [1], "the whole block is the texture itself, which is left out");
    assert_eq!(ids(&server.post("query", &block([2, 2, 2], [12, 12, 12])).json()).len(), 1);
    let said = server.post("query", &block([8, 8, 8], [16, 16, 16])).problem(400);
    assert!(said.contains("16 x 16 x 16"), "{said}");
}

#[test]
fn wrong_queries_are_refused_with_a_sentence() {
    let server = TestServer::new();
    for (request, status, words) in [
        (json!({"ids": [99]}), 404, "99"),
        (json!({"ids": []}), 400, "example"),
        (json!({"ids": [1], "upload": "x"}), 400, "one kind"),
        (json!({"upload": "x"}), 404, "upload"),
        (json!({"ids": [1], "k": 0}), 422, "k must be >= 1"),
        (json!({"ids": [1], "k": 100_000_000}), 400, "10000"),
        (json!({"ids": [1], "within": -1}), 422, "-1"),
        (json!({"ids": [1], "space": "hyper"}), 422, "'hyper'"),
        (json!({"ids": [1], "where": ["ball"]}), 400, "KEY=VALUE"),
        (json!({"ids": [1], "colour": 1}), 422, "colour"),
        (json!({"ids": ["1"]}), 422, "ids"),
    ] {
        let said = server.post("query", &request).problem(status);
        assert!(said.contains(words), "{request}: {said}");
    }
    let bad = server.form("query", &[("file", Some("torn.npy"), b"\x93NUMPY\x01\x00v\x00{'descr'")]);
    let said = bad.problem(422);
    assert!(said.starts_with("torn.npy: "), "{said}");
    assert!(server.form("query", &[("options", None, b"{}")]).problem(400).contains("no file"));
    let two = [("file", Some("a.npy"), &npy(&ball(8, 2))[..]), ("file", Some("b.npy"), &npy(&ball(8, 3)))];
    assert!(server.form("query", &two).problem(400).contains("2 volumes"));
    let said = server.form("query", &[("file", Some("a.npy"), b"x"), ("options", None, b"{\"k\":")]).problem(400);
    assert!(said.contains("options"), "{said}");
}
