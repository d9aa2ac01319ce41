//! Latencies of many clients that query one server, while another client adds textures:
//!
//! ```sh
//! cargo run --release --example load [CLIENTS] [SECONDS] [ingest|alone]
//! ```
//!
//! Generates the paper's 600 textures and serves them on a free local port. Every client (64 by default) queries for the 30
//! nearest neighbours of one texture after another for so many seconds (10 by default), while another client uploads new
//! textures (not with `alone`). Prints the latencies that the clients observed. Clients, server and ingest share the machine.

use std::error::Error;
use std::io::{BufRead, BufReader, Read, Write};
use std::net::{SocketAddr, TcpStream};
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::time::{Duration, Instant};

use hlacdb::serve::{Server, ServerOptions};
use hlacdb::synth::{self, Recipe};
use hlacdb::volume::Volume;
use hlacdb::{Database, ingest};

type Outcome<T> = Result<T, Box<dyn Error + Send + Sync>>;

fn main() -> Outcome<()> {
    let argument = |at: usize, default: u64| std::env::args().nth(at).map_or(Ok(default), |text| text.parse());
    let (clients, seconds) = (argument(1, 64)?, argument(2, 10)?);
    let alone = std::env::args().nth(3).is_some_and(|word| word == "alone");
    let folder = tempfile::tempdir()?;
    let database = Database::open(folder.path().join("load.hlacdb"))?;
    let recipe = Recipe::parse(synth::builtin("paper600").ok_or("there is no recipe paper600")?)?;
    ingest::ingest_recipe(&database, &recipe, &(), &mut |_| {})?;
    let server = Server::bind(database, ServerOptions::new())?;
    let (address, stopper) = (server.address(), server.stopper());
    let running = std::thread::spawn(move || server.run());

    let (done, added) = (AtomicBool::new(false), AtomicU64::new(0));
    let latencies = std::thread::scope(|scope| {
        let querying: Vec<_> = (0..clients)
            .map(|client| {
                scope.spawn({
                    let done = &done;
                    move || query(address, client, done)
                })
            })
            .collect();
        let uploading = (!alone).then(|| scope.spawn(|| upload(address, &done, &added)));
        std::thread::sleep(Duration::from_secs(seconds));
        done.store(true, Ordering::Relaxed);
        let latencies: Vec<Outcome<Vec<Duration>>> = querying
            .into_iter()
            .map(|client| client.join().unwrap_or_else(|_| Err("a client panicked".into())))
            .collect();
        if let Some(uploading) = uploading {
            uploading.join().unwrap_or_else(|_| Err("the ingest panicked".into()))?;
        }
        Ok::<_, Box<dyn Error + Send + Sync>>(latencies)
    })?;
    stopper.stop();
    running.join().map_err(|_| "the server panicked")??;

    let errors = latencies.iter().filter(|client| client.is_err()).count();
    for error in latencies.iter().filter_map(|client| client.as_ref().err()).take(3) {
        println!("error: {error}");
    }
    let mut latencies: Vec<Duration> = latencies.into_iter().flatten().flatten().collect();
    latencies.sort_unstable();
    let quantile = |fraction: f64| {
        latencies
            .get(((latencies.len() as f64 * fraction) as usize).min(latencies.len().saturating_sub(1)))
            .copied()
            .unwrap_or_default()
    };
    println!(
        "{clients} clients, {seconds} s: {} answers ({:.0} per second), {errors} errors",
        latencies.len(),
        latencies.len() as f64 / seconds as f64
    );
    println!(
        "p50 {:?}, p95 {:?}, p99 {:?}, longest {:?}",
        quantile(0.5),
        quantile(0.95),
        quantile(0.99),
        quantile(1.0)
    );
    println!("{} textures of 64^3 added in the meantime", added.load(Ordering::Relaxed));
    Ok(())
}

/// Queries until `done`; returns the time of each answer.
fn query(address: SocketAddr, client: u64, done: &AtomicBool) -> Outcome<Vec<Duration>> {
    let mut connection = BufReader::new(TcpStream::connect(address)?);
    connection.get_ref().set_nodelay(true)?;
    let mut latencies = Vec::new();
    for round in 0.. {
        if done.load(Ordering::Relaxed) {
            break;
        }
        let body = format!("{{\"ids\":[{}],\"k\":30}}", 1 + (client * 37 + round * 11) % 600);
        let start = Instant::now();
        exchange(&mut connection, "/api/v1/query", "application/json", body.as_bytes())?;
        latencies.push(start.elapsed());
    }
    Ok(latencies)
}

/// Uploads new textures, eight at a time, until `done`.
fn upload(address: SocketAddr, done: &AtomicBool, added: &AtomicU64) -> Outcome<()> {
    let mut connection = BufReader::new(TcpStream::connect(address)?);
    let folder = tempfile::tempdir()?;
    for batch in 0_u64.. {
        if done.load(Ordering::Relaxed) {
            break;
        }
        let mut body = Vec::new();
        for number in 0..8 {
            let mut state = batch * 8 + number + 1;
            let volume = Volume::from_fn([64; 3], |z, y, x| {
                state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
                ((z * (number as usize + 1) + y + x) as u8 / 2).wrapping_add((state >> 59) as u8)
            })?;
            let path = folder.path().join("volume.npy");
            hlacdb::arrays::write_volume(&path, &volume)?;
            write!(
                body,
                "--edge\r\nContent-Disposition: form-data; name=\"file\"; filename=\"{batch}-{number}.npy\"\r\n\r\n"
            )?;
            body.extend(std::fs::read(path)?);
            body.extend_from_slice(b"\r\n");
        }
        body.extend_from_slice(b"--edge--\r\n");
        exchange(&mut connection, "/api/v1/textures", "multipart/form-data; boundary=edge", &body)?;
        added.fetch_add(8, Ordering::Relaxed);
    }
    Ok(())
}

/// Sends one request and reads its answer; the connection stays open.
fn exchange(connection: &mut BufReader<TcpStream>, path: &str, kind: &str, body: &[u8]) -> Outcome<Vec<u8>> {
    let head = format!(
        "POST {path} HTTP/1.1\r\nHost: localhost\r\nContent-Type: {kind}\r\nContent-Length: {}\r\n\r\n",
        body.len()
    );
    connection.get_mut().write_all(&[head.as_bytes(), body].concat())?;
    let (mut line, mut status, mut length) = (String::new(), String::new(), 0);
    loop {
        line.clear();
        if connection.read_line(&mut line)? == 0 {
            return Err("the connection was closed".into());
        }
        if status.is_empty() {
            status = line.trim().to_owned();
        } else if let Some(value) = line.to_ascii_lowercase().strip_prefix("content-length:") {
            length = value.trim().parse()?;
        } else if line == "\r\n" {
            break;
        }
    }
    let mut answer = vec![0; length];
    connection.read_exact(&mut answer)?;
    if status.starts_with("HTTP/1.1 2") {
        Ok(answer)
    } else {
        Err(format!("{status}: {}", String::from_utf8_lossy(&answer)).into())
    }
}
