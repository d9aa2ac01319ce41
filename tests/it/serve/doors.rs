//! Who may come in, what is refused at the door, the page, and the end.

use std::time::{Duration, Instant};

use hlacdb::serve::{ServeError, Server, Settings};
use hlacdb::{Database, serve};
use serde_json::json;

use super::place::Place;

const TOKEN: &str = "0123456789abcdef0123";

#[test]
fn a_token_opens_the_door_and_nothing_else_does() {
    let place = Place::filled(Settings { token: Some(TOKEN.into()), ..Settings::default() });
    for path in ["health", "textures", "textures/1/thumbnail.png", "/", "/metrics", "openapi.json", "none"] {
        let said = place.get(path).problem(401);
        assert!(said.contains("token") && !said.contains(TOKEN), "{said}");
    }
    let bearer = |value: &str| place.get_with("health", &[("Authorization", value)]).status;
    assert_eq!(bearer(&format!("Bearer {TOKEN}")), 200);
    assert_eq!(bearer(&format!("bearer {TOKEN}")), 200);
    for wrong in [format!("Bearer {TOKEN}x"), "Bearer ".into(), format!("Basic {TOKEN}"), TOKEN.into()] {
        assert_eq!(bearer(&wrong), 401, "{wrong}");
    }
    place.get("/?token=wrong").problem(401);
    place.get(&format!("health?token={TOKEN}")).problem(401);
    let opened = place.get(&format!("/?token={TOKEN}"));
    assert_eq!((opened.status, opened.header("location")), (303, Some("/")));
    let cookie = opened.header("set-cookie").unwrap();
    assert!(cookie.contains("HttpOnly") && cookie.contains("SameSite=Strict") && !cookie.contains(TOKEN), "{cookie}");
    let pair = cookie.split(';').next().unwrap();
    assert_eq!(place.get_with("health", &[("Cookie", pair)]).status, 200);
    assert_eq!(place.get_with("/", &[("Cookie", &format!("a=b; {pair}"))]).status, 200);
    assert_eq!(place.get_with("health", &[("Cookie", "hlacdb=0000")]).status, 401);
}

#[test]
fn other_addresses_need_a_token_and_tokens_must_be_good() {
    let bind = |address: &str, token: Option<&str>| {
        let folder = tempfile::tempdir().unwrap();
        let database = Database::open(folder.path().join("s.hlacdb")).unwrap();
        let settings =
            Settings { address: address.parse().unwrap(), token: token.map(str::to_owned), ..Settings::default() };
        Server::bind(database, settings).map(drop)
    };
    assert!(matches!(bind("0.0.0.0:0", None), Err(ServeError::NeedsToken { .. })));
    assert!(matches!(bind("[::]:0", None), Err(ServeError::NeedsToken { .. })));
    assert!(matches!(bind("127.0.0.1:0", Some("short")), Err(ServeError::BadToken)));
    assert!(matches!(bind("127.0.0.1:0", Some("with spaces in it, and long")), Err(ServeError::BadToken)));
    assert!(bind("127.0.0.1:0", None).is_ok());
    assert!(bind("0.0.0.0:0", Some(TOKEN)).is_ok());
    let taken = std::net::TcpListener::bind("127.0.0.1:0").unwrap();
    let error = bind(&taken.local_addr().unwrap().to_string(), None).unwrap_err();
    assert!(matches!(error, serve::ServeError::Listen { .. }) && error.to_string().contains("--addr"), "{error}");
}

#[test]
fn other_sites_pages_and_other_names_are_kept_out() {
    let place = Place::new();
    let evil = [("Origin", "http://evil.example"), ("Sec-Fetch-Site", "cross-site")];
    for header in evil {
        place.post_with("jobs/reindex", &json!({}), &[header]).problem(403);
        place.post_with("query", &json!({"ids": [1]}), &[header]).problem(403);
    }
    let own = format!("http://{}", place.address);
    assert_eq!(place.post_with("query", &json!({"ids": [1]}), &[("Origin", &own)]).status, 200);
    let answer = place.raw("GET /api/v1/health HTTP/1.1\r\nHost: evil.example\r\nConnection: close\r\n\r\n");
    assert!(answer.starts_with("HTTP/1.1 403 ") && answer.contains("application/problem+json"), "{answer}");
    let answer = place.raw("GET /api/v1/health HTTP/1.1\r\nHost: localhost:1\r\nConnection: close\r\n\r\n");
    assert!(answer.starts_with("HTTP/1.1 200 "), "{answer}");
}

