//! The store as a whole: sizes, statistics, spaces, tags, the map.

use std::sync::Arc;

use axum::extract::{Query, State};
use axum::http::HeaderMap;
use axum::response::Response;
use serde::{Deserialize, Serialize};

use crate::DEFAULT_SPACE;
use crate::serve::problem::Problem;
use crate::serve::reply::{self, Keep};
use crate::serve::state::App;

#[derive(Serialize, utoipa::ToSchema)]
struct Health {
    status: &'static str,
    version: &'static str,
    textures: u64,
    read_only: bool,
    /// Whether there is a folder to ingest from.
    ingest_folder: bool,
}

/// Whether all is well
#[utoipa::path(get, path = "/health", tag = "server",
    responses((status = 200, body = Health, content_type = "application/json"), (status = 500, body = Problem)))]
pub(crate) async fn health(State(app): State<Arc<App>>) -> Result<Response, Problem> {
    app.quick(|app| {
        reply::json(&Health {
            status: "ok",
            version: env!("CARGO_PKG_VERSION"),
            textures: app.database.len()?,
            read_only: app.settings.read_only,
            ingest_folder: app.ingest_root.is_some() && !app.settings.read_only,
        })
    })
    .await
}

/// Sizes, settings, the default space, normalisation statistics, drift
#[utoipa::path(get, path = "/statistics", tag = "store",
    responses((status = 200, body = Object, description = "As `hlacdb --json stats`", content_type = "application/json")))]
pub(crate) async fn statistics(State(app): State<Arc<App>>, headers: HeaderMap) -> Result<Response, Problem> {
    app.heavy(move |app| {
        let tag = reply::tag_of(&[b"statistics", app.run.as_bytes(), &app.database.revision()?.to_le_bytes()]);
        app.kept(&headers, &tag, || reply::document(&app.database.statistics()?))
    })
    .await
}

#[derive(Serialize, utoipa::ToSchema)]
struct Spaces {
    spaces: Vec<Space>,
    /// The one that answers where none is named.
    default: &'static str,
}

#[derive(Serialize, utoipa::ToSchema)]
struct Space {
    name: String,
    /// How points and distances are computed.
    about: String,
    /// The number of the fit; 0 before the first.
    epoch: u64,
    /// Coordinates of a point.
    dims: usize,
}

/// The spaces that can be asked in
#[utoipa::path(get, path = "/spaces", tag = "likeness", responses((status = 200, body = Spaces, content_type = "application/json")))]
pub(crate) async fn spaces(State(app): State<Arc<App>>) -> Result<Response, Problem> {
    app.heavy(|app| {
        let spaces = app.database.spaces()?.into_iter().map(|space| Space {
            name: space.name().to_owned(),
            about: space.definition().formula(),
            epoch: space.epoch(),
            dims: space.dims(),
        });
        reply::json(&Spaces { spaces: spaces.collect(), default: DEFAULT_SPACE })
    })
    .await
}

/// So many values of a tag are listed.
const VALUES: usize = 200;

#[derive(Serialize, utoipa::ToSchema)]
struct Tags<'a> {
    tags: Vec<Tag<'a>>,
}

#[derive(Serialize, utoipa::ToSchema)]
struct Tag<'a> {
    key: &'a str,
    /// By falling count, at most 200.
    values: Vec<Value<'a>>,
    /// How many values are not listed.
    others: usize,
}

#[derive(Serialize, utoipa::ToSchema)]
struct Value<'a> {
    value: &'a str,
    count: u64,
}

