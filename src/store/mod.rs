//! The store: one file on disk that holds textures and everything derived from them. It knows bytes, records and
//! blocks; it knows no distance.
//!
//! [`Store`] is the open file. [`Store::read`] takes a [`Snapshot`], one consistent state; [`Store::write`] begins a
//! [`Transaction`], whose changes are committed together or not at all. [`Reads`] lists what either can answer.
//! `docs/format.md` describes every byte.
//!
//! | folder | holds |
//! |---|---|
//! | `format/` | every type that reaches the disk: keys, frames, records, blocks, and how they are encoded |
//! | `access/` | the open file, snapshots, reads and transactions |
//! | `upkeep/` | work over the whole file: verify, compact, copy, salvage, sizes |
//! | `os/` | the engine's panics, the process that holds the lock, file names |
//!
//! Imports go one way: `damage`, `error` and `os` are lowest, then `format`, `access` and `upkeep`.
//!
//! Vocabulary: a *record* is what is known of a texture apart from its numbers; a *row* is a texture's place in the
//! *descriptor blocks* (moments, per view) and *point blocks* (coordinates, per space); a *tombstone* is the row of a
//! removed texture; *statistics* and *spaces* are named blobs whose meaning is known to their owner only.
//!
//! Invariants, checked by `verify`: a texture is in `textures`, `rows`, `hashes` (where its content is known), `tags`,
//! `chunks` and `sums` (where its record says so), or in none of them; ids ascend with rows and are never reused;
//! every value carries a checksum that covers its key.
//!
//! The store does not know what a view, a statistic or a space means, and finds nothing by likeness.

mod access;
mod damage;
mod error;
mod format;
#[cfg(feature = "fuzz")]
#[doc(hidden)]
pub mod fuzz;
mod open_error;
mod os;
mod upkeep;

pub use access::handle::Store;
pub use access::open::StoreOptions;
pub use access::reads::{Counts, Reads, Records};
pub use access::snapshot::Snapshot;
pub use access::transaction::{NewTexture, Transaction};
pub use damage::{Damage, DamageKey};
pub use error::StoreError;
pub use format::descriptors::{DESCRIPTOR_ROWS, DescriptorBlock, ViewCode};
pub use format::header::{FORMAT_VERSION, Settings, Volumes};
pub use format::keys::{MAX_NAME, MAX_TAG_VALUE};
pub use format::points::{MAX_POINT_WIDTH, PointsLayout, point_rows_per_block};
#[cfg(test)]
pub(crate) use format::record::hashes_made;
pub use format::record::{Content, Cut, Provenance, Record, RecordedMapping, StoredVoxels, VoxelFilter, path_bytes};
pub use format::rows::Rows;
pub use format::voxels::CompressedVoxels;
pub use open_error::OpenError;
pub use os::panic_boundary::panic_is_contained;
pub use upkeep::compact::CompactReport;
pub use upkeep::copy::CopyReport;
pub use upkeep::salvage::{SalvageReport, SalvagedSettings};
pub use upkeep::sizes::TableSize;
pub use upkeep::verify::{CheckReport, DeepCheck};
