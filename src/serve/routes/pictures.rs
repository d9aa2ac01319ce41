//! Slices and thumbnails.

use std::sync::Arc;

use axum::body::Bytes;
use axum::extract::{Path, Query, State};
use axum::http::HeaderMap;
use axum::response::Response;
use serde::Deserialize;

use crate::ContentHash;
use crate::render::{self, ContactSheetOptions, PngEffort, RenderError, SliceAxis, SliceImageOptions};
use crate::serve::problem::Problem;
use crate::serve::reply::{self, Keep};
use crate::serve::state::App;
use crate::volume::Volume;

/// What is shown: its content, by which answers are known again, and where its voxels are.
pub(crate) struct Shown {
    pub(crate) content: [u8; 32],
    subject: Subject,
}

enum Subject {
    Texture(u64),
    Upload(Arc<Volume>),
}

impl Shown {
    /// A texture of the store, whose voxels must be kept.
    pub(crate) fn texture(app: &App, id: u64) -> Result<Self, Problem> {
        let catalogue = app.catalogue()?;
        let (voxels, content) = match catalogue.get(id) {
            Some(texture) => (texture.voxels, texture.content),
            // The list may be some moments old.
            None => {
                let texture = app.database.texture(id)?;
                (texture.stored_bytes.is_some(), texture.content)
            }
        };
        match content {
            Some(ContentHash(content)) if voxels => Ok(Self { content, subject: Subject::Texture(id) }),
            _ => Err(without_voxels(id)),
        }
    }

    /// A volume that was asked with.
    pub(crate) fn upload(app: &App, token: &str) -> Result<Self, Problem> {
        let gone = || Problem::not_found("there is no such upload: only the last few are kept, send the file again");
        let upload = app.uploads.get(token).ok_or_else(gone)?;
        Ok(Self { content: upload.content, subject: Subject::Upload(Arc::clone(&upload.volume)) })
    }

    /// The voxels.
    pub(crate) fn volume(&self, app: &App) -> Result<Arc<Volume>, Problem> {
        match &self.subject {
            Subject::Upload(volume) => Ok(Arc::clone(volume)),
            &Subject::Texture(id) => {
                if let Some(volume) = app.volumes.get(&self.content) {
                    return Ok(volume);
                }
                let volume = Arc::new(app.database.volume(id)?.ok_or_else(|| without_voxels(id))?);
                app.volumes.insert(self.content, Arc::clone(&volume));
                Ok(volume)
            }
        }
    }
}

fn without_voxels(id: u64) -> Problem {
    Problem::not_found(format!("texture {id} was stored without its voxels: there is nothing to be seen of it"))
}

