//! Looking at textures, and tending them.

use std::collections::BTreeMap;
use std::sync::Arc;

use axum::Json;
use axum::extract::{Path, Query, State};
use axum::http::{HeaderMap, StatusCode, Uri};
use axum::response::{IntoResponse, Response};
use serde::{Deserialize, Serialize};

use crate::hlac::View;
use crate::serve::problem::Problem;
use crate::serve::reply::{self, Keep};
use crate::serve::state::App;
use crate::store::Provenance;
use crate::volume::display_path;
use crate::{BlockOf, Listed, Order, ParseTagFilterError, Selection, TagEdit, TagFilter, Texture};

/// So many textures are in one answer at most.
const LONGEST_PAGE: usize = 1000;
const PAGE: usize = 100;

#[derive(Deserialize, utoipa::IntoParams)]
#[into_params(parameter_in = Query)]
pub(crate) struct ListQuery {
    /// How many of the list to pass over.
    #[serde(default)]
    offset: usize,
    /// How many to give, at most 1000; 100 unless said.
    limit: Option<usize>,
    /// `id`, `name` or `size`, with `-` before it the other way round.
    sort: Option<String>,
    /// A part of the name or of a tag's value, in upper or lower case.
    #[serde(default)]
    text: String,
    /// `KEY=VALUE`; may be repeated, and all must hold.
    #[serde(skip)]
    #[param(rename = "where", value_type = Vec<String>, style = Form, explode)]
    #[allow(dead_code, reason = "read by `filters`, since it may be repeated")]
    filters: Vec<String>,
}

#[derive(Serialize, utoipa::ToSchema)]
struct List<'a> {
    total: usize,
    offset: usize,
    textures: Vec<&'a Listed>,
}

/// The `where=KEY=VALUE` of a query.
pub(crate) fn filters(uri: &Uri) -> Result<Vec<TagFilter>, Problem> {
    let Ok(Query(pairs)) = Query::<Vec<(String, String)>>::try_from_uri(uri) else { return Ok(Vec::new()) };
    pairs.into_iter().filter(|(key, _)| key == "where").map(|(_, filter)| parse_filter(&filter)).collect()
}

/// `KEY=VALUE`, split at the first `=`.
pub(crate) fn parse_filter(filter: &str) -> Result<TagFilter, Problem> {
    filter.parse().map_err(|error: ParseTagFilterError| Problem::bad_request(error.to_string()))
}

/// The textures, page by page
#[utoipa::path(get, path = "/textures", tag = "textures", params(ListQuery),
    responses((status = 200, body = List, content_type = "application/json"), (status = 400, body = Problem)))]
pub(crate) async fn list(
    State(app): State<Arc<App>>,
    Query(query): Query<ListQuery>,
    uri: Uri,
    headers: HeaderMap,
) -> Result<Response, Problem> {
    let sort = query.sort.as_deref().unwrap_or("id");
    let (descending, key) = sort.strip_prefix('-').map_or((false, sort), |key| (true, key));
    let order = match key {
        "id" => Order::Id,
        "name" => Order::Name,
        "size" => Order::Size,
        _ => return Err(Problem::bad_request(format!("'{}' is no order: use id, name or size", sort.escape_debug()))),
    };
    let selection = Selection { filters: filters(&uri)?, text: query.text, order, descending };
    let (offset, limit) = (query.offset, query.limit.unwrap_or(PAGE).min(LONGEST_PAGE));
    app.quick(move |app| {
        let catalogue = app.catalogue()?;
        let revision = catalogue.revision().to_le_bytes();
        let asked = uri.query().unwrap_or_default();
        let tag = reply::tag_of(&[b"list", app.run.as_bytes(), &revision, asked.as_bytes()]);
        reply::tagged(&headers, &tag, Keep::Check, reply::JSON, || {
            let places = catalogue.select(&selection);
            let textures = places.iter().skip(offset).take(limit);
            let textures = textures.filter_map(|&place| catalogue.textures().get(place as usize)).collect();
            reply::document(&List { total: places.len(), offset, textures })
        })
    })
    .await
}

#[derive(Serialize, utoipa::ToSchema)]
struct Detail {
    id: u64,
    name: String,
    shape: Option<[usize; 3]>,
    channels: u8,
    tags: BTreeMap<String, String>,
    voxels: bool,
    /// BLAKE3 of the content, 64 hexadecimal digits.
    hash: Option<String>,
    /// The name of the file it was read from.
    file: Option<String>,
    #[schema(value_type = Option<Object>)]
    source: Option<Provenance>,
    #[schema(value_type = Option<Object>)]
    block: Option<BlockOf>,
    /// The compressed size of its voxels.
    stored_bytes: Option<u64>,
    /// Placements of the 3x3x3 window in it.
    windows: Option<u64>,
}

