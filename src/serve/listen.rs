//! [`Server`]: listens, accepts connections, and stops.

use std::net::{SocketAddr, TcpListener};
use std::sync::Arc;
use std::time::Duration;

use axum::Router;
use axum::extract::DefaultBodyLimit;
use axum::middleware::from_fn_with_state;
use hyper_util::rt::{TokioIo, TokioTimer};
use hyper_util::server::graceful::GracefulShutdown;
use hyper_util::service::TowerToHyperService;
use tokio::sync::{Semaphore, watch};
use tower_http::CompressionLevel;
use tower_http::compression::CompressionLayer;
use tower_http::compression::predicate::{DefaultPredicate, NotForContentType, Predicate};

use super::options::{ServeError, ServerOptions};
use super::state::App;
use super::{assets, middleware, openapi};
use crate::Database;

/// How long a client may take to send the head of a request, and how long a connection may be idle.
const HEAD_TIME: Duration = Duration::from_secs(30);
/// How long running requests may take to end once the server stops.
const GRACE: Duration = Duration::from_secs(10);

/// A server. It listens from the moment it is bound, so that its address is known, and answers while [`Server::run`] runs.
///
/// ```
/// use hlacdb::{Database, serve::{Server, ServerOptions}};
/// # let folder = tempfile::tempdir()?;
/// let database = Database::open(folder.path().join("textures.hlacdb"))?;
/// let server = Server::bind(database, ServerOptions::new())?;
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

/// Stops a server from any thread. Running requests are answered first.
#[derive(Clone, Debug)]
pub struct Stopper(Arc<watch::Sender<bool>>);

impl Stopper {
    /// Asks the server to stop; further calls have no effect.
    pub fn stop(&self) {
        self.0.send_replace(true);
    }
}

impl Server {
    /// Listens on the address of the options.
    ///
    /// # Errors
    /// [`ServeError::NeedsToken`], [`ServeError::BadToken`], [`ServeError::IngestFolder`], [`ServeError::Listen`].
    pub fn bind(database: Database, options: ServerOptions) -> Result<Self, ServeError> {
        options.check()?;
        let refused = |source| ServeError::Listen { address: options.address, source };
        let listener = TcpListener::bind(options.address).map_err(refused)?;
        listener.set_nonblocking(true).map_err(refused)?;
        let address = listener.local_addr().map_err(refused)?;
        let (sender, stopping) = watch::channel(false);
        let app = Arc::new(App::new(database, options, stopping)?);
        Ok(Self { listener, address, app, stopper: Stopper(Arc::new(sender)) })
    }

    /// The address it listens on.
    pub fn address(&self) -> SocketAddr {
        self.address
    }

    /// A handle that stops it.
    pub fn stopper(&self) -> Stopper {
        self.stopper.clone()
    }

    /// Serves until [`Stopper::stop`] is called. Running requests are then answered, and jobs are cancelled at their next
    /// safe point.
    ///
    /// # Errors
    /// [`ServeError::Io`] if the operating system starts no threads.
    pub fn run(self) -> Result<(), ServeError> {
        let runtime = tokio::runtime::Builder::new_multi_thread().enable_all().build();
        let runtime = runtime.map_err(|source| ServeError::Io { doing: "starting the server's threads", source })?;
        let done = runtime.block_on(self.serve());
        // Threads that are still busy after this time are abandoned.
        runtime.shutdown_timeout(GRACE);
        done
    }

    async fn serve(self) -> Result<(), ServeError> {
        let listener = tokio::net::TcpListener::from_std(self.listener);
        let listener = listener.map_err(|source| ServeError::Io { doing: "listening", source })?;
        let router = router(&self.app);
        let app = Arc::clone(&self.app);
        tokio::task::spawn_blocking(move || app.warm_up());
        let permits = Arc::new(Semaphore::new(self.app.options.connections.max(1)));
        let graceful = GracefulShutdown::new();
        let mut stopping = self.app.stopping.clone();
        loop {
            let permit = Arc::clone(&permits).acquire_owned();
            let next = async { (permit.await, listener.accept().await) };
            let (permit, stream) = tokio::select! {
                (permit, accepted) = next => match accepted {
                    Ok((stream, _)) => (permit, stream),
                    Err(error) => {
                        // Too many open files, or a client that disconnected: the next attempt may succeed.
                        tracing::warn!(%error, "a connection was not accepted");
                        tokio::time::sleep(Duration::from_millis(20)).await;
                        continue;
                    }
                },
                _ = stopping.wait_for(|&stop| stop) => break,
            };
            // Small responses are sent at once.
            let _ = stream.set_nodelay(true);
            let connection = hyper::server::conn::http1::Builder::new()
                .timer(TokioTimer::new())
                .header_read_timeout(HEAD_TIME)
                .serve_connection(TokioIo::new(stream), TowerToHyperService::new(router.clone()));
            let connection = graceful.watch(connection);
            tokio::spawn(async move {
                let _permit = permit;
                if let Err(error) = connection.await {
                    tracing::debug!(%error, "a connection failed");
                }
            });
        }
        drop(listener);
        if tokio::time::timeout(GRACE, graceful.shutdown()).await.is_err() {
            tracing::warn!("some requests did not end in time: stopping without them");
        }
        Ok(())
    }
}

/// All routes with their middleware.
pub(crate) fn router(app: &Arc<App>) -> Router {
    // Pictures are already compressed, and voxels are mostly read on the same machine.
    let compressible = DefaultPredicate::new().and(NotForContentType::const_new("application/octet-stream"));
    let compression = CompressionLayer::new().quality(CompressionLevel::Fastest).compress_when(compressible);
    let limit = usize::try_from(app.options.max_body).unwrap_or(usize::MAX);
    openapi::routes()
        .fallback(assets::asset)
        .layer(DefaultBodyLimit::max(limit))
        .layer(compression)
        .layer(from_fn_with_state(Arc::clone(app), middleware::handle))
        .layer(from_fn_with_state(Arc::clone(app), middleware::count))
        .with_state(Arc::clone(app))
}
