//! Voxels as they are, for the viewer.

use std::ops::Range;
use std::sync::Arc;

use axum::body::Bytes;
use axum::extract::{Path, Query, State};
use axum::http::{HeaderMap, HeaderName, HeaderValue, StatusCode, header};
use axum::response::{IntoResponse, Response};
use serde::Deserialize;

use super::pictures::Shown;
use crate::serve::problem::Problem;
use crate::serve::reply;
use crate::serve::state::App;
use crate::volume::Volume;

#[derive(Deserialize, utoipa::IntoParams)]
#[into_params(parameter_in = Query)]
pub(crate) struct VoxelsQuery {
    /// No side longer than this: longer axes are averaged by whole blocks, each by its own factor, so that proportions are
    /// those of the texture's shape, not of `X-Shape`. 8 or more.
    edge: Option<usize>,
}

/// The voxels of a texture: one byte each, X fastest, then Y, then Z, channels innermost
#[utoipa::path(get, path = "/textures/{id}/voxels", tag = "pictures", params(("id" = u64, Path), VoxelsQuery),
    responses(
        (status = 200, content_type = "application/octet-stream",
            headers(("X-Shape" = String, description = "Z,Y,X"), ("X-Channels" = u8, description = "1 or 3"))),
        (status = 206, content_type = "application/octet-stream"), (status = 304), (status = 404, body = Problem), (status = 416)))]
pub(crate) async fn voxels(
    State(app): State<Arc<App>>,
    Path(id): Path<u64>,
    Query(query): Query<VoxelsQuery>,
    headers: HeaderMap,
) -> Result<Response, Problem> {
    app.heavy(move |app| send(app, &headers, &Shown::texture(app, id)?, &query)).await
}

/// The voxels of an upload, as those of a texture
#[utoipa::path(get, path = "/uploads/{token}/voxels", tag = "pictures", params(("token" = String, Path), VoxelsQuery),
    responses((status = 200, content_type = "application/octet-stream"), (status = 206, content_type = "application/octet-stream"),
        (status = 304), (status = 404, body = Problem), (status = 416)))]
pub(crate) async fn upload_voxels(
    State(app): State<Arc<App>>,
    Path(token): Path<String>,
    Query(query): Query<VoxelsQuery>,
    headers: HeaderMap,
) -> Result<Response, Problem> {
    app.heavy(move |app| send(app, &headers, &Shown::upload(app, &token)?, &query)).await
}

fn send(app: &App, headers: &HeaderMap, shown: &Shown, query: &VoxelsQuery) -> Result<Response, Problem> {
    if let Some(edge) = query.edge.filter(|&edge| edge < 8) {
        return Err(Problem::bad_request(format!("an edge of {edge} voxels shows nothing: use 8 or more")));
    }
    // Strong: the bytes are sent as they are, and parts of them may be put together.
    let tag = reply::tag_of(&[&shown.content, format!("voxels {:?}", query.edge).as_bytes()]).replace("W/", "");
    let mut response = if reply::is_known(headers, &tag) {
        StatusCode::NOT_MODIFIED.into_response()
    } else {
        let volume = shown.volume(app)?;
        let small = query.edge.filter(|&edge| volume.shape().iter().any(|&side| side > edge));
        let volume = small.map_or(volume.clone(), |edge| Arc::new(volume.shrunk_to(edge)));
        // A part is only of use where it fits the parts that the caller has.
        let same = headers.get(header::IF_RANGE).is_none_or(|range| range.as_bytes() == tag.as_bytes());
        part(volume, headers.get(header::RANGE).filter(|_| same))
    };
    let headers = response.headers_mut();
    headers.insert(header::CACHE_CONTROL, HeaderValue::from_static("private, max-age=3600"));
    headers.insert(header::ACCEPT_RANGES, HeaderValue::from_static("bytes"));
    if let Ok(tag) = HeaderValue::from_str(&tag) {
        headers.insert(header::ETAG, tag);
    }
    Ok(response)
}

/// The voxels, or the range of them that is asked for.
fn part(volume: Arc<Volume>, range: Option<&HeaderValue>) -> Response {
    let (length, [z, y, x], channels) = (volume.voxels().len(), volume.shape(), volume.channels());
    let bytes = Bytes::from_owner(Voxels(volume));
    let shape = [
        (HeaderName::from_static("x-shape"), format!("{z},{y},{x}")),
        (HeaderName::from_static("x-channels"), channels.to_string()),
        (header::CONTENT_TYPE, "application/octet-stream".to_owned()),
    ];
    match range.and_then(|range| range.to_str().ok()).and_then(|range| parse(range, length)) {
        None => (shape, bytes).into_response(),
        Some(None) => {
            let whole = [(header::CONTENT_RANGE, format!("bytes */{length}"))];
            (StatusCode::RANGE_NOT_SATISFIABLE, whole).into_response()
        }
        Some(Some(range)) => {
            let place = [(header::CONTENT_RANGE, format!("bytes {}-{}/{length}", range.start, range.end - 1))];
            (StatusCode::PARTIAL_CONTENT, shape, place, bytes.slice(range)).into_response()
        }
    }
}

/// The bytes of a volume, sent without a copy.
struct Voxels(Arc<Volume>);

impl AsRef<[u8]> for Voxels {
    fn as_ref(&self) -> &[u8] {
        self.0.voxels()
    }
}

/// The range that a header asks for: `None` where it is not one range of bytes (all is sent then, as the standard has it),
/// `Some(None)` where it lies beyond the end.
fn parse(header: &str, length: usize) -> Option<Option<Range<usize>>> {
    let (first, last) = header.strip_prefix("bytes=")?.split_once('-')?;
    let number = |text: &str| text.trim().parse::<usize>().ok();
    let range = match (first.trim(), last.trim()) {
        ("", last) => length.saturating_sub(number(last)?)..length,
        (first, "") => number(first)?..length,
        (first, last) => {
            let (first, last) = (number(first)?, number(last)?);
            if last < first {
                return None;
            }
            first..last.saturating_add(1).min(length)
        }
    };
    Some((range.start < range.end).then_some(range))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ranges_are_read_as_the_standard_has_them() {
        for (header, expected) in [
            ("bytes=0-9", Some(Some(0..10))),
            ("bytes=90-", Some(Some(90..100))),
            ("bytes=-10", Some(Some(90..100))),
            ("bytes=-1000", Some(Some(0..100))),
            ("bytes=99-1000", Some(Some(99..100))),
            ("bytes=100-", Some(None)),
            ("bytes=-0", Some(None)),
            ("bytes=5-4", None),
            ("bytes=0-1,3-4", None),
            ("lines=0-1", None),
            ("bytes=a-b", None),
            ("bytes=0-99999999999999999999999", None),
        ] {
            assert_eq!(parse(header, 100), expected, "{header}");
        }
    }
}
