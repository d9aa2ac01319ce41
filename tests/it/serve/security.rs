//! Authentication, limits, and the files of the page.

use std::time::{Duration, Instant};

use hlacdb::Database;
use hlacdb::serve::{ServeError, Server, ServerOptions};
use serde_json::json;

use super::server::TestServer;

const TOKEN: &str = "0123456789abcdef0123";

#[test]
fn only_the_token_gives_access() {
    let server = TestServer::filled(ServerOptions::new().token(TOKEN));
    for path in ["health", "textures", "textures/1/thumbnail.png", "/", "/metrics", "openapi.json", "none"] {
        let said = server.get(path).problem(401);
        assert!(said.contains("token") && !said.contains(TOKEN), "{said}");
    }
    let bearer = |value: &str| server.get_with("health", &[("Authorization", value)]).status;
    assert_eq!(bearer(&format!("Bearer {TOKEN}")), 200);
    assert_eq!(bearer(&format!("bearer {TOKEN}")), 200);
    for wrong in [format!("Bearer {TOKEN}x"), "Bearer ".into(), format!("Basic {TOKEN}"), TOKEN.into()] {
        assert_eq!(bearer(&wrong), 401, "{wrong}");
    }
    server.get("/?token=wrong").problem(401);
    server.get(&format!("health?token={TOKEN}")).problem(401);
    let opened = server.get(&format!("/?token={TOKEN}"));
    assert_eq!((opened.status, opened.header("location")), (303, Some("/")));
    let cookie = opened.header("set-cookie").unwrap();
    assert!(cookie.contains("HttpOnly") && cookie.contains("SameSite=Strict") && !cookie.contains(TOKEN), "{cookie}");
    let pair = cookie.split(';').next().unwrap();
    assert_eq!(server.get_with("health", &[("Cookie", pair)]).status, 200);
    assert_eq!(server.get_with("/", &[("Cookie", &format!("a=b; {pair}"))]).status, 200);
    assert_eq!(server.get_with("health", &[("Cookie", "hlacdb=0000")]).status, 401);
}

#[test]
fn public_addresses_need_a_token_and_tokens_must_be_long() {
    let bind = |address: &str, token: Option<&str>| {
        let folder = tempfile::tempdir().unwrap();
        let database = Database::open(folder.path().join("s.hlacdb")).unwrap();
        let options = ServerOptions::new().address(address.parse().unwrap());
        let options = token.iter().fold(options, |options, &token| options.token(token));
        Server::bind(database, options).map(drop)
    };
    assert!(matches!(bind("0.0.0.0:0", None), Err(ServeError::NeedsToken { .. })));
    assert!(matches!(bind("[::]:0", None), Err(ServeError::NeedsToken { .. })));
    assert!(matches!(bind("127.0.0.1:0", Some("short")), Err(ServeError::BadToken)));
    assert!(matches!(bind("127.0.0.1:0", Some("with spaces in it, and long")), Err(ServeError::BadToken)));
    assert!(bind("127.0.0.1:0", None).is_ok());
    assert!(bind("0.0.0.0:0", Some(TOKEN)).is_ok());
    let taken = std::net::TcpListener::bind("127.0.0.1:0").unwrap();
    let error = bind(&taken.local_addr().unwrap().to_string(), None).unwrap_err();
    assert!(matches!(error, ServeError::Listen { .. }) && !error.to_string().contains("--"), "{error}");
}

#[test]
fn pages_of_other_sites_and_other_host_names_are_refused() {
    let server = TestServer::new();
    let evil = [("Origin", "http://evil.example"), ("Sec-Fetch-Site", "cross-site")];
    for header in evil {
        server.post_with("jobs/reindex", &json!({}), &[header]).problem(403);
        server.post_with("query", &json!({"ids": [1]}), &[header]).problem(403);
    }
    let own = format!("http://{}", server.address);
    assert_eq!(server.post_with("query", &json!({"ids": [1]}), &[("Origin", &own)]).status, 200);
    let answer = server.raw("GET /api/v1/health HTTP/1.1\r\nHost: evil.example\r\nConnection: close\r\n\r\n");
    assert!(answer.starts_with("HTTP/1.1 403 ") && answer.contains("application/problem+json"), "{answer}");
    let answer = server.raw("GET /api/v1/health HTTP/1.1\r\nHost: localhost:1\r\nConnection: close\r\n\r\n");
    assert!(answer.starts_with("HTTP/1.1 200 "), "{answer}");
}

#[test]
fn paths_lead_nowhere() {
    let server = TestServer::new();
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
        let answer = server.raw(&format!("GET {path} HTTP/1.1\r\nHost: 127.0.0.1\r\nConnection: close\r\n\r\n"));
        assert!(!answer.contains("[package]") && !answer.contains("root:") && !answer.contains("mod assets"), "{path}");
        let page = answer.starts_with("HTTP/1.1 200 ") && answer.to_ascii_lowercase().contains("text/html");
        let refused = answer.starts_with("HTTP/1.1 404 ") || answer.starts_with("HTTP/1.1 400 ");
        assert!(page || refused, "{path}: {answer}");
    }
    for request in ["nonsense\r\n\r\n", "GET / HTTP/1.1\r\nHost: a b\r\nContent-Length: -1\r\n\r\n"] {
        let answer = server.raw(request);
        assert!(answer.is_empty() || answer.starts_with("HTTP/1.1 400 "), "{answer}");
    }
    assert!(server.get("/api/v1/none").problem(404).contains("openapi.json"));
    assert!(server.post("health", &json!({})).problem(405).contains("openapi.json"));
    assert_eq!(server.json("health")["status"], "ok");
}

#[test]
fn the_page_has_a_security_policy_and_an_entity_tag() {
    let server = TestServer::new();
    let page = server.get("/");
    assert_eq!(page.status, 200);
    assert!(page.header("content-type").unwrap().starts_with("text/html"));
    let policy = page.header("content-security-policy").unwrap();
    assert!(policy.contains("default-src 'self'") && policy.contains("frame-ancestors 'none'"));
    assert_eq!(page.header("x-content-type-options"), Some("nosniff"));
    let tag = page.header("etag").unwrap();
    assert_eq!(server.get_with("/", &[("If-None-Match", tag)]).status, 304);
    assert_eq!(server.get("/texture/1").bytes, page.bytes, "every address without an extension is the page");
}

#[test]
fn a_request_that_takes_too_long_gets_504() {
    let options = ServerOptions::new().time(Duration::from_millis(300));
    let server = TestServer::filled(options);
    // The body is never sent.
    let began = Instant::now();
    let answer = server.raw(
        "POST /api/v1/query HTTP/1.1\r\nHost: 127.0.0.1\r\nContent-Type: application/json\r\nContent-Length: 20\r\n\r\n{",
    );
    assert!(answer.starts_with("HTTP/1.1 504 ") && answer.contains("application/problem+json"), "{answer}");
    assert!(began.elapsed() < Duration::from_secs(20));
}

#[test]
fn all_of_many_concurrent_requests_are_answered() {
    let server = TestServer::filled(ServerOptions::new().concurrency(2));
    std::thread::scope(|scope| {
        for id in 1..=8_u64 {
            let server = &server;
            scope.spawn(move || {
                for _ in 0..10 {
                    let answer = server.post("query", &json!({"ids": [id], "exclude_self": false})).json();
                    assert_eq!(answer["hits"][0]["id"], id);
                    assert_eq!(server.get(&format!("textures/{id}/thumbnail.png")).status, 200);
                }
            });
        }
    });
}
