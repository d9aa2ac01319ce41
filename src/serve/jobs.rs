//! Long work beside the requests, how far it is, and how it is stopped.

use std::collections::BTreeMap;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use axum::http::StatusCode;
use serde::Serialize;
use tokio::sync::watch;

use super::problem::Problem;
use super::state::App;
use crate::{Error, Progress, chain};

/// So many jobs that have ended are remembered.
const REMEMBERED: usize = 100;
/// So many may run at once.
const RUNNING: usize = 4;

#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, utoipa::ToSchema)]
#[serde(rename_all = "lowercase")]
pub(crate) enum State {
    Running,
    Done,
    Failed,
    Cancelled,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, utoipa::ToSchema)]
#[serde(rename_all = "lowercase")]
pub(crate) enum Kind {
    Reindex,
    Ingest,
}

/// A job as callers see it.
#[derive(Clone, Debug, Serialize, utoipa::ToSchema)]
pub(crate) struct Report {
    pub(crate) id: u64,
    kind: Kind,
    pub(crate) state: State,
    /// Steps done.
    done: u64,
    /// Steps there are, where that is known.
    total: Option<u64>,
    /// What is being done, or what came of it.
    message: String,
    /// Why it failed.
    error: Option<String>,
}

/// A job under way, or ended.
pub(crate) struct Job {
    report: watch::Sender<Report>,
    cancelled: AtomicBool,
    /// The server's own end cancels every job.
    stopping: watch::Receiver<bool>,
}

impl Job {
    pub(crate) fn report(&self) -> Report {
        self.report.borrow().clone()
    }

    /// Every change of the report from now on.
    pub(crate) fn watch(&self) -> watch::Receiver<Report> {
        self.report.subscribe()
    }

    pub(crate) fn cancel(&self) {
        self.cancelled.store(true, Ordering::Relaxed);
        self.report.send_modify(|report| {
            if report.state == State::Running {
                report.message = "stopping at the next safe place".to_owned();
            }
        });
    }

    /// Says what is being done.
    pub(crate) fn say(&self, message: String) {
        self.report.send_modify(|report| report.message = message);
    }

    fn end(&self, ended: Result<Ended, Problem>) {
        self.report.send_modify(|report| match ended {
            Ok(Ended { state, message }) => (report.state, report.message) = (state, message),
            Err(problem) => {
                report.state = State::Failed;
                report.error = Some(problem.sentence());
            }
        });
    }
}

impl Progress for Job {
    fn begin(&self, stage: &str, steps: Option<u64>) {
        self.report.send_modify(|report| {
            (report.done, report.total) = (0, steps);
            report.message = stage.to_owned();
        });
    }

    fn advance(&self, steps: u64) {
        self.report.send_modify(|report| report.done += steps);
    }

    fn cancelled(&self) -> bool {
        self.cancelled.load(Ordering::Relaxed) || *self.stopping.borrow()
    }
}

/// How a job ended that did not fail.
pub(crate) struct Ended {
    pub(crate) state: State,
    pub(crate) message: String,
}

/// The jobs of this run, by id.
#[derive(Default)]
pub(crate) struct Jobs(Mutex<BTreeMap<u64, Arc<Job>>>);

impl Jobs {
    fn held(&self) -> MutexGuard<'_, BTreeMap<u64, Arc<Job>>> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }

    pub(crate) fn get(&self, id: u64) -> Result<Arc<Job>, Problem> {
        self.held().get(&id).cloned().ok_or_else(|| Problem::not_found(format!("there is no job {id}")))
    }

    /// All jobs, the newest first.
    pub(crate) fn reports(&self) -> Vec<Report> {
        self.held().values().rev().map(|job| job.report()).collect()
    }

    pub(crate) fn running(&self) -> usize {
        self.held().values().filter(|job| job.report.borrow().state == State::Running).count()
    }

    /// Begins a job on a thread of its own.
    pub(crate) fn begin(
        app: &Arc<App>,
        kind: Kind,
        work: impl FnOnce(&App, &Job) -> Result<Ended, Problem> + Send + 'static,
    ) -> Result<Report, Problem> {
        let job = app.jobs.enter(kind, app.stopping.clone())?;
        let (app, running) = (Arc::clone(app), Arc::clone(&job));
        // Not one of the runtime's threads: those are waited for when the server ends, and this one only as far as it
        // heeds its cancellation.
        let started = std::thread::Builder::new().name(format!("{kind:?}").to_lowercase()).spawn(move || {
            let work = std::panic::AssertUnwindSafe(|| work(&app, &running));
            let ended = std::panic::catch_unwind(work).unwrap_or_else(|_| Err(Problem::internal()));
            // Whatever was made durable before a failure is shown too.
            let _ = app.note_change();
            running.end(ended.map_err(|problem| problem.map(|text| app.shown(text))));
        });
        if let Err(error) = started {
            tracing::error!(%error, "no thread could be started for a job");
            job.end(Err(Problem::internal()));
        }
        Ok(job.report())
    }

    fn enter(&self, kind: Kind, stopping: watch::Receiver<bool>) -> Result<Arc<Job>, Problem> {
        let mut jobs = self.held();
        let running = |job: &&Arc<Job>| job.report.borrow().state == State::Running;
        let busy = |sentence: &str| Err(Problem::new(StatusCode::CONFLICT, sentence));
        if kind == Kind::Reindex && jobs.values().filter(running).any(|job| job.report.borrow().kind == kind) {
            return busy("a reindex is running already: wait for it, or cancel it");
        }
        if jobs.values().filter(running).count() >= RUNNING {
            return busy("too many jobs are running already: wait for one, or cancel one");
        }
        while jobs.len() >= REMEMBERED {
            let ended = jobs.iter().find(|(_, job)| !running(job)).map(|(&id, _)| id);
            let Some(id) = ended else { break };
            jobs.remove(&id);
        }
        let id = jobs.last_key_value().map_or(1, |(&last, _)| last + 1);
        let report = Report {
            id,
            kind,
            state: State::Running,
            done: 0,
            total: None,
            message: "beginning".to_owned(),
            error: None,
        };
        let job = Arc::new(Job { report: watch::Sender::new(report), cancelled: AtomicBool::new(false), stopping });
        jobs.insert(id, Arc::clone(&job));
        Ok(job)
    }
}

/// What a job that was stopped before its end says.
pub(crate) fn stopped(error: Error) -> Result<Ended, Problem> {
    match error {
        Error::Cancelled => Ok(Ended { state: State::Cancelled, message: chain(&Error::Cancelled) }),
        error => Err(error.into()),
    }
}
