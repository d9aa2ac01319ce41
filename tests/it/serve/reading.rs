//! Requests that only read: lists, textures, pictures, voxels, statistics.

use serde_json::json;

use super::server::TestServer;
use crate::support::{ball, stripes};

#[test]
fn lists_are_paged_sorted_filtered_and_searched() {
    let server = TestServer::new();
    let ids = |query: &str| -> Vec<u64> {
        let list = server.json(&format!("textures?{query}"));
        list["textures"].as_array().unwrap().iter().map(|texture| texture["id"].as_u64().unwrap()).collect()
    };
    let list = server.json("textures");
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
    assert!(server.get("textures?sort=colour").problem(400).contains("'colour'"));
    assert!(server.get("textures?where=ball").problem(400).contains("KEY=VALUE"));
    assert!(server.get("textures?limit=many").problem(400).contains("limit"));

    let tags = server.json("tags");
    assert_eq!(tags["tags"][0]["key"], "kind");
    assert_eq!(tags["tags"][0]["values"], json!([{"value": "Stripes", "count": 4}, {"value": "ball", "count": 4}]));
    assert_eq!(tags["tags"][1]["others"], 0);
}

#[test]
fn an_unchanged_list_is_not_sent_again() {
    let server = TestServer::new();
    let first = server.get("textures?limit=2");
    let tag = first.header("etag").unwrap();
    assert_eq!(server.get_with("textures?limit=2", &[("If-None-Match", tag)]).status, 304);
    assert_eq!(server.get_with("textures?limit=3", &[("If-None-Match", tag)]).status, 200);
    assert_eq!(server.put("textures/1/tags", &json!({"kind": "new"})).status, 200);
    let again = server.get_with("textures?limit=2", &[("If-None-Match", tag)]);
    assert_eq!(again.json()["textures"][0]["tags"]["kind"], "new");
    let squeezed = server.get_with("textures", &[("Accept-Encoding", "gzip")]);
    assert_eq!(squeezed.header("content-encoding"), Some("gzip"));
    assert_eq!(squeezed.bytes[..2], [0x1f, 0x8b]);
}

#[test]
fn a_texture_has_details_but_no_folder() {
    let server = TestServer::new();
    let texture = server.json("textures/2");
    assert_eq!((texture["name"].as_str(), texture["windows"].as_u64()), (Some("ball 1"), Some(14 * 14 * 14)));
    assert_eq!(texture["hash"].as_str().unwrap().len(), 64);
    assert!(server.get("textures/99").problem(404).contains("99"));
    assert_eq!(server.get("textures/one").status, 400);
    let descriptor = server.json("textures/2/descriptor");
    assert_eq!(descriptor["view"], "full@1");
    assert_eq!(
        (descriptor["moments"].as_array().unwrap().len(), descriptor["sums"].as_array().unwrap().len()),
        (251, 251)
    );
    let other = server.json("textures/2/descriptor?view=sign@1");
    assert_eq!((other["sums"].is_null(), other["moments"].as_array().unwrap().len()), (true, 251));
    assert!(server.get("textures/2/descriptor?view=none@9").problem(404).contains("full@1"));
}

#[test]
fn pictures_show_the_voxels() {
    let server = TestServer::new();
    let slices = server.get("textures/1/slices.png?columns=4");
    let picture = slices.picture();
    assert_eq!((picture.width(), picture.height()), (4 * 17 - 1, 4 * 17 - 1));
    assert_eq!(server.get("textures/1/slices.png?gap=0&scale=2&axis=x").picture().width(), 8 * 32);
    assert_eq!(server.get("textures/1/slices.png?pixels=8&slices=4&gap=0").picture().width(), 4 * 8);
    let slice = server.get("textures/1/slice.png?axis=y&index=5").picture().into_luma8();
    let volume = stripes(16, 1);
    let expected: Vec<u8> = (0..256).map(|at| volume.voxels()[(at / 16) * 256 + 5 * 16 + at % 16]).collect();
    assert_eq!(slice.into_raw(), expected);
    let small = server.get("textures/1/thumbnail.png?size=48").picture();
    assert_eq!((small.width(), small.height()), (48, 48));
    assert!(server.get("textures/1/slices.png?captions=1").picture().height() > 64);

    let tag = slices.header("etag").unwrap();
    assert_eq!(server.get_with("textures/1/slices.png?columns=4", &[("If-None-Match", tag)]).status, 304);
    assert_eq!(server.get_with("textures/1/slices.png?columns=5", &[("If-None-Match", tag)]).status, 200);
    for (path, words) in [
        ("textures/1/slice.png?index=16", "slice 16"),
        ("textures/99/thumbnail.png", "99"),
        ("uploads/none/thumbnail.png", "upload"),
    ] {
        assert!(server.get(path).problem(404).contains(words), "{path}");
    }
    for path in ["slices.png?axis=w", "slices.png?columns=0", "slice.png?scale=99", "thumbnail.png?size=0"] {
        server.get(&format!("textures/1/{path}")).problem(400);
    }
}

