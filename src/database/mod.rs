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

mod catalogue;
mod change;
mod exchange;
mod filter;
mod fit;
mod handle;
mod inspect;
mod locks;
mod maintain;
mod open;
mod points;
mod quarantine;
mod scheme;
mod search;
mod texture;
mod write;

pub use catalogue::{Catalogue, Listed, Order, Selection, TagValues};
pub use exchange::arrays;
pub use exchange::moments::{ExportReport, ImportReport};
#[cfg(feature = "fuzz")]
pub use exchange::textures::fuzz_list;
pub use exchange::textures::{TexturesExportReport, TexturesImportReport};
pub use fit::reindex::{NuisanceUpdate, ReindexOptions, ReindexReport};
pub use handle::Database;
pub use inspect::explain::PairExplanation;
pub use inspect::map::TextureMap;
pub use inspect::statistics::{
    AxisReport, DriftReport, MomentStatistics, SettingsReport, SpaceReport, StatisticsReport,
};
pub use maintain::backup::BackupReport;
pub use maintain::repair::{RepairOptions, RepairReport};
pub use maintain::verify::VerifyReport;
pub use open::OpenOptions;
pub use points::loading::TexturePoint;
pub use quarantine::Quarantined;
pub use scheme::DEFAULT_SPACE;
pub use search::pairs::{DUPLICATE_DISTANCE, NearPair};
pub use search::{Answer, Combine, Hit, Query, UnknownCombine};
pub use texture::{BlockOf, ContentHash, Meta, Texture};
pub use write::Added;
pub use write::prepare::Prepared;
