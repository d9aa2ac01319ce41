//! Listing, adding, tagging and removing textures.

use std::collections::BTreeMap;
use std::sync::Arc;

use axum::Json;
use axum::extract::{Multipart, Path, Query, State};
use axum::http::{HeaderMap, StatusCode, Uri};
use axum::response::{IntoResponse, Response};
use serde::{Deserialize, Serialize};

use crate::hlac::View;
use crate::ingest;
use crate::serve::form::UploadedForm;
use crate::serve::parameters;
use crate::serve::problem::{Problem, ProblemDocument, full_sentence};
use crate::serve::reply::{self, CachePolicy};
use crate::serve::state::App;
use crate::store::Provenance;
use crate::volume::display_path;
use crate::{BlockOf, CatalogueEntry, CatalogueOrder, CatalogueQuery, TagEdit, TagFilter, Texture};

/// The greatest number of textures in one response.
const MAX_PAGE: usize = 1000;
const DEFAULT_PAGE: usize = 100;

#[derive(Deserialize, utoipa::IntoParams)]
#[into_params(parameter_in = Query)]
pub(crate) struct ListQuery {
    /// How many textures of the list to skip.
    #[serde(default)]
    offset: usize,
    /// The number of textures to return, at most 1000; default 100.
    limit: Option<usize>,
    /// The order: `id` (default), `name` or `size`; with a leading `-` descending.
    sort: Option<String>,
    /// A substring of the name or of the value of a tag; case is ignored.
    #[serde(default)]
    text: String,
    /// `KEY=VALUE`: only textures with this tag. May be repeated; all must hold.
    #[serde(skip)]
    #[param(rename = "where", value_type = Vec<String>, style = Form, explode)]
    #[allow(dead_code, reason = "read by `filters`, because it may be repeated")]
    filters: Vec<String>,
}

#[derive(Serialize, utoipa::ToSchema)]
struct TextureList<'a> {
    total: usize,
    offset: usize,
    textures: Vec<&'a CatalogueEntry>,
}

/// The `where=KEY=VALUE` parameters of a query.
fn filters(uri: &Uri) -> Result<Vec<TagFilter>, Problem> {
    let Ok(Query(pairs)) = Query::<Vec<(String, String)>>::try_from_uri(uri) else { return Ok(Vec::new()) };
    pairs.into_iter().filter(|(key, _)| key == "where").map(|(_, filter)| parameters::tag_filter(&filter)).collect()
}

/// A page of the list of textures
#[utoipa::path(get, path = "/textures", tag = "textures", params(ListQuery),
    responses((status = 200, body = TextureList, content_type = "application/json"), (status = 400, body = ProblemDocument)))]
pub(crate) async fn list(
    State(app): State<Arc<App>>,
    Query(query): Query<ListQuery>,
    uri: Uri,
    headers: HeaderMap,
) -> Result<Response, Problem> {
    let sort = query.sort.as_deref().unwrap_or("id");
    let (descending, key) = sort.strip_prefix('-').map_or((false, sort), |key| (true, key));
    let order = match key {
        "id" => CatalogueOrder::Id,
        "name" => CatalogueOrder::Name,
        "size" => CatalogueOrder::Size,
        _ => {
            return Err(Problem::bad_request(format!("sort must be id, name or size (got '{}')", sort.escape_debug())));
        }
    };
    let selection = CatalogueQuery::new().filters(filters(&uri)?).text(query.text).order(order).descending(descending);
    let (offset, limit) = (query.offset, query.limit.unwrap_or(DEFAULT_PAGE).min(MAX_PAGE));
    app.quick(move |app| {
        let catalogue = app.catalogue()?;
        let revision = catalogue.revision().to_le_bytes();
        let parameters = uri.query().unwrap_or_default();
        let tag = reply::entity_tag(&[b"list", app.run.as_bytes(), &revision, parameters.as_bytes()]);
        reply::tagged(&headers, &tag, CachePolicy::Revalidate, reply::JSON, || {
            let positions = catalogue.select(&selection);
            let textures = positions.iter().skip(offset).take(limit);
            let textures = textures.filter_map(|&position| catalogue.textures().get(position as usize)).collect();
            reply::json_bytes(&TextureList { total: positions.len(), offset, textures })
        })
    })
    .await
}

