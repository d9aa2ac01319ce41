//! Who may come in, and what every answer says to the browser.

use std::sync::Arc;

use axum::extract::{Request, State};
use axum::http::{HeaderMap, HeaderName, HeaderValue, Method, StatusCode, Uri, header};
use axum::middleware::Next;
use axum::response::{IntoResponse, Response};
use futures_util::StreamExt;

use super::problem::Problem;
use super::state::App;

const COOKIE: &str = "hlacdb";

/// The page loads nothing from elsewhere, and nobody frames it.
const POLICY: &str = "default-src 'self'; img-src 'self' blob: data:; object-src 'none'; base-uri 'none'; \
                      form-action 'self'; frame-ancestors 'none'";

/// What every answer carries.
const HEADERS: [(HeaderName, &str); 5] = [
    (header::CONTENT_SECURITY_POLICY, POLICY),
    (header::X_CONTENT_TYPE_OPTIONS, "nosniff"),
    (header::REFERRER_POLICY, "no-referrer"),
    (HeaderName::from_static("cross-origin-resource-policy"), "same-origin"),
    (HeaderName::from_static("cross-origin-opener-policy"), "same-origin"),
];

/// Lets in who may come in, within the time a request has, and dresses the answer.
pub(crate) async fn guard(State(app): State<Arc<App>>, request: Request, next: Next) -> Response {
    let limit = app.settings.time;
    let mut response = match admit(&app, &request) {
        Err(refused) => refused.into_response(),
        Ok(Admitted::Redirect(response)) => response,
        Ok(Admitted::In) if is_too_large(&app, request.headers()) => {
            let _ = tokio::time::timeout(limit, drain(request)).await;
            Problem::new(StatusCode::PAYLOAD_TOO_LARGE, too_large(&app)).into_response()
        }
        Ok(Admitted::In) => match tokio::time::timeout(limit, next.run(request)).await {
            Ok(response) => as_problem(&app, response).await,
            Err(_) => {
                let sentence = format!("the answer was not there within {} seconds: ask for less", limit.as_secs());
                Problem::new(StatusCode::GATEWAY_TIMEOUT, sentence).into_response()
            }
        },
    };
    for (name, value) in HEADERS {
        response.headers_mut().insert(name, HeaderValue::from_static(value));
    }
    response
}

/// A body that says beforehand that it is longer than what is taken.
fn is_too_large(app: &App, headers: &HeaderMap) -> bool {
    let length = headers.get(header::CONTENT_LENGTH).and_then(|length| length.to_str().ok());
    length.and_then(|length| length.parse::<u64>().ok()).is_some_and(|length| length > app.settings.max_body)
}

/// So much of a refused body is read, and thrown away.
const DRAINED: usize = 64 << 20;

/// Reads on, so that the caller, who is still sending, hears why it is refused and not only that the connection broke.
async fn drain(request: Request) {
    let (mut body, mut read) = (request.into_body().into_data_stream(), 0);
    while let Some(Ok(chunk)) = body.next().await {
        read += chunk.len();
        if read > DRAINED {
            break;
        }
    }
}

enum Admitted {
    In,
    Redirect(Response),
}

fn admit(app: &App, request: &Request) -> Result<Admitted, Problem> {
    let headers = request.headers();
    if app.settings.token.is_none() && !names_this_machine(headers, request.uri()) {
        // A page whose own name was made to lead to this address would be of the same origin: its name betrays it.
        let sentence = "this server is for this machine alone: call it 127.0.0.1 or localhost";
        return Err(Problem::new(StatusCode::FORBIDDEN, sentence));
    }
    let changes = !matches!(*request.method(), Method::GET | Method::HEAD | Method::OPTIONS);
    if changes && !is_same_origin(headers) {
        let sentence = "another site's page may not change anything here: use the page of this server, or a program";
        return Err(Problem::new(StatusCode::FORBIDDEN, sentence));
    }
    let Some(token) = &app.settings.token else { return Ok(Admitted::In) };
    if request.uri().path() == "/" && given_in_query(request.uri()).is_some_and(|given| same(&given, token)) {
        return Ok(Admitted::Redirect(with_cookie(token)));
    }
    let bearer = headers.get(header::AUTHORIZATION).and_then(|value| value.to_str().ok());
    let bearer = bearer.and_then(|value| value.split_once(' ')).filter(|(how, _)| how.eq_ignore_ascii_case("bearer"));
    let shown = bearer.is_some_and(|(_, given)| same(given.trim(), token));
    if shown || cookies(headers).any(|given| same(given, &cookie_value(token))) {
        return Ok(Admitted::In);
    }
    let sentence = "a token is needed: open the page as /?token=TOKEN, or send `Authorization: Bearer TOKEN`";
    Err(Problem::new(StatusCode::UNAUTHORIZED, sentence))
}

/// Whether two secrets are the same, in a time that does not tell how much of them is.
fn same(a: &str, b: &str) -> bool {
    // Hashes of this type are compared in constant time.
    blake3::hash(a.as_bytes()) == blake3::hash(b.as_bytes())
}

/// What the cookie holds: not the token itself, which may be used elsewhere too.
fn cookie_value(token: &str) -> String {
    blake3::derive_key("hlacdb serve, cookie of the page", token.as_bytes())
        .iter()
        .map(|byte| format!("{byte:02x}"))
        .collect()
}

fn with_cookie(token: &str) -> Response {
    let cookie = format!("{COOKIE}={}; Path=/; HttpOnly; SameSite=Strict", cookie_value(token));
    let headers = [(header::SET_COOKIE, cookie), (header::LOCATION, "/".to_owned())];
    (StatusCode::SEE_OTHER, headers).into_response()
}

