//! What the fuzzer drives: requests answered without a network. Built only with the feature `fuzz`.

use std::sync::Arc;
use std::time::Duration;

use axum::Router;
use axum::body::Body;
use axum::http::Request;
use hyper::service::Service;
use hyper_util::service::TowerToHyperService;
use tokio::runtime::{Builder, Runtime};
use tokio::sync::watch;

use super::listen::router;
use super::routes::textures;
use super::settings::{ServeError, Settings};
use super::state::App;
use crate::Database;

/// So long an answer's body may take.
const BODY_TIME: Duration = Duration::from_secs(60);

/// A server without a network.
pub struct Door {
    runtime: Runtime,
    router: Router,
    /// While it is there the server is not told to stop.
    _stopper: watch::Sender<bool>,
}

impl Door {
    /// A server for `database`.
    ///
    /// # Errors
    /// As [`Server::bind`](super::Server::bind), and [`ServeError::Io`].
    pub fn open(database: Database, settings: Settings) -> Result<Self, ServeError> {
        settings.check()?;
        let runtime = Builder::new_current_thread().enable_all().build();
        let runtime = runtime.map_err(|source| ServeError::Io { doing: "starting the server's thread", source })?;
        let (stopper, stopping) = watch::channel(false);
        let app = Arc::new(App::new(database, settings, stopping)?);
        Ok(Self { runtime, router: router(&app), _stopper: stopper })
    }

    /// The status and body that answer a request, which is given as its text: method and target, headers, an empty line,
    /// the body to the end. `None` where no program of this kind could be sent that.
    ///
    /// # Panics
    /// Where the body of the answer breaks off, or does not end.
    pub fn answer(&self, text: &[u8]) -> Option<(u16, Vec<u8>)> {
        let request = request(text)?;
        self.runtime.block_on(async {
            let Ok(answer) = TowerToHyperService::new(self.router.clone()).call(request).await;
            let status = answer.status().as_u16();
            let body = tokio::time::timeout(BODY_TIME, axum::body::to_bytes(answer.into_body(), usize::MAX)).await;
            match body {
                Ok(Ok(body)) => Some((status, body.to_vec())),
                Ok(Err(error)) => panic!("the body of the answer breaks off: {error}"),
                Err(_) => panic!("the body of the answer does not end"),
            }
        })
    }
}

fn request(text: &[u8]) -> Option<Request<Body>> {
    let (line, mut rest) = line(text)?;
    let (method, target) = line.split_at(line.iter().position(|&byte| byte == b' ')?);
    let mut request = Request::builder().method(method).uri(target.get(1..)?);
    loop {
        let (header, after) = line_of_head(rest);
        rest = after;
        if header.is_empty() {
            return request.body(Body::from(rest.to_vec())).ok();
        }
        let colon = header.iter().position(|&byte| byte == b':')?;
        request = request.header(&header[..colon], header[colon + 1..].trim_ascii());
    }
}

/// The first line, without its end, and what follows it; `None` where no line ends.
fn line(text: &[u8]) -> Option<(&[u8], &[u8])> {
    let end = text.iter().position(|&byte| byte == b'\n')?;
    Some((text[..end].strip_suffix(b"\r").unwrap_or(&text[..end]), &text[end + 1..]))
}

/// The same; a head that breaks off ends with the text.
fn line_of_head(text: &[u8]) -> (&[u8], &[u8]) {
    line(text).unwrap_or((text, &[]))
}

/// `KEY=VALUE` as the server reads it; `None` where it refuses it.
pub fn filter(text: &str) -> Option<crate::TagFilter> {
    textures::parse_filter(text).ok()
}
