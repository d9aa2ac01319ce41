//! What a small change costs, whatever the store holds: one texture added, tagged and removed, and the statistics shown, in
//! stores of 10 000, 100 000 and 1 000 000 textures; each command is a process of its own, from its start to its exit.
//!
//!     cargo bench --bench incremental                        10 000 and 100 000 rows
//!     cargo bench --bench incremental -- 10000 1000000       other sizes
//!     cargo bench --bench incremental -- --than OLD 10000    the same by another hlacdb binary, side by side
//!     cargo bench --bench incremental -- --ingest            CPU time per texture of an ingest of 600 files
//!
//! Beside it stands plain redb with one row per key and no index. `benches/peers/incremental.py` measures LanceDB in the same way,
//! on the same rows. Every figure is the median of several runs; bytes are those that the process asked the system to
//! read and write (`/proc/self/io`), cached or not. Linux only.

use std::error::Error;
use std::fs::{self, File};
use std::io::{BufWriter, Write};
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

use redb::ReadableTable as _;

type Outcome<T> = Result<T, Box<dyn Error>>;

const MASKS: usize = 251;
const VIEWS: [&str; 8] = ["full@1", "stretch@1", "stretch@2", "stretch@4", "sign@1", "sign@2", "sign@4", "detail@1"];
/// Rows of the array that is imported again and again until the store is full.
const ROWS_AT_ONCE: usize = 10_000;
/// Runs of each command; the median counts.
const RUNS: usize = 7;
const ROWS: redb::TableDefinition<u64, &[u8]> = redb::TableDefinition::new("rows");

fn main() -> Outcome<()> {
    let arguments: Vec<String> = std::env::args().skip(1).filter(|argument| argument != "--bench").collect();
    if let [flag, path] = &arguments[..]
        && flag == "--redb-add"
    {
        return redb_add(Path::new(path));
    }
    let mut programs = vec![("hlacdb", PathBuf::from(env!("CARGO_BIN_EXE_hlacdb")))];
    let (mut sizes, mut ingest) = (Vec::new(), false);
    let mut rest = arguments.iter();
    while let Some(argument) = rest.next() {
        match argument.as_str() {
            "--than" => programs.push(("other", rest.next().ok_or("--than needs the path of a binary")?.into())),
            "--ingest" => ingest = true,
            rows => sizes.push(rows.parse::<usize>()?),
        }
    }
    if sizes.is_empty() && !ingest {
        sizes = vec![10_000, 100_000];
    }
    let folder = tempfile::tempdir()?;
    if ingest {
        return ingest_600(&programs, folder.path());
    }
    println!(
        "{:>9} {:8} {:16} {:>9} {:>10} {:>10} {:>9}",
        "rows", "program", "command", "ms", "read KB", "written KB", "peak MB"
    );
    for rows in sizes {
        for (name, program) in &programs {
            store_of(program, folder.path(), rows).and_then(|store| measure(name, program, &store, rows))?;
        }
        plain_redb(folder.path(), rows)?;
    }
    Ok(())
}

/// A store of `rows` textures in eight views, without voxels.
fn store_of(program: &Path, folder: &Path, rows: usize) -> Outcome<PathBuf> {
    let store = folder.join("textures.hlacdb");
    if store.exists() {
        fs::remove_file(&store)?;
    }
    let array = folder.join("moments.npy");
    write_moments(&array, ROWS_AT_ONCE.min(rows))?;
    for _ in 0..rows.div_ceil(ROWS_AT_ONCE) {
        let mut command = Command::new(program);
        command.arg("-s").arg(&store).args(["-q", "import"]).arg(&array).args(["--views", &VIEWS.join(",")]);
        check(command.stdout(Stdio::null()).status()?.success(), "import")?;
    }
    Ok(store)
}

/// Moments that behave like real ones: each falls with the number of cells, and neighbours go together.
fn write_moments(path: &Path, rows: usize) -> Outcome<()> {
    let mut file = BufWriter::new(File::create(path)?);
    let columns = MASKS * VIEWS.len();
    let mut header = format!("{{'descr': '<f4', 'fortran_order': False, 'shape': ({rows}, {columns}), }}");
    while !(10 + header.len() + 1).is_multiple_of(64) {
        header.push(' ');
    }
    header.push('\n');
    file.write_all(b"\x93NUMPY\x01\x00")?;
    file.write_all(&(header.len() as u16).to_le_bytes())?;
    file.write_all(header.as_bytes())?;
    let mut state = 0x9E37_79B9_7F4A_7C15_u64;
    let mut random = move || {
        state ^= state << 13;
        state ^= state >> 7;
        state ^= state << 17;
        (state >> 40) as f32 / (1_u64 << 24) as f32
    };
    for _ in 0..rows {
        for _ in 0..VIEWS.len() {
            let brightness = 0.3 + 0.4 * random();
            for mask in 0..MASKS {
                let cells = if mask == 0 {
                    1
                } else if mask < 15 {
                    2
                } else {
                    3
                };
                let moment = brightness.powi(cells) * (0.9 + 0.2 * random());
                file.write_all(&moment.min(1.0).to_le_bytes())?;
            }
        }
    }
    Ok(file.flush()?)
}

