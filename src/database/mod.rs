//! [`Database`]: textures, statistics, fitted spaces and indexes over one store file.
//!
//! A *database* joins a store (what is on disk), the spaces that are fitted on it, and an index per space that answers queries.
//! The threads of a process share one `Database`: each query sees one consistent state and never waits for a writer, and
//! changes are made one transaction at a time. Other processes may read while one writes.
//!
//! - Textures are added whole and in input order, and the statistics are updated in the same transaction. Spaces are fitted
//!   automatically each time the number of textures has doubled since the last fit; until then, the fitted spaces map
//!   new textures.
//! - [`Database::reindex`] fits the spaces on all textures.
//!
//! | module | holds |
//! |---|---|
//! | `open`, `handle` | opening a store; what a process keeps of it in memory |
//! | `texture`, `filter`, `scheme` | what is recorded of textures; which ones match filters; the views and spaces of a store |
//! | `points` | moments, statistics and points, stored and in memory |
//! | `change`, `write` | transactions; adding, removing, tagging |
//! | `fit` | reindexing, nuisances, user-defined spaces |
//! | `search` | queries |
//! | `inspect`, `catalogue`, `quarantine` | what a store holds |
//! | `maintain` | verification, compaction, backup, repair, migration |
//! | `exchange` | arrays and archives |

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

pub use catalogue::{Catalogue, CatalogueEntry, CatalogueOrder, CatalogueQuery, TagValues};
#[cfg(feature = "archives")]
pub use exchange::archive::export::ArchiveExportReport;
#[cfg(all(feature = "fuzz", feature = "archives"))]
pub use exchange::archive::fuzz_list;
#[cfg(feature = "archives")]
pub use exchange::archive::import::ArchiveImportReport;
pub use exchange::arrays;
pub use exchange::moments::{ExportReport, ImportReport};
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
pub use quarantine::QuarantinedTexture;
pub use scheme::DEFAULT_SPACE;
pub use search::pairs::{DUPLICATE_DISTANCE, NearPair};
pub use search::{Answer, Combine, DescribedVolume, Hit, ParseCombineError, Query};
pub use texture::{BlockOf, ContentHash, Meta, Texture};
pub use write::Added;
pub use write::prepare::PreparedTexture;
