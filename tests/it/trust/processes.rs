//! Several processes on one store: killed at any moment, one writing while others read, two that want to write.

use std::collections::BTreeMap;
use std::io::{BufRead, BufReader};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Output, Stdio};
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::time::{Duration, Instant};

use hlacdb::{Database, Meta, Query, ReindexOptions};
use serde_json::Value;

use super::{long, volume};
use crate::support::{noise, write_npy};

fn hlacdb(store: &Path) -> Command {
    let mut command = Command::new(assert_cmd::cargo::cargo_bin("hlacdb"));
    command.env_remove("HLACDB_STORE").arg("-s").arg(store);
    command
}

fn run(store: &Path, arguments: &[&str]) -> Output {
    hlacdb(store).args(arguments).output().unwrap()
}

fn json(output: &Output) -> Value {
    serde_json::from_slice(&output.stdout).unwrap_or_else(|error| {
        panic!("{error}: {} {}", String::from_utf8_lossy(&output.stdout), String::from_utf8_lossy(&output.stderr))
    })
}

/// A folder of volumes to ingest.
fn scans(folder: &Path, count: u64) -> PathBuf {
    let scans = folder.join("scans");
    std::fs::create_dir(&scans).unwrap();
    for n in 1..=count {
        write_npy(&scans.join(format!("{n}.npy")), &volume(n, 12));
    }
    scans
}

/// Ingests until it is killed after `delay` (counted from its first line, or from its start); what it acknowledged.
fn killed(store: &Path, scans: &Path, delay: Duration, from_start: bool) -> BTreeMap<u64, String> {
    let mut child: Child = hlacdb(store)
        .args(["-q", "ingest", "--stream", "--jobs", "2"])
        .arg(scans)
        .stdout(Stdio::piped())
        .spawn()
        .unwrap();
    let mut lines = BufReader::new(child.stdout.take().unwrap()).lines();
    let mut acknowledged = BTreeMap::new();
    let mut note = |line: std::io::Result<String>| {
        // A line that the kill cut short acknowledges nothing.
        if let Ok(Ok(event)) = line.map(|line| serde_json::from_str::<Value>(&line))
            && let Some(id) = event["id"].as_u64()
        {
            acknowledged.insert(id, event["path"].as_str().unwrap().to_owned());
        }
    };
    if !from_start && let Some(line) = lines.next() {
        note(line);
    }
    std::thread::sleep(delay);
    child.kill().unwrap();
    lines.for_each(note);
    child.wait().unwrap();
    acknowledged
}

/// Kills `ingest --stream` at random moments: nothing that was acknowledged is lost, the store is whole, and a re-run
/// completes the set.
#[test]
fn a_killed_ingest_keeps_every_acknowledged_texture() {
    let mut next = noise(hlacdb_testing::seed());
    let rounds = if long() { 50 } else { 2 };
    let folder = tempfile::tempdir().unwrap();
    let count = 120;
    let scans = scans(folder.path(), count);
    let (mut acknowledged_in_all, mut in_store) = (0, 0);
    for round in 0..rounds {
        let store = folder.path().join(format!("{round}.hlacdb"));
        let mut acknowledged = BTreeMap::new();
        // One kill, or several of the same store.
        for _ in 0..=next() % 2 {
            let from_start = next().is_multiple_of(3);
            let delay = Duration::from_micros(next() % if from_start { 600_000 } else { 300_000 });
            acknowledged.extend(killed(&store, &scans, delay, from_start));
        }
        acknowledged_in_all += acknowledged.len();
        if store.exists() {
            let verified = run(&store, &["--json", "verify", "--deep"]);
            assert_eq!(json(&verified)["ok"], true, "round {round}");
            let listed = json(&run(&store, &["--json", "list"]));
            let ids: Vec<u64> =
                listed["textures"].as_array().unwrap().iter().map(|texture| texture["id"].as_u64().unwrap()).collect();
            in_store += ids.len();
            for (id, path) in &acknowledged {
                assert!(ids.contains(id), "round {round}: {path} was acknowledged as texture {id} and is lost");
            }
        } else {
            assert!(acknowledged.is_empty(), "round {round}");
        }
        let again = run(&store, &["--json", "ingest", scans.to_str().unwrap()]);
        let report = json(&again);
        assert_eq!(report["added"].as_u64().unwrap() + report["duplicates"].as_u64().unwrap(), count);
        assert_eq!(json(&run(&store, &["--json", "verify", "--deep"]))["ok"], true, "round {round}");
        let left: Vec<_> = std::fs::read_dir(folder.path())
            .unwrap()
            .map(|entry| entry.unwrap().file_name().into_string().unwrap())
            .filter(|name| name.starts_with(&format!("{round}.hlacdb")) && *name != format!("{round}.hlacdb"))
            .collect();
        assert!(left.is_empty(), "{left:?}");
        std::fs::remove_file(&store).unwrap();
    }
    eprintln!(
        "{rounds} rounds: {acknowledged_in_all} acknowledged before a kill, {in_store} found after it, none lost"
    );
}

