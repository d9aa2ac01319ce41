//! How a server is set up, and what can be wrong with that.

use std::net::SocketAddr;
use std::path::PathBuf;
use std::time::Duration;

use crate::volume::display_path;

/// How a server is set up.
///
/// ```
/// use hlacdb::serve::Settings;
/// let settings = Settings { read_only: true, ..Settings::default() };
/// assert!(settings.address.ip().is_loopback());
/// ```
#[derive(Clone, Debug)]
pub struct Settings {
    /// Where to listen; port 0 takes a free one. Any address but a loopback one needs a token.
    pub address: SocketAddr,
    /// What a caller must show: `Authorization: Bearer TOKEN`, or the page opened once as `/?token=TOKEN`.
    pub token: Option<String>,
    /// Refuse whatever would change the store.
    pub read_only: bool,
    /// The folder of this machine that callers may ingest from; none unless set.
    pub ingest_folder: Option<PathBuf>,
    /// The longest body of a request, in bytes.
    pub max_body: u64,
    /// The most voxels of an uploaded volume.
    pub max_voxels: u64,
    /// The most bytes that an upload which is compressed far more than ordinary scans may take in memory.
    pub max_inflated: u64,
    /// How long a request may take until its answer begins.
    pub time: Duration,
    /// Connections at once.
    pub connections: usize,
    /// Work on the database at once; 0 is twice the number of cores.
    pub concurrency: usize,
    /// The page's files are read from this folder instead of the program: for who works on the page.
    pub page: Option<PathBuf>,
}

impl Default for Settings {
    /// A free port of the loopback address, no token, 1 GiB of body, plain or inflated, 2^28 voxels, 60 seconds, 1024 connections.
    fn default() -> Self {
        Self {
            address: SocketAddr::from(([127, 0, 0, 1], 0)),
            token: None,
            read_only: false,
            ingest_folder: None,
            max_body: 1 << 30,
            max_voxels: 1 << 28,
            max_inflated: 1 << 30,
            time: Duration::from_secs(60),
            connections: 1024,
            concurrency: 0,
            page: None,
        }
    }
}

impl Settings {
    /// Refuses settings under which anybody could come in, or nobody.
    pub(crate) fn check(&self) -> Result<(), ServeError> {
        match &self.token {
            None if !self.address.ip().is_loopback() => Err(ServeError::NeedsToken { address: self.address }),
            Some(token) if token.len() < SHORTEST_TOKEN || !token.bytes().all(|byte| byte.is_ascii_graphic()) => {
                Err(ServeError::BadToken)
            }
            _ => Ok(()),
        }
    }

    pub(crate) fn lanes(&self) -> usize {
        match self.concurrency {
            0 => 2 * std::thread::available_parallelism().map_or(2, std::num::NonZero::get),
            set => set,
        }
    }
}

/// A token that is shorter is guessed too soon.
const SHORTEST_TOKEN: usize = 16;

/// Why a server did not start, or ended.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ServeError {
    /// Other machines could connect, and nothing would be asked of them.
    #[error(
        "{address} can be reached from other machines, so that a token is needed: set HLACDB_TOKEN (or --token), or listen on 127.0.0.1"
    )]
    NeedsToken {
        /// The address asked for.
        address: SocketAddr,
    },
    /// A token that is guessed too soon, or that no header can carry.
    #[error(
        "the token must have at least 16 characters, all of them visible ASCII: make one with `openssl rand -hex 16`"
    )]
    BadToken,
    /// The address cannot be listened on.
    #[error("{address} cannot be listened on: choose another with --addr, port 0 takes a free one")]
    Listen {
        /// The address asked for.
        address: SocketAddr,
        /// The system's own words.
        #[source]
        source: std::io::Error,
    },
    /// The folder to ingest from is none.
    #[error("{}: this is no folder that can be ingested from: name another with --ingest-folder", display_path(path))]
    IngestFolder {
        /// The folder asked for.
        path: PathBuf,
        /// The system's own words.
        #[source]
        source: std::io::Error,
    },
    /// The operating system refused something else.
    #[error("{doing} failed")]
    Io {
        /// What was being done.
        doing: &'static str,
        /// The system's own words.
        #[source]
        source: std::io::Error,
    },
}
