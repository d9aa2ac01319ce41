//! [`Server`]: the address, the connections, and how they end.

use std::net::{SocketAddr, TcpListener};
use std::sync::Arc;
use std::time::Duration;

use axum::extract::DefaultBodyLimit;
use axum::{Router, middleware};
use hyper_util::rt::{TokioIo, TokioTimer};
use hyper_util::server::graceful::GracefulShutdown;
use hyper_util::service::TowerToHyperService;
use tokio::sync::{Semaphore, watch};
use tower_http::CompressionLevel;
use tower_http::compression::CompressionLayer;
use tower_http::compression::predicate::{DefaultPredicate, NotForContentType, Predicate};

use super::settings::{ServeError, Settings};
use super::state::App;
use super::{assets, auth, metrics, openapi};
use crate::Database;

/// So long a caller may take to send a request's head, or leave a connection idle.
const HEAD_TIME: Duration = Duration::from_secs(30);
/// So long requests that are under way may take to end once the server is told to stop.
const GRACE: Duration = Duration::from_secs(10);

/// A server that listens already, so that its address is known, and answers once it runs.
///
/// ```
/// use hlacdb::{Database, serve::{Server, Settings}};
/// # let folder = tempfile::tempdir()?;
/// let database = Database::open(folder.path().join("textures.hlacdb"))?;
/// let server = Server::bind(database, Settings::default())?;
/// println!("listening on http://{}/", server.address());
/// let stopper = server.stopper();
/// let running = std::thread::spawn(move || server.run());
/// stopper.stop();
/// running.join().unwrap()?;
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub struct Server {
    listener: TcpListener,
    address: SocketAddr,
    app: Arc<App>,
    stopper: Stopper,
}

/// Ends a server from any thread. Requests under way are answered first.
#[derive(Clone, Debug)]
pub struct Stopper(Arc<watch::Sender<bool>>);

impl Stopper {
    /// Tells the server to stop; more than once is the same.
    pub fn stop(&self) {
        self.0.send_replace(true);
    }
}

impl Server {
    /// Listens on the address of the settings.
    ///
    /// # Errors
    /// [`ServeError::NeedsToken`], [`ServeError::BadToken`], [`ServeError::IngestFolder`], [`ServeError::Listen`].
    pub fn bind(database: Database, settings: Settings) -> Result<Self, ServeError> {
        settings.check()?;
        let refused = |source| ServeError::Listen { address: settings.address, source };
        let listener = TcpListener::bind(settings.address).map_err(refused)?;
        listener.set_nonblocking(true).map_err(refused)?;
        let address = listener.local_addr().map_err(refused)?;
        let (sender, stopping) = watch::channel(false);
        let app = Arc::new(App::new(database, settings, stopping)?);
        Ok(Self { listener, address, app, stopper: Stopper(Arc::new(sender)) })
    }

    /// Where it listens.
    pub fn address(&self) -> SocketAddr {
        self.address
    }

    /// What ends it.
    pub fn stopper(&self) -> Stopper {
        self.stopper.clone()
    }

    /// Serves until [`Stopper::stop`] is called. Requests under way are answered, jobs are cancelled where it is safe.
    ///
    /// # Errors
    /// [`ServeError::Io`] where the system grants no threads.
    pub fn run(self) -> Result<(), ServeError> {
        let runtime = tokio::runtime::Builder::new_multi_thread().enable_all().build();
        let runtime = runtime.map_err(|source| ServeError::Io { doing: "starting the server's threads", source })?;
        let done = runtime.block_on(self.serve());
        // Work that is still running is bounded by the grace; what a thread does after it is no longer waited for.
        runtime.shutdown_timeout(GRACE);
        done
    }

    async fn serve(self) -> Result<(), ServeError> {
        let listener = tokio::net::TcpListener::from_std(self.listener);
        let listener = listener.map_err(|source| ServeError::Io { doing: "listening", source })?;
        let router = router(&self.app);
        let ahead = Arc::clone(&self.app);
        tokio::task::spawn_blocking(move || ahead.warm_up());
        let places = Arc::new(Semaphore::new(self.app.settings.connections.max(1)));
        let graceful = GracefulShutdown::new();
        let mut stopping = self.app.stopping.clone();
        loop {
            let place = Arc::clone(&places).acquire_owned();
            let next = async { (place.await, listener.accept().await) };
            let (place, stream) = tokio::select! {
                (place, accepted) = next => match accepted {
                    Ok((stream, _)) => (place, stream),
                    Err(error) => {
                        // Too many open files, or a caller that went away: the next may fare better.
                        tracing::warn!(%error, "a connection was not accepted");
                        tokio::time::sleep(Duration::from_millis(20)).await;
                        continue;
                    }
                },
                _ = stopping.wait_for(|&stop| stop) => break,
            };
            // Small answers go out at once.
            let _ = stream.set_nodelay(true);
            let connection = hyper::server::conn::http1::Builder::new()
                .timer(TokioTimer::new())
                .header_read_timeout(HEAD_TIME)
                .serve_connection(TokioIo::new(stream), TowerToHyperService::new(router.clone()));
            let connection = graceful.watch(connection);
            tokio::spawn(async move {
                let _place = place;
                if let Err(error) = connection.await {
                    tracing::debug!(%error, "a connection ended early");
                }
            });
        }
        drop(listener);
        if tokio::time::timeout(GRACE, graceful.shutdown()).await.is_err() {
            tracing::warn!("requests under way took too long to end: stopping without them");
        }
        Ok(())
    }
}

/// Everything that is answered.
pub(crate) fn router(app: &Arc<App>) -> Router {
    // Pictures are compressed already, and voxels are read on the same machine as a rule.
    let worth_it = DefaultPredicate::new().and(NotForContentType::const_new("application/octet-stream"));
    let compression = CompressionLayer::new().quality(CompressionLevel::Fastest).compress_when(worth_it);
    let limit = usize::try_from(app.settings.max_body).unwrap_or(usize::MAX);
    openapi::routes()
        .fallback(assets::asset)
        .layer(DefaultBodyLimit::max(limit))
        .layer(compression)
        .layer(middleware::from_fn_with_state(Arc::clone(app), auth::guard))
        .layer(middleware::from_fn_with_state(Arc::clone(app), metrics::count))
        .with_state(Arc::clone(app))
}