fn given_in_query(uri: &Uri) -> Option<String> {
    let query = axum::extract::Query::<Vec<(String, String)>>::try_from_uri(uri).ok()?;
    query.0.into_iter().find(|(key, _)| key == "token").map(|(_, value)| value)
}

fn cookies(headers: &HeaderMap) -> impl Iterator<Item = &str> {
    let lines = headers.get_all(header::COOKIE).iter().filter_map(|value| value.to_str().ok());
    lines
        .flat_map(|line| line.split(';'))
        .filter_map(|pair| pair.trim().split_once('='))
        .filter_map(|(name, value)| (name == COOKIE).then_some(value))
}

/// The host that the caller meant, without its port; empty where what was sent is no host.
fn host<'a>(headers: &'a HeaderMap, uri: &'a Uri) -> Option<&'a str> {
    let host = match uri.authority() {
        Some(authority) => authority.as_str(),
        None => headers.get(header::HOST)?.to_str().unwrap_or_default(),
    };
    match host.strip_prefix('[') {
        Some(rest) => Some(rest.split_once(']').map_or("", |(address, _)| address)),
        None => Some(host.split(':').next().unwrap_or(host)),
    }
}

fn names_this_machine(headers: &HeaderMap, uri: &Uri) -> bool {
    match host(headers, uri) {
        Some(host) => {
            host.eq_ignore_ascii_case("localhost")
                || host.parse::<std::net::IpAddr>().is_ok_and(|address| address.is_loopback())
        }
        // Programs that speak HTTP/1.0 name no host; browsers always do.
        None => true,
    }
}

/// Whether a browser says that its request comes from this server's own page; programs say nothing.
fn is_same_origin(headers: &HeaderMap) -> bool {
    let text = |name: &str| headers.get(name).and_then(|value| value.to_str().ok());
    match (text("sec-fetch-site"), text("origin"), text("host")) {
        (Some(site), ..) => matches!(site, "same-origin" | "none"),
        (None, None, _) => true,
        (None, Some(origin), Some(host)) => origin.split_once("://").is_some_and(|(_, rest)| rest == host),
        (None, Some(_), None) => false,
    }
}

/// Errors that are not ours (a route that is none, a query that cannot be read) become problems too.
async fn as_problem(app: &App, response: Response) -> Response {
    let status = response.status();
    let kind = response.headers().get(header::CONTENT_TYPE).and_then(|kind| kind.to_str().ok()).unwrap_or_default();
    if !(status.is_client_error() || status.is_server_error())
        || kind.starts_with("application/problem+json")
        || status == StatusCode::RANGE_NOT_SATISFIABLE
    {
        return response;
    }
    let (parts, body) = response.into_parts();
    let text = axum::body::to_bytes(body, 4096).await.unwrap_or_default();
    let said = String::from_utf8_lossy(&text).trim().to_owned();
    let sentence = match status {
        StatusCode::NOT_FOUND => "there is nothing here: /api/v1/openapi.json lists what there is".to_owned(),
        StatusCode::METHOD_NOT_ALLOWED => "this cannot be done here: /api/v1/openapi.json lists what can".to_owned(),
        StatusCode::PAYLOAD_TOO_LARGE => too_large(app),
        _ if said.is_empty() => "the request cannot be answered".to_owned(),
        _ => said,
    };
    let mut problem = Problem::new(status, sentence).into_response();
    if let Some(allow) = parts.headers.get(header::ALLOW) {
        problem.headers_mut().insert(header::ALLOW, allow.clone());
    }
    problem
}

/// The sentence about a body that is too long.
pub(crate) fn too_large(app: &App) -> String {
    format!(
        "the body is longer than the {} bytes that this server takes: send less at once, or start it with a larger --max-body",
        app.settings.max_body
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    fn headers(pairs: &[(&'static str, &'static str)]) -> HeaderMap {
        pairs.iter().map(|&(name, value)| (HeaderName::from_static(name), HeaderValue::from_static(value))).collect()
    }

    #[test]
    fn only_this_machines_own_names_are_answered_to() {
        let uri = Uri::from_static("/");
        for host in ["localhost", "LOCALHOST:80", "127.0.0.1:8080", "127.9.9.9", "[::1]:80"] {
            let named = HeaderMap::from_iter([(header::HOST, HeaderValue::from_static(host))]);
            assert!(names_this_machine(&named, &uri), "{host}");
        }
        for host in ["evil.example", "localhost.evil.example:80", "10.0.0.1", "[2001:db8::1]", "[::1"] {
            let named = HeaderMap::from_iter([(header::HOST, HeaderValue::from_static(host))]);
            assert!(!names_this_machine(&named, &uri), "{host}");
        }
    }

    #[test]
    fn other_sites_are_told_by_what_browsers_say() {
        assert!(is_same_origin(&headers(&[("host", "127.0.0.1:80")])));
        assert!(is_same_origin(&headers(&[("host", "127.0.0.1:80"), ("origin", "http://127.0.0.1:80")])));
        assert!(is_same_origin(&headers(&[("sec-fetch-site", "same-origin"), ("origin", "null")])));
        assert!(!is_same_origin(&headers(&[("host", "127.0.0.1:80"), ("origin", "http://127.0.0.1:81")])));
        assert!(!is_same_origin(&headers(&[("host", "127.0.0.1:80"), ("origin", "null")])));
        assert!(!is_same_origin(&headers(&[("sec-fetch-site", "cross-site")])));
        assert!(!is_same_origin(&headers(&[("sec-fetch-site", "same-site")])));
    }
}