/// A picture of what is shown: the one that was made before, or a new one.
fn picture(
    app: &App,
    headers: &HeaderMap,
    shown: &Shown,
    what: &str,
    draw: impl FnOnce(&Volume) -> Result<Vec<u8>, Problem>,
) -> Result<Response, Problem> {
    let tag = reply::tag_of(&[&shown.content, what.as_bytes()]);
    reply::tagged(headers, &tag, Keep::Hour, reply::PNG, || {
        if let Some(bytes) = app.pictures.get(&tag) {
            return Ok(bytes);
        }
        let volume = shown.volume(app)?;
        let bytes = Bytes::from(draw(&volume)?);
        app.pictures.insert(tag.clone(), bytes.clone());
        Ok(bytes)
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

/// Pixels of a voxel, as asked for.
fn scale(scale: Option<u32>) -> Result<u32, Problem> {
    match scale.unwrap_or(1) {
        scale @ 1..=16 => Ok(scale),
        other => Err(Problem::bad_request(format!("a voxel cannot be {other} pixels wide: use a scale of 1 to 16"))),
    }
}

#[derive(Deserialize, utoipa::IntoParams)]
#[into_params(parameter_in = Query)]
pub(crate) struct SlicesQuery {
    /// Slices across which axis: `z` (unless said), `y` or `x`.
    axis: Option<String>,
    /// Slices in a row; 8 unless said.
    columns: Option<usize>,
    /// At most so many slices, spread evenly; all unless said.
    slices: Option<usize>,
    /// Pixels of a voxel; 1 unless said.
    scale: Option<u32>,
    /// The longest side of a slice in pixels: larger ones are averaged down, smaller ones enlarged by whole factors. In
    /// place of `scale`.
    pixels: Option<u32>,
    /// 0 for no transparent line between slices.
    gap: Option<u8>,
    /// 1 for a sheet with the name below the slices, as `hlacdb sheet` draws it.
    captions: Option<u8>,
}

/// All slices of a texture, side by side
#[utoipa::path(get, path = "/textures/{id}/slices.png", tag = "pictures", params(("id" = u64, Path), SlicesQuery),
    responses((status = 200, content_type = "image/png"), (status = 304), (status = 404, body = Problem)))]
pub(crate) async fn slices(
    State(app): State<Arc<App>>,
    Path(id): Path<u64>,
    Query(query): Query<SlicesQuery>,
    headers: HeaderMap,
) -> Result<Response, Problem> {
    let layout = layout(&query)?;
    app.heavy(move |app| {
        let shown = Shown::texture(app, id)?;
        if query.captions == Some(1) {
            let texture = app.database.texture(id)?;
            let what = format!("sheet {layout:?} {id} {:?} {:?}", texture.name, texture.tags);
            return picture(app, &headers, &shown, &what, |volume| {
                let (columns, slices, axis) = (layout.columns, layout.slices.min(64), layout.axis);
                let options = ContactSheetOptions::new().columns(columns).slices(slices).axis(axis);
                encode(render::texture_sheet(&texture, volume, &options).encode_png(PngEffort::Small))
            });
        }
        draw_slices(app, &headers, &shown, &query, layout)
    })
    .await
}

fn layout(query: &SlicesQuery) -> Result<SliceImageOptions, Problem> {
    scale(query.scale)?;
    if query.columns == Some(0) || query.slices == Some(0) || query.pixels == Some(0) {
        return Err(Problem::bad_request("columns, slices and pixels are 1 or more"));
    }
    let default = SliceImageOptions::new();
    Ok(default
        .axis(axis(query.axis.as_deref())?)
        .columns(query.columns.unwrap_or(default.columns).min(1024))
        .slices(query.slices.unwrap_or(default.slices))
        .slice_pixels(query.pixels.unwrap_or(default.slice_pixels).min(4096))
        .gap(query.gap != Some(0)))
}

/// The slices and nothing else.
fn draw_slices(
    app: &App,
    headers: &HeaderMap,
    shown: &Shown,
    query: &SlicesQuery,
    layout: SliceImageOptions,
) -> Result<Response, Problem> {
    let (scale, pixels) = (scale(query.scale)?, query.pixels);
    let what = format!("slices {layout:?} {scale} {pixels:?}");
    picture(app, headers, shown, &what, |volume| {
        let longest = volume.shape().into_iter().max().unwrap_or(1) as u32;
        let slice_pixels = pixels.map_or(longest.saturating_mul(scale).min(4096), |_| layout.slice_pixels);
        encode(render::slice_image(volume, &layout.slice_pixels(slice_pixels)).encode_png(PngEffort::Fast))
    })
}

#[derive(Deserialize, utoipa::IntoParams)]
#[into_params(parameter_in = Query)]
pub(crate) struct SliceQuery {
    /// Across which axis: `z` (unless said), `y` or `x`.
    axis: Option<String>,
    /// Which slice, from 0; the middle one unless said.
    index: Option<usize>,
    /// Pixels of a voxel; 1 unless said.
    scale: Option<u32>,
}

/// One slice of a texture
#[utoipa::path(get, path = "/textures/{id}/slice.png", tag = "pictures", params(("id" = u64, Path), SliceQuery),
    responses((status = 200, content_type = "image/png"), (status = 304), (status = 404, body = Problem)))]
pub(crate) async fn slice(
    State(app): State<Arc<App>>,
    Path(id): Path<u64>,
    Query(query): Query<SliceQuery>,
    headers: HeaderMap,
) -> Result<Response, Problem> {
    app.heavy(move |app| draw_slice(app, &headers, &Shown::texture(app, id)?, &query)).await
}

