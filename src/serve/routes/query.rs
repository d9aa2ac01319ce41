//! Queries: the textures most like an example.

use std::sync::Arc;

use axum::Json;
use axum::extract::multipart::MultipartRejection;
use axum::extract::rejection::JsonRejection;
use axum::extract::{FromRequest, Multipart, Request, State};
use axum::http::{StatusCode, header};
use axum::response::Response;
use serde::{Deserialize, Serialize};

use crate::serve::form::{UploadedForm, unknown_field};
use crate::serve::limits;
use crate::serve::parameters;
use crate::serve::problem::{Problem, ProblemDocument};
use crate::serve::reply;
use crate::serve::state::App;
use crate::serve::upload_cache::Upload;
use crate::serve::volume_source::{VolumeSource, find_upload};
use crate::volume::{self, Volume, display_path};
use crate::{Answer, Combine, Error, ParseCombineError, Query, TagFilter};

/// The greatest number of hits in one response.
const MAX_HITS: usize = 10_000;
/// The number of hits if none is given.
const DEFAULT_HITS: usize = 30;

#[derive(Default, Deserialize, utoipa::ToSchema)]
#[serde(deny_unknown_fields)]
pub(crate) struct QueryRequest {
    /// Textures of the store as examples.
    #[serde(default)]
    ids: Vec<u64>,
    /// An earlier upload as the example, by the token in its response; takes the place of `ids`.
    upload: Option<String>,
    /// A block of a texture as the example; takes the place of `ids`.
    block: Option<Block>,
    /// How several examples are combined: `mean` (default; like all of them) or `min` (like any of them).
    combine: Option<String>,
    /// The number of hits, at most 10000; default 30.
    k: Option<usize>,
    /// Only hits at this distance or nearer.
    within: Option<f64>,
    /// `KEY=VALUE`: only textures with these tags; all must hold.
    #[serde(default, rename = "where")]
    filters: Vec<String>,
    /// The space; default `default`.
    space: Option<String>,
    /// Leave out the examples themselves; default true for textures and blocks, false for uploads.
    exclude_self: Option<bool>,
}

/// A block of a texture.
#[derive(Deserialize, utoipa::ToSchema)]
#[serde(
    deny_unknown_fields,
    expecting = "a block of a texture, such as {\"id\":12,\"origin\":[0,0,0],\"size\":[64,64,64]} (Z, Y, X)"
)]
struct Block {
    id: u64,
    /// The first voxel (Z, Y, X).
    origin: [usize; 3],
    /// The shape (Z, Y, X), each side at least 3.
    size: [usize; 3],
}

/// A query with its example.
#[derive(utoipa::ToSchema)]
#[allow(dead_code, reason = "documents the form")]
struct QueryForm {
    /// The example, in any supported format; several files for a detached header with its data, or for slices.
    #[schema(content_media_type = "application/octet-stream")]
    file: Vec<String>,
    /// The other fields of the query, as JSON.
    options: Option<String>,
    /// How samples of more than 8 bits are mapped to 256 levels: `full`, `auto`, `nonzero` or `LO..HI`.
    intensity: Option<String>,
}

#[derive(Serialize, utoipa::ToSchema)]
struct QueryResponse {
    space: String,
    /// The index that found the hits.
    index: &'static str,
    /// The number of the fit of the space.
    epoch: u64,
    /// The time of the search alone, in microseconds.
    elapsed_us: u64,
    /// The uploaded example. Later requests refer to it by its token.
    #[serde(skip_serializing_if = "Option::is_none")]
    upload: Option<UploadSummary>,
    /// Remarks on the query, one sentence each; usually absent.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    warnings: Vec<String>,
    hits: Vec<Hit>,
}

#[derive(Serialize, utoipa::ToSchema)]
struct UploadSummary {
    token: String,
    name: String,
    shape: [usize; 3],
    channels: usize,
}

