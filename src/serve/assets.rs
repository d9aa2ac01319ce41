//! The files of the page: compiled into the program, or read from a folder during development.

use std::path::{Component, Path};
use std::sync::Arc;

use axum::body::Bytes;
use axum::extract::State;
use axum::http::{HeaderMap, HeaderValue, Method, StatusCode, Uri, header};
use axum::response::{IntoResponse, Response};
use rust_embed::Embed;

use super::problem::Problem;
use super::reply::{self, CachePolicy};
use super::state::App;

/// The files as they were when the program was built; debug builds read them from the source tree.
#[derive(Embed)]
#[folder = "src/serve/page/"]
struct Page;

/// The page. It is sent for every address without a file extension, because the page keeps its state in the address.
const INDEX: &str = "index.html";

/// Answers every request that no route of the API answers.
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
    let folder = app.options.page.clone();
    let wanted = name.to_owned();
    let found = tokio::task::spawn_blocking(move || content(folder.as_deref(), &wanted)).await;
    let Ok(Some(bytes)) = found else {
        return Err(Problem::not_found(format!("the page has no file /{}", name.escape_default())));
    };
    let tag = reply::entity_tag(&[&bytes]);
    let mut response = if reply::client_has(&headers, &tag) {
        StatusCode::NOT_MODIFIED.into_response()
    } else {
        bytes.into_response()
    };
    let media_type = mime_guess::from_path(name).first_or_octet_stream();
    let media_type =
        if media_type.type_() == "text" { format!("{media_type}; charset=utf-8") } else { media_type.to_string() };
    if let Ok(value) = HeaderValue::from_str(&media_type) {
        response.headers_mut().insert(header::CONTENT_TYPE, value);
    }
    reply::set_tag(&mut response, &tag, CachePolicy::Revalidate);
    Ok(response)
}

fn content(folder: Option<&Path>, name: &str) -> Option<Bytes> {
    // No name may lead out of the folder.
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
