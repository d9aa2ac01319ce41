//! Lists, textures, pictures, voxels, and the store as a whole.

use serde_json::json;

use super::place::Place;
use crate::support::{ball, stripes};

#[test]
fn lists_are_paged_sorted_filtered_and_searched() {
    let place = Place::new();
    let ids = |query: &str| -> Vec<u64> {
        let list = place.json(&format!("textures?{query}"));
        list["textures"].as_array().unwrap().iter().map(|texture| texture["id"].as_u64().unwrap()).collect()
    };
    let list = place.json("textures");
    assert_eq!((list["total"].as_u64(), list["offset"].as_u64()), (Some(8), Some(0)));
    assert_eq!(
        list["textures"][0],
        json!({"id": 1, "name": "Stripes 1", "shape": [16, 16, 16], "channels": 1,
               "tags": {"kind": "Stripes", "step": "1"}, "voxels": true})
    );
    assert_eq!(ids("offset=2&limit=3"), [3, 4, 5]);
    assert_eq!(ids("offset=100"), [0_u64; 0]);
    assert_eq!(ids("sort=-id&limit=2"), [8, 7]);
    assert_eq!(ids("sort=name"), [1, 3, 5, 7, 2, 4, 6, 8]);
    assert_eq!(ids("where=kind=ball&where=step=3"), [6]);
    assert_eq!(ids("text=STRIPES%203"), [5]);
    assert_eq!(ids("text=no%20such"), [0_u64; 0]);
    assert!(place.get("textures?sort=colour").problem(400).contains("'colour'"));
    assert!(place.get("textures?where=ball").problem(400).contains("KEY=VALUE"));
    assert!(place.get("textures?limit=many").problem(400).contains("limit"));

    let tags = place.json("tags");
    assert_eq!(tags["tags"][0]["key"], "kind");
    assert_eq!(tags["tags"][0]["values"], json!([{"value": "Stripes", "count": 4}, {"value": "ball", "count": 4}]));
    assert_eq!(tags["tags"][1]["others"], 0);
}

#[test]
fn a_list_is_sent_once_until_it_changes() {
    let place = Place::new();
    let first = place.get("textures?limit=2");
    let tag = first.header("etag").unwrap();
    assert_eq!(place.get_with("textures?limit=2", &[("If-None-Match", tag)]).status, 304);
    assert_eq!(place.get_with("textures?limit=3", &[("If-None-Match", tag)]).status, 200);
    assert_eq!(place.put("textures/1/tags", &json!({"kind": "new"})).status, 200);
    let again = place.get_with("textures?limit=2", &[("If-None-Match", tag)]);
    assert_eq!(again.json()["textures"][0]["tags"]["kind"], "new");
    let squeezed = place.get_with("textures", &[("Accept-Encoding", "gzip")]);
    assert_eq!(squeezed.header("content-encoding"), Some("gzip"));
    assert_eq!(squeezed.bytes[..2], [0x1f, 0x8b]);
}

#[test]
fn one_texture_tells_all_but_where_it_lay() {
    let place = Place::new();
    let texture = place.json("textures/2");
    assert_eq!((texture["name"].as_str(), texture["windows"].as_u64()), (Some("ball 1"), Some(14 * 14 * 14)));
    assert_eq!(texture["hash"].as_str().unwrap().len(), 64);
    assert!(place.get("textures/99").problem(404).contains("99"));
    assert_eq!(place.get("textures/one").status, 400);
    let descriptor = place.json("textures/2/descriptor");
    assert_eq!(descriptor["view"], "full@1");
    assert_eq!(
        (descriptor["moments"].as_array().unwrap().len(), descriptor["sums"].as_array().unwrap().len()),
        (251, 251)
    );
    let other = place.json("textures/2/descriptor?view=sign@1");
    assert_eq!((other["sums"].is_null(), other["moments"].as_array().unwrap().len()), (true, 251));
    assert!(place.get("textures/2/descriptor?view=none@9").problem(404).contains("full@1"));
}

#[test]
fn pictures_are_those_of_the_voxels() {
    let place = Place::new();
    let slices = place.get("textures/1/slices.png?columns=4");
    let picture = slices.picture();
    assert_eq!((picture.width(), picture.height()), (4 * 17 - 1, 4 * 17 - 1));
    assert_eq!(place.get("textures/1/slices.png?gap=0&scale=2&axis=x").picture().width(), 8 * 32);
    assert_eq!(place.get("textures/1/slices.png?pixels=8&slices=4&gap=0").picture().width(), 4 * 8);
    let slice = place.get("textures/1/slice.png?axis=y&index=5").picture().into_luma8();
    let volume = stripes(16, 1);
    let expected: Vec<u8> = (0..256).map(|at| volume.voxels()[(at / 16) * 256 + 5 * 16 + at % 16]).collect();
    assert_eq!(slice.into_raw(), expected);
    let small = place.get("textures/1/thumbnail.png?size=48").picture();
    assert_eq!((small.width(), small.height()), (48, 48));
    assert!(place.get("textures/1/slices.png?captions=1").picture().height() > 64);

    let tag = slices.header("etag").unwrap();
    assert_eq!(place.get_with("textures/1/slices.png?columns=4", &[("If-None-Match", tag)]).status, 304);
    assert_eq!(place.get_with("textures/1/slices.png?columns=5", &[("If-None-Match", tag)]).status, 200);
    for (path, words) in [
        ("textures/1/slice.png?index=16", "slice 16"),
        ("textures/99/thumbnail.png", "99"),
        ("uploads/none/thumbnail.png", "upload"),
    ] {
        assert!(place.get(path).problem(404).contains(words), "{path}");
    }
    for path in ["slices.png?axis=w", "slices.png?columns=0", "slice.png?scale=99", "thumbnail.png?size=0"] {
        place.get(&format!("textures/1/{path}")).problem(400);
    }
}

