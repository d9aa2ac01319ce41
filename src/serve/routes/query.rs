//! The question, and the ones alike.

use std::sync::Arc;

use axum::Json;
use axum::extract::rejection::JsonRejection;
use axum::extract::{FromRequest, Multipart, Request, State};
use axum::http::{StatusCode, header};
use axum::response::Response;
use serde::{Deserialize, Serialize};

use super::textures::parse_filter;
use crate::serve::auth::too_large;
use crate::serve::form::Intake;
use crate::serve::problem::Problem;
use crate::serve::reply;
use crate::serve::state::App;
use crate::serve::upload_cache::Upload;
use crate::volume::{self, Volume, display_path};
use crate::{Answer, Combine, Error, Query, TagFilter, UnknownCombine};

#[derive(Default, Deserialize, utoipa::ToSchema)]
#[serde(deny_unknown_fields)]
pub(crate) struct Asked {
    /// Textures of the store: what is looked for is what they share.
    #[serde(default)]
    ids: Vec<u64>,
    /// A volume that was asked with before, by the token of its answer; in place of `ids`.
    upload: Option<String>,
    /// A part of a texture; in place of `ids`.
    block: Option<Block>,
    /// What several examples mean together: `mean` (like all of them, unless said) or `min` (like any of them).
    combine: Option<String>,
    /// How many hits; 30 unless said.
    k: Option<usize>,
    /// Only hits at this distance or nearer.
    within: Option<f64>,
    /// `KEY=VALUE`, all of which must hold.
    #[serde(default, rename = "where")]
    filters: Vec<String>,
    /// In which space; `default` unless said.
    space: Option<String>,
    /// Leave out the examples themselves; yes unless said for textures, no unless said for uploads.
    exclude_self: Option<bool>,
}

/// A part of a texture.
#[derive(Deserialize, utoipa::ToSchema)]
#[serde(
    deny_unknown_fields,
    expecting = "a block of a texture, as {\"id\":12,\"origin\":[0,0,0],\"size\":[64,64,64]} (Z, Y, X)"
)]
struct Block {
    id: u64,
    /// Its first voxel (Z, Y, X).
    origin: [usize; 3],
    /// Its shape (Z, Y, X), each side 3 or more.
    size: [usize; 3],
}

/// A question with its example.
#[derive(utoipa::ToSchema)]
#[allow(dead_code, reason = "describes the form")]
struct Form {
    /// The volume to ask with, in any supported format; a detached header with its data, or slices, as several.
    #[schema(content_media_type = "application/octet-stream")]
    file: Vec<String>,
    /// The rest of the question, as JSON.
    options: Option<String>,
    /// How samples deeper than 8 bits become 256 levels: `full`, `auto`, `nonzero` or `LO..HI`.
    intensity: Option<String>,
}

#[derive(Serialize, utoipa::ToSchema)]
struct Answered {
    space: String,
    /// The index that found the hits.
    index: &'static str,
    epoch: u64,
    /// The time of the search alone, in microseconds.
    elapsed_us: u64,
    /// The example, where it was sent or is kept: by its token it can be seen, and asked with again.
    #[serde(skip_serializing_if = "Option::is_none")]
    upload: Option<Kept>,
    /// What was odd about the question, one sentence each; mostly nothing.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    warnings: Vec<String>,
    hits: Vec<Hit>,
}

#[derive(Serialize, utoipa::ToSchema)]
struct Kept {
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

/// So many hits are in one answer at most.
const MOST_HITS: usize = 10_000;

/// The textures most alike
///
/// As JSON, or as a form with a file.
#[utoipa::path(post, path = "/query", tag = "likeness",
    request_body(content((Asked = "application/json"), (Form = "multipart/form-data"))),
    responses((status = 200, body = Answered, content_type = "application/json"), (status = 400, body = Problem),
        (status = 404, body = Problem), (status = 413, body = Problem), (status = 422, body = Problem)))]
pub(crate) async fn query(State(app): State<Arc<App>>, request: Request) -> Result<Response, Problem> {
    let kind = request.headers().get(header::CONTENT_TYPE).and_then(|kind| kind.to_str().ok()).unwrap_or_default();
    if kind.starts_with("multipart/form-data") {
        let refused =
            |error: axum::extract::multipart::MultipartRejection| Problem::new(error.status(), error.body_text());
        let form = Multipart::from_request(request, &()).await.map_err(refused)?;
        let intake = Intake::receive(&app, form).await?;
        let answer = move |app: &App| by_form(app, &intake).map_err(|problem| problem.map(|text| intake.shown(text)));
        return app.heavy(answer).await;
    }
    let refused = |error: JsonRejection| match error.status() {
        StatusCode::PAYLOAD_TOO_LARGE => Problem::new(error.status(), too_large(&app)),
        status => Problem::new(status, error.body_text()),
    };
    let Json(asked) = Json::<Asked>::from_request(request, &()).await.map_err(refused)?;
    // What must be read or described takes longer than what is in memory.
    if asked.block.is_some() || asked.upload.is_some() {
        app.heavy(move |app| by_example(app, &asked)).await
    } else {
        app.quick(move |app| by_example(app, &asked)).await
    }
}

