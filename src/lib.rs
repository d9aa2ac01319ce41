//! hlacdb: an embedded database that finds *solid textures* (voxel volumes: marble, clouds, CT cores, foams) that look
//! alike.
//!
//! Each texture is described by its 251 exact 3-D higher-order local autocorrelation features (Suzuki, Yaginuma, Osawa:
//! *A HLAC Shape Descriptor Extraction Method for 3D Solid Textures*) and searched by exact nearest neighbours, in one
//! file on disk.
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
//! The rooms of the house, lower ones first; a lower one never imports a higher one:
//!
//! | room | from | to |
//! |---|---|---|
//! | [`volume`] | files | voxels |
//! | [`hlac`] | voxels | exact sums, moments |
//! | [`space`] | moments | points |
//! | `index` | points | neighbours |
//! | [`synth`] | recipes | voxels |
//! | [`Database`], [`ingest`], [`Query`], [`eval`] | all of them | answers |
//! | `render` | volumes, answers | pictures |

#![deny(unsafe_code)]

mod database;
mod describe;
mod error;
pub mod eval;
// Tests reach it through `internals`; without it some of what it offers is unused.
#[cfg_attr(not(feature = "unstable-internals"), allow(dead_code, unreachable_pub, unused_imports))]
mod index;
pub mod ingest;
mod isolated;
// Tests reach this room and the store through `internals`; otherwise some of what they offer is unused.
#[cfg_attr(not(feature = "unstable-internals"), allow(dead_code, unreachable_pub))]
#[path = "../migrations/mod.rs"]
mod migrations;
mod progress;
#[cfg(feature = "render")]
pub mod render;
#[cfg(feature = "serve")]
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

#[cfg(feature = "fuzz")]
#[doc(hidden)]
pub use database::fuzz_list;
pub use database::{
    Added, Answer, AxisReport, BackupReport, BlockOf, Catalogue, Combine, ContentHash, DEFAULT_SPACE,
    DUPLICATE_DISTANCE, Database, DriftReport, ExportReport, Hit, ImportReport, Listed, Meta, MomentStatistics,
    NearPair, NuisanceUpdate, OpenOptions, Order, PairExplanation, Prepared, Quarantined, Query, ReindexOptions,
    ReindexReport, RepairOptions, RepairReport, Selection, SettingsReport, SpaceReport, StatisticsReport, TagValues,
    Texture, TextureMap, TexturePoint, TexturesExportReport, TexturesImportReport, UnknownCombine, VerifyReport,
    arrays,
};
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
pub use store::{
    CompactReport, Cut, Damage, DamageKey, OpenError, Provenance, RecordedMapping, StoreError, TableSize, Volumes,
    panic_is_contained,
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