#[test]
fn voxels_come_whole_in_parts_and_smaller() {
    let place = Place::new();
    let volume = ball(16, 3);
    let whole = place.get("textures/2/voxels");
    assert_eq!(whole.bytes, volume.voxels());
    assert_eq!((whole.header("x-shape"), whole.header("x-channels")), (Some("16,16,16"), Some("1")));
    let tag = whole.header("etag").unwrap();
    let part = |range: &str| place.get_with("textures/2/voxels", &[("Range", range)]);
    let some = part("bytes=100-199");
    assert_eq!((some.status, some.header("content-range")), (206, Some("bytes 100-199/4096")));
    assert_eq!(some.bytes, volume.voxels()[100..200]);
    assert_eq!(part("bytes=-6").bytes, volume.voxels()[4090..]);
    assert_eq!(part("bytes=0-1,5-6").status, 200);
    let beyond = part("bytes=5000-");
    assert_eq!((beyond.status, beyond.header("content-range")), (416, Some("bytes */4096")));
    let with = |headers: &[(&str, &str)]| place.get_with("textures/2/voxels", headers).status;
    assert_eq!(with(&[("Range", "bytes=0-9"), ("If-Range", tag)]), 206);
    assert_eq!(with(&[("Range", "bytes=0-9"), ("If-Range", "\"other\"")]), 200);
    assert_eq!(with(&[("If-None-Match", tag)]), 304);
    let small = place.get("textures/2/voxels?edge=8");
    assert_eq!((small.header("x-shape"), &small.bytes[..]), (Some("8,8,8"), volume.shrunk_to(8).voxels()));
    place.get("textures/2/voxels?edge=2").problem(400);
}

#[test]
fn the_store_as_a_whole() {
    let place = Place::new();
    let health = place.json("health");
    assert_eq!((&health["status"], &health["textures"]), (&json!("ok"), &json!(8)));
    assert_eq!((&health["read_only"], &health["ingest_folder"]), (&json!(false), &json!(false)));
    let statistics = place.json("statistics");
    assert_eq!(statistics["textures"], 8);
    assert_eq!(statistics["statistics"]["mean"].as_array().unwrap().len(), 251);
    let spaces = place.json("spaces");
    assert_eq!((spaces["spaces"].as_array().unwrap().len(), &spaces["default"]), (5, &json!("default")));
    assert!(spaces["spaces"][0]["about"].as_str().unwrap().len() > 10);

    let map = place.json("map?tag=kind");
    assert_eq!((map["total"].as_u64(), map["ids"].as_array().unwrap().len()), (Some(8), 8));
    assert_eq!(map["values"], json!(["Stripes", "ball"]));
    assert_eq!(map["value"], json!([0, 1, 0, 1, 0, 1, 0, 1]));
    let shares = map["explained"].as_array().unwrap();
    assert!(shares[0].as_f64() >= shares[1].as_f64() && shares[1].as_f64() > Some(0.0));
    assert_eq!(place.json("map?limit=3&space=paper")["ids"], json!([1, 4, 7]));
    assert!(place.get("map?space=none").problem(422).contains("'none'"));

    let explained = place.json("explain?a=1&b=2");
    let cells: f64 = explained["cells"].as_array().unwrap().iter().map(|share| share.as_f64().unwrap()).sum();
    assert!((cells - 1.0).abs() < 1e-6);
    assert!(place.get("explain?a=1&b=99").problem(404).contains("99"));
    assert!(place.get("explain?a=1").problem(400).contains('b'));
}

#[test]
fn the_api_describes_itself_and_is_counted() {
    let place = Place::new();
    let document = place.json("openapi.json");
    let paths = document["paths"].as_object().unwrap();
    for path in [
        "/api/v1/health",
        "/api/v1/textures",
        "/api/v1/textures/{id}",
        "/api/v1/textures/{id}/tags/{key}",
        "/api/v1/textures/{id}/slices.png",
        "/api/v1/textures/{id}/voxels",
        "/api/v1/uploads/{token}/slice.png",
        "/api/v1/query",
        "/api/v1/map",
        "/api/v1/jobs/{id}/events",
        "/metrics",
    ] {
        assert!(paths.contains_key(path), "{path}");
    }
    assert!(paths["/api/v1/textures"]["post"]["requestBody"]["content"]["multipart/form-data"].is_object());
    place.post("query", &json!({"ids": [1]})).json();
    let metrics = place.get("/metrics");
    let text = String::from_utf8(metrics.bytes).unwrap();
    for line in [
        "hlacdb_requests_total{method=\"POST\",route=\"/api/v1/query\",status=\"200\"} 1",
        "hlacdb_request_duration_seconds_count{route=\"/api/v1/openapi.json\"} 1",
        "hlacdb_search_duration_seconds_count{space=\"default\",index=\"linear\"} 1",
        "hlacdb_textures 8",
        "# EOF",
    ] {
        assert!(text.contains(line), "{line}: {text}");
    }
}

#[test]
fn textures_without_voxels_are_listed_and_say_why_they_are_not_seen() {
    let place = Place::with(hlacdb::serve::Settings::default(), |database| {
        let prepared = database.prepare(ball(16, 3), hlacdb::Meta::named("bare"), hlacdb::Volumes::None);
        database.commit(vec![prepared.unwrap()]).unwrap();
    });
    assert_eq!(place.json("textures")["textures"][0]["voxels"], false);
    for path in ["thumbnail.png", "slices.png", "slice.png", "voxels"] {
        let said = place.get(&format!("textures/1/{path}")).problem(404);
        assert!(said.contains("without its voxels"), "{said}");
    }
}
