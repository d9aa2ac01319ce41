//! An embedded database that finds *solid textures* that look alike: voxel volumes such as marble, clouds, CT cores and foams.
//!
//! Each texture is described by its 251 exact 3-D higher-order local autocorrelation features (Suzuki, Yaginuma, Osawa:
//! *A HLAC Shape Descriptor Extraction Method for 3D Solid Textures*). Queries find the exact nearest neighbours. A database is
//! one file on disk.
//!
//! ```
//! use hlacdb::{Database, Meta, Query, volume::Volume};
//! # let folder = tempfile::tempdir()?;
//! # let path = folder.path().join("textures.hlacdb");
//! let database = Database::open(&path)?;
//! let checker = Volume::from_fn([16, 16, 16], |z, y, x| if (z / 4 + y / 4 + x / 4) % 2 == 0 { 200 } else { 40 })?;
//! let id = database.add(&checker, Meta::named("checker").tag("family", "checker"))?.id();
//! let answer = database.query(&Query::volume(&checker).k(30).filter("family", "checker"))?;
//! assert_eq!(answer.hits[0].id, id);
//! println!("{} textures", database.statistics()?.textures);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! | module | is for |
//! |---|---|
//! | [`Database`] | adding, querying, inspecting and maintaining textures |
//! | [`ingest`] | adding files and synthetic textures in parallel |
//! | [`eval`] | measuring how well spaces retrieve labelled textures |
//! | [`volume`] | voxels, and reading them from files (package `hlacdb-volume`) |
//! | [`hlac`] | exact features of voxels (package `hlac`) |
//! | [`space`] | the spaces in which distance means likeness |
//! | [`synth`] | synthetic textures |
//! | [`arrays`] | moments as NumPy arrays |
//!
//! # Features
//!
//! `default-features = false` gives a lean library, which reads NumPy arrays and uncompressed NRRD, MetaImage, NIfTI and raw
//! samples. These features add to it:
//!
//! | feature | adds |
//! |---|---|
//! | `archives` | [`Database::export_textures`] and [`Database::import_textures`] |
//! | `bzip2`, `gzip`, `images`, `npz`, `tiff`, `vox` | file formats of volumes |
//! | `render` | contact sheets, slice images and plots |
//! | `cli`, `serve` | the program and its server |

#![deny(unsafe_code)]

mod database;
mod describe;
mod error;
pub mod eval;
// Tests and benches reach these rooms through `internals`. Without it, some of what the rooms offer is unused.
#[cfg_attr(not(feature = "unstable-internals"), allow(dead_code, unreachable_pub, unused_imports))]
mod index;
pub mod ingest;
mod isolated;
#[cfg_attr(not(feature = "unstable-internals"), allow(dead_code, unreachable_pub))]
#[path = "../migrations/mod.rs"]
mod migrations;
mod progress;
#[cfg(feature = "render")]
pub mod render;
#[cfg(feature = "serve")]
#[doc(hidden)]
pub mod serve;
pub mod space;
#[cfg_attr(not(feature = "unstable-internals"), allow(dead_code, unreachable_pub, unused_imports))]
mod store;
pub mod synth;
mod tags;
mod texture_id;

/// The examples of the README are compiled and run like any other.
#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;

#[cfg(all(feature = "fuzz", feature = "archives"))]
#[doc(hidden)]
pub use database::fuzz_list;
pub use database::{
    Added, Answer, AxisReport, BackupReport, BlockOf, Catalogue, CatalogueEntry, CatalogueOrder, CatalogueQuery,
    Combine, ContentHash, DEFAULT_SPACE, DUPLICATE_DISTANCE, Database, DescribedVolume, DriftReport, ExportReport, Hit,
    ImportReport, Meta, MomentStatistics, NearPair, NuisanceUpdate, OpenOptions, PairExplanation, ParseCombineError,
    PreparedTexture, QuarantinedTexture, Query, ReindexOptions, ReindexReport, RepairOptions, RepairReport,
    SettingsReport, SpaceReport, StatisticsReport, TagValues, Texture, TextureMap, TexturePoint, VerifyReport, arrays,
};
#[cfg(feature = "archives")]
pub use database::{ArchiveExportReport, ArchiveImportReport};
pub use describe::{describe, octant_sums};
pub use error::{Error, ExampleKind, ExchangeError, Hint, IngestError, MaintenanceError, QueryError, chain};
pub use hlac;
pub use hlacdb_volume as volume;
pub use index::{IndexError, IndexMethod, UnknownIndexMethod};
pub use migrations::{MigrateOptions, MigrateReport, MigrationError};
pub use progress::Progress;
#[cfg(feature = "fuzz")]
#[doc(hidden)]
pub use store::fuzz::values as fuzz_values;
#[doc(hidden)]
pub use store::panic_is_contained;
pub use store::{
    CompactReport, Cut, Damage, DamageKey, OpenError, Provenance, RecordedMapping, StoreError, TableSize, Volumes,
};
pub use tags::{ParseTagFilterError, TagEdit, TagFilter};
pub use texture_id::TextureId;

/// What the tests and benches of this repository reach inside the library. Anything in it may change at any time.
#[cfg(feature = "unstable-internals")]
#[doc(hidden)]
pub mod internals {
    pub mod index {
        pub use crate::index::*;
    }
    pub mod migrations {
        pub use crate::migrations::*;
    }
    pub mod space {
        pub use crate::space::contribution::Contribution;
        pub use crate::space::nuisance::NuisanceStatistics;
        pub use crate::space::prior::{Observations, Prior};
    }
    pub mod store {
        pub use crate::store::*;
    }
}
