//! Starting, watching and cancelling jobs.

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
use crate::ingest::{self, IngestOptions, IngestStatus};
use crate::serve::jobs::{Job, JobKind, JobOutcome, JobReport, JobState};
use crate::serve::parameters;
use crate::serve::problem::{Problem, ProblemDocument, full_sentence};
use crate::serve::reply;
use crate::serve::state::App;
use crate::volume::display_path;

/// The least time between two events of a job.
const EVENT_INTERVAL: Duration = Duration::from_millis(100);

#[derive(Deserialize, utoipa::ToSchema)]
#[serde(deny_unknown_fields)]
pub(crate) struct ReindexRequest {
    /// First describe every texture again whose voxels are stored.
    #[serde(default)]
    reextract: bool,
}

/// Fit the spaces again, on all textures
#[utoipa::path(post, path = "/jobs/reindex", tag = "jobs", request_body = ReindexRequest,
    responses((status = 202, body = JobReport, content_type = "application/json"), (status = 403, body = ProblemDocument),
        (status = 409, body = ProblemDocument)))]
pub(crate) async fn reindex(
    State(app): State<Arc<App>>,
    request: Option<Json<ReindexRequest>>,
) -> Result<Response, Problem> {
    app.check_writable()?;
    let options = ReindexOptions::new().reextract(request.is_some_and(|Json(request)| request.reextract));
    let report = app.start_job(JobKind::Reindex, move |app, job| match app.database.reindex(&options, job) {
        Ok(report) => Ok(JobOutcome {
            state: JobState::Done,
            message: format!("fit {} of {} on {} textures", report.epoch, report.spaces.join(", "), report.textures),
        }),
        Err(error) => JobOutcome::of_error(error),
    })?;
    accepted(&report)
}

#[derive(Deserialize, utoipa::ToSchema)]
#[serde(deny_unknown_fields)]
pub(crate) struct IngestRequest {
    /// A file or folder, by its path below the folder to ingest from; empty for that folder itself.
    #[serde(default)]
    path: String,
    /// Tags of every texture that is added.
    #[serde(default)]
    tags: BTreeMap<String, String>,
    /// Cut each volume into blocks of this side, 3 to 4096 voxels.
    block: Option<usize>,
    /// How samples of more than 8 bits are mapped to 256 levels: `full`, `auto`, `nonzero` or `LO..HI`.
    intensity: Option<String>,
}

/// Add the volumes of a file or folder on the server
#[utoipa::path(post, path = "/jobs/ingest", tag = "jobs", request_body = IngestRequest,
    responses((status = 202, body = JobReport, content_type = "application/json"), (status = 403, body = ProblemDocument),
        (status = 404, body = ProblemDocument), (status = 409, body = ProblemDocument)))]
pub(crate) async fn ingest(
    State(app): State<Arc<App>>,
    Json(request): Json<IngestRequest>,
) -> Result<Response, Problem> {
    app.check_writable()?;
    let Some(root) = app.ingest_root.clone() else {
        let detail = "this server has no folder to ingest from: start it with --ingest-folder, or upload the files";
        return Err(Problem::new(StatusCode::FORBIDDEN, detail));
    };
    let block = request.block.map(parameters::check_block_side).transpose()?;
    parameters::check_tags(&request.tags)?;
    let mut reading = parameters::read_options(&app.options);
    if let Some(rule) = &request.intensity {
        reading.intensity = parameters::intensity(rule)?;
    }
    let options = IngestOptions::new().reading(reading).tags(request.tags).relative_to(root.clone());
    let options = match block {
        Some(side) => options.block(side),
        None => options,
    };
    let path = app.heavy(move |_| Ok(ingest::resolve_within(&root, &request.path)?)).await?;
    let report = app.start_job(JobKind::Ingest, move |app, job| {
        let mut failed = 0_u64;
        let mut report = ingest::ingest(&app.database, &[path], &options, job, &mut |event| {
            if event.status == IngestStatus::Failed {
                failed += 1;
                job.set_message(format!("{failed} failed, the last: {}", display_path(&event.path)));
            }
        })?;
        let state = if report.cancelled { JobState::Cancelled } else { JobState::Done };
        let (added, duplicates, failed) = (report.added, report.duplicates, report.failed.len());
        let mut message = format!("{added} added, {duplicates} already in the store, {failed} failed");
        if let Some(last) = report.failed.pop() {
            message = format!("{message}, the last: {}", full_sentence(&app.roots.error(last.error)));
        }
        Ok(JobOutcome { state, message })
    })?;
    accepted(&report)
}

/// 202 with the address of the job.
fn accepted(report: &JobReport) -> Result<Response, Problem> {
    let mut response = (StatusCode::ACCEPTED, reply::json(report)?).into_response();
    if let Ok(address) = HeaderValue::from_str(&format!("/api/v1/jobs/{}", report.id)) {
        response.headers_mut().insert(header::LOCATION, address);
    }
    Ok(response)
}

#[derive(Serialize, utoipa::ToSchema)]
struct JobList {
    jobs: Vec<JobReport>,
}

/// All jobs since the server started, newest first
#[utoipa::path(get, path = "/jobs", tag = "jobs", responses((status = 200, body = JobList, content_type = "application/json")))]
pub(crate) async fn list(State(app): State<Arc<App>>) -> Result<Response, Problem> {
    reply::json(&JobList { jobs: app.jobs.reports() })
}

/// One job
#[utoipa::path(get, path = "/jobs/{id}", tag = "jobs", params(("id" = u64, Path)),
    responses((status = 200, body = JobReport, content_type = "application/json"), (status = 404, body = ProblemDocument)))]
pub(crate) async fn get(State(app): State<Arc<App>>, Path(id): Path<u64>) -> Result<Response, Problem> {
    reply::json(&app.jobs.get(id)?.report())
}

/// Cancel a job: it stops at its next safe point, and what it has committed stays
#[utoipa::path(delete, path = "/jobs/{id}", tag = "jobs", params(("id" = u64, Path)),
    responses((status = 202, body = JobReport, content_type = "application/json"), (status = 404, body = ProblemDocument)))]
pub(crate) async fn cancel(State(app): State<Arc<App>>, Path(id): Path<u64>) -> Result<Response, Problem> {
    let job = app.jobs.get(id)?;
    job.cancel();
    accepted(&job.report())
}

/// The progress of a job as server-sent events: `progress`, and at last `end`
#[utoipa::path(get, path = "/jobs/{id}/events", tag = "jobs", params(("id" = u64, Path)),
    responses((status = 200, body = JobReport, content_type = "text/event-stream"), (status = 404, body = ProblemDocument)))]
pub(crate) async fn events(State(app): State<Arc<App>>, Path(id): Path<u64>) -> Result<Response, Problem> {
    let job = app.jobs.get(id)?;
    Ok(Sse::new(event_stream(&app, &job))
        .keep_alive(KeepAlive::new().interval(Duration::from_secs(15)))
        .into_response())
}

fn event_stream(app: &App, job: &Arc<Job>) -> impl Stream<Item = Result<Event, Infallible>> + use<> {
    let mut watched = job.watch();
    // The current state is the first event.
    watched.mark_changed();
    stream::unfold(Some((watched, app.stopping.clone())), async |open| {
        let (mut watched, mut stopping) = open?;
        // The server waits for open streams when it stops, so they are closed then.
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
        tokio::time::sleep(EVENT_INTERVAL).await;
        Some((Ok(event), Some((watched, stopping))))
    })
}
