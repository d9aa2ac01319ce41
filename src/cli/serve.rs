//! `hlacdb serve`.

use std::io::Write;
use std::net::{SocketAddr, ToSocketAddrs};
use std::path::PathBuf;
use std::time::Duration;

use clap::Args;
use hlacdb::serve::{Server, Settings};
use hlacdb::volume::display_path;

use super::{Context, Failure, Outcome};

/// The search interface: a page, and an HTTP API, on this machine
///
/// See the textures as slices and volumes, drop a file to find the ones alike, look at the whole store as a map. The API is
/// described at /api/v1/openapi.json.
#[derive(Args)]
#[command(after_help = "Examples:
  hlacdb serve                                       then open the address it prints
  hlacdb serve --read-only                           beside a process that writes to the store
  hlacdb serve --addr 127.0.0.1:0                    a free port
  HLACDB_TOKEN=$(openssl rand -hex 16) hlacdb serve --addr 0.0.0.0:8080    for other machines")]
pub(crate) struct Serve {
    /// Where to listen; port 0 takes a free one; any but a loopback address needs a token
    #[arg(long, value_name = "ADDRESS:PORT", default_value = "127.0.0.1:8251", value_parser = address)]
    addr: SocketAddr,

    /// What callers must show: the page is opened once as /?token=TOKEN, programs send `Authorization: Bearer TOKEN`
    #[arg(long, value_name = "TOKEN", env = "HLACDB_TOKEN", hide_env_values = true)]
    token: Option<String>,

    /// Show the store, and follow whoever writes to it, but change nothing
    #[arg(long)]
    read_only: bool,

    /// The folder that the page may ingest from
    #[arg(long, value_name = "DIR")]
    ingest_folder: Option<PathBuf>,

    /// The longest request, uploads included, in bytes
    #[arg(long, value_name = "BYTES", default_value_t = Settings::default().max_body)]
    max_body: u64,

    /// The most voxels of an uploaded volume
    #[arg(long, value_name = "N", default_value_t = Settings::default().max_voxels)]
    max_voxels: u64,

    /// The most bytes that an upload may take in memory whose samples are more than 16 times its own bytes
    #[arg(long, value_name = "BYTES", default_value_t = Settings::default().max_inflated)]
    max_inflated: u64,

    /// How long a request may take, in seconds
    #[arg(long, value_name = "SECONDS", default_value_t = 60, value_parser = clap::value_parser!(u64).range(1..=86_400))]
    time: u64,

    /// How many connections may be open at once
    #[arg(long, value_name = "N", default_value_t = 1024, value_parser = clap::value_parser!(u32).range(1..=65_536))]
    connections: u32,

    /// How many requests work on the store at once [default: twice the number of cores]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=1024))]
    concurrency: Option<u32>,

    /// The page's files are read from this folder
    #[arg(long, value_name = "DIR", env = "HLACDB_PAGE_DIR", hide = true)]
    page: Option<PathBuf>,
}

impl Serve {
    pub(crate) fn run(self, context: &mut Context) -> Result<Outcome, Failure> {
        let is_new = !self.read_only && !context.store.exists();
        let database = if self.read_only { context.open_to_read()? } else { context.open_or_create()? };
        if is_new {
            context.note(&format!("there was no store {}: an empty one was made", display_path(&context.store)));
        }
        let settings = Settings {
            address: self.addr,
            token: self.token,
            read_only: self.read_only,
            ingest_folder: self.ingest_folder,
            max_body: self.max_body,
            max_voxels: self.max_voxels,
            max_inflated: self.max_inflated,
            time: Duration::from_secs(self.time),
            connections: self.connections as usize,
            concurrency: self.concurrency.unwrap_or(0) as usize,
            page: self.page,
        };
        let asks = if settings.token.is_some() { "?token=TOKEN" } else { "" };
        let server = Server::bind(database, settings)?;
        let address = server.address();
        let stopper = server.stopper();
        ctrlc::set_handler(move || stopper.stop())?;
        if context.json {
            let document = serde_json::json!({
                "address": address, "url": format!("http://{address}/"), "read_only": self.read_only,
            });
            context.print_json(&document)?;
        } else {
            writeln!(context.out(), "listening on http://{address}/{asks}")?;
        }
        context.out().flush()?;
        server.run()?;
        Ok(Outcome::Done)
    }
}

/// An address, or a name of one, with a port.
fn address(text: &str) -> Result<SocketAddr, String> {
    let resolved = text.to_socket_addrs().ok().and_then(|mut addresses| addresses.next());
    resolved.ok_or_else(|| "an address with a port is expected, as 127.0.0.1:8251 or localhost:0".into())
}