#[test]
fn paths_lead_nowhere() {
    let place = Place::new();
    for path in [
        "/../../etc/passwd",
        "/%2e%2e/%2e%2e/etc/passwd.txt",
        "/..%2f..%2fCargo.toml",
        "//etc/passwd.txt",
        "/js/../../mod.rs",
        "/js/%2e%2e/%2e%2e/mod.rs",
        "/none.js",
        "/api/v1/../../Cargo.toml",
        "/api/v1/textures/..%2f..%2f1/thumbnail.png",
        "/api/v2/textures",
    ] {
        let answer = place.raw(&format!("GET {path} HTTP/1.1\r\nHost: 127.0.0.1\r\nConnection: close\r\n\r\n"));
        assert!(!answer.contains("[package]") && !answer.contains("root:") && !answer.contains("mod assets"), "{path}");
        let page = answer.starts_with("HTTP/1.1 200 ") && answer.to_ascii_lowercase().contains("text/html");
        let refused = answer.starts_with("HTTP/1.1 404 ") || answer.starts_with("HTTP/1.1 400 ");
        assert!(page || refused, "{path}: {answer}");
    }
    for request in ["nonsense\r\n\r\n", "GET / HTTP/1.1\r\nHost: a b\r\nContent-Length: -1\r\n\r\n"] {
        let answer = place.raw(request);
        assert!(answer.is_empty() || answer.starts_with("HTTP/1.1 400 "), "{answer}");
    }
    assert!(place.get("/api/v1/none").problem(404).contains("openapi.json"));
    assert!(place.post("health", &json!({})).problem(405).contains("openapi.json"));
    assert_eq!(place.json("health")["status"], "ok");
}

#[test]
fn the_page_is_served_with_a_policy_and_kept_by_its_content() {
    let place = Place::new();
    let page = place.get("/");
    assert_eq!(page.status, 200);
    assert!(page.header("content-type").unwrap().starts_with("text/html"));
    let policy = page.header("content-security-policy").unwrap();
    assert!(policy.contains("default-src 'self'") && policy.contains("frame-ancestors 'none'"));
    assert_eq!(page.header("x-content-type-options"), Some("nosniff"));
    let tag = page.header("etag").unwrap();
    assert_eq!(place.get_with("/", &[("If-None-Match", tag)]).status, 304);
    assert_eq!(place.get("/texture/1").bytes, page.bytes, "the page keeps what it shows in its address");
}

#[test]
fn a_request_that_takes_too_long_is_told_so() {
    let settings = Settings { time: Duration::from_millis(300), ..Settings::default() };
    let place = Place::filled(settings);
    // The body never comes.
    let began = Instant::now();
    let answer = place.raw(
        "POST /api/v1/query HTTP/1.1\r\nHost: 127.0.0.1\r\nContent-Type: application/json\r\nContent-Length: 20\r\n\r\n{",
    );
    assert!(answer.starts_with("HTTP/1.1 504 ") && answer.contains("application/problem+json"), "{answer}");
    assert!(began.elapsed() < Duration::from_secs(20));
}

#[test]
fn many_at_once_are_all_answered() {
    let place = Place::filled(Settings { concurrency: 2, ..Settings::default() });
    std::thread::scope(|scope| {
        for id in 1..=8_u64 {
            let place = &place;
            scope.spawn(move || {
                for _ in 0..10 {
                    let answer = place.post("query", &json!({"ids": [id], "exclude_self": false})).json();
                    assert_eq!(answer["hits"][0]["id"], id);
                    assert_eq!(place.get(&format!("textures/{id}/thumbnail.png")).status, 200);
                }
            });
        }
    });
}
