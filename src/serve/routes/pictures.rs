//! Pictures: slices and thumbnails of textures and uploads.

use std::sync::Arc;

use axum::body::Bytes;
use axum::extract::{Path, Query, State};
use axum::http::HeaderMap;
use axum::response::Response;
use serde::Deserialize;

use crate::render::{self, ContactSheetOptions, PngEffort, RenderError, SliceAxis, SliceImageOptions};
use crate::serve::problem::{Problem, ProblemDocument};
use crate::serve::reply::{self, CachePolicy};
use crate::serve::state::App;
use crate::serve::volume_source::VolumeSource;
use crate::volume::Volume;

/// A picture of a volume, drawn once: `parameters` are what it depends on besides the content of the volume.
fn picture(
    app: &App,
    headers: &HeaderMap,
    source: &VolumeSource,
    parameters: &str,
    draw: impl FnOnce(&Volume) -> Result<Vec<u8>, Problem>,
) -> Result<Response, Problem> {
    let tag = reply::entity_tag(&[&source.content, parameters.as_bytes()]);
    reply::tagged(headers, &tag, CachePolicy::OneHour, reply::PNG, || {
        app.cached(&tag, || Ok(Bytes::from(draw(&*source.volume(app)?)?)))
    })
}

fn axis(text: Option<&str>) -> Result<SliceAxis, Problem> {
    text.unwrap_or("z").parse().map_err(|error: render::ParseSliceAxisError| Problem::bad_request(error.to_string()))
}

fn encode(encoded: Result<Vec<u8>, RenderError>) -> Result<Vec<u8>, Problem> {
    encoded.map_err(|error| {
        tracing::error!(%error, "a picture cannot be encoded");
        Problem::internal()
    })
}

/// Checks the pixels per voxel.
fn scale(scale: Option<u32>) -> Result<u32, Problem> {
    match scale.unwrap_or(1) {
        scale @ 1..=16 => Ok(scale),
        other => Err(Problem::bad_request(format!("scale must be 1 to 16 pixels per voxel (got {other})"))),
    }
}

#[derive(Deserialize, utoipa::IntoParams)]
#[into_params(parameter_in = Query)]
pub(crate) struct SlicesQuery {
    /// The axis across which slices are taken: `z` (default), `y` or `x`.
    axis: Option<String>,
    /// Slices per row; default 8.
    columns: Option<usize>,
    /// The greatest number of slices, evenly spaced; default all.
    slices: Option<usize>,
    /// Pixels per voxel, 1 to 16; default 1.
    scale: Option<u32>,
    /// The longest side of a slice in pixels: larger slices are averaged down, smaller ones enlarged by whole factors.
    /// Takes the place of `scale`.
    pixels: Option<u32>,
    /// 0 omits the transparent line between slices.
    gap: Option<u8>,
    /// 1 draws a contact sheet with the name below the slices, as `hlacdb sheet` does.
    captions: Option<u8>,
}

/// The slices of a texture as one picture
#[utoipa::path(get, path = "/textures/{id}/slices.png", tag = "pictures", params(("id" = u64, Path), SlicesQuery),
    responses((status = 200, content_type = "image/png"), (status = 304), (status = 404, body = ProblemDocument)))]
pub(crate) async fn slices(
    State(app): State<Arc<App>>,
    Path(id): Path<u64>,
    Query(query): Query<SlicesQuery>,
    headers: HeaderMap,
) -> Result<Response, Problem> {
    let layout = layout(&query)?;
    app.heavy(move |app| {
        let source = VolumeSource::texture(app, id)?;
        if query.captions == Some(1) {
            let texture = app.database.texture(id)?;
            let what = format!("sheet {layout:?} {id} {:?} {:?}", texture.name, texture.tags);
            return picture(app, &headers, &source, &what, |volume| {
                let (columns, slices, axis) = (layout.columns, layout.slices.min(64), layout.axis);
                let options = ContactSheetOptions::new().columns(columns).slices(slices).axis(axis);
                encode(render::texture_sheet(&texture, volume, &options).encode_png(PngEffort::Small))
            });
        }
        draw_slices(app, &headers, &source, &query, layout)
    })
    .await
}

fn layout(query: &SlicesQuery) -> Result<SliceImageOptions, Problem> {
    scale(query.scale)?;
    if query.columns == Some(0) || query.slices == Some(0) || query.pixels == Some(0) {
        return Err(Problem::bad_request("columns, slices and pixels must be at least 1"));
    }
    let default = SliceImageOptions::new();
    Ok(default
        .axis(axis(query.axis.as_deref())?)
        .columns(query.columns.unwrap_or(default.columns).min(1024))
        .slices(query.slices.unwrap_or(default.slices))
        .slice_pixels(query.pixels.unwrap_or(default.slice_pixels).min(4096))
        .gap(query.gap != Some(0)))
}

/// The slices without captions.
fn draw_slices(
    app: &App,
    headers: &HeaderMap,
    source: &VolumeSource,
    query: &SlicesQuery,
    layout: SliceImageOptions,
) -> Result<Response, Problem> {
    let (scale, pixels) = (scale(query.scale)?, query.pixels);
    let what = format!("slices {layout:?} {scale} {pixels:?}");
    picture(app, headers, source, &what, |volume| {
        let longest = volume.shape().into_iter().max().unwrap_or(1) as u32;
        let slice_pixels = pixels.map_or(longest.saturating_mul(scale).min(4096), |_| layout.slice_pixels);
        encode(render::slice_image(volume, &layout.slice_pixels(slice_pixels)).encode_png(PngEffort::Fast))
    })
}

