//! Creates the fixture store of a released format version:
//!
//! ```sh
//! cargo run --example fixture_store -- tests/fixtures/stores/v1.hlacdb.zst
//! ```
//!
//! Run it in the source code of the release that introduced the version; it refuses to write another version.

use hlacdb::volume::Volume;
use hlacdb::{Database, Meta, ReindexOptions};

/// The format version of the fixture.
const VERSION: u32 = 1;

/// A small texture of stripes and checks, different for every `n`.
fn texture(n: usize) -> Volume {
    let (side, step) = (9 + n % 3, 2 + n);
    let voxels = (0..side * side * side).map(|i| {
        let (z, y, x) = (i / (side * side), i / side % side, i % side);
        ((z * step + y * 3 + x * (n % 4 + 1)) * 17 % 251) as u8
    });
    #[allow(clippy::expect_used)]
    Volume::new([side; 3], 1, voxels.collect()).expect("the shape is valid")
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let target = std::env::args().nth(1).ok_or("give the file to write")?;
    let path = std::env::temp_dir().join(format!("hlacdb-fixture-{}", std::process::id()));
    let database = Database::open(&path)?;
    let format = database.statistics()?.settings.format;
    if format != VERSION {
        return Err(format!("this makes stores of version {VERSION}, the library writes {format}").into());
    }
    for n in 1..=6 {
        let meta = Meta::named(format!("texture {n}")).tag("parity", if n % 2 == 0 { "even" } else { "odd" });
        database.add(&texture(n), meta.path(format!("/scans/{n}.npy")))?;
    }
    database.remove([3])?;
    database.reindex(&ReindexOptions::default(), &())?;
    database.compact(&())?;
    database.add(&texture(7), Meta::named("texture 7").tag("parity", "odd"))?;
    drop(database);
    let packed = zstd::encode_all(std::fs::File::open(&path)?, 19)?;
    std::fs::remove_file(&path)?;
    std::fs::write(&target, &packed)?;
    println!("{target}: {} bytes", packed.len());
    Ok(())
}
