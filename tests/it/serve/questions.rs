//! Queries: by id, by file, by upload, by a part.

use serde_json::{Value, json};

use super::place::{Place, npy};
use crate::support::{ball, stripes};

fn ids(answer: &Value) -> Vec<u64> {
    answer["hits"].as_array().unwrap().iter().map(|hit| hit["id"].as_u64().unwrap()).collect()
}

#[test]
fn a_texture_finds_its_like() {
    let place = Place::new();
    let answer = place.post("query", &json!({"ids": [1], "k": 3})).json();
    assert_eq!((&answer["space"], ids(&answer).len()), (&json!("default"), 3));
    assert!(!ids(&answer).contains(&1) && answer["upload"].is_null());
    let hit = &answer["hits"][0];
    assert_eq!((&hit["rank"], &hit["shape"], &hit["voxels"]), (&json!(1), &json!([16, 16, 16]), &json!(true)));
    let with_self = place.post("query", &json!({"ids": [1], "exclude_self": false, "space": "paper"})).json();
    assert_eq!((ids(&with_self)[0], with_self["hits"][0]["distance"].as_f64()), (1, Some(0.0)));
    let balls = place.post("query", &json!({"ids": [1], "where": ["kind=ball"]})).json();
    assert_eq!(ids(&balls).len(), 4);
    let near = place.post("query", &json!({"ids": [1], "within": 0, "exclude_self": false})).json();
    assert_eq!(ids(&near), [1]);
}

#[test]
fn a_file_is_asked_with_and_kept_for_the_next_question() {
    let place = Place::new();
    let file = npy(&stripes(16, 3));
    let answer = place.form("query", &[("file", Some("mine.npy"), &file), ("options", None, br#"{"k":2}"#)]).json();
    assert_eq!((ids(&answer)[0], ids(&answer).len()), (5, 2));
    assert_eq!((&answer["upload"]["name"], &answer["upload"]["shape"]), (&json!("mine.npy"), &json!([16, 16, 16])));
    let token = answer["upload"]["token"].as_str().unwrap();
    let again = place.post("query", &json!({"upload": token, "space": "oriented", "exclude_self": true})).json();
    assert!(ids(&again).len() == 7 && !ids(&again).contains(&5), "the texture of the same content is left out");
    assert_eq!(again["upload"]["token"].as_str(), Some(token));
    assert_eq!(place.get(&format!("uploads/{token}/voxels")).bytes, stripes(16, 3).voxels());
    assert_eq!(place.get(&format!("uploads/{token}/slices.png?gap=0")).picture().width(), 128);
    assert_eq!(place.get(&format!("uploads/{token}/thumbnail.png")).picture().width(), 96);
    assert_eq!(place.get(&format!("uploads/{token}/slice.png")).picture().width(), 16);
    assert_eq!(place.json("health")["textures"], 8, "asking adds nothing");
}

#[test]
fn slices_and_detached_headers_are_asked_with_as_one_volume() {
    let place = Place::new();
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
    let answer = place.form("query", &parts).json();
    assert_eq!((ids(&answer)[0], &answer["upload"]["name"]), (4, &json!("core")));

    let header = b"NRRD0004\ntype: uint8\ndimension: 3\nsizes: 16 16 16\nencoding: raw\ndata file: ball.raw\n";
    let parts = [("file", Some("ball.raw"), volume.voxels()), ("file", Some("ball.nhdr"), &header[..])];
    assert_eq!(ids(&place.form("query", &parts).json())[0], 4);
}

#[test]
fn a_part_of_a_texture_is_asked_with() {
    let place = Place::new();
    let block = |origin, size| json!({"block": {"id": 1, "origin": origin, "size": size}, "k": 1});
    let answer = place.post("query", &block([0, 0, 0], [16, 16, 16])).json();
    assert_ne!(ids(&answer), [1], "the whole is the texture itself, which is left out");
    assert_eq!(ids(&place.post("query", &block([2, 2, 2], [12, 12, 12])).json()).len(), 1);
    let said = place.post("query", &block([8, 8, 8], [16, 16, 16])).problem(400);
    assert!(said.contains("16 x 16 x 16"), "{said}");
}

#[test]
fn wrong_questions_are_refused_in_a_sentence() {
    let place = Place::new();
    for (asked, status, words) in [
        (json!({"ids": [99]}), 404, "99"),
        (json!({"ids": []}), 400, "example"),
        (json!({"ids": [1], "upload": "x"}), 400, "one kind"),
        (json!({"upload": "x"}), 404, "upload"),
        (json!({"ids": [1], "k": 0}), 422, "k is 0"),
        (json!({"ids": [1], "k": 100_000_000}), 400, "10000"),
        (json!({"ids": [1], "within": -1}), 422, "-1"),
        (json!({"ids": [1], "space": "hyper"}), 422, "'hyper'"),
        (json!({"ids": [1], "where": ["ball"]}), 400, "KEY=VALUE"),
        (json!({"ids": [1], "colour": 1}), 422, "colour"),
        (json!({"ids": ["1"]}), 422, "ids"),
    ] {
        let said = place.post("query", &asked).problem(status);
        assert!(said.contains(words), "{asked}: {said}");
    }
    let bad = place.form("query", &[("file", Some("torn.npy"), b"\x93NUMPY\x01\x00v\x00{'descr'")]);
    let said = bad.problem(422);
    assert!(said.starts_with("torn.npy: "), "{said}");
    assert!(place.form("query", &[("options", None, b"{}")]).problem(400).contains("no file"));
    let two = [("file", Some("a.npy"), &npy(&ball(8, 2))[..]), ("file", Some("b.npy"), &npy(&ball(8, 3)))];
    assert!(place.form("query", &two).problem(400).contains("2 volumes"));
    let said = place.form("query", &[("file", Some("a.npy"), b"x"), ("options", None, b"{\"k\":")]).problem(400);
    assert!(said.contains("options"), "{said}");
}