#[test]
fn voxels_are_sent_whole_in_ranges_and_reduced() {
    let server = TestServer::new();
    let volume = ball(16, 3);
    let whole = server.get("textures/2/voxels");
    assert_eq!(whole.bytes, volume.voxels());
    assert_eq!((whole.header("x-shape"), whole.header("x-channels")), (Some("16,16,16"), Some("1")));
    let tag = whole.header("etag").unwrap();
    let part = |range: &str| server.get_with("textures/2/voxels", &[("Range", range)]);
    let some = part("bytes=100-199");
    assert_eq!((some.status, some.header("content-range")), (206, Some("bytes 100-199/4096")));
    assert_eq!(some.bytes, volume.voxels()[100..200]);
    assert_eq!(part("bytes=-6").bytes, volume.voxels()[4090..]);
    assert_eq!(part("bytes=0-1,5-6").status, 200);
    let beyond = part("bytes=5000-");
    assert_eq!((beyond.status, beyond.header("content-range")), (416, Some("bytes */4096")));
    let with = |headers: &[(&str, &str)]| server.get_with("textures/2/voxels", headers).status;
    assert_eq!(with(&[("Range", "bytes=0-9"), ("If-Range", tag)]), 206);
    assert_eq!(with(&[("Range", "bytes=0-9"), ("If-Range", "\"other\"")]), 200);
    assert_eq!(with(&[("If-None-Match", tag)]), 304);
    let small = server.get("textures/2/voxels?edge=8");
    assert_eq!((small.header("x-shape"), &small.bytes[..]), (Some("8,8,8"), volume.shrunk_to(8).voxels()));
    server.get("textures/2/voxels?edge=2").problem(400);
}

#[test]
fn health_statistics_spaces_map_and_explanations() {
    let server = TestServer::new();
    let health = server.json("health");
    assert_eq!((&health["status"], &health["textures"]), (&json!("ok"), &json!(8)));
    assert_eq!((&health["read_only"], &health["ingest_folder"]), (&json!(false), &json!(false)));
    let statistics = server.json("statistics");
    assert_eq!(statistics["textures"], 8);
    assert_eq!(statistics["statistics"]["mean"].as_array().unwrap().len(), 251);
    let spaces = server.json("spaces");
    assert_eq!((spaces["spaces"].as_array().unwrap().len(), &spaces["default"]), (5, &json!("default")));
    assert!(spaces["spaces"][0]["about"].as_str().unwrap().len() > 10);

    let map = server.json("map?tag=kind");
    assert_eq!((map["total"].as_u64(), map["ids"].as_array().unwrap().len()), (Some(8), 8));
    assert_eq!(map["values"], json!(["Stripes", "ball"]));
    assert_eq!(map["value"], json!([0, 1, 0, 1, 0, 1, 0, 1]));
    let shares = map["explained"].as_array().unwrap();
    assert!(shares[0].as_f64() >= shares[1].as_f64() && shares[1].as_f64() > Some(0.0));
    assert_eq!(server.json("map?limit=3&space=paper")["ids"], json!([1, 4, 7]));
    assert!(server.get("map?space=none").problem(422).contains("'none'"));

    let explained = server.json("explain?a=1&b=2");
    let cells: f64 = explained["cells"].as_array().unwrap().iter().map(|share| share.as_f64().unwrap()).sum();
    assert!((cells - 1.0).abs() < 1e-6);
    assert!(server.get("explain?a=1&b=99").problem(404).contains("99"));
    assert!(server.get("explain?a=1").problem(400).contains('b'));
}

#[test]
fn the_api_is_documented_and_measured() {
    let server = TestServer::new();
    let document = server.json("openapi.json");
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
    server.post("query", &json!({"ids": [1]})).json();
    let metrics = server.get("/metrics");
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
fn textures_without_voxels_are_listed_but_not_shown() {
    let server = TestServer::with(hlacdb::serve::ServerOptions::new(), |database| {
        let prepared = database.prepare(ball(16, 3), hlacdb::Meta::named("bare"), hlacdb::Volumes::None);
        database.commit(vec![prepared.unwrap()]).unwrap();
    });
    assert_eq!(server.json("textures")["textures"][0]["voxels"], false);
    for path in ["thumbnail.png", "slices.png", "slice.png", "voxels"] {
        let said = server.get(&format!("textures/1/{path}")).problem(404);
        assert!(said.contains("without its voxels"), "{said}");
    }
}
