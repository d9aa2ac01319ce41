//! Responses with entity tags, so that a browser fetches each content once.

use axum::body::Bytes;
use axum::http::{HeaderMap, HeaderValue, StatusCode, header};
use axum::response::{IntoResponse, Response};
use serde::Serialize;

use super::problem::Problem;

/// The media type of JSON responses.
pub(crate) const JSON: &str = "application/json";
/// The media type of pictures.
pub(crate) const PNG: &str = "image/png";

/// How long a browser may use a response without asking again.
#[derive(Clone, Copy)]
pub(crate) enum CachePolicy {
    /// Not at all: it asks each time whether the response has changed.
    Revalidate,
    /// One hour. A content never changes, but the texture with an id may be removed.
    OneHour,
}

impl CachePolicy {
    pub(crate) fn header(self) -> HeaderValue {
        HeaderValue::from_static(match self {
            Self::Revalidate => "private, no-cache",
            Self::OneHour => "private, max-age=3600",
        })
    }
}

/// The entity tag of a response that is determined by these parts. The tag is weak, because the response may be compressed on its
/// way.
pub(crate) fn entity_tag(parts: &[&[u8]]) -> String {
    format!("W/{}", strong_entity_tag(parts))
}

/// The same for a response that is never compressed, so that ranges of it can be combined.
pub(crate) fn strong_entity_tag(parts: &[&[u8]]) -> String {
    let mut hasher = blake3::Hasher::new();
    for part in parts {
        hasher.update(&(part.len() as u64).to_le_bytes()).update(part);
    }
    let hash = hasher.finalize().to_hex();
    format!("\"{}\"", hash.get(..32).unwrap_or_default())
}

/// Whether the client already has a response with this tag (`If-None-Match`, compared weakly).
pub(crate) fn client_has(headers: &HeaderMap, tag: &str) -> bool {
    let matches = |value: &HeaderValue| {
        let Ok(value) = value.to_str() else { return false };
        let bare = tag.trim_start_matches("W/");
        value.split(',').map(str::trim).any(|known| known == "*" || known.trim_start_matches("W/") == bare)
    };
    headers.get_all(header::IF_NONE_MATCH).iter().any(matches)
}

/// A response with its tag. If the client has it already, `body` is not called and the response is `304 Not Modified`.
pub(crate) fn tagged(
    headers: &HeaderMap,
    tag: &str,
    policy: CachePolicy,
    media_type: &'static str,
    body: impl FnOnce() -> Result<Bytes, Problem>,
) -> Result<Response, Problem> {
    let mut response = if client_has(headers, tag) {
        StatusCode::NOT_MODIFIED.into_response()
    } else {
        let mut response = body()?.into_response();
        response.headers_mut().insert(header::CONTENT_TYPE, HeaderValue::from_static(media_type));
        response
    };
    set_tag(&mut response, tag, policy);
    Ok(response)
}

/// Adds the entity tag and cache policy to a response.
pub(crate) fn set_tag(response: &mut Response, tag: &str, policy: CachePolicy) {
    let headers = response.headers_mut();
    headers.insert(header::CACHE_CONTROL, policy.header());
    if let Ok(tag) = HeaderValue::from_str(tag) {
        headers.insert(header::ETAG, tag);
    }
}

/// A value as JSON bytes.
pub(crate) fn json_bytes(value: &impl Serialize) -> Result<Bytes, Problem> {
    let bytes = serde_json::to_vec(value).map_err(|error| {
        tracing::error!(%error, "a response cannot be written as JSON");
        Problem::internal()
    })?;
    Ok(bytes.into())
}

/// A JSON response that is not cached.
pub(crate) fn json(value: &impl Serialize) -> Result<Response, Problem> {
    let headers = [(header::CONTENT_TYPE, JSON), (header::CACHE_CONTROL, "no-store")];
    Ok((headers, json_bytes(value)?).into_response())
}
