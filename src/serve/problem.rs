//! Errors as clients see them: problem details (RFC 9457) with the library's sentences.

use axum::http::{HeaderValue, StatusCode, header};
use axum::response::{IntoResponse, Response};
use serde::Serialize;

use super::paths::Roots;
use super::status::status_of;
use crate::volume::Hint as ReadHint;
use crate::{Error, Hint};

/// What went wrong with a request or job.
///
/// An error of the library is kept as it is until it is shown, because its paths are shown relative to the folders that
/// are served.
#[derive(Debug)]
pub(crate) struct Problem {
    status: StatusCode,
    what: What,
}

#[derive(Debug)]
enum What {
    Error(Box<Error>),
    Text { detail: String, causes: Vec<String> },
}

/// What went wrong, as `application/problem+json`.
#[derive(Clone, Debug, Serialize, utoipa::ToSchema)]
#[schema(as = Problem)]
pub(crate) struct ProblemDocument {
    /// Always `about:blank`: the status says what kind of problem it is.
    #[serde(rename = "type")]
    kind: &'static str,
    /// The name of the status.
    title: &'static str,
    /// The HTTP status.
    status: u16,
    /// One sentence: what was found, what was expected, what to do.
    detail: String,
    /// The causes, nearest first.
    causes: Vec<String>,
}

impl Problem {
    pub(crate) fn new(status: StatusCode, detail: impl Into<String>) -> Self {
        Self { status, what: What::Text { detail: detail.into(), causes: Vec::new() } }
    }

    pub(crate) fn with_causes(status: StatusCode, detail: impl Into<String>, causes: Vec<String>) -> Self {
        Self { status, what: What::Text { detail: detail.into(), causes } }
    }

    pub(crate) fn bad_request(detail: impl Into<String>) -> Self {
        Self::new(StatusCode::BAD_REQUEST, detail)
    }

    pub(crate) fn not_found(detail: impl Into<String>) -> Self {
        Self::new(StatusCode::NOT_FOUND, detail)
    }

    /// A bug, or a failure of the machine; the log has the details.
    pub(crate) fn internal() -> Self {
        Self::new(StatusCode::INTERNAL_SERVER_ERROR, "internal error: the server's log has the details")
    }

    /// With all paths relative to these folders.
    pub(crate) fn relative_to(mut self, roots: &Roots) -> Self {
        if let What::Error(error) = self.what {
            self.what = What::Error(Box::new(roots.error(*error)));
        }
        self
    }

    /// The sentence and its causes in one line.
    pub(crate) fn sentence(self) -> String {
        let ProblemDocument { detail, causes, .. } = self.into_document();
        std::iter::once(detail).chain(causes).collect::<Vec<_>>().join(": ")
    }

    fn into_document(self) -> ProblemDocument {
        let status = self.status;
        // Only here are paths turned into text. Those below no served folder are reduced to their names.
        let (detail, causes) = match self.relative_to(&Roots::default()).what {
            What::Text { detail, causes } => (detail, causes),
            What::Error(error) => (with_remedy(error.to_string(), &error), causes(&*error)),
        };
        ProblemDocument {
            kind: "about:blank",
            title: status.canonical_reason().unwrap_or("Error"),
            status: status.as_u16(),
            detail,
            causes,
        }
    }
}

/// An error, its causes and its remedy in one line.
pub(crate) fn full_sentence(error: &Error) -> String {
    with_remedy(crate::chain(error), error)
}

fn with_remedy(sentence: String, error: &Error) -> String {
    match remedy(error) {
        Some(remedy) => format!("{sentence} ({remedy})"),
        None => sentence,
    }
}

/// The remedy of an error in the words of the server.
fn remedy(error: &Error) -> Option<String> {
    let remedy = match error.hint()? {
        Hint::Read(hint) => return Some(remedy_of_file(hint)),
        Hint::ListTextures => "GET /api/v1/textures lists the ids",
        Hint::ChooseSpace => "GET /api/v1/spaces lists the spaces",
        Hint::OpenForWriting => "start the server without --read-only",
        Hint::StayInFolder => "give a path below the folder to ingest from",
        Hint::Reindex => "start the job `reindex`",
        Hint::RepairStore => "stop the server and run `hlacdb repair`, or restore a backup",
        Hint::ReopenStore => "restart the server",
        // These do not depend on where they are read.
        hint @ (Hint::CreateStore
        | Hint::ChooseAnotherPath
        | Hint::UpgradeHlacdb
        | Hint::MigrateStore
        | Hint::WaitForWriter
        | Hint::UseLocalDisk
        | Hint::CloseReaders
        | Hint::RestoreBackup
        | Hint::RenameSpace
        | Hint::TagTextures
        | Hint::ChooseLabel
        | Hint::SmallerBlock
        | Hint::UseArchive
        | Hint::KeepVoxels) => return Some(hint.to_string()),
    };
    Some(remedy.to_owned())
}

/// The remedy for a file that could not be read.
fn remedy_of_file(hint: ReadHint) -> String {
    match hint {
        ReadHint::RaiseVoxelLimit => "start the server with a larger --max-voxels if the file is right".into(),
        ReadHint::RaiseInflatedLimit => "start the server with a larger --max-inflated if the file is right".into(),
        ReadHint::GiveRawLayout | ReadHint::CheckRawLayout => {
            "samples without a header are read by `hlacdb ingest` only".into()
        }
        ReadHint::EnableFeature(_) => "this server was built without that format".into(),
        hint => hint.to_string(),
    }
}

fn causes(error: &dyn std::error::Error) -> Vec<String> {
    std::iter::successors(error.source(), |error| error.source()).map(ToString::to_string).collect()
}

impl IntoResponse for Problem {
    fn into_response(self) -> Response {
        let status = self.status;
        let body = serde_json::to_vec(&self.into_document()).unwrap_or_default();
        let mut response = (status, body).into_response();
        let media_type = HeaderValue::from_static("application/problem+json");
        response.headers_mut().insert(header::CONTENT_TYPE, media_type);
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
        Self { status, what: What::Error(Box::new(error)) }
    }
}
