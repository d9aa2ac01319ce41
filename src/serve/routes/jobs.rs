//! Jobs as callers begin, watch and end them.

use std::collections::BTreeMap;
use std::convert::Infallible;
use std::sync::Arc;
use std::time::Duration;

use axum::Json;
use axum::extract::{Path, State};
use axum::http::{HeaderValue, StatusCode, header};
use axum::response::sse::{Event, KeepAlive, Sse};
use axum::response::{IntoResponse, Response};
use futures_util::stream::{self, Stream};
use serde::{Deserialize, Serialize};

use crate::ReindexOptions;
use crate::ingest::{self, Options, Status};
use crate::serve::form::{self, BLOCKS};
use crate::serve::jobs::{self, Ended, Job, Jobs, Kind, Report, State as JobState};
use crate::serve::problem::Problem;
use crate::serve::reply;
use crate::serve::state::App;

/// Two events of a job are at least so far apart.
const PACE: Duration = Duration::from_millis(100);

#[derive(Deserialize, utoipa::ToSchema)]
#[serde(deny_unknown_fields)]
pub(crate) struct ReindexAsked {
    /// Describe every texture whose voxels are kept anew.
    #[serde(default)]
    reextract: bool,
}

/// Fit the spaces anew on everything there is
#[utoipa::path(post, path = "/jobs/reindex", tag = "jobs", request_body = ReindexAsked,
    responses((status = 202, body = Report, content_type = "application/json"), (status = 403, body = Problem),
        (status = 409, body = Problem)))]
pub(crate) async fn reindex(
    State(app): State<Arc<App>>,
    asked: Option<Json<ReindexAsked>>,
) -> Result<Response, Problem> {
    app.may_change()?;
    let options =
        ReindexOptions { reextract: asked.is_some_and(|Json(asked)| asked.reextract), ..ReindexOptions::default() };
    let report = Jobs::begin(&app, Kind::Reindex, move |app, job| match app.database.reindex(&options, job) {
        Ok(report) => Ok(Ended {
            state: JobState::Done,
            message: format!("fit {} of {} on {} textures", report.epoch, report.spaces.join(", "), report.textures),
        }),
        Err(error) => jobs::stopped(error),
    })?;
    accepted(&report)
}

#[derive(Deserialize, utoipa::ToSchema)]
#[serde(deny_unknown_fields)]
pub(crate) struct IngestAsked {
    /// A file or folder, by its path below the folder that may be ingested from; the whole folder where it is empty.
    #[serde(default)]
    path: String,
    /// Tags for every texture added.
    #[serde(default)]
    tags: BTreeMap<String, String>,
    /// Cut each volume into blocks of this side.
    block: Option<usize>,
    /// How samples deeper than 8 bits become 256 levels: `full`, `auto`, `nonzero` or `LO..HI`.
    intensity: Option<String>,
}

/// Add what is in a folder of the server
#[utoipa::path(post, path = "/jobs/ingest", tag = "jobs", request_body = IngestAsked,
    responses((status = 202, body = Report, content_type = "application/json"), (status = 403, body = Problem),
        (status = 404, body = Problem), (status = 409, body = Problem)))]
pub(crate) async fn ingest(State(app): State<Arc<App>>, Json(asked): Json<IngestAsked>) -> Result<Response, Problem> {
    app.may_change()?;
    let Some(root) = app.ingest_root.clone() else {
        let sentence = "this server has no folder to ingest from: start it with --ingest-folder, or send the files";
        return Err(Problem::new(StatusCode::FORBIDDEN, sentence));
    };
    if let Some(side) = asked.block.filter(|side| !BLOCKS.contains(side)) {
        return Err(Problem::bad_request(format!("{side} is no side of a block: use 3 to 4096")));
    }
    let mut options = Options {
        reading: form::reading(&app),
        tags: form::tags(asked.tags)?,
        block: asked.block,
        within: Some(root.clone()),
        ..Options::default()
    };
    if let Some(rule) = &asked.intensity {
        options.reading.intensity = form::intensity(rule)?;
    }
    let path = app.heavy(move |_| Ok(ingest::confined(&root, &asked.path)?)).await?;
    let report = Jobs::begin(&app, Kind::Ingest, move |app, job| {
        let mut failed = 0_u64;
        let report = ingest::ingest(&app.database, &[path], &options, job, &mut |event| {
            if event.status == Status::Failed {
                failed += 1;
                let error = event.error.as_ref().map(|error| crate::chain(error)).unwrap_or_default();
                job.say(format!("{failed} failed, the last: {}", app.shown(&error)));
            }
        })?;
        let state = if report.cancelled { JobState::Cancelled } else { JobState::Done };
        let mut message =
            format!("{} added, {} already there, {} failed", report.added, report.duplicates, report.failed.len());
        if let Some(last) = report.failed.last() {
            message = format!("{message}, the last: {}", app.shown(&crate::chain(&last.error)));
        }
        Ok(Ended { state, message })
    })?;
    accepted(&report)
}

