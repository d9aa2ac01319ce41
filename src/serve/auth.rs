//! Authentication: who may send requests, and who may change the store.
//!
//! Without a token the server answers only requests that name this machine in their `Host`, which defeats DNS rebinding.
//! With a token, programs send `Authorization: Bearer TOKEN`; a browser opens `/?token=TOKEN` once and gets a cookie.
//! Requests that change something are refused if a browser says that another site's page sent them.

use axum::extract::{Query, Request};
use axum::http::{HeaderMap, Method, StatusCode, Uri, header};
use axum::response::{IntoResponse, Redirect, Response};
use axum_extra::extract::CookieJar;
use axum_extra::extract::cookie::{Cookie, SameSite};
use axum_extra::headers::HeaderMapExt;
use axum_extra::headers::authorization::{Authorization, Bearer};

use super::problem::Problem;

const COOKIE: &str = "hlacdb";

/// What an admitted request gets.
pub(crate) enum Admission {
    /// It is passed on to its route.
    Proceed,
    /// It brought the token in its address: it is sent to the page with a cookie.
    SetCookie(Response),
}

/// Admits a request, or says why it is refused.
///
/// # Errors
/// 401 without the token, 403 for a foreign host name or another site's page.
pub(crate) fn admit(token: Option<&str>, request: &Request) -> Result<Admission, Problem> {
    let headers = request.headers();
    if token.is_none() && !names_this_machine(headers, request.uri()) {
        let detail = "this server answers this machine only: address it as 127.0.0.1 or localhost";
        return Err(Problem::new(StatusCode::FORBIDDEN, detail));
    }
    let changes = !matches!(*request.method(), Method::GET | Method::HEAD | Method::OPTIONS);
    if changes && !is_same_origin(headers) {
        let detail = "pages of other sites may not change anything here: use the page of this server, or a program";
        return Err(Problem::new(StatusCode::FORBIDDEN, detail));
    }
    let Some(token) = token else { return Ok(Admission::Proceed) };
    if request.uri().path() == "/" && token_in_query(request.uri()).is_some_and(|given| equal(&given, token)) {
        return Ok(Admission::SetCookie(redirect_with_cookie(token)));
    }
    let bearer = headers.typed_get::<Authorization<Bearer>>();
    let cookies = CookieJar::from_headers(headers);
    if bearer.is_some_and(|bearer| equal(bearer.token(), token))
        || cookies.get(COOKIE).is_some_and(|cookie| equal(cookie.value(), &cookie_value(token)))
    {
        return Ok(Admission::Proceed);
    }
    let detail = "a token is required: open the page as /?token=TOKEN, or send `Authorization: Bearer TOKEN`";
    Err(Problem::new(StatusCode::UNAUTHORIZED, detail))
}

/// Compares two secrets in constant time.
fn equal(a: &str, b: &str) -> bool {
    // Comparison of `blake3::Hash` takes constant time.
    blake3::hash(a.as_bytes()) == blake3::hash(b.as_bytes())
}

/// The value of the cookie: derived from the token, which may be used elsewhere too.
fn cookie_value(token: &str) -> String {
    let key = blake3::derive_key("hlacdb serve, cookie of the page", token.as_bytes());
    blake3::Hash::from_bytes(key).to_hex().to_string()
}

fn redirect_with_cookie(token: &str) -> Response {
    let cookie = Cookie::build((COOKIE, cookie_value(token))).path("/").http_only(true).same_site(SameSite::Strict);
    (CookieJar::new().add(cookie), Redirect::to("/")).into_response()
}

fn token_in_query(uri: &Uri) -> Option<String> {
    let query = Query::<Vec<(String, String)>>::try_from_uri(uri).ok()?;
    query.0.into_iter().find(|(key, _)| key == "token").map(|(_, value)| value)
}

/// The host that the request is addressed to, without its port; empty if what was sent is not a host.
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