/// What one process did.
struct Cost {
    wall: Duration,
    read: u64,
    written: u64,
    peak_kb: u64,
}

/// Runs a command to its end. The system adds a child's bytes to those of the parent when it is waited for.
fn run(command: &mut Command) -> Outcome<Cost> {
    let (before, began) = (bytes_moved()?, Instant::now());
    let mut child = command.stdout(Stdio::null()).stderr(Stdio::null()).spawn()?;
    let status_path = format!("/proc/{}/status", child.id());
    let mut peak_kb = 0;
    let status = loop {
        if let Some(status) = child.try_wait()? {
            break status;
        }
        peak_kb = peak(&status_path).unwrap_or(0).max(peak_kb);
        std::thread::sleep(Duration::from_micros(300));
    };
    let wall = began.elapsed();
    check(status.success(), &format!("{command:?}"))?;
    let after = bytes_moved()?;
    Ok(Cost { wall, read: after.0 - before.0, written: after.1 - before.1, peak_kb })
}

/// The most memory that a process has had so far, in KB.
fn peak(status: &str) -> Option<u64> {
    let text = fs::read_to_string(status).ok()?;
    let line = text.lines().find_map(|line| line.strip_prefix("VmHWM:"))?;
    line.split_whitespace().next()?.parse().ok()
}

/// Bytes read and written so far, by this process and the children it has waited for.
fn bytes_moved() -> Outcome<(u64, u64)> {
    let text = fs::read_to_string("/proc/self/io")?;
    let value = |name: &str| text.lines().find_map(|line| line.strip_prefix(name)?.trim().parse().ok());
    Ok((value("rchar:").ok_or("no rchar")?, value("wchar:").ok_or("no wchar")?))
}

fn median(rows: usize, program: &str, command: &str, mut costs: Vec<Cost>) {
    let mut of = |value: fn(&Cost) -> u64| {
        costs.sort_by_key(value);
        value(&costs[costs.len() / 2])
    };
    let (wall, read, written, peak) = (
        of(|cost| cost.wall.as_micros() as u64),
        of(|cost| cost.read),
        of(|cost| cost.written),
        of(|cost| cost.peak_kb),
    );
    let most = costs.iter().map(|cost| cost.written).max().unwrap_or(0);
    println!(
        "{rows:>9} {program:8} {command:16} {:>9.1} {:>10} {:>10} {:>9.1}   at most {} KB written",
        wall as f64 / 1e3,
        read / 1000,
        written / 1000,
        peak as f64 / 1e3,
        most / 1000
    );
}

fn measure(name: &str, program: &Path, store: &Path, rows: usize) -> Outcome<()> {
    let folder = store.parent().ok_or("no folder")?;
    let command = |words: &[&str]| {
        let mut command = Command::new(program);
        command.arg("-s").arg(store).arg("-q").args(words);
        command
    };
    let mut added = Vec::new();
    for number in 0..RUNS {
        let path = folder.join(format!("volume-{number}.npy"));
        write_volume(&path, number as u64 + 1)?;
        added.push(run(command(&["ingest"]).arg(&path))?);
    }
    median(rows, name, "ingest one 64^3", added);
    let id = |number: usize| (rows.div_ceil(ROWS_AT_ONCE) * ROWS_AT_ONCE.min(rows) / 2 + number).to_string();
    let tagged = (0..RUNS).map(|number| run(&mut command(&["tag", &id(number), "rock=ketton"])));
    median(rows, name, "tag one", tagged.collect::<Outcome<_>>()?);
    let removed = (0..RUNS).map(|number| run(&mut command(&["remove", &id(number)])));
    median(rows, name, "remove one", removed.collect::<Outcome<_>>()?);
    let shown = (0..RUNS).map(|_| run(&mut command(&["stats"])));
    median(rows, name, "stats", shown.collect::<Outcome<_>>()?);
    let asked = (0..RUNS).map(|number| run(&mut command(&["query", "--id", &id(RUNS + number), "-k", "10"])));
    median(rows, name, "query by id", asked.collect::<Outcome<_>>()?);
    let length = fs::metadata(store)?.len();
    println!(
        "{rows:>9} {name:8} {:16} {:>9.3} times the moments and points",
        "file",
        length as f64 / (rows * (VIEWS.len() * MASKS * 4 + 32 * 4)) as f64
    );
    Ok(())
}