fn accepted(report: &Report) -> Result<Response, Problem> {
    let place = format!("/api/v1/jobs/{}", report.id);
    let mut response = (StatusCode::ACCEPTED, reply::json(report)?).into_response();
    if let Ok(place) = HeaderValue::from_str(&place) {
        response.headers_mut().insert(header::LOCATION, place);
    }
    Ok(response)
}

#[derive(Serialize, utoipa::ToSchema)]
struct List {
    jobs: Vec<Report>,
}

/// The jobs of this run of the server, the newest first
#[utoipa::path(get, path = "/jobs", tag = "jobs", responses((status = 200, body = List, content_type = "application/json")))]
pub(crate) async fn list(State(app): State<Arc<App>>) -> Result<Response, Problem> {
    reply::json(&List { jobs: app.jobs.reports() })
}

/// One job
#[utoipa::path(get, path = "/jobs/{id}", tag = "jobs", params(("id" = u64, Path)),
    responses((status = 200, body = Report, content_type = "application/json"), (status = 404, body = Problem)))]
pub(crate) async fn get(State(app): State<Arc<App>>, Path(id): Path<u64>) -> Result<Response, Problem> {
    reply::json(&app.jobs.get(id)?.report())
}

/// Stop a job at the next safe place; what it has made durable stays
#[utoipa::path(delete, path = "/jobs/{id}", tag = "jobs", params(("id" = u64, Path)),
    responses((status = 202, body = Report, content_type = "application/json"), (status = 404, body = Problem)))]
pub(crate) async fn cancel(State(app): State<Arc<App>>, Path(id): Path<u64>) -> Result<Response, Problem> {
    let job = app.jobs.get(id)?;
    job.cancel();
    accepted(&job.report())
}

/// How far a job is, as it goes: events `progress`, and a last one, `end`
#[utoipa::path(get, path = "/jobs/{id}/events", tag = "jobs", params(("id" = u64, Path)),
    responses((status = 200, body = Report, content_type = "text/event-stream"), (status = 404, body = Problem)))]
pub(crate) async fn events(State(app): State<Arc<App>>, Path(id): Path<u64>) -> Result<Response, Problem> {
    let job = app.jobs.get(id)?;
    Ok(Sse::new(told(&app, &job)).keep_alive(KeepAlive::new().interval(Duration::from_secs(15))).into_response())
}

fn told(app: &App, job: &Arc<Job>) -> impl Stream<Item = Result<Event, Infallible>> + use<> {
    let mut watched = job.watch();
    // The state of now is the first event.
    watched.mark_changed();
    stream::unfold(Some((watched, app.stopping.clone())), async |open| {
        let (mut watched, mut stopping) = open?;
        // A server that ends closes its streams, or it would wait for them.
        tokio::select! {
            changed = watched.changed() => changed.ok()?,
            _ = stopping.wait_for(|&stop| stop) => return None,
        }
        let report = watched.borrow_and_update().clone();
        let ended = report.state != JobState::Running;
        let event = Event::default().event(if ended { "end" } else { "progress" });
        let event = event.json_data(&report).unwrap_or_default();
        if ended {
            return Some((Ok(event), None));
        }
        tokio::time::sleep(PACE).await;
        Some((Ok(event), Some((watched, stopping))))
    })
}
