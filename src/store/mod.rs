//! The store: what is on disk. It knows bytes, records and blocks; it knows no distance.
//!
//! A [`Store`] is one file. [`Store::read`] gives a [`Snapshot`], one consistent state; [`Store::write`] gives the one
//! [`Transaction`], whose changes are committed all or none. What can be asked of either is in [`Reads`].
//! `docs/format.md` describes every byte.
//!
//! Vocabulary: a *record* is what is known of a texture apart from its numbers; a *row* is a texture's place in the
//! *descriptor blocks* (moments, per view) and *point blocks* (coordinates, per space); a *tombstone* is the row of a
//! removed texture; *statistics* and *spaces* are named bytes whose meaning is their owner's.
//!
//! Invariants, checked by `verify`: a texture is in `textures`, `rows`, `hashes` (where its content is known), `tags`,
//! `chunks` and `sums` (where its record says so) or in none of them; ids ascend with rows and are never used again;
//! every value carries a checksum that covers its key.
//!
//! Not for: knowing what a view, a statistic or a space means, and not for finding anything by likeness.

mod bits;
mod blob;
mod codec;
mod compact;
mod copy;
mod descriptors;
mod discard;
mod error;
mod frame;
#[cfg(feature = "fuzz")]
#[doc(hidden)]
pub mod fuzz;
mod guard;
mod handle;
mod header;
mod holder;
mod keys;
mod open_blocks;
mod pieces;
mod points;
mod progress;
mod reads;
mod record;
mod rows;
mod salvage;
mod sizes;
mod snapshot;
mod sums;
mod tables;
mod transaction;
mod verify;
mod voxels;

pub use compact::CompactReport;
pub use copy::Copied;
pub use descriptors::{DESCRIPTOR_ROWS, DescriptorBlock, ViewCode};
pub use error::{Damage, StoreError};
pub use guard::panic_is_contained;
pub use handle::{Options, Store};
pub use header::{FORMAT_VERSION, Settings, Volumes};
pub use keys::{MAX_NAME, MAX_TAG_VALUE};
pub use points::{MAX_POINT_WIDTH, PointsLayout, point_rows_per_block};
pub use progress::{Progress, Report, silent};
pub use reads::{Counts, Reads, Records};
pub use record::{Content, Cut, Provenance, Record, RecordedMapping, StoredVoxels, VoxelFilter, path_bytes};
pub use rows::Rows;
pub use salvage::{Salvaged, SalvagedSettings};
pub use sizes::TableSize;
pub use snapshot::Snapshot;
pub use transaction::{NewTexture, Transaction};
pub use verify::{DeepCheck, VerifyReport};
pub use voxels::CompressedVoxels;