fn draw_slice(app: &App, headers: &HeaderMap, shown: &Shown, query: &SliceQuery) -> Result<Response, Problem> {
    let (axis, scale, index) = (axis(query.axis.as_deref())?, scale(query.scale)?, query.index);
    picture(app, headers, shown, &format!("slice {axis} {index:?} {scale}"), |volume| {
        let [z, y, x] = volume.shape();
        let length = axis.slices([z, y, x]);
        let index = index.unwrap_or(length / 2);
        let pixels = (z.max(y).max(x) as u32).saturating_mul(scale);
        let beyond =
            || Problem::not_found(format!("there is no slice {index} across {axis}: the last one is {}", length - 1));
        encode(render::slice(volume, axis, index, pixels).ok_or_else(beyond)?.encode_png(PngEffort::Fast))
    })
}

#[derive(Deserialize, utoipa::IntoParams)]
#[into_params(parameter_in = Query)]
pub(crate) struct ThumbnailQuery {
    /// The side in pixels, at most 1024; 96 unless said.
    size: Option<u32>,
}

/// The middle slice of a texture, square
#[utoipa::path(get, path = "/textures/{id}/thumbnail.png", tag = "pictures", params(("id" = u64, Path), ThumbnailQuery),
    responses((status = 200, content_type = "image/png"), (status = 304), (status = 404, body = Problem)))]
pub(crate) async fn thumbnail(
    State(app): State<Arc<App>>,
    Path(id): Path<u64>,
    Query(query): Query<ThumbnailQuery>,
    headers: HeaderMap,
) -> Result<Response, Problem> {
    app.heavy(move |app| draw_thumbnail(app, &headers, &Shown::texture(app, id)?, &query)).await
}

fn draw_thumbnail(app: &App, headers: &HeaderMap, shown: &Shown, query: &ThumbnailQuery) -> Result<Response, Problem> {
    let size = match query.size.unwrap_or(96) {
        size @ 1..=1024 => size,
        other => return Err(Problem::bad_request(format!("a thumbnail is 1 to 1024 pixels wide, not {other}"))),
    };
    picture(app, headers, shown, &format!("thumbnail {size}"), |volume| {
        encode(render::thumbnail(volume, size).encode_png(PngEffort::Fast))
    })
}

/// All slices of an upload, side by side
#[utoipa::path(get, path = "/uploads/{token}/slices.png", tag = "pictures", params(("token" = String, Path), SlicesQuery),
    responses((status = 200, content_type = "image/png"), (status = 304), (status = 404, body = Problem)))]
pub(crate) async fn upload_slices(
    State(app): State<Arc<App>>,
    Path(token): Path<String>,
    Query(query): Query<SlicesQuery>,
    headers: HeaderMap,
) -> Result<Response, Problem> {
    let layout = layout(&query)?;
    app.heavy(move |app| draw_slices(app, &headers, &Shown::upload(app, &token)?, &query, layout)).await
}

/// One slice of an upload
#[utoipa::path(get, path = "/uploads/{token}/slice.png", tag = "pictures", params(("token" = String, Path), SliceQuery),
    responses((status = 200, content_type = "image/png"), (status = 304), (status = 404, body = Problem)))]
pub(crate) async fn upload_slice(
    State(app): State<Arc<App>>,
    Path(token): Path<String>,
    Query(query): Query<SliceQuery>,
    headers: HeaderMap,
) -> Result<Response, Problem> {
    app.heavy(move |app| draw_slice(app, &headers, &Shown::upload(app, &token)?, &query)).await
}

/// The middle slice of an upload, square
#[utoipa::path(get, path = "/uploads/{token}/thumbnail.png", tag = "pictures",
    params(("token" = String, Path), ThumbnailQuery),
    responses((status = 200, content_type = "image/png"), (status = 304), (status = 404, body = Problem)))]
pub(crate) async fn upload_thumbnail(
    State(app): State<Arc<App>>,
    Path(token): Path<String>,
    Query(query): Query<ThumbnailQuery>,
    headers: HeaderMap,
) -> Result<Response, Problem> {
    app.heavy(move |app| draw_thumbnail(app, &headers, &Shown::upload(app, &token)?, &query)).await
}