/// A page whose own host name was made to resolve to this machine (DNS rebinding) would count as the same origin, but its
/// requests still carry that name.
fn names_this_machine(headers: &HeaderMap, uri: &Uri) -> bool {
    match host(headers, uri) {
        Some(host) => {
            host.eq_ignore_ascii_case("localhost")
                || host.parse::<std::net::IpAddr>().is_ok_and(|address| address.is_loopback())
        }
        // HTTP/1.0 programs may omit the host; browsers always send it.
        None => true,
    }
}

/// Whether a browser says that the request comes from this server's own page. Programs other than browsers say nothing and
/// are let in.
fn is_same_origin(headers: &HeaderMap) -> bool {
    let text = |name: &str| headers.get(name).and_then(|value| value.to_str().ok());
    match (text("sec-fetch-site"), text("origin"), text("host")) {
        (Some(site), ..) => matches!(site, "same-origin" | "none"),
        (None, None, _) => true,
        (None, Some(origin), Some(host)) => origin.split_once("://").is_some_and(|(_, rest)| rest == host),
        (None, Some(_), None) => false,
    }
}

#[cfg(test)]
mod tests {
    use axum::body::Body;
    use axum::http::{HeaderName, HeaderValue};

    use super::*;

    const TOKEN: &str = "0123456789abcdef0123";

    fn headers(pairs: &[(&'static str, &'static str)]) -> HeaderMap {
        pairs.iter().map(|&(name, value)| (HeaderName::from_static(name), HeaderValue::from_static(value))).collect()
    }

    #[test]
    fn only_names_of_this_machine_are_accepted() {
        let uri = Uri::from_static("/");
        for host in ["localhost", "LOCALHOST:80", "127.0.0.1:8080", "127.9.9.9", "[::1]:80"] {
            let headers = HeaderMap::from_iter([(header::HOST, HeaderValue::from_static(host))]);
            assert!(names_this_machine(&headers, &uri), "{host}");
        }
        for host in ["evil.example", "localhost.evil.example:80", "10.0.0.1", "[2001:db8::1]", "[::1"] {
            let headers = HeaderMap::from_iter([(header::HOST, HeaderValue::from_static(host))]);
            assert!(!names_this_machine(&headers, &uri), "{host}");
        }
    }

    #[test]
    fn requests_of_other_sites_are_recognised() {
        assert!(is_same_origin(&headers(&[("host", "127.0.0.1:80")])));
        assert!(is_same_origin(&headers(&[("host", "127.0.0.1:80"), ("origin", "http://127.0.0.1:80")])));
        assert!(is_same_origin(&headers(&[("sec-fetch-site", "same-origin"), ("origin", "null")])));
        assert!(!is_same_origin(&headers(&[("host", "127.0.0.1:80"), ("origin", "http://127.0.0.1:81")])));
        assert!(!is_same_origin(&headers(&[("host", "127.0.0.1:80"), ("origin", "null")])));
        assert!(!is_same_origin(&headers(&[("sec-fetch-site", "cross-site")])));
        assert!(!is_same_origin(&headers(&[("sec-fetch-site", "same-site")])));
    }

    #[test]
    fn a_cookie_is_derived_from_the_token_and_admits() {
        let value = cookie_value(TOKEN);
        assert!(value.len() == 64 && !value.contains(TOKEN));
        let with = |name: &str, value: String| {
            let request = Request::builder().uri("/api/v1/health").header(name, value).body(Body::empty()).unwrap();
            matches!(admit(Some(TOKEN), &request), Ok(Admission::Proceed))
        };
        assert!(with("cookie", format!("a=b; hlacdb={value}; c")));
        assert!(!with("cookie", format!("hlacdb={TOKEN}")) && !with("cookie", format!("other={value}")));
        assert!(with("authorization", format!("BEARER {TOKEN}")) && !with("authorization", format!("Bearer {value}")));
    }
}
