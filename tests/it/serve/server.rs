//! A server with a small store, and a client.

use std::io::{BufRead, BufReader, Read, Write};
use std::net::{SocketAddr, TcpStream};
use std::path::{Path, PathBuf};
use std::sync::LazyLock;
use std::thread::JoinHandle;
use std::time::Duration;

use hlacdb::serve::{ServeError, Server, ServerOptions, Stopper};
use hlacdb::volume::Volume;
use hlacdb::{Database, Meta, OpenOptions};
use serde_json::Value;

use crate::support::{ball, stripes};

/// A response, read to its end.
pub(super) struct Reply {
    pub(super) status: u16,
    headers: Vec<(String, String)>,
    pub(super) bytes: Vec<u8>,
}

impl Reply {
    pub(super) fn header(&self, name: &str) -> Option<&str> {
        self.headers.iter().find(|(other, _)| other == name).map(|(_, value)| value.as_str())
    }

    pub(super) fn json(&self) -> Value {
        let shown = String::from_utf8_lossy(&self.bytes);
        assert!((200..300).contains(&self.status), "{}: {shown}", self.status);
        assert_eq!(self.header("content-type"), Some("application/json"), "{shown}");
        serde_json::from_slice(&self.bytes).unwrap()
    }

    /// The sentence and causes of a well-formed problem with this status.
    pub(super) fn problem(&self, status: u16) -> String {
        let shown = String::from_utf8_lossy(&self.bytes).into_owned();
        assert_eq!(self.status, status, "{shown}");
        assert_eq!(self.header("content-type"), Some("application/problem+json"), "{shown}");
        let problem: Value = serde_json::from_slice(&self.bytes).unwrap();
        assert_eq!(problem["status"], status);
        assert!(problem["title"].is_string() && problem["causes"].is_array());
        let detail = problem["detail"].as_str().unwrap();
        assert!(!detail.is_empty());
        let causes = problem["causes"].as_array().unwrap().iter().map(|cause| cause.as_str().unwrap());
        std::iter::once(detail).chain(causes).collect::<Vec<_>>().join(": ")
    }

    pub(super) fn picture(&self) -> image::DynamicImage {
        assert_eq!((self.status, self.header("content-type")), (200, Some("image/png")));
        image::load_from_memory(&self.bytes).unwrap()
    }
}

/// A server that stops at the end of the test.
pub(super) struct TestServer {
    pub(super) folder: tempfile::TempDir,
    pub(super) address: SocketAddr,
    stopper: Stopper,
    running: Option<JoinHandle<Result<(), ServeError>>>,
    agent: ureq::Agent,
}

impl TestServer {
    /// Eight textures of two kinds, with voxels.
    pub(super) fn new() -> Self {
        Self::filled(ServerOptions::new())
    }

    /// The same eight with other options.
    pub(super) fn filled(options: ServerOptions) -> Self {
        let (folder, path) = Self::store();
        Self::serving(folder, Database::open(path).unwrap(), options)
    }

    /// The same eight, read-only.
    pub(super) fn read_only() -> Self {
        let (folder, path) = Self::store();
        let database = OpenOptions::new().read_only(true).open(path).unwrap();
        Self::serving(folder, database, ServerOptions::new().read_only(true))
    }

    /// A store with the eight textures, which are described only once.
    fn store() -> (tempfile::TempDir, PathBuf) {
        static STORE: LazyLock<Vec<u8>> = LazyLock::new(|| {
            let folder = tempfile::tempdir().unwrap();
            let path = folder.path().join("textures.hlacdb");
            textures(&Database::open(&path).unwrap());
            std::fs::read(path).unwrap()
        });
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("textures.hlacdb");
        std::fs::write(&path, &*STORE).unwrap();
        (folder, path)
    }

    /// A new store, filled by the caller.
    pub(super) fn with(options: ServerOptions, fill: impl FnOnce(&Database)) -> Self {
        let folder = tempfile::tempdir().unwrap();
        let database = Database::open(folder.path().join("textures.hlacdb")).unwrap();
        fill(&database);
        Self::serving(folder, database, options)
    }

    pub(super) fn serving(folder: tempfile::TempDir, database: Database, options: ServerOptions) -> Self {
        let server = Server::bind(database, options).unwrap();
        let (address, stopper) = (server.address(), server.stopper());
        let running = Some(std::thread::spawn(move || server.run()));
        let agent = ureq::Agent::config_builder()
            .http_status_as_error(false)
            .max_redirects(0)
            .max_redirects_will_error(false)
            .timeout_global(Some(Duration::from_secs(60)))
            .build()
            .into();
        Self { folder, address, stopper, running, agent }
    }

    pub(super) fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    /// The address of a path: below the API, or below the root if it begins with `/`.
    fn url(&self, path: &str) -> String {
        let below = if path.starts_with('/') { String::new() } else { "/api/v1/".to_owned() };
        format!("http://{}{below}{path}", self.address)
    }

    pub(super) fn get(&self, path: &str) -> Reply {
        self.get_with(path, &[])
    }