impl Detail {
    fn of(texture: Texture, windows: Option<u64>) -> Self {
        // Where on its machine a file lies is nobody's business who only looks at the texture.
        let file = texture.path.as_deref().and_then(|path| path.file_name());
        Self {
            id: texture.id.get(),
            name: texture.name,
            shape: texture.shape,
            channels: texture.channels,
            tags: texture.tags,
            voxels: texture.stored_bytes.is_some(),
            hash: texture.content.map(|hash| hash.to_string()),
            file: file.map(|name| display_path(name.as_ref())),
            source: texture.source,
            block: texture.block,
            stored_bytes: texture.stored_bytes,
            windows,
        }
    }
}

/// One texture
#[utoipa::path(get, path = "/textures/{id}", tag = "textures", params(("id" = u64, Path)),
    responses((status = 200, body = Detail, content_type = "application/json"), (status = 404, body = Problem)))]
pub(crate) async fn get(State(app): State<Arc<App>>, Path(id): Path<u64>) -> Result<Response, Problem> {
    app.quick(move |app| {
        let texture = app.database.texture(id)?;
        let windows = app.database.sums(id)?.map(|sums| sums.windows);
        reply::json(&Detail::of(texture, windows))
    })
    .await
}

#[derive(Deserialize, utoipa::IntoParams)]
#[into_params(parameter_in = Query)]
pub(crate) struct DescriptorQuery {
    /// Which view; `full@1` unless said.
    view: Option<String>,
}

#[derive(Serialize, utoipa::ToSchema)]
struct Descriptor {
    view: &'static str,
    /// The views that the texture has.
    views: Vec<&'static str>,
    /// The 251 moments, in the order of the masks.
    moments: Vec<f32>,
    /// The exact sums; of `full@1` only, `null` where they are not kept.
    sums: Option<Vec<u64>>,
}

/// The 251 values of a texture in one view
#[utoipa::path(get, path = "/textures/{id}/descriptor", tag = "textures", params(("id" = u64, Path), DescriptorQuery),
    responses((status = 200, body = Descriptor, content_type = "application/json"), (status = 404, body = Problem)))]
pub(crate) async fn descriptor(
    State(app): State<Arc<App>>,
    Path(id): Path<u64>,
    Query(query): Query<DescriptorQuery>,
) -> Result<Response, Problem> {
    app.quick(move |app| {
        let descriptor = app.database.descriptor(id)?;
        let views: Vec<&str> = descriptor.views().map(View::name).collect();
        let wanted = query.view.unwrap_or_else(|| View::Full.name().to_owned());
        let Some((view, moments)) = descriptor.iter().find(|(view, _)| view.name() == wanted) else {
            let has = if views.is_empty() { "none".to_owned() } else { views.join(", ") };
            let sentence = format!("texture {id} has no view '{}'; it has: {has}", wanted.escape_debug());
            return Err(Problem::not_found(sentence));
        };
        let sums = if view == View::Full { app.database.sums(id)? } else { None };
        let sums = sums.map(|sums| sums.values.to_vec());
        reply::json(&Descriptor { view: view.name(), moments: moments.to_vec(), sums, views })
    })
    .await
}

/// Set tags of a texture
#[utoipa::path(put, path = "/textures/{id}/tags", tag = "textures", params(("id" = u64, Path)),
    request_body = BTreeMap<String, String>,
    responses((status = 200, body = Detail, content_type = "application/json"), (status = 404, body = Problem),
        (status = 422, body = Problem)))]
pub(crate) async fn set_tags(
    State(app): State<Arc<App>>,
    Path(id): Path<u64>,
    Json(tags): Json<BTreeMap<String, String>>,
) -> Result<Response, Problem> {
    app.may_change()?;
    let edit = tags.into_iter().fold(TagEdit::new(), |edit, (key, value)| edit.set(key, value));
    app.heavy(move |app| changed_tags(app, id, &edit)).await
}

/// Take a tag off a texture
#[utoipa::path(delete, path = "/textures/{id}/tags/{key}", tag = "textures", params(("id" = u64, Path), ("key" = String, Path)),
    responses((status = 200, body = Detail, content_type = "application/json"), (status = 404, body = Problem)))]
pub(crate) async fn unset_tag(
    State(app): State<Arc<App>>,
    Path((id, key)): Path<(u64, String)>,
) -> Result<Response, Problem> {
    app.may_change()?;
    app.heavy(move |app| changed_tags(app, id, &TagEdit::new().unset(key))).await
}

fn changed_tags(app: &App, id: u64, edit: &TagEdit) -> Result<Response, Problem> {
    let texture = app.database.tag(id, edit)?;
    app.note_change()?;
    let windows = app.database.sums(id)?.map(|sums| sums.windows);
    reply::json(&Detail::of(texture, windows))
}

/// Remove a texture
#[utoipa::path(delete, path = "/textures/{id}", tag = "textures", params(("id" = u64, Path)),
    responses((status = 204), (status = 404, body = Problem)))]
pub(crate) async fn remove(State(app): State<Arc<App>>, Path(id): Path<u64>) -> Result<Response, Problem> {
    app.may_change()?;
    app.heavy(move |app| {
        app.database.remove([id])?;
        app.note_change()?;
        Ok(StatusCode::NO_CONTENT.into_response())
    })
    .await
}
