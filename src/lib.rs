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
//! | [`index`] | points | neighbours |
//! | [`store`] | records | bytes on disk |
//! | [`synth`] | recipes | voxels |
//! | [`Database`], [`ingest`], [`Query`], [`eval`] | all of them | answers |
//! | `render` | volumes, answers | pictures |

#![deny(unsafe_code)]

mod database;
mod describe;
mod error;
pub mod eval;
pub mod index;
pub mod ingest;
mod isolated;
#[path = "../migrations/mod.rs"]
pub mod migrations;
mod progress;
#[cfg(feature = "render")]
pub mod render;
#[cfg(feature = "serve")]
pub mod serve;
pub mod space;
pub mod store;
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
    Added, Answer, AxisReport, BackupReport, BlockOf, Catalogue, Combine, CompactReport, ContentHash, DEFAULT_SPACE,
    DUPLICATE_DISTANCE, DamageReport, Database, DriftReport, ExportReport, Hit, ImportReport, Listed, Meta,
    MomentStatistics, NearPair, NuisanceUpdate, OpenOptions, Order, PairExplanation, Prepared, Quarantined, Query,
    ReindexOptions, ReindexReport, RepairOptions, RepairReport, Selection, SettingsReport, SpaceReport,
    StatisticsReport, TagValues, Texture, TextureMap, TexturePoint, TexturesExportReport, TexturesImportReport,
    UnknownCombine, VerifyReport, arrays,
};
pub use describe::{describe, octant_sums};
pub use error::{Error, ExampleKind, ExchangeError, Hint, IngestError, MaintenanceError, QueryError, chain};
pub use hlac;
pub use hlacdb_volume as volume;
pub use progress::Progress;
pub use store::{OpenError, StoreError};
pub use tags::{ParseTagFilterError, TagEdit, TagFilter};
pub use texture_id::TextureId;