/// A question about what the store or the server has.
fn by_example(app: &App, asked: &Asked) -> Result<Response, Problem> {
    match (&asked.ids[..], &asked.upload, &asked.block) {
        ([], Some(token), None) => {
            let gone =
                || Problem::not_found("there is no such upload: only the last few are kept, send the file again");
            let upload = app.uploads.get(token).ok_or_else(gone)?;
            by_upload(app, asked, &upload)
        }
        ([], None, Some(block)) => {
            let volume = part(app, block)?;
            answered(app, Query::volume(&volume), asked, true, None)
        }
        (ids @ [_, ..], None, None) => {
            let how = asked.combine.as_deref().unwrap_or(Combine::Mean.name());
            let how: Combine = how.parse().map_err(|error: UnknownCombine| Problem::bad_request(error.to_string()))?;
            answered(app, Query::textures(ids.iter().copied()).combine(how), asked, true, None)
        }
        _ => Err(Problem::bad_request(
            "ask with one kind of example: ids of textures, an upload, or a block of a texture",
        )),
    }
}

/// The voxels of a part of a texture.
fn part(app: &App, block: &Block) -> Result<Volume, Problem> {
    let shown = super::pictures::Shown::texture(app, block.id)?;
    let whole = shown.volume(app)?;
    whole.block(block.origin, block.size).ok_or_else(|| {
        let ([z, y, x], [a, b, c]) = (block.origin, block.size);
        let [depth, height, width] = whole.shape();
        Problem::bad_request(format!(
            "a block of {a} x {b} x {c} voxels at {z},{y},{x} does not lie in texture {} of {depth} x {height} x {width}, or has a side under 3",
            block.id
        ))
    })
}

/// A question with its own volume.
fn by_form(app: &App, intake: &Intake) -> Result<Response, Problem> {
    let (mut asked, mut reading) = (Asked::default(), crate::serve::form::reading(app));
    for (key, value) in &intake.fields {
        match key.as_str() {
            "options" => {
                let wrong = |error| Problem::bad_request(format!("the options are not what this asks for: {error}"));
                asked = serde_json::from_str(value).map_err(wrong)?;
            }
            "intensity" => reading.intensity = crate::serve::form::intensity(value)?,
            _ => {
                let sentence =
                    format!("'{}' is no field of this form: use file, options, intensity", key.escape_debug());
                return Err(Problem::bad_request(sentence));
            }
        }
    }
    if !asked.ids.is_empty() || asked.upload.is_some() || asked.block.is_some() {
        return Err(Problem::bad_request("ask with the file, or with ids, an upload or a block, but not with both"));
    }
    let (found, _) = intake.volumes()?;
    let [path] = &found[..] else {
        let sentence = format!("{} volumes were sent, but one is asked with: send them one by one", found.len());
        return Err(Problem::bad_request(sentence));
    };
    let name = path.file_name().map(|name| display_path(name.as_ref())).unwrap_or_default();
    let (volume, _) = volume::read(path, &reading).map_err(|error| {
        let name = path.file_name().unwrap_or_default().to_owned();
        Error::from(error.with_path(name))
    })?;
    let descriptor = app.database.describe(&volume)?;
    by_upload(app, &asked, &app.uploads.keep(name, volume, descriptor))
}

fn by_upload(app: &App, asked: &Asked, upload: &Upload) -> Result<Response, Problem> {
    let kept = Kept {
        token: upload.token.clone(),
        name: upload.name.clone(),
        shape: upload.volume.shape(),
        channels: upload.volume.channels(),
    };
    // Its moments are known. Which texture has the same content, only the volume tells.
    let query = match asked.exclude_self {
        Some(true) => Query::volume(&upload.volume),
        _ => Query::descriptor(upload.descriptor.clone()),
    };
    answered(app, query, asked, false, Some(kept))
}

fn answered(
    app: &App,
    query: Query<'_>,
    asked: &Asked,
    exclude_self: bool,
    upload: Option<Kept>,
) -> Result<Response, Problem> {
    let answer = app.database.query(&refined(query, asked, exclude_self)?)?;
    app.metrics.searched(&answer.space, answer.index, answer.elapsed);
    reply::json(&Answered { upload, ..shown(app, answer)? })
}

fn refined<'a>(mut query: Query<'a>, asked: &Asked, exclude_self: bool) -> Result<Query<'a>, Problem> {
    let k = asked.k.unwrap_or(30);
    if k > MOST_HITS {
        return Err(Problem::bad_request(format!("k is {k}, but an answer holds at most {MOST_HITS} hits")));
    }
    query = query.k(k);
    if let Some(distance) = asked.within {
        query = query.within(distance);
    }
    if let Some(space) = &asked.space {
        query = query.space(space);
    }
    if asked.exclude_self.unwrap_or(exclude_self) {
        query = query.exclude_self();
    }
    let filters: Vec<TagFilter> = asked.filters.iter().map(|filter| parse_filter(filter)).collect::<Result<_, _>>()?;
    Ok(query.filters(filters))
}

fn shown(app: &App, answer: Answer) -> Result<Answered, Problem> {
    let catalogue = app.catalogue()?;
    let mut hits = Vec::with_capacity(answer.hits.len());
    for hit in answer.hits {
        let (shape, voxels) = match catalogue.get(hit.id) {
            Some(texture) => (texture.shape, texture.voxels),
            // The list may be some moments older than the answer, and the texture may be gone since.
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
    Ok(Answered {
        space: answer.space,
        index: answer.index,
        epoch: answer.epoch,
        elapsed_us: answer.elapsed.as_micros() as u64,
        upload: None,
        warnings: answer.warnings,
        hits,
    })
}
