//! [`ServerOptions`], and why a server does not start.

use std::net::SocketAddr;
use std::path::PathBuf;
use std::time::Duration;

use crate::volume::display_path;

/// How a server is set up.
///
/// ```
/// use hlacdb::serve::ServerOptions;
/// let options = ServerOptions::new().address(([127, 0, 0, 1], 8251).into()).read_only(true).max_body(64 << 20);
/// # let _ = options;
/// ```
#[derive(Clone, Debug)]
pub struct ServerOptions {
    pub(crate) address: SocketAddr,
    pub(crate) token: Option<String>,
    pub(crate) read_only: bool,
    pub(crate) ingest_folder: Option<PathBuf>,
    pub(crate) max_body: u64,
    pub(crate) max_voxels: u64,
    pub(crate) max_inflated: u64,
    pub(crate) time: Duration,
    pub(crate) connections: usize,
    pub(crate) concurrency: Option<usize>,
    pub(crate) page: Option<PathBuf>,
}

impl Default for ServerOptions {
    fn default() -> Self {
        Self::new()
    }
}

impl ServerOptions {
    /// The default of [`ServerOptions::max_body`]: 1 GiB.
    pub const MAX_BODY: u64 = 1 << 30;
    /// The default of [`ServerOptions::max_voxels`]: 2^28.
    pub const MAX_VOXELS: u64 = 1 << 28;
    /// The default of [`ServerOptions::max_inflated`]: 1 GiB.
    pub const MAX_INFLATED: u64 = 1 << 30;
    /// The default of [`ServerOptions::time`]: 60 seconds.
    pub const TIME: Duration = Duration::from_secs(60);
    /// The default of [`ServerOptions::connections`]: 1024.
    pub const CONNECTIONS: usize = 1024;

    /// A free port of 127.0.0.1, no token, the store writable if the database is, no folder to ingest from, and the default limits.
    pub fn new() -> Self {
        Self {
            address: SocketAddr::from(([127, 0, 0, 1], 0)),
            token: None,
            read_only: false,
            ingest_folder: None,
            max_body: Self::MAX_BODY,
            max_voxels: Self::MAX_VOXELS,
            max_inflated: Self::MAX_INFLATED,
            time: Self::TIME,
            connections: Self::CONNECTIONS,
            concurrency: None,
            page: None,
        }
    }

    /// The address to listen on; port 0 takes a free port. Any address but a loopback one requires a token.
    #[must_use]
    pub fn address(mut self, address: SocketAddr) -> Self {
        self.address = address;
        self
    }

    /// The token that every request must carry: 16 or more visible ASCII characters. Programs send it as
    /// `Authorization: Bearer TOKEN`; a browser opens the page once as `/?token=TOKEN`.
    #[must_use]
    pub fn token(mut self, token: impl Into<String>) -> Self {
        self.token = Some(token.into());
        self
    }

    /// Refuses every request that would change the store.
    #[must_use]
    pub fn read_only(mut self, read_only: bool) -> Self {
        self.read_only = read_only;
        self
    }

    /// The folder of this machine from which requests may ingest.
    #[must_use]
    pub fn ingest_folder(mut self, folder: impl Into<PathBuf>) -> Self {
        self.ingest_folder = Some(folder.into());
        self
    }

    /// The greatest length of a request's body, in bytes.
    #[must_use]
    pub fn max_body(mut self, bytes: u64) -> Self {
        self.max_body = bytes;
        self
    }

    /// The greatest number of voxels of an uploaded volume.
    #[must_use]
    pub fn max_voxels(mut self, voxels: u64) -> Self {
        self.max_voxels = voxels;
        self
    }

    /// Decompression limit: an uploaded compressed file may expand to at most `max(max_inflated, 16 * file size)` bytes.
    #[must_use]
    pub fn max_inflated(mut self, bytes: u64) -> Self {
        self.max_inflated = bytes;
        self
    }

    /// How long a request may take until its response begins.
    #[must_use]
    pub fn time(mut self, time: Duration) -> Self {
        self.time = time;
        self
    }

    /// How many connections may be open at once.
    #[must_use]
    pub fn connections(mut self, connections: usize) -> Self {
        self.connections = connections;
        self
    }

    /// How many requests of one kind (short queries; work on volumes) may use the database at once. Default: twice the
    /// number of cores.
    #[must_use]
    pub fn concurrency(mut self, requests: usize) -> Self {
        self.concurrency = Some(requests);
        self
    }

    /// Reads the files of the page from this folder instead of the program: for development of the page.
    #[must_use]
    pub fn page(mut self, folder: impl Into<PathBuf>) -> Self {
        self.page = Some(folder.into());
        self
    }

    /// Refuses options under which everybody could come in, or a token that is easily guessed.
    pub(crate) fn check(&self) -> Result<(), ServeError> {
        match &self.token {
            None if !self.address.ip().is_loopback() => Err(ServeError::NeedsToken { address: self.address }),
            Some(token) if token.len() < MIN_TOKEN_LENGTH || !token.bytes().all(|byte| byte.is_ascii_graphic()) => {
                Err(ServeError::BadToken)
            }
            _ => Ok(()),
        }
    }

    pub(crate) fn requests_at_once(&self) -> usize {
        let cores = || std::thread::available_parallelism().map_or(2, std::num::NonZero::get);
        self.concurrency.unwrap_or_else(|| 2 * cores())
    }
}

/// Shorter tokens are too easily guessed.
const MIN_TOKEN_LENGTH: usize = 16;

/// Why a server did not start, or ended.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ServeError {
    /// Other machines could connect without a token.
    #[error("other machines can reach {address}, so a token is required")]
    NeedsToken {
        /// The address asked for.
        address: SocketAddr,
    },
    /// The token is too short, or a header cannot carry it.
    #[error("the token must have at least 16 characters, all of them visible ASCII")]
    BadToken,
    /// The system does not let the server listen on the address.
    #[error("cannot listen on {address}")]
    Listen {
        /// The address asked for.
        address: SocketAddr,
        /// The system's error.
        #[source]
        source: std::io::Error,
    },
    /// The folder to ingest from does not exist, is not a folder or cannot be read.
    #[error("{}: not a folder that can be ingested from", display_path(path))]
    IngestFolder {
        /// The folder asked for.
        path: PathBuf,
        /// The system's error.
        #[source]
        source: std::io::Error,
    },
    /// The operating system failed in another way.
    #[error("{doing} failed")]
    Io {
        /// What was being done.
        doing: &'static str,
        /// The system's error.
        #[source]
        source: std::io::Error,
    },
}