    pub(super) fn get_with(&self, path: &str, headers: &[(&str, &str)]) -> Reply {
        let mut request = self.agent.get(self.url(path));
        for (name, value) in headers {
            request = request.header(*name, *value);
        }
        reply(request.call().unwrap())
    }

    pub(super) fn json(&self, path: &str) -> Value {
        self.get(path).json()
    }

    pub(super) fn post(&self, path: &str, body: &Value) -> Reply {
        self.post_with(path, body, &[])
    }

    pub(super) fn post_with(&self, path: &str, body: &Value, headers: &[(&str, &str)]) -> Reply {
        let mut request = self.agent.post(self.url(path));
        for (name, value) in headers {
            request = request.header(*name, *value);
        }
        reply(request.send_json(body).unwrap())
    }

    pub(super) fn put(&self, path: &str, body: &Value) -> Reply {
        reply(self.agent.put(self.url(path)).send_json(body).unwrap())
    }

    pub(super) fn delete(&self, path: &str) -> Reply {
        reply(self.agent.delete(self.url(path)).call().unwrap())
    }

    /// Sends a form of parts (name, file name of a file, content).
    pub(super) fn form(&self, path: &str, parts: &[(&str, Option<&str>, &[u8])]) -> Reply {
        let mut body = Vec::new();
        for (name, file, content) in parts {
            let file = file.map(|file| format!("; filename=\"{file}\"")).unwrap_or_default();
            let head = format!("--edge\r\nContent-Disposition: form-data; name=\"{name}\"{file}\r\n\r\n");
            body.extend_from_slice(head.as_bytes());
            body.extend_from_slice(content);
            body.extend_from_slice(b"\r\n");
        }
        body.extend_from_slice(b"--edge--\r\n");
        let request = self.agent.post(self.url(path)).header("Content-Type", "multipart/form-data; boundary=edge");
        reply(request.send(&body[..]).unwrap())
    }

    /// Waits until a job has ended, and returns its report.
    pub(super) fn ended(&self, job: &Value) -> Value {
        for _ in 0..600 {
            let report = self.json(&format!("jobs/{}", job["id"]));
            if report["state"] != "running" {
                return report;
            }
            std::thread::sleep(Duration::from_millis(50));
        }
        panic!("the job did not end: {job}");
    }

    /// The events of a job until the stream ends: name and report.
    pub(super) fn events(&self, job: &Value) -> Vec<(String, Value)> {
        let mut response = self.agent.get(self.url(&format!("jobs/{}/events", job["id"]))).call().unwrap();
        assert_eq!(response.headers()["content-type"], "text/event-stream");
        let (mut events, mut name) = (Vec::new(), String::new());
        for line in BufReader::new(response.body_mut().as_reader()).lines() {
            let line = line.unwrap();
            if let Some(event) = line.strip_prefix("event: ") {
                name = event.to_owned();
            } else if let Some(data) = line.strip_prefix("data: ") {
                events.push((name.clone(), serde_json::from_str(data).unwrap()));
            }
        }
        events
    }

    /// The response to exactly these bytes.
    pub(super) fn raw(&self, request: &str) -> String {
        let mut stream = TcpStream::connect(self.address).unwrap();
        stream.write_all(request.as_bytes()).unwrap();
        let mut answer = Vec::new();
        stream.read_to_end(&mut answer).unwrap();
        String::from_utf8_lossy(&answer).into_owned()
    }

    pub(super) fn stop(&mut self) {
        self.stopper.stop();
        if let Some(running) = self.running.take() {
            running.join().unwrap().unwrap();
        }
    }
}

impl Drop for TestServer {
    fn drop(&mut self) {
        if !std::thread::panicking() {
            self.stop();
        }
    }
}

fn reply(mut response: ureq::http::Response<ureq::Body>) -> Reply {
    let headers = response.headers().iter();
    let headers = headers
        .map(|(name, value)| (name.as_str().to_owned(), value.to_str().unwrap_or_default().to_owned()))
        .collect();
    let bytes = response.body_mut().with_config().limit(1 << 30).read_to_vec().unwrap();
    Reply { status: response.status().as_u16(), headers, bytes }
}

/// Eight textures of two kinds.
fn textures(database: &Database) {
    for step in 1..=4 {
        let meta = |kind: &str| Meta::named(format!("{kind} {step}")).tag("kind", kind).tag("step", step.to_string());
        database.add(&stripes(16, step), meta("Stripes")).unwrap();
        database.add(&ball(16, 2 + step), meta("ball")).unwrap();
    }
}

/// A volume as the bytes of a numpy file.
pub(super) fn npy(volume: &Volume) -> Vec<u8> {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("volume.npy");
    crate::support::write_npy(&path, volume);
    std::fs::read(path).unwrap()
}

/// Whether a text names a folder of this machine.
pub(super) fn names_a_path(text: &str, folder: &Path) -> bool {
    text.contains(folder.to_str().unwrap()) || text.contains(std::env::temp_dir().to_str().unwrap())
}