/// A volume of 64^3 voxels with some texture, as a numpy array.
fn write_volume(path: &Path, seed: u64) -> Outcome<()> {
    const SIDE: usize = 64;
    let mut bytes = b"\x93NUMPY\x01\x00\x76\x00".to_vec();
    let header = format!("{{'descr': '|u1', 'fortran_order': False, 'shape': ({SIDE}, {SIDE}, {SIDE}), }}");
    bytes.extend(format!("{header:<117}\n").as_bytes());
    let mut state = seed.wrapping_mul(0x9E37_79B9_7F4A_7C15) | 1;
    for z in 0..SIDE {
        for y in 0..SIDE {
            for x in 0..SIDE {
                state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
                let wave = (z * (3 + seed as usize % 5) + y * 5 + x * 7) % 160;
                bytes.push((wave as u64 + (state >> 58)) as u8);
            }
        }
    }
    Ok(fs::write(path, bytes)?)
}

/// One row per key in plain redb: no points, no statistics, no index.
fn plain_redb(folder: &Path, rows: usize) -> Outcome<()> {
    let path = folder.join("plain.redb");
    let value = vec![7_u8; VIEWS.len() * MASKS * 4];
    let database = redb::Database::create(&path)?;
    for batch in 0..rows.div_ceil(ROWS_AT_ONCE) {
        let transaction = database.begin_write()?;
        {
            let mut table = transaction.open_table(ROWS)?;
            for row in batch * ROWS_AT_ONCE..((batch + 1) * ROWS_AT_ONCE).min(rows) {
                table.insert(row as u64, &value[..])?;
            }
        }
        transaction.commit()?;
    }
    drop(database);
    let program = std::env::current_exe()?;
    let costs = (0..RUNS).map(|_| run(Command::new(&program).arg("--redb-add").arg(&path)));
    median(rows, "redb", "add one row", costs.collect::<Outcome<_>>()?);
    Ok(fs::remove_file(path)?)
}

fn redb_add(path: &Path) -> Outcome<()> {
    let database = redb::Database::open(path)?;
    let mut transaction = database.begin_write()?;
    transaction.set_quick_repair(true);
    {
        let mut table = transaction.open_table(ROWS)?;
        let next = table.last()?.map_or(0, |(key, _)| key.value() + 1);
        table.insert(next, &vec![7_u8; VIEWS.len() * MASKS * 4][..])?;
    }
    Ok(transaction.commit()?)
}

/// CPU time of an ingest of 600 files of 64^3 voxels.
fn ingest_600(programs: &[(&str, PathBuf)], folder: &Path) -> Outcome<()> {
    let files = folder.join("files");
    fs::create_dir(&files)?;
    for number in 0..600 {
        write_volume(&files.join(format!("{number:03}.npy")), number + 1)?;
    }
    for round in 0..3 {
        for (name, program) in programs {
            let store = folder.join(format!("{name}-{round}.hlacdb"));
            let (before, began) = (children_cpu()?, Instant::now());
            let mut command = Command::new(program);
            run(command.arg("-s").arg(&store).args(["-q", "ingest"]).arg(&files))?;
            let cpu = children_cpu()? - before;
            println!(
                "{name:8} {:.2} ms of CPU and {:.2} ms of time a texture",
                cpu / 0.6,
                began.elapsed().as_secs_f64() / 0.6
            );
            fs::remove_file(store)?;
        }
    }
    Ok(())
}

/// CPU seconds of the children waited for so far.
fn children_cpu() -> Outcome<f64> {
    let text = fs::read_to_string("/proc/self/stat")?;
    let fields: Vec<&str> = text.rsplit_once(')').ok_or("no fields")?.1.split_whitespace().collect();
    let ticks = |at: usize| fields.get(at).and_then(|field| field.parse::<f64>().ok()).ok_or("no times");
    // Times are in ticks of a hundredth of a second on every Linux.
    Ok((ticks(13)? + ticks(14)?) / 100.0)
}

fn check(good: bool, what: &str) -> Outcome<()> {
    if good { Ok(()) } else { Err(format!("failed: {what}").into()) }
}
