//! Jobs: long work on threads of its own, with progress and cancellation.

use std::collections::BTreeMap;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use axum::http::StatusCode;
use serde::Serialize;
use tokio::sync::watch;

use super::problem::Problem;
use crate::{Error, Progress, chain};

/// How many jobs are remembered, running ones included.
const REMEMBERED: usize = 100;
/// How many jobs may run at once.
const MAX_RUNNING: usize = 4;

#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, utoipa::ToSchema)]
#[serde(rename_all = "lowercase")]
pub(crate) enum JobState {
    Running,
    Done,
    Failed,
    Cancelled,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, utoipa::ToSchema)]
#[serde(rename_all = "lowercase")]
pub(crate) enum JobKind {
    Reindex,
    Ingest,
}

impl JobKind {
    pub(super) const fn name(self) -> &'static str {
        match self {
            Self::Reindex => "reindex",
            Self::Ingest => "ingest",
        }
    }
}

/// A job: its state and progress.
#[derive(Clone, Debug, Serialize, utoipa::ToSchema)]
pub(crate) struct JobReport {
    pub(crate) id: u64,
    kind: JobKind,
    pub(crate) state: JobState,
    /// Steps done.
    done: u64,
    /// Steps in all, if known.
    total: Option<u64>,
    /// The current stage, or the result.
    message: String,
    /// Why the job failed.
    error: Option<String>,
}

/// A job that runs or has ended.
pub(crate) struct Job {
    report: watch::Sender<JobReport>,
    cancelled: AtomicBool,
    /// Stopping the server cancels every job.
    stopping: watch::Receiver<bool>,
}

impl Job {
    pub(crate) fn report(&self) -> JobReport {
        self.report.borrow().clone()
    }

    /// Receives every change of the report from now on.
    pub(crate) fn watch(&self) -> watch::Receiver<JobReport> {
        self.report.subscribe()
    }

    pub(crate) fn cancel(&self) {
        self.cancelled.store(true, Ordering::Relaxed);
        self.report.send_modify(|report| {
            if report.state == JobState::Running {
                report.message = "stopping at the next safe point".to_owned();
            }
        });
    }

    pub(crate) fn set_message(&self, message: String) {
        self.report.send_modify(|report| report.message = message);
    }

    fn is_running(&self) -> bool {
        self.report.borrow().state == JobState::Running
    }

    pub(super) fn end(&self, outcome: Result<JobOutcome, Problem>) {
        self.report.send_modify(|report| match outcome {
            Ok(JobOutcome { state, message }) => (report.state, report.message) = (state, message),
            Err(problem) => {
                report.state = JobState::Failed;
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

/// How a job ended that did not fail: done or cancelled.
pub(crate) struct JobOutcome {
    pub(crate) state: JobState,
    pub(crate) message: String,
}

impl JobOutcome {
    /// The outcome of a job that `error` ended: cancelled if that is what the error says.
    pub(crate) fn of_error(error: Error) -> Result<Self, Problem> {
        match error {
            Error::Cancelled => Ok(Self { state: JobState::Cancelled, message: chain(&Error::Cancelled) }),
            error => Err(error.into()),
        }
    }
}

/// The jobs since the server started, by id.
#[derive(Default)]
pub(crate) struct Jobs(Mutex<BTreeMap<u64, Arc<Job>>>);

impl Jobs {
    fn lock(&self) -> MutexGuard<'_, BTreeMap<u64, Arc<Job>>> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }

    pub(crate) fn get(&self, id: u64) -> Result<Arc<Job>, Problem> {
        self.lock().get(&id).cloned().ok_or_else(|| Problem::not_found(format!("there is no job {id}")))
    }

    /// All jobs, newest first.
    pub(crate) fn reports(&self) -> Vec<JobReport> {
        self.lock().values().rev().map(|job| job.report()).collect()
    }

    pub(crate) fn running(&self) -> usize {
        self.lock().values().filter(|job| job.is_running()).count()
    }

    /// Adds a job of this kind.
    ///
    /// # Errors
    /// 409 if too many jobs are running, or a second reindex is asked for.
    pub(super) fn register(&self, kind: JobKind, stopping: watch::Receiver<bool>) -> Result<Arc<Job>, Problem> {
        let mut jobs = self.lock();
        let running: Vec<JobKind> =
            jobs.values().filter(|job| job.is_running()).map(|job| job.report.borrow().kind).collect();
        let conflict = |detail: &str| Err(Problem::new(StatusCode::CONFLICT, detail));
        if kind == JobKind::Reindex && running.contains(&kind) {
            return conflict("a reindex is already running: wait for it, or cancel it");
        }
        if running.len() >= MAX_RUNNING {
            return conflict("too many jobs are already running: wait for one, or cancel one");
        }
        while jobs.len() >= REMEMBERED {
            let ended = jobs.iter().find(|(_, job)| !job.is_running()).map(|(&id, _)| id);
            let Some(id) = ended else { break };
            jobs.remove(&id);
        }
        let id = jobs.last_key_value().map_or(1, |(&last, _)| last + 1);
        let report = JobReport {
            id,
            kind,
            state: JobState::Running,
            done: 0,
            total: None,
            message: "starting".to_owned(),
            error: None,
        };
        let job = Arc::new(Job { report: watch::Sender::new(report), cancelled: AtomicBool::new(false), stopping });
        jobs.insert(id, Arc::clone(&job));
        Ok(job)
    }
}
