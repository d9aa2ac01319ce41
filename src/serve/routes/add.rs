//! Textures that are sent.

use std::sync::Arc;

use axum::extract::{Multipart, State};
use axum::http::StatusCode;
use axum::response::{IntoResponse, Response};
use serde::Serialize;

use crate::ingest;
use crate::serve::form::Intake;
use crate::serve::problem::{Problem, with_remedy};
use crate::serve::reply;
use crate::serve::state::App;

#[derive(utoipa::ToSchema)]
#[allow(dead_code, reason = "describes the form")]
struct Form {
    /// Volumes in any supported format, detached headers with their data, or the slices of one volume. Repeated.
    #[schema(content_media_type = "application/octet-stream")]
    file: Vec<String>,
    /// `KEY=VALUE` for every texture added. Repeated.
    tag: Option<Vec<String>>,
    /// How samples deeper than 8 bits become 256 levels: `full`, `auto`, `nonzero` or `LO..HI`.
    intensity: Option<String>,
    /// Cut each volume into blocks of this side.
    block: Option<usize>,
}

#[derive(Serialize, utoipa::ToSchema)]
struct Report {
    added: u64,
    duplicates: u64,
    failed: Vec<Failed>,
    /// The ids of all that are there now, in the order of the files.
    ids: Vec<u64>,
}

#[derive(Serialize, utoipa::ToSchema)]
struct Failed {
    path: String,
    error: String,
}

/// Add the volumes of a form
#[utoipa::path(post, path = "/textures", tag = "textures",
    request_body(content = Form, content_type = "multipart/form-data"),
    responses((status = 201, description = "Something was added", body = Report, content_type = "application/json"),
        (status = 200, description = "Everything was there already", body = Report, content_type = "application/json"),
        (status = 403, body = Problem), (status = 413, body = Problem),
        (status = 422, description = "None of the files is a volume", body = Problem)))]
pub(crate) async fn add(State(app): State<Arc<App>>, form: Multipart) -> Result<Response, Problem> {
    app.may_change()?;
    let intake = Intake::receive(&app, form).await?;
    app.heavy(move |app| ingested(app, &intake).map_err(|problem| problem.map(|text| intake.shown(text)))).await
}

fn ingested(app: &App, intake: &Intake) -> Result<Response, Problem> {
    let mut options = intake.options(app)?;
    let (files, folder) = intake.volumes()?;
    options.within = Some(folder);
    let report = ingest::ingest(&app.database, &files, &options, &(), &mut |_| {})?;
    app.note_change()?;
    let failed: Vec<Failed> = report
        .failed
        .into_iter()
        .map(|file| Failed {
            path: intake.shown(&crate::volume::display_path(&file.path)),
            error: intake.shown(&app.shown(&with_remedy(&file.error))),
        })
        .collect();
    if report.ids.is_empty() {
        let mut sentences = failed.into_iter().map(|file| file.error);
        let first = sentences.next().unwrap_or_else(|| "no volume was found among the files".to_owned());
        let mut problem = Problem::new(StatusCode::UNPROCESSABLE_ENTITY, first);
        problem.add_causes(sentences);
        return Err(problem);
    }
    let status = if report.added > 0 { StatusCode::CREATED } else { StatusCode::OK };
    let ids = report.ids.into_iter().map(u64::from).collect();
    let report = Report { added: report.added, duplicates: report.duplicates, failed, ids };
    Ok((status, reply::json(&report)?).into_response())
}
