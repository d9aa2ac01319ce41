//! Errors as callers see them: problem details (RFC 9457) with the library's sentences.

use axum::http::{HeaderValue, StatusCode, header};
use axum::response::{IntoResponse, Response};
use serde::Serialize;

use crate::volume::Hint as ReadHint;
use crate::{Error, Hint, IngestError, OpenError, QueryError, StoreError};

/// What went wrong, as `application/problem+json`.
#[derive(Clone, Debug, Serialize, utoipa::ToSchema)]
pub(crate) struct Problem {
    /// Always `about:blank`: the status says what kind of problem it is.
    #[serde(rename = "type")]
    kind: &'static str,
    /// The name of the status.
    title: &'static str,
    /// The HTTP status.
    status: u16,
    /// One sentence: what was found, what was expected, what to do.
    detail: String,
    /// What lies below it, the nearest first.
    causes: Vec<String>,
}

impl Problem {
    pub(crate) fn new(status: StatusCode, detail: impl Into<String>) -> Self {
        Self {
            kind: "about:blank",
            title: status.canonical_reason().unwrap_or("Error"),
            status: status.as_u16(),
            detail: detail.into(),
            causes: Vec::new(),
        }
    }

    pub(crate) fn of(status: StatusCode, error: &dyn std::error::Error) -> Self {
        let mut problem = Self::new(status, error.to_string());
        let mut cause = error.source();
        while let Some(error) = cause {
            problem.causes.push(error.to_string());
            cause = error.source();
        }
        problem
    }

    pub(crate) fn bad_request(detail: impl Into<String>) -> Self {
        Self::new(StatusCode::BAD_REQUEST, detail)
    }

    pub(crate) fn not_found(detail: impl Into<String>) -> Self {
        Self::new(StatusCode::NOT_FOUND, detail)
    }

    /// A thread of ours died: the log has more.
    pub(crate) fn internal() -> Self {
        Self::new(StatusCode::INTERNAL_SERVER_ERROR, "the server stumbled over this request: its log says more")
    }

    pub(crate) fn status(&self) -> StatusCode {
        StatusCode::from_u16(self.status).unwrap_or(StatusCode::INTERNAL_SERVER_ERROR)
    }

    /// What else was wrong.
    pub(crate) fn add_causes(&mut self, causes: impl IntoIterator<Item = String>) {
        self.causes.extend(causes);
    }

    /// Sentence and causes in one line.
    pub(crate) fn sentence(&self) -> String {
        let causes = self.causes.iter().map(String::as_str);
        std::iter::once(self.detail.as_str()).chain(causes).collect::<Vec<_>>().join(": ")
    }

    /// With every text passed through `show`.
    pub(crate) fn map(mut self, show: impl Fn(&str) -> String) -> Self {
        self.detail = show(&self.detail);
        self.causes = self.causes.iter().map(|cause| show(cause)).collect();
        self
    }
}

impl IntoResponse for Problem {
    fn into_response(self) -> Response {
        let body = serde_json::to_vec(&self).unwrap_or_default();
        let mut response = (self.status(), body).into_response();
        let kind = HeaderValue::from_static("application/problem+json");
        response.headers_mut().insert(header::CONTENT_TYPE, kind);
        response.headers_mut().insert(header::CACHE_CONTROL, HeaderValue::from_static("no-store"));
        response
    }
}

impl From<Error> for Problem {
    fn from(error: Error) -> Self {
        let status = status_of(&error);
        if status.is_server_error() {
            tracing::warn!(error = crate::chain(&error), "a request failed");
        }
        let mut problem = Self::of(status, &error);
        if let Some(remedy) = remedy(&error) {
            problem.detail = format!("{} ({remedy})", problem.detail);
        }
        problem
    }
}

/// An error and its causes in one line, with the remedy in brackets.
pub(crate) fn with_remedy(error: &Error) -> String {
    let chain = crate::chain(error);
    match remedy(error) {
        Some(remedy) => format!("{chain} ({remedy})"),
        None => chain,
    }
}

/// What would help against an error, in the words of the server.
fn remedy(error: &Error) -> Option<String> {
    Some(match error.hint()? {
        Hint::Read(ReadHint::RaiseVoxelLimit | ReadHint::RaiseInflatedLimit) => {
            "the limit is set where the server is started".into()
        }
        Hint::Read(ReadHint::GiveRawLayout | ReadHint::CheckRawLayout) => {
            "samples without a header are read by the program only".into()
        }
        Hint::Read(ReadHint::EnableFeature(_)) => "this server was built without that format".into(),
        Hint::OpenForWriting => "the server was started for reading only".into(),
        other => other.to_string(),
    })
}

/// The status for an error: 422 for what the caller gave, 404 for what is not there, 403 for what is not allowed, 409 and
/// 503 for the state of the store, and 500 for the rest. No wildcard, so that a new error is given a status here.
fn status_of(error: &Error) -> StatusCode {
    match error {
        Error::Open(OpenError::HeldByWriter { .. }) => StatusCode::SERVICE_UNAVAILABLE,
        Error::Query(QueryError::TooFewLabels { .. }) | Error::Ingest(IngestError::NotFound { .. }) => {
            StatusCode::NOT_FOUND
        }
        Error::Ingest(IngestError::OutsideFolder { .. }) => StatusCode::FORBIDDEN,
        Error::Query(_) | Error::Ingest(_) | Error::Exchange(_) => StatusCode::UNPROCESSABLE_ENTITY,
        Error::Store(error) => of_store(error),
        Error::Cancelled => StatusCode::CONFLICT,
        Error::Open(_) | Error::Maintenance(_) | Error::Space(_) | Error::Io { .. } => {
            StatusCode::INTERNAL_SERVER_ERROR
        }
    }
}

fn of_store(error: &StoreError) -> StatusCode {
    match error {
        StoreError::NoSuchTexture { .. } => StatusCode::NOT_FOUND,
        StoreError::ReadOnly => StatusCode::FORBIDDEN,
        StoreError::Invalid { .. } => StatusCode::UNPROCESSABLE_ENTITY,
        StoreError::Duplicate { .. } => StatusCode::CONFLICT,
        StoreError::Busy { .. } => StatusCode::SERVICE_UNAVAILABLE,
        StoreError::Open(_)
        | StoreError::Damage(_)
        | StoreError::Broken
        | StoreError::Poisoned
        | StoreError::Cancelled { .. }
        | StoreError::Engine { .. } => StatusCode::INTERNAL_SERVER_ERROR,
    }
}
