//! `hlacdb serve`.

use std::io::Write;
use std::net::{SocketAddr, ToSocketAddrs};
use std::path::PathBuf;
use std::time::Duration;

use clap::Args;
use hlacdb::serve::{ServeError, Server, ServerOptions};
use hlacdb::volume::display_path;

use crate::cli::context::{Context, Failure, Outcome};

/// Serve the web page and the HTTP API
///
/// The page shows textures as slices and volumes, searches with a file that is dropped on it, and draws a map of the whole
/// store. /api/v1/openapi.json describes the API.
#[derive(Args)]
#[command(after_help = "Examples:
  hlacdb serve                                       then open the printed address
  hlacdb serve --read-only                           while another process writes to the store
  hlacdb serve --addr 127.0.0.1:0                    on a free port
  HLACDB_TOKEN=$(openssl rand -hex 16) hlacdb serve --addr 0.0.0.0:8080    for other machines")]
pub(crate) struct Serve {
    /// The address to listen on. Port 0 takes a free port; addresses other than loopback need a token
    #[arg(long, value_name = "ADDRESS:PORT", default_value = "127.0.0.1:8251", value_parser = address)]
    addr: SocketAddr,

    /// The token that callers need: open the page once as /?token=TOKEN; programs send `Authorization: Bearer TOKEN`
    #[arg(long, value_name = "TOKEN", env = "HLACDB_TOKEN", hide_env_values = true)]
    token: Option<String>,

    /// Change nothing, and follow the changes of another process
    #[arg(long)]
    read_only: bool,

    /// The folder from which the page may ingest files
    #[arg(long, value_name = "DIR")]
    ingest_folder: Option<PathBuf>,

    /// The largest request in bytes, including uploads
    #[arg(long, value_name = "BYTES", default_value_t = ServerOptions::MAX_BODY)]
    max_body: u64,

    /// The most voxels of an uploaded volume
    #[arg(long, value_name = "N", default_value_t = ServerOptions::MAX_VOXELS)]
    max_voxels: u64,

    /// Decompression limit: an upload may expand to at most this, or to 16 times its size if that is more
    #[arg(long, value_name = "BYTES", default_value_t = ServerOptions::MAX_INFLATED)]
    max_inflated: u64,

    /// The longest time for a request, in seconds
    #[arg(long, value_name = "SECONDS", default_value_t = 60, value_parser = clap::value_parser!(u64).range(1..=86_400))]
    time: u64,

    /// The most open connections
    #[arg(long, value_name = "N", default_value_t = 1024, value_parser = clap::value_parser!(u32).range(1..=65_536))]
    connections: u32,

    /// The most requests that use the store at once [default: twice the number of cores]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=1024))]
    concurrency: Option<u32>,

    /// Read the files of the page from this folder
    #[arg(long, value_name = "DIR", env = "HLACDB_PAGE_DIR", hide = true)]
    page: Option<PathBuf>,
}

impl Serve {
    pub(crate) fn run(self, context: &mut Context) -> Result<Outcome, Failure> {
        let is_new = !self.read_only && !context.store.exists();
        let database = if self.read_only { context.open_to_read()? } else { context.open_or_create()? };
        if is_new {
            context.note(&format!("created the empty store {}", display_path(&context.store)));
        }
        let query = if self.token.is_some() { "?token=TOKEN" } else { "" };
        let server = Server::bind(database, self.options()).map_err(|error| with_remedy(&error))?;
        let address = server.address();
        let stopper = server.stopper();
        ctrlc::set_handler(move || stopper.stop())?;
        if context.json {
            let document = serde_json::json!({
                "address": address, "url": format!("http://{address}/"), "read_only": self.read_only,
            });
            context.print_json(&document)?;
        } else {
            writeln!(context.out(), "listening on http://{address}/{query}")?;
        }
        context.out().flush()?;
        server.run()?;
        Ok(Outcome::Done)
    }

    fn options(&self) -> ServerOptions {
        let mut options = ServerOptions::new()
            .address(self.addr)
            .read_only(self.read_only)
            .max_body(self.max_body)
            .max_voxels(self.max_voxels)
            .max_inflated(self.max_inflated)
            .time(Duration::from_secs(self.time))
            .connections(self.connections as usize);
        if let Some(token) = &self.token {
            options = options.token(token);
        }
        if let Some(folder) = &self.ingest_folder {
            options = options.ingest_folder(folder);
        }
        if let Some(requests) = self.concurrency {
            options = options.concurrency(requests as usize);
        }
        if let Some(folder) = &self.page {
            options = options.page(folder);
        }
        options
    }
}

/// The error of a server that does not start, with what to do about it.
fn with_remedy(error: &ServeError) -> Failure {
    let remedy = match error {
        ServeError::NeedsToken { .. } => ": set HLACDB_TOKEN (or --token), or listen on 127.0.0.1",
        ServeError::BadToken => ": make one with `openssl rand -hex 16`",
        ServeError::Listen { .. } => ": choose another address with --addr (port 0 takes a free port)",
        ServeError::IngestFolder { .. } => ": choose another folder with --ingest-folder",
        _ => "",
    };
    Failure::message(format!("{}{remedy}", hlacdb::chain(error)))
}

/// Parses an address or host name with a port.
fn address(text: &str) -> Result<SocketAddr, String> {
    let resolved = text.to_socket_addrs().ok().and_then(|mut addresses| addresses.next());
    resolved.ok_or_else(|| "expected an address with a port, e.g. 127.0.0.1:8251 or localhost:0".into())
}