#[derive(Serialize, utoipa::ToSchema)]
struct TextureDetail {
    id: u64,
    name: String,
    shape: Option<[usize; 3]>,
    channels: u8,
    tags: BTreeMap<String, String>,
    voxels: bool,
    /// BLAKE3 hash of the content, 64 hexadecimal digits.
    hash: Option<String>,
    /// The name of the file it was read from.
    file: Option<String>,
    #[schema(value_type = Option<Object>)]
    source: Option<Provenance>,
    #[schema(value_type = Option<Object>)]
    block: Option<BlockOf>,
    /// The compressed size of the voxels in bytes.
    stored_bytes: Option<u64>,
    /// The number of placements of the 3x3x3 window.
    windows: Option<u64>,
}

impl TextureDetail {
    fn of(texture: Texture, windows: Option<u64>) -> Self {
        // Only the name: the folders of the machine are not shown.
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
    responses((status = 200, body = TextureDetail, content_type = "application/json"), (status = 404, body = ProblemDocument)))]
pub(crate) async fn get(State(app): State<Arc<App>>, Path(id): Path<u64>) -> Result<Response, Problem> {
    app.quick(move |app| {
        let texture = app.database.texture(id)?;
        let windows = app.database.sums(id)?.map(|sums| sums.windows);
        reply::json(&TextureDetail::of(texture, windows))
    })
    .await
}

#[derive(Deserialize, utoipa::IntoParams)]
#[into_params(parameter_in = Query)]
pub(crate) struct DescriptorQuery {
    /// The view; default `full@1`.
    view: Option<String>,
}

#[derive(Serialize, utoipa::ToSchema)]
struct Descriptor {
    view: &'static str,
    /// The views that are stored for the texture.
    views: Vec<&'static str>,
    /// The 251 moments, in the order of the masks.
    moments: Vec<f32>,
    /// The exact sums, for `full@1` only; `null` if they are not stored.
    sums: Option<Vec<u64>>,
}

/// The 251 moments of a texture in one view
#[utoipa::path(get, path = "/textures/{id}/descriptor", tag = "textures", params(("id" = u64, Path), DescriptorQuery),
    responses((status = 200, body = Descriptor, content_type = "application/json"), (status = 404, body = ProblemDocument)))]
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
            let sentence = format!("texture {id} has no view '{}'; its views: {has}", wanted.escape_debug());
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
    responses((status = 200, body = TextureDetail, content_type = "application/json"), (status = 404, body = ProblemDocument),
        (status = 422, body = ProblemDocument)))]
pub(crate) async fn set_tags(
    State(app): State<Arc<App>>,
    Path(id): Path<u64>,
    Json(tags): Json<BTreeMap<String, String>>,
) -> Result<Response, Problem> {
    app.check_writable()?;
    let edit = tags.into_iter().fold(TagEdit::new(), |edit, (key, value)| edit.set(key, value));
    app.heavy(move |app| change_tags(app, id, &edit)).await
}

/// Remove a tag of a texture
#[utoipa::path(delete, path = "/textures/{id}/tags/{key}", tag = "textures", params(("id" = u64, Path), ("key" = String, Path)),
    responses((status = 200, body = TextureDetail, content_type = "application/json"), (status = 404, body = ProblemDocument)))]
pub(crate) async fn unset_tag(
    State(app): State<Arc<App>>,
    Path((id, key)): Path<(u64, String)>,
) -> Result<Response, Problem> {
    app.check_writable()?;
    app.heavy(move |app| change_tags(app, id, &TagEdit::new().unset(key))).await
}

