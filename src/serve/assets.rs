//! The page's own files: part of the program, or read from a folder for who works on them.

use std::path::{Component, Path};
use std::sync::Arc;

use axum::body::Bytes;
use axum::extract::State;
use axum::http::{HeaderMap, HeaderValue, Method, StatusCode, Uri, header};
use axum::response::{IntoResponse, Response};
use rust_embed::Embed;

use super::problem::Problem;
use super::reply::{is_known, tag_of};
use super::state::App;

/// The page as it was when the program was built; in debug builds, as it is now.
#[derive(Embed)]
#[folder = "src/serve/page/"]
struct Page;

/// The page itself; every address that is no file's belongs to it, for it keeps what it shows in its address.
const INDEX: &str = "index.html";

/// Whatever is not the API.
pub(crate) async fn asset(
    State(app): State<Arc<App>>,
    method: Method,
    uri: Uri,
    headers: HeaderMap,
) -> Result<Response, Problem> {
    let path = uri.path().trim_start_matches('/');
    if path.starts_with("api/") || !matches!(method, Method::GET | Method::HEAD) {
        return Ok(StatusCode::NOT_FOUND.into_response());
    }
    let name = if Path::new(path).extension().is_none() { INDEX } else { path };
    let folder = app.settings.page.clone();
    let wanted = name.to_owned();
    let found = tokio::task::spawn_blocking(move || content(folder.as_deref(), &wanted)).await;
    let Ok(Some(bytes)) = found else {
        return Err(Problem::not_found(format!("the page has no file /{}", name.escape_default())));
    };
    let tag = tag_of(&[&bytes]);
    let mut response =
        if is_known(&headers, &tag) { StatusCode::NOT_MODIFIED.into_response() } else { bytes.into_response() };
    let kind = mime_guess::from_path(name).first_or_octet_stream();
    let kind = if kind.type_() == "text" { format!("{kind}; charset=utf-8") } else { kind.to_string() };
    for (name, value) in
        [(header::CONTENT_TYPE, kind.as_str()), (header::ETAG, &tag), (header::CACHE_CONTROL, "no-cache")]
    {
        if let Ok(value) = HeaderValue::from_str(value) {
            response.headers_mut().insert(name, value);
        }
    }
    Ok(response)
}

fn content(folder: Option<&Path>, name: &str) -> Option<Bytes> {
    // No name leads out of the folder.
    if !Path::new(name).components().all(|component| matches!(component, Component::Normal(_))) {
        return None;
    }
    match folder {
        Some(folder) => std::fs::read(folder.join(name)).ok().map(Bytes::from),
        None => Page::get(name).map(|file| match file.data {
            std::borrow::Cow::Borrowed(bytes) => Bytes::from_static(bytes),
            std::borrow::Cow::Owned(bytes) => Bytes::from(bytes),
        }),
    }
}