#[derive(Deserialize, utoipa::IntoParams)]
#[into_params(parameter_in = Query)]
pub(crate) struct SliceQuery {
    /// The axis across which the slice is taken: `z` (default), `y` or `x`.
    axis: Option<String>,
    /// The index of the slice, from 0; default the middle slice.
    index: Option<usize>,
    /// Pixels per voxel, 1 to 16; default 1.
    scale: Option<u32>,
}

/// One slice of a texture
#[utoipa::path(get, path = "/textures/{id}/slice.png", tag = "pictures", params(("id" = u64, Path), SliceQuery),
    responses((status = 200, content_type = "image/png"), (status = 304), (status = 404, body = ProblemDocument)))]
pub(crate) async fn slice(
    State(app): State<Arc<App>>,
    Path(id): Path<u64>,
    Query(query): Query<SliceQuery>,
    headers: HeaderMap,
) -> Result<Response, Problem> {
    app.heavy(move |app| draw_slice(app, &headers, &VolumeSource::texture(app, id)?, &query)).await
}

fn draw_slice(app: &App, headers: &HeaderMap, source: &VolumeSource, query: &SliceQuery) -> Result<Response, Problem> {
    let (axis, scale, index) = (axis(query.axis.as_deref())?, scale(query.scale)?, query.index);
    picture(app, headers, source, &format!("slice {axis} {index:?} {scale}"), |volume| {
        let [z, y, x] = volume.shape();
        let length = axis.slices([z, y, x]);
        let index = index.unwrap_or(length / 2);
        let pixels = (z.max(y).max(x) as u32).saturating_mul(scale);
        let out_of_range =
            || Problem::not_found(format!("there is no slice {index} along {axis}: the last is {}", length - 1));
        encode(render::slice(volume, axis, index, pixels).ok_or_else(out_of_range)?.encode_png(PngEffort::Fast))
    })
}

#[derive(Deserialize, utoipa::IntoParams)]
#[into_params(parameter_in = Query)]
pub(crate) struct ThumbnailQuery {
    /// The side of the thumbnail in pixels, 1 to 1024; default 96.
    size: Option<u32>,
}

/// A square thumbnail of a texture: its middle slice
#[utoipa::path(get, path = "/textures/{id}/thumbnail.png", tag = "pictures", params(("id" = u64, Path), ThumbnailQuery),
    responses((status = 200, content_type = "image/png"), (status = 304), (status = 404, body = ProblemDocument)))]
pub(crate) async fn thumbnail(
    State(app): State<Arc<App>>,
    Path(id): Path<u64>,
    Query(query): Query<ThumbnailQuery>,
    headers: HeaderMap,
) -> Result<Response, Problem> {
    app.heavy(move |app| draw_thumbnail(app, &headers, &VolumeSource::texture(app, id)?, &query)).await
}

fn draw_thumbnail(
    app: &App,
    headers: &HeaderMap,
    source: &VolumeSource,
    query: &ThumbnailQuery,
) -> Result<Response, Problem> {
    let size = match query.size.unwrap_or(96) {
        size @ 1..=1024 => size,
        other => {
            return Err(Problem::bad_request(format!(
                "the size of a thumbnail must be 1 to 1024 pixels (got {other})"
            )));
        }
    };
    picture(app, headers, source, &format!("thumbnail {size}"), |volume| {
        encode(render::thumbnail(volume, size).encode_png(PngEffort::Fast))
    })
}

/// The slices of an upload as one picture
#[utoipa::path(get, path = "/uploads/{token}/slices.png", tag = "pictures", params(("token" = String, Path), SlicesQuery),
    responses((status = 200, content_type = "image/png"), (status = 304), (status = 404, body = ProblemDocument)))]
pub(crate) async fn upload_slices(
    State(app): State<Arc<App>>,
    Path(token): Path<String>,
    Query(query): Query<SlicesQuery>,
    headers: HeaderMap,
) -> Result<Response, Problem> {
    let layout = layout(&query)?;
    app.heavy(move |app| draw_slices(app, &headers, &VolumeSource::upload(app, &token)?, &query, layout)).await
}

/// One slice of an upload
#[utoipa::path(get, path = "/uploads/{token}/slice.png", tag = "pictures", params(("token" = String, Path), SliceQuery),
    responses((status = 200, content_type = "image/png"), (status = 304), (status = 404, body = ProblemDocument)))]
pub(crate) async fn upload_slice(
    State(app): State<Arc<App>>,
    Path(token): Path<String>,
    Query(query): Query<SliceQuery>,
    headers: HeaderMap,
) -> Result<Response, Problem> {
    app.heavy(move |app| draw_slice(app, &headers, &VolumeSource::upload(app, &token)?, &query)).await
}

/// A square thumbnail of an upload: its middle slice
#[utoipa::path(get, path = "/uploads/{token}/thumbnail.png", tag = "pictures",
    params(("token" = String, Path), ThumbnailQuery),
    responses((status = 200, content_type = "image/png"), (status = 304), (status = 404, body = ProblemDocument)))]
pub(crate) async fn upload_thumbnail(
    State(app): State<Arc<App>>,
    Path(token): Path<String>,
    Query(query): Query<ThumbnailQuery>,
    headers: HeaderMap,
) -> Result<Response, Problem> {
    app.heavy(move |app| draw_thumbnail(app, &headers, &VolumeSource::upload(app, &token)?, &query)).await
}