fn change_tags(app: &App, id: u64, edit: &TagEdit) -> Result<Response, Problem> {
    let texture = app.database.tag(id, edit)?;
    app.note_change()?;
    let windows = app.database.sums(id)?.map(|sums| sums.windows);
    reply::json(&TextureDetail::of(texture, windows))
}

/// Remove a texture
#[utoipa::path(delete, path = "/textures/{id}", tag = "textures", params(("id" = u64, Path)),
    responses((status = 204), (status = 404, body = ProblemDocument)))]
pub(crate) async fn remove(State(app): State<Arc<App>>, Path(id): Path<u64>) -> Result<Response, Problem> {
    app.check_writable()?;
    app.heavy(move |app| {
        app.database.remove([id])?;
        app.note_change()?;
        Ok(StatusCode::NO_CONTENT.into_response())
    })
    .await
}

#[derive(utoipa::ToSchema)]
#[allow(dead_code, reason = "documents the form")]
struct AddForm {
    /// Volumes in any supported format, detached headers with their data, or the slices of one volume. Repeated.
    #[schema(content_media_type = "application/octet-stream")]
    file: Vec<String>,
    /// `KEY=VALUE`, a tag of every texture that is added. Repeated.
    tag: Option<Vec<String>>,
    /// How samples of more than 8 bits are mapped to 256 levels: `full`, `auto`, `nonzero` or `LO..HI`.
    intensity: Option<String>,
    /// Cut each volume into blocks of this side, 3 to 4096 voxels.
    block: Option<usize>,
}

#[derive(Serialize, utoipa::ToSchema)]
struct AddReport {
    added: u64,
    duplicates: u64,
    failed: Vec<FailedFile>,
    /// The ids of the textures, added or already in the store, in the order of the files.
    ids: Vec<u64>,
}

#[derive(Serialize, utoipa::ToSchema)]
struct FailedFile {
    path: String,
    error: String,
}

/// Add the volumes of a form
#[utoipa::path(post, path = "/textures", tag = "textures",
    request_body(content = AddForm, content_type = "multipart/form-data"),
    responses((status = 201, description = "At least one texture was added", body = AddReport, content_type = "application/json"),
        (status = 200, description = "All were already in the store", body = AddReport, content_type = "application/json"),
        (status = 403, body = ProblemDocument), (status = 413, body = ProblemDocument),
        (status = 422, description = "No file is a volume", body = ProblemDocument)))]
pub(crate) async fn add(State(app): State<Arc<App>>, form: Multipart) -> Result<Response, Problem> {
    app.check_writable()?;
    let form = UploadedForm::receive(&app, form).await?;
    app.heavy(move |app| add_form(app, &form).map_err(|problem| problem.relative_to(&form.roots()))).await
}

fn add_form(app: &App, form: &UploadedForm) -> Result<Response, Problem> {
    let options = form.ingest_options(app)?;
    let volumes = form.volumes()?;
    let options = options.relative_to(volumes.root);
    let report = ingest::ingest(&app.database, &volumes.paths, &options, &(), &mut |_| {})?;
    app.note_change()?;
    let roots = form.roots();
    let failed = report
        .failed
        .into_iter()
        .map(|file| FailedFile { path: roots.show(&file.path), error: full_sentence(&roots.error(file.error)) });
    if report.ids.is_empty() {
        let mut sentences = failed.map(|file| file.error);
        let first = sentences.next().unwrap_or_else(|| "the form holds no volume".to_owned());
        return Err(Problem::with_causes(StatusCode::UNPROCESSABLE_ENTITY, first, sentences.collect()));
    }
    let status = if report.added > 0 { StatusCode::CREATED } else { StatusCode::OK };
    let (added, duplicates) = (report.added, report.duplicates);
    let ids = report.ids.into_iter().map(u64::from).collect();
    let report = AddReport { added, duplicates, failed: failed.collect(), ids };
    Ok((status, reply::json(&report)?).into_response())
}