#[derive(Serialize, utoipa::ToSchema)]
struct Hit {
    rank: usize,
    id: u64,
    name: String,
    distance: f64,
    tags: std::collections::BTreeMap<String, String>,
    shape: Option<[usize; 3]>,
    voxels: bool,
}

/// The textures most like an example
///
/// As JSON, or as a form with a file.
#[utoipa::path(post, path = "/query", tag = "likeness",
    request_body(content((QueryRequest = "application/json"), (QueryForm = "multipart/form-data"))),
    responses((status = 200, body = QueryResponse, content_type = "application/json"),
        (status = 400, body = ProblemDocument), (status = 404, body = ProblemDocument),
        (status = 413, body = ProblemDocument), (status = 422, body = ProblemDocument)))]
pub(crate) async fn query(State(app): State<Arc<App>>, request: Request) -> Result<Response, Problem> {
    let kind = request.headers().get(header::CONTENT_TYPE).and_then(|kind| kind.to_str().ok()).unwrap_or_default();
    if kind.starts_with("multipart/form-data") {
        let rejected = |error: MultipartRejection| Problem::new(error.status(), error.body_text());
        let form = Multipart::from_request(request, &()).await.map_err(rejected)?;
        let form = UploadedForm::receive(&app, form).await?;
        let work = move |app: &App| by_form(app, &form).map_err(|problem| problem.relative_to(&form.roots()));
        return app.heavy(work).await;
    }
    let rejected = |error: JsonRejection| match error.status() {
        StatusCode::PAYLOAD_TOO_LARGE => limits::body_too_long(app.options.max_body),
        status => Problem::new(status, error.body_text()),
    };
    let Json(request) = Json::<QueryRequest>::from_request(request, &()).await.map_err(rejected)?;
    // Only a block has to be read and described; textures and uploads already are.
    if request.block.is_some() {
        app.heavy(move |app| by_example(app, &request)).await
    } else {
        app.quick(move |app| by_example(app, &request)).await
    }
}

/// A query whose example the store or the server has.
fn by_example(app: &App, request: &QueryRequest) -> Result<Response, Problem> {
    match (&request.ids[..], &request.upload, &request.block) {
        ([], Some(token), None) => by_upload(app, request, &*find_upload(app, token)?),
        ([], None, Some(block)) => {
            let volume = read_block(app, block)?;
            app.metrics.count_description();
            let exclude_self = request.exclude_self.unwrap_or(true);
            let query = Query::volume(&volume);
            answer(app, if exclude_self { query.exclude_self() } else { query }, request, None)
        }
        (ids @ [_, ..], None, None) => {
            let combine = request.combine.as_deref().unwrap_or(Combine::Mean.name());
            let combine: Combine =
                combine.parse().map_err(|error: ParseCombineError| Problem::bad_request(error.to_string()))?;
            let exclude_self = request.exclude_self.unwrap_or(true);
            let query = Query::textures(ids.iter().copied()).combine(combine);
            answer(app, if exclude_self { query.exclude_self() } else { query }, request, None)
        }
        _ => Err(Problem::bad_request(
            "a query needs one kind of example: ids of textures, an upload, or a block of a texture",
        )),
    }
}

/// The voxels of a block of a texture.
fn read_block(app: &App, block: &Block) -> Result<Volume, Problem> {
    let whole = VolumeSource::texture(app, block.id)?.volume(app)?;
    whole.block(block.origin, block.size).ok_or_else(|| {
        let ([z, y, x], [a, b, c]) = (block.origin, block.size);
        let [depth, height, width] = whole.shape();
        Problem::bad_request(format!(
            "a block must lie inside its texture and have at least 3 voxels a side (got {a} x {b} x {c} at {z},{y},{x} in \
             texture {} of {depth} x {height} x {width})",
            block.id
        ))
    })
}

