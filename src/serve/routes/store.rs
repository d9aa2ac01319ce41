//! The store as a whole: health, statistics, spaces, tags, the map, explanations of distances.

use std::sync::Arc;

use axum::extract::{Query, State};
use axum::http::HeaderMap;
use axum::response::Response;
use serde::{Deserialize, Serialize};

use crate::DEFAULT_SPACE;
use crate::serve::problem::{Problem, ProblemDocument};
use crate::serve::reply::{self, CachePolicy};
use crate::serve::state::App;
use crate::volume::formats;

#[derive(Serialize, utoipa::ToSchema)]
struct Health {
    status: &'static str,
    version: &'static str,
    textures: u64,
    read_only: bool,
    /// Whether `POST /jobs/ingest` may be used.
    ingest_folder: bool,
}

/// Whether the server and its store work
#[utoipa::path(get, path = "/health", tag = "server",
    responses((status = 200, body = Health, content_type = "application/json"), (status = 500, body = ProblemDocument)))]
pub(crate) async fn health(State(app): State<Arc<App>>) -> Result<Response, Problem> {
    app.quick(|app| {
        reply::json(&Health {
            status: "ok",
            version: env!("CARGO_PKG_VERSION"),
            textures: app.database.len()?,
            read_only: app.options.read_only,
            ingest_folder: app.ingest_root.is_some() && !app.options.read_only,
        })
    })
    .await
}

#[derive(Serialize, utoipa::ToSchema)]
struct FormatList {
    formats: Vec<FormatSummary>,
}

#[derive(Serialize, utoipa::ToSchema)]
struct FormatSummary {
    /// The name in records, e.g. `nrrd`.
    name: &'static str,
    /// The name as people write it, e.g. `NRRD`.
    title: &'static str,
    /// What is read of the format.
    description: &'static str,
    /// The extensions of its files, each with its dot.
    extensions: &'static [&'static str],
    /// How samples may be compressed.
    compressions: &'static [&'static str],
}

/// The file formats that uploads and ingested files may have
#[utoipa::path(get, path = "/formats", tag = "server",
    responses((status = 200, body = FormatList, content_type = "application/json")))]
pub(crate) async fn formats() -> Result<Response, Problem> {
    // Uploads have no description of samples without a header.
    let readable = formats::infos().filter(|info| info.available && !info.needs_layout);
    let formats = readable.map(|info| FormatSummary {
        name: info.name,
        title: info.title,
        description: info.description,
        extensions: info.extensions,
        compressions: info.compressions,
    });
    reply::json(&FormatList { formats: formats.collect() })
}

/// Sizes, settings, the default space, normalisation statistics and drift of the store
#[utoipa::path(get, path = "/statistics", tag = "store",
    responses((status = 200, body = Object, description = "As `hlacdb --json stats`", content_type = "application/json")))]
pub(crate) async fn statistics(State(app): State<Arc<App>>, headers: HeaderMap) -> Result<Response, Problem> {
    app.heavy(move |app| {
        let tag = reply::entity_tag(&[b"statistics", app.run.as_bytes(), &app.database.revision()?.to_le_bytes()]);
        app.cached_json(&headers, &tag, || reply::json_bytes(&app.database.statistics()?))
    })
    .await
}

#[derive(Serialize, utoipa::ToSchema)]
struct SpaceList {
    spaces: Vec<SpaceSummary>,
    /// The space that is used if none is named.
    default: &'static str,
}

#[derive(Serialize, utoipa::ToSchema)]
struct SpaceSummary {
    name: String,
    /// How points and distances are computed.
    about: String,
    /// The number of the fit; 0 before the first fit.
    epoch: u64,
    /// The number of coordinates of a point.
    dims: usize,
}

/// The spaces of the store
#[utoipa::path(get, path = "/spaces", tag = "likeness", responses((status = 200, body = SpaceList, content_type = "application/json")))]
pub(crate) async fn spaces(State(app): State<Arc<App>>) -> Result<Response, Problem> {
    app.heavy(|app| {
        let spaces = app.database.spaces()?.into_iter().map(|space| SpaceSummary {
            name: space.name().to_owned(),
            about: space.definition().formula(),
            epoch: space.epoch(),
            dims: space.dims(),
        });
        reply::json(&SpaceList { spaces: spaces.collect(), default: DEFAULT_SPACE })
    })
    .await
}

/// How many values of a tag are listed.
const MAX_VALUES: usize = 200;

#[derive(Serialize, utoipa::ToSchema)]
struct TagList<'a> {
    tags: Vec<TagSummary<'a>>,
}

#[derive(Serialize, utoipa::ToSchema)]
struct TagSummary<'a> {
    key: &'a str,
    /// The most frequent values first, at most 200.
    values: Vec<TagCount<'a>>,
    /// The number of values that are not listed.
    others: usize,
}

#[derive(Serialize, utoipa::ToSchema)]
struct TagCount<'a> {
    value: &'a str,
    count: u64,
}