/// All tags, their values, and how many textures carry each
#[utoipa::path(get, path = "/tags", tag = "store", responses((status = 200, body = Tags, content_type = "application/json")))]
pub(crate) async fn tags(State(app): State<Arc<App>>, headers: HeaderMap) -> Result<Response, Problem> {
    app.quick(move |app| {
        let catalogue = app.catalogue()?;
        let tag = reply::tag_of(&[b"tags", app.run.as_bytes(), &catalogue.revision().to_le_bytes()]);
        reply::tagged(&headers, &tag, Keep::Check, reply::JSON, || {
            let tags = catalogue.tags().iter().map(|tag| Tag {
                key: &tag.key,
                values: tag.values.iter().take(VALUES).map(|(value, count)| Value { value, count: *count }).collect(),
                others: tag.values.len().saturating_sub(VALUES),
            });
            reply::document(&Tags { tags: tags.collect() })
        })
    })
    .await
}

#[derive(Deserialize, utoipa::IntoParams)]
#[into_params(parameter_in = Query)]
pub(crate) struct MapQuery {
    /// In which space; `default` unless said.
    space: Option<String>,
    /// The tag whose values colour the map.
    tag: Option<String>,
    /// At most so many textures, thinned out evenly; 200000 unless said.
    limit: Option<usize>,
}

#[derive(Serialize, utoipa::ToSchema)]
struct MapDocument {
    space: String,
    epoch: u64,
    /// Textures that have a point.
    total: u64,
    /// The shares of the variance that the two axes show.
    explained: [f64; 2],
    ids: Vec<u64>,
    x: Vec<f32>,
    y: Vec<f32>,
    /// The values of the tag.
    values: Vec<String>,
    /// For each texture the place of its value in `values`; -1 where it does not carry the tag.
    value: Vec<i32>,
}

/// Every texture as a place in the plane, by the two axes along which the points of a space vary most
#[utoipa::path(get, path = "/map", tag = "likeness", params(MapQuery),
    responses((status = 200, body = MapDocument, content_type = "application/json"), (status = 422, body = Problem)))]
pub(crate) async fn map(
    State(app): State<Arc<App>>,
    Query(query): Query<MapQuery>,
    headers: HeaderMap,
) -> Result<Response, Problem> {
    app.heavy(move |app| {
        let space = query.space.as_deref().unwrap_or(DEFAULT_SPACE);
        let limit = query.limit.unwrap_or(200_000).clamp(1, 1_000_000);
        let revision = app.database.revision()?;
        let asked = format!("{space}\n{:?}\n{limit}\n{revision}", query.tag);
        let tag = reply::tag_of(&[b"map", app.run.as_bytes(), asked.as_bytes()]);
        app.kept(&headers, &tag, || reply::document(&drawn(app, space, query.tag.as_deref(), limit)?))
    })
    .await
}

fn drawn(app: &App, space: &str, key: Option<&str>, limit: usize) -> Result<MapDocument, Problem> {
    let map = app.database.map(space, limit)?;
    let catalogue = app.catalogue()?;
    let tag = key.and_then(|key| catalogue.tags().iter().find(|tag| &*tag.key == key));
    let values: Vec<String> =
        tag.map_or_else(Vec::new, |tag| tag.values.iter().map(|(value, _)| value.to_string()).collect());
    let places: std::collections::HashMap<&str, i32> = values.iter().map(String::as_str).zip(0..).collect();
    let value = map.ids.iter().map(|&id| {
        let value = catalogue.get(id).zip(key).and_then(|(texture, key)| texture.tag(key));
        value.and_then(|value| places.get(value).copied()).unwrap_or(-1)
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
    /// The one texture.
    a: u64,
    /// The other.
    b: u64,
    /// In which space; `default` unless said.
    space: Option<String>,
}

/// What makes the distance between two textures: by view, by number of cells, by orbit
#[utoipa::path(get, path = "/explain", tag = "likeness", params(ExplainQuery),
    responses((status = 200, body = Object, description = "Shares of the distance", content_type = "application/json"),
        (status = 404, body = Problem), (status = 422, body = Problem)))]
pub(crate) async fn explain(
    State(app): State<Arc<App>>,
    Query(query): Query<ExplainQuery>,
) -> Result<Response, Problem> {
    app.quick(move |app| reply::json(&app.database.explain(query.a, query.b, query.space.as_deref())?)).await
}
