//! [`Database`]: the one public door. It joins store, space and index.
//!
//! A *database* is a store (what is on disk), the spaces fitted on it, and an index per space that answers queries. One
//! `Database` is shared by the threads of a process: queries read one consistent state each and never wait for a
//! writer; changes are made one transaction at a time. Other processes may read while one writes.
//!
//! What is done when:
//! - *adding*: textures go in whole, in input order; statistics are kept up to date in the same transaction;
//!   the spaces are fitted anew, by themselves, each time the store has doubled since the last fit;
//! - *in between*, new textures are mapped by the fitted space;
//! - [`Database::reindex`] fits on everything there is.

mod backup;
mod books;
mod catalogue;
pub(crate) mod cold;
mod counts;
mod exchange;
mod explain;
mod kept;
mod map;
mod nuisance;
mod open;
mod own_spaces;
mod pairs;
mod prepare;
mod quarantine;
mod rebuild;
mod repair;
mod scheme;
mod search;
mod spaces;
mod statistics;
mod textures;
mod transfer;
mod verify;
mod write;

pub use backup::BackedUp;
pub use catalogue::{Catalogue, Listed, Order, Selection, TagValues};
#[cfg(feature = "fuzz")]
pub use exchange::fuzz_list;
pub use exchange::{TexturesExported, TexturesImported};
pub use explain::Explained;
pub use map::Map;
pub use open::OpenOptions;
pub use pairs::{DUPLICATE_DISTANCE, NearPair};
pub use prepare::{BlockOf, Meta, Prepared};
pub use quarantine::Quarantined;
pub(crate) use quarantine::left_out;
pub use repair::{Repair, Repaired};
pub use search::IdPoint;
pub use spaces::{Learn, Reindex, Reindexed};
pub use statistics::{AxisReport, DriftReport, MomentStatistics, SettingsReport, SpaceReport, StatisticsReport};
pub use textures::{ContentHash, Texture};
pub use transfer::{Exported, Imported};
pub use verify::{Compacted, DamageReport, Verified};
pub use write::Added;

pub(crate) use search::Ground;
pub(crate) use textures::known_moments;

use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, RwLock};

use crate::error::Error;
use crate::store::Store;

use books::Books;
use search::SpaceStates;
use textures::Filtered;

/// The space that answers where none is named.
pub const DEFAULT_SPACE: &str = "default";

/// A database of solid textures in one file.
///
/// ```
/// use hlacdb::{Database, Meta, Query, volume::Volume};
/// # let folder = tempfile::tempdir()?;
/// # let path = folder.path().join("textures.hlacdb");
/// let database = Database::open(&path)?;
/// for step in 1..=8 {
///     let stripes = Volume::from_fn([16, 16, 16], |z, y, x| ((z + y * step + x) * 8) as u8)?;
///     database.add(&stripes, Meta::named(format!("stripes {step}")).tag("family", "stripes"))?;
/// }
/// let like = Volume::from_fn([16, 16, 16], |z, y, x| ((z + y * 3 + x) * 8) as u8)?;
/// let answer = database.query(&Query::volume(&like).k(3).filter("family", "stripes"))?;
/// assert_eq!((answer.hits[0].name.as_str(), answer.hits[0].distance), ("stripes 3", 0.0));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub struct Database {
    path: PathBuf,
    store: Store,
    /// The statistics in memory, and the lock that makes writers take turns.
    books: Mutex<Books>,
    /// The newest state of each space that was asked for.
    spaces: Arc<SpaceStates>,
    /// Held while a state is built, so that threads that ask at once build it once.
    building: Mutex<()>,
    /// The textures that the last filter let through.
    filtered: Mutex<Option<Filtered>>,
    /// The newest list of textures that was asked for.
    catalogue: RwLock<Option<Arc<Catalogue>>>,
    /// Held while a list is read, so that threads that ask at once read it once.
    listing: Mutex<()>,
}

impl Database {
    /// Opens the store at `path` for reading and writing, and makes it where there is none. [`OpenOptions`] has more.
    ///
    /// # Errors
    /// [`Error::Store`]: the file is not a store, is newer or older than this version, or is held by another writer.
    pub fn open(path: impl AsRef<Path>) -> Result<Self, Error> {
        OpenOptions::new().open(path)
    }

    /// Where the store is.
    pub fn path(&self) -> &Path {
        &self.path
    }

    pub(crate) fn store(&self) -> &Store {
        &self.store
    }
}

/// A lock's content, whether or not a thread panicked while it held it: what it guards is replaced whole, never half.
fn held<T>(locked: Result<T, std::sync::PoisonError<T>>) -> T {
    locked.unwrap_or_else(std::sync::PoisonError::into_inner)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_database_is_shared_by_threads() {
        fn shared<T: Send + Sync>() {}
        shared::<Database>();
        shared::<Error>();
    }
}