/// All tags with their values and the number of textures that carry each
#[utoipa::path(get, path = "/tags", tag = "store", responses((status = 200, body = TagList, content_type = "application/json")))]
pub(crate) async fn tags(State(app): State<Arc<App>>, headers: HeaderMap) -> Result<Response, Problem> {
    app.quick(move |app| {
        let catalogue = app.catalogue()?;
        let tag = reply::entity_tag(&[b"tags", app.run.as_bytes(), &catalogue.revision().to_le_bytes()]);
        reply::tagged(&headers, &tag, CachePolicy::Revalidate, reply::JSON, || {
            let tags = catalogue.tags().iter().map(|tag| TagSummary {
                key: &tag.key,
                values: tag
                    .values
                    .iter()
                    .take(MAX_VALUES)
                    .map(|(value, count)| TagCount { value, count: *count })
                    .collect(),
                others: tag.values.len().saturating_sub(MAX_VALUES),
            });
            reply::json_bytes(&TagList { tags: tags.collect() })
        })
    })
    .await
}

#[derive(Deserialize, utoipa::IntoParams)]
#[into_params(parameter_in = Query)]
pub(crate) struct MapQuery {
    /// The space; default `default`.
    space: Option<String>,
    /// The tag whose values colour the map.
    tag: Option<String>,
    /// The greatest number of textures, evenly spaced; default 200000.
    limit: Option<usize>,
}

#[derive(Serialize, utoipa::ToSchema)]
struct MapDocument {
    space: String,
    epoch: u64,
    /// The number of textures that have a point.
    total: u64,
    /// The shares of the variance along the two axes.
    explained: [f64; 2],
    ids: Vec<u64>,
    x: Vec<f32>,
    y: Vec<f32>,
    /// The values of the tag.
    values: Vec<String>,
    /// For each texture the index of its value in `values`; -1 if it does not carry the tag.
    value: Vec<i32>,
}

/// The points of all textures, projected to the plane of their greatest variance
#[utoipa::path(get, path = "/map", tag = "likeness", params(MapQuery),
    responses((status = 200, body = MapDocument, content_type = "application/json"), (status = 422, body = ProblemDocument)))]
pub(crate) async fn map(
    State(app): State<Arc<App>>,
    Query(query): Query<MapQuery>,
    headers: HeaderMap,
) -> Result<Response, Problem> {
    app.heavy(move |app| {
        let space = query.space.as_deref().unwrap_or(DEFAULT_SPACE);
        let limit = query.limit.unwrap_or(200_000).clamp(1, 1_000_000);
        let revision = app.database.revision()?;
        let parameters = format!("{space}\n{:?}\n{limit}\n{revision}", query.tag);
        let tag = reply::entity_tag(&[b"map", app.run.as_bytes(), parameters.as_bytes()]);
        app.cached_json(&headers, &tag, || reply::json_bytes(&map_document(app, space, query.tag.as_deref(), limit)?))
    })
    .await
}

fn map_document(app: &App, space: &str, key: Option<&str>, limit: usize) -> Result<MapDocument, Problem> {
    let map = app.database.map(space, limit)?;
    let catalogue = app.catalogue()?;
    let tag = key.and_then(|key| catalogue.tags().iter().find(|tag| &*tag.key == key));
    let values: Vec<String> =
        tag.map_or_else(Vec::new, |tag| tag.values.iter().map(|(value, _)| value.to_string()).collect());
    let positions: std::collections::HashMap<&str, i32> = values.iter().map(String::as_str).zip(0..).collect();
    let value = map.ids.iter().map(|&id| {
        let value = catalogue.get(id).zip(key).and_then(|(texture, key)| texture.tag(key));
        value.and_then(|value| positions.get(value).copied()).unwrap_or(-1)
    });
    let value = value.collect();
    Ok(MapDocument {
        space: map.space,
        epoch: map.epoch,
        total: map.total,
        explained: map.explained,
        ids: map.ids.into_iter().map(u64::from).collect(),
        x: map.x,
        y: map.y,
        values,
        value,
    })
}

#[derive(Deserialize, utoipa::IntoParams)]
#[into_params(parameter_in = Query)]
pub(crate) struct ExplainQuery {
    /// The id of the one texture.
    a: u64,
    /// The id of the other texture.
    b: u64,
    /// The space; default `default`.
    space: Option<String>,
}

/// How the distance between two textures is composed: by view, by number of cells, by orbit
#[utoipa::path(get, path = "/explain", tag = "likeness", params(ExplainQuery),
    responses((status = 200, body = Object, description = "Shares of the distance", content_type = "application/json"),
        (status = 404, body = ProblemDocument), (status = 422, body = ProblemDocument)))]
pub(crate) async fn explain(
    State(app): State<Arc<App>>,
    Query(query): Query<ExplainQuery>,
) -> Result<Response, Problem> {
    app.quick(move |app| reply::json(&app.database.explain(query.a, query.b, query.space.as_deref())?)).await
}
