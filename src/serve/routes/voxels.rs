//! Voxels as bytes, for the viewer.

use std::ops::Range;
use std::sync::Arc;

use axum::body::Bytes;
use axum::extract::{Path, Query, State};
use axum::http::{HeaderMap, HeaderName, HeaderValue, StatusCode, header};
use axum::response::{IntoResponse, Response};
use serde::Deserialize;

use crate::serve::problem::{Problem, ProblemDocument};
use crate::serve::reply::{self, CachePolicy};
use crate::serve::state::App;
use crate::serve::volume_source::VolumeSource;
use crate::volume::Volume;

#[derive(Deserialize, utoipa::IntoParams)]
#[into_params(parameter_in = Query)]
pub(crate) struct VoxelsQuery {
    /// The longest side of the result, at least 8. Longer axes are averaged over whole blocks, each axis by its own factor:
    /// the proportions are those of the shape of the texture, not of `X-Shape`.
    edge: Option<usize>,
}

/// The voxels of a texture: one byte per sample, X fastest, then Y, then Z; the channels of a voxel are adjacent
#[utoipa::path(get, path = "/textures/{id}/voxels", tag = "pictures", params(("id" = u64, Path), VoxelsQuery),
    responses(
        (status = 200, content_type = "application/octet-stream",
            headers(("X-Shape" = String, description = "Z,Y,X"), ("X-Channels" = u8, description = "1 or 3"))),
        (status = 206, content_type = "application/octet-stream"), (status = 304), (status = 404, body = ProblemDocument), (status = 416)))]
pub(crate) async fn voxels(
    State(app): State<Arc<App>>,
    Path(id): Path<u64>,
    Query(query): Query<VoxelsQuery>,
    headers: HeaderMap,
) -> Result<Response, Problem> {
    app.heavy(move |app| send(app, &headers, &VolumeSource::texture(app, id)?, &query)).await
}

/// The voxels of an upload, in the same order as those of a texture
#[utoipa::path(get, path = "/uploads/{token}/voxels", tag = "pictures", params(("token" = String, Path), VoxelsQuery),
    responses((status = 200, content_type = "application/octet-stream"), (status = 206, content_type = "application/octet-stream"),
        (status = 304), (status = 404, body = ProblemDocument), (status = 416)))]
pub(crate) async fn upload_voxels(
    State(app): State<Arc<App>>,
    Path(token): Path<String>,
    Query(query): Query<VoxelsQuery>,
    headers: HeaderMap,
) -> Result<Response, Problem> {
    app.heavy(move |app| send(app, &headers, &VolumeSource::upload(app, &token)?, &query)).await
}

fn send(app: &App, headers: &HeaderMap, source: &VolumeSource, query: &VoxelsQuery) -> Result<Response, Problem> {
    if let Some(edge) = query.edge.filter(|&edge| edge < 8) {
        return Err(Problem::bad_request(format!("edge must be at least 8 voxels (got {edge})")));
    }
    let tag = reply::strong_entity_tag(&[&source.content, format!("voxels {:?}", query.edge).as_bytes()]);
    let mut response = if reply::client_has(headers, &tag) {
        StatusCode::NOT_MODIFIED.into_response()
    } else {
        let volume = source.volume(app)?;
        let small = query.edge.filter(|&edge| volume.shape().iter().any(|&side| side > edge));
        let volume = small.map_or(volume.clone(), |edge| Arc::new(volume.shrunk_to(edge)));
        // A range is of use only if it fits the ranges that the client has.
        let same = headers.get(header::IF_RANGE).is_none_or(|range| range.as_bytes() == tag.as_bytes());
        voxels_or_range(volume, headers.get(header::RANGE).filter(|_| same))
    };
    reply::set_tag(&mut response, &tag, CachePolicy::OneHour);
    response.headers_mut().insert(header::ACCEPT_RANGES, HeaderValue::from_static("bytes"));
    Ok(response)
}

/// All voxels, or the requested range of their bytes.
fn voxels_or_range(volume: Arc<Volume>, range: Option<&HeaderValue>) -> Response {
    let (length, [z, y, x], channels) = (volume.voxels().len(), volume.shape(), volume.channels());
    let bytes = Bytes::from_owner(Voxels(volume));
    let shape = [
        (HeaderName::from_static("x-shape"), format!("{z},{y},{x}")),
        (HeaderName::from_static("x-channels"), channels.to_string()),
        (header::CONTENT_TYPE, "application/octet-stream".to_owned()),
    ];
    match range.and_then(|range| range.to_str().ok()).and_then(|range| parse_range(range, length)) {
        None => (shape, bytes).into_response(),
        Some(None) => {
            let headers = [(header::CONTENT_RANGE, format!("bytes */{length}"))];
            (StatusCode::RANGE_NOT_SATISFIABLE, headers).into_response()
        }
        Some(Some(range)) => {
            let headers = [(header::CONTENT_RANGE, format!("bytes {}-{}/{length}", range.start, range.end - 1))];
            (StatusCode::PARTIAL_CONTENT, shape, headers, bytes.slice(range)).into_response()
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

/// The range of a `Range` header (RFC 9110): `None` if it is not a single range of bytes, in which case everything is sent;
/// `Some(None)` if it lies beyond the end.
fn parse_range(header: &str, length: usize) -> Option<Option<Range<usize>>> {
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
    fn ranges_are_parsed_as_the_standard_says() {
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
            assert_eq!(parse_range(header, 100), expected, "{header}");
        }
    }
}