/// One process ingests while others query and verify; a second writer is refused, at once, by a sentence that says who.
#[test]
fn readers_follow_one_writer_and_a_second_writer_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let until = Instant::now() + Duration::from_secs(if long() { 60 } else { 2 });
    let count = if long() { 4000 } else { 300 };
    let scans = scans(folder.path(), count);
    let store = folder.path().join("t.hlacdb");
    drop(Database::open(&store).unwrap());
    let mut writer = hlacdb(&store)
        .args(["-q", "ingest", "--stream", "--jobs", "1"])
        .arg(&scans)
        .stdout(Stdio::piped())
        .spawn()
        .unwrap();
    let mut lines = BufReader::new(writer.stdout.take().unwrap()).lines();
    lines.next().unwrap().unwrap();
    let pid = writer.id();
    let drain = std::thread::spawn(move || lines.map_while(Result::ok).count());

    let began = Instant::now();
    let refused = run(&store, &["tag", "1", "a=b"]);
    let took = began.elapsed();
    let said = String::from_utf8_lossy(&refused.stderr).into_owned();
    assert_eq!(refused.status.code(), Some(1), "{said}");
    assert!(said.contains("is open for writing elsewhere") && said.contains("wait for that process"), "{said}");
    if cfg!(target_os = "linux") {
        assert!(said.contains(&format!("(process {pid})")), "{said}");
    }
    eprintln!("a second writer was refused in {took:?}");

    let asked = AtomicU64::new(0);
    std::thread::scope(|scope| {
        for reader in 0..3 {
            let (store, asked) = (&store, &asked);
            scope.spawn(move || {
                let mut seen = 0;
                while Instant::now() < until {
                    let output = match reader {
                        0 => run(store, &["--json", "verify"]),
                        _ => run(store, &["--json", "query", "--id", "1", "-k", "100000"]),
                    };
                    let said = String::from_utf8_lossy(&output.stderr).into_owned();
                    assert!(output.status.success(), "{said}");
                    if reader > 0 {
                        let hits = json(&output)["hits"].as_array().unwrap().len();
                        assert!(hits >= seen, "{hits} hits after {seen}");
                        seen = hits;
                    }
                    asked.fetch_add(1, Ordering::SeqCst);
                }
            });
        }
    });
    let told = drain.join().unwrap();
    assert!(writer.wait().unwrap().success());
    assert_eq!(told as u64, count - 1);
    assert_eq!(json(&run(&store, &["--json", "verify"]))["ok"], true);
    eprintln!("{} questions of other processes beside an ingest of {count}", asked.into_inner());
}

/// Threads: queries beside ingest, reindex and remove see whole states, as a model of the history has them.
#[test]
fn queries_see_whole_states_beside_a_writer() {
    let folder = tempfile::tempdir().unwrap();
    let database = Database::open(folder.path().join("t")).unwrap();
    let rounds = if long() { 200 } else { 12 };
    // The model: the ids after every change, by number of the change; the writer says which change is done.
    let states: Vec<std::sync::OnceLock<Vec<u64>>> = (0..=3 * rounds).map(|_| std::sync::OnceLock::new()).collect();
    let (begun, done) = (AtomicU64::new(0), AtomicBool::new(false));
    assert_eq!(database.add(&volume(0, 8), Meta::named("0")).unwrap().id(), 1);
    let (mut ids, mut last) = (vec![1], 1);
    states[0].set(ids.clone()).unwrap();
    std::thread::scope(|scope| {
        for _ in 0..3 {
            scope.spawn(|| {
                while !done.load(Ordering::SeqCst) {
                    let before = begun.load(Ordering::SeqCst);
                    let answer = database.query(&Query::volume(&volume(5, 8)).k(10_000)).unwrap();
                    let after = begun.load(Ordering::SeqCst);
                    let mut hits: Vec<u64> = answer.hits.iter().map(|hit| hit.id.get()).collect();
                    hits.sort_unstable();
                    // The state is one of those between what was done before the question and what was begun after it.
                    let possible = (before.saturating_sub(1)..=after).filter_map(|at| states[at as usize].get());
                    assert!(possible.into_iter().any(|state| *state == hits), "{before}..={after}: {hits:?}");
                }
            });
        }
        let mut change = 0;
        let mut note = |ids: &[u64]| {
            change += 1;
            states[change].set(ids.to_vec()).unwrap();
            begun.store(change as u64, Ordering::SeqCst);
        };
        for round in 1..=rounds as u64 {
            last += 1;
            ids.push(last);
            note(&ids);
            assert_eq!(database.add(&volume(round, 8), Meta::named("t")).unwrap().id(), last);
            if round % 3 == 0 {
                let gone = ids.remove(ids.len() / 2);
                note(&ids);
                database.remove([gone]).unwrap();
            }
            if round % 7 == 0 {
                database.reindex(&ReindexOptions::default(), &()).unwrap();
            }
        }
        done.store(true, Ordering::SeqCst);
    });
    assert!(database.verify(true, &()).unwrap().ok());
}
