//! Answers that a browser may keep: each with a tag of its content, so that it is sent once.

use axum::body::Bytes;
use axum::http::{HeaderMap, HeaderValue, StatusCode, header};
use axum::response::{IntoResponse, Response};
use serde::Serialize;

use super::problem::Problem;

/// How long an answer may be used without asking.
#[derive(Clone, Copy)]
pub(crate) enum Keep {
    /// Ask each time whether it has changed.
    Check,
    /// What is shown of a content never changes, but the texture of an id may be removed.
    Hour,
}

impl Keep {
    fn header(self) -> HeaderValue {
        HeaderValue::from_static(match self {
            Self::Check => "private, no-cache",
            Self::Hour => "private, max-age=3600",
        })
    }
}

/// The entity tag of an answer that is made of these parts: weak, since it may be compressed on its way.
pub(crate) fn tag_of(parts: &[&[u8]]) -> String {
    let mut hasher = blake3::Hasher::new();
    for part in parts {
        hasher.update(&(part.len() as u64).to_le_bytes()).update(part);
    }
    let hash = hasher.finalize().to_hex();
    format!("W/\"{}\"", hash.get(..32).unwrap_or_default())
}

/// True where the caller has an answer with this tag already.
pub(crate) fn is_known(headers: &HeaderMap, tag: &str) -> bool {
    let known = |value: &HeaderValue| {
        let Ok(value) = value.to_str() else { return false };
        let bare = tag.trim_start_matches("W/");
        value.split(',').map(str::trim).any(|known| known == "*" || known.trim_start_matches("W/") == bare)
    };
    headers.get_all(header::IF_NONE_MATCH).iter().any(known)
}

/// An answer with its tag; `304 Not Modified` where the caller has it already, in which case `body` is not asked for.
pub(crate) fn tagged(
    headers: &HeaderMap,
    tag: &str,
    keep: Keep,
    kind: &'static str,
    body: impl FnOnce() -> Result<Bytes, Problem>,
) -> Result<Response, Problem> {
    let mut response = if is_known(headers, tag) {
        StatusCode::NOT_MODIFIED.into_response()
    } else {
        let mut response = body()?.into_response();
        response.headers_mut().insert(header::CONTENT_TYPE, HeaderValue::from_static(kind));
        response
    };
    let headers = response.headers_mut();
    headers.insert(header::CACHE_CONTROL, keep.header());
    if let Ok(tag) = HeaderValue::from_str(tag) {
        headers.insert(header::ETAG, tag);
    }
    Ok(response)
}

/// A JSON document as bytes.
pub(crate) fn document(value: &impl Serialize) -> Result<Bytes, Problem> {
    let bytes = serde_json::to_vec(value).map_err(|error| {
        tracing::error!(%error, "an answer cannot be written as JSON");
        Problem::internal()
    })?;
    Ok(bytes.into())
}

/// A JSON answer that is made anew each time.
pub(crate) fn json(value: &impl Serialize) -> Result<Response, Problem> {
    let headers = [(header::CONTENT_TYPE, JSON), (header::CACHE_CONTROL, "no-store")];
    Ok((headers, document(value)?).into_response())
}

/// The kind of JSON answers.
pub(crate) const JSON: &str = "application/json";
/// The kind of pictures.
pub(crate) const PNG: &str = "image/png";
