//! Requests answered without a network, for fuzz targets. Built only with the feature `fuzz`.

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
use super::options::{ServeError, ServerOptions};
use super::parameters::tag_filter;
use super::state::App;
use crate::Database;

/// How long the body of a response may take.
const BODY_TIME: Duration = Duration::from_secs(60);

/// A server without a network.
pub struct InProcessServer {
    runtime: Runtime,
    router: Router,
    /// Dropping it would stop the server.
    _stopper: watch::Sender<bool>,
}

impl InProcessServer {
    /// A server for `database`.
    ///
    /// # Errors
    /// As [`Server::bind`](super::Server::bind), and [`ServeError::Io`].
    pub fn open(database: Database, options: ServerOptions) -> Result<Self, ServeError> {
        options.check()?;
        let runtime = Builder::new_current_thread().enable_all().build();
        let runtime = runtime.map_err(|source| ServeError::Io { doing: "starting the server's thread", source })?;
        let (stopper, stopping) = watch::channel(false);
        let app = Arc::new(App::new(database, options, stopping)?);
        Ok(Self { runtime, router: router(&app), _stopper: stopper })
    }

    /// The status and body of the response to a request, which is given as text: method and target, headers, an empty line,
    /// body. `None` if the text is not a request.
    ///
    /// # Panics
    /// If the body of the response breaks off or does not end.
    pub fn answer(&self, text: &[u8]) -> Option<(u16, Vec<u8>)> {
        let request = request(text)?;
        self.runtime.block_on(async {
            let Ok(response) = TowerToHyperService::new(self.router.clone()).call(request).await;
            let status = response.status().as_u16();
            let body = tokio::time::timeout(BODY_TIME, axum::body::to_bytes(response.into_body(), usize::MAX)).await;
            match body {
                Ok(Ok(body)) => Some((status, body.to_vec())),
                Ok(Err(error)) => panic!("the body of the response breaks off: {error}"),
                Err(_) => panic!("the body of the response does not end"),
            }
        })
    }
}

fn request(text: &[u8]) -> Option<Request<Body>> {
    let (line, mut rest) = line(text)?;
    let (method, target) = line.split_at(line.iter().position(|&byte| byte == b' ')?);
    let mut request = Request::builder().method(method).uri(target.get(1..)?);
    loop {
        let (header, after) = header_line(rest);
        rest = after;
        if header.is_empty() {
            return request.body(Body::from(rest.to_vec())).ok();
        }
        let colon = header.iter().position(|&byte| byte == b':')?;
        request = request.header(&header[..colon], header[colon + 1..].trim_ascii());
    }
}

/// The first line without its end, and the rest; `None` if no line ends.
fn line(text: &[u8]) -> Option<(&[u8], &[u8])> {
    let end = text.iter().position(|&byte| byte == b'\n')?;
    Some((text[..end].strip_suffix(b"\r").unwrap_or(&text[..end]), &text[end + 1..]))
}

/// The same; a line that does not end reaches to the end of the text.
fn header_line(text: &[u8]) -> (&[u8], &[u8]) {
    line(text).unwrap_or((text, &[]))
}

/// Parses `KEY=VALUE` as the server does; `None` if the server refuses it.
pub fn filter(text: &str) -> Option<crate::TagFilter> {
    tag_filter(text).ok()
}