/// A query whose example is in the form.
fn by_form(app: &App, form: &UploadedForm) -> Result<Response, Problem> {
    let (mut request, mut reading) = (QueryRequest::default(), parameters::read_options(&app.options));
    for (key, value) in &form.fields {
        match key.as_str() {
            "options" => {
                let malformed = |error| Problem::bad_request(format!("the field 'options' is not a query: {error}"));
                request = serde_json::from_str(value).map_err(malformed)?;
            }
            "intensity" => reading.intensity = parameters::intensity(value)?,
            _ => return Err(unknown_field(key, "file, options, intensity")),
        }
    }
    if !request.ids.is_empty() || request.upload.is_some() || request.block.is_some() {
        return Err(Problem::bad_request("a query with a file cannot name ids, an upload or a block as well"));
    }
    let volumes = form.volumes()?;
    let [path] = &volumes.paths[..] else {
        let found = volumes.paths.len();
        return Err(Problem::bad_request(format!(
            "a query needs one volume (got {found} volumes): send them one by one"
        )));
    };
    let name = path.file_name().map(|name| display_path(name.as_ref())).unwrap_or_default();
    let (volume, _) = volume::read(path, &reading).map_err(Error::from)?;
    let described = app.database.describe(&volume)?;
    app.metrics.count_description();
    let upload = app.uploads.insert(name, volume, described).map_err(|error| {
        tracing::error!(%error, "no random numbers for a token");
        Problem::internal()
    })?;
    by_upload(app, &request, &upload)
}

/// A query whose example is an upload. It was described in all views of the store when it came, so that it is never
/// described again, whatever the space.
fn by_upload(app: &App, request: &QueryRequest, upload: &Upload) -> Result<Response, Problem> {
    let summary = UploadSummary {
        token: upload.token.clone(),
        name: upload.name.clone(),
        shape: upload.volume.shape(),
        channels: upload.volume.channels(),
    };
    let query = Query::described(&upload.described);
    let query = if request.exclude_self == Some(true) { query.exclude_self() } else { query };
    answer(app, query, request, Some(summary))
}

fn answer(
    app: &App,
    query: Query<'_>,
    request: &QueryRequest,
    upload: Option<UploadSummary>,
) -> Result<Response, Problem> {
    let answer = app.database.query(&with_conditions(query, request)?)?;
    app.metrics.count_search(&answer.space, answer.index, answer.elapsed);
    reply::json(&QueryResponse { upload, ..response(app, answer)? })
}

/// The query with the number of hits and the conditions of the request.
fn with_conditions<'a>(mut query: Query<'a>, request: &QueryRequest) -> Result<Query<'a>, Problem> {
    let k = request.k.unwrap_or(DEFAULT_HITS);
    if k > MAX_HITS {
        return Err(Problem::bad_request(format!("k must be at most {MAX_HITS} (got {k})")));
    }
    query = query.k(k);
    if let Some(distance) = request.within {
        query = query.within(distance);
    }
    if let Some(space) = &request.space {
        query = query.space(space);
    }
    let filters: Vec<TagFilter> =
        request.filters.iter().map(|filter| parameters::tag_filter(filter)).collect::<Result<_, _>>()?;
    Ok(query.filters(filters))
}

/// An answer of the library, with what the page shows of each hit.
fn response(app: &App, answer: Answer) -> Result<QueryResponse, Problem> {
    let catalogue = app.catalogue()?;
    let mut hits = Vec::with_capacity(answer.hits.len());
    for hit in answer.hits {
        let (shape, voxels) = match catalogue.get(hit.id) {
            Some(texture) => (texture.shape, texture.voxels),
            // The catalogue may be older than the answer, and the texture may have been removed since.
            None => app
                .database
                .texture(hit.id)
                .map_or((None, false), |texture| (texture.shape, texture.stored_bytes.is_some())),
        };
        hits.push(Hit {
            rank: hit.rank,
            id: hit.id.get(),
            name: hit.name,
            distance: hit.distance,
            tags: hit.tags,
            shape,
            voxels,
        });
    }
    Ok(QueryResponse {
        space: answer.space,
        index: answer.index,
        epoch: answer.epoch,
        elapsed_us: answer.elapsed.as_micros() as u64,
        upload: None,
        warnings: answer.warnings,
        hits,
    })
}
