//! Repair: a damaged store is replaced by one that holds everything that can still be read or derived.
//!
//! The data of the damaged file are not changed (opening it for writing, which keeps others from writing, updates the engine's
//! own bookkeeping). What is intact is copied to a new store. What is damaged is derived from other entries, if possible:
//!
//! | damaged | derived from |
//! |---|---|
//! | hashes, tags, rows, counters | records |
//! | settings | the names of statistics, and fitted spaces |
//! | moments, sums | voxels |
//! | statistics | moments and voxels |
//! | spaces, points | statistics and moments |
//!
//! The new store is verified and takes the name of the old one, which is kept beside it.
//!
//! A texture whose record or moments cannot be derived is *quarantined*: it keeps its id and what is left of it, verification
//! and statistics list it, and no answer contains it.

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

use serde::Serialize;

use crate::database::fit::rebuild::{Rewrite, rebuild, restore_moments};
use crate::database::handle::Database;
use crate::database::open::OpenOptions;
use crate::database::points::fitting::fit;
use crate::database::points::spaces::{next_epoch, store_points};
use crate::database::points::statistics_cache::StatisticsCache;
use crate::database::quarantine::{self, QuarantinedTexture};
use crate::database::scheme::{Scheme, put_definition};
use crate::error::{Error, MaintenanceError, chain};
use crate::hlac::View;
use crate::progress::Progress;
use crate::space::{Definition, Space};
use crate::store::{
    Damage, DamageKey, OpenError, Reads, SalvageReport, SalvagedSettings, Settings, Store, StoreError, StoreOptions,
    ViewCode,
};
use crate::volume::display_path;

/// How [`Database::repair`] works.
#[derive(Clone, Copy, Debug, Default)]
pub struct RepairOptions {
    deep: bool,
    check_only: bool,
}

impl RepairOptions {
    /// Repairs what [`Database::verify`] finds without describing voxels.
    pub fn new() -> Self {
        Self::default()
    }

    /// Also looks for damage in voxels: they are decompressed, hashed and described again.
    #[must_use]
    pub fn deep(mut self, deep: bool) -> Self {
        self.deep = deep;
        self
    }

    /// Only reports what is damaged.
    #[must_use]
    pub fn check_only(mut self, check_only: bool) -> Self {
        self.check_only = check_only;
        self
    }
}

/// What [`Database::repair`] found and did.
#[derive(Clone, Debug, Serialize)]
#[non_exhaustive]
pub struct RepairReport {
    /// What was damaged; empty if nothing was.
    pub damage: Vec<Damage>,
    /// The number of entries of each kind that were derived from others.
    pub derived: BTreeMap<&'static str, u64>,
    /// Textures of which something is lost.
    pub quarantined: Vec<QuarantinedTexture>,
    /// The path of the damaged file; `None` if the store was not replaced.
    pub original: Option<String>,
}

impl RepairReport {
    /// The report of a store that was not replaced.
    fn unchanged(damage: Vec<Damage>, quarantined: Vec<QuarantinedTexture>) -> Self {
        Self { damage, derived: BTreeMap::new(), quarantined, original: None }
    }
}

impl Database {
    /// Repairs the store at `path`. If [`Database::verify`] finds no damage, nothing is done. Otherwise a new store is made of
    /// everything that is intact or can be derived. It is verified and takes the place of the damaged one, which is kept
    /// beside it as `NAME.damaged`. If none of the damage can be repaired, as after an earlier repair, the store stays as it
    /// is. A repair needs as much disk space as the store has.
    ///
    /// # Errors
    /// [`MaintenanceError::BeyondRepair`] if nothing of the file can be read; [`Error::Open`] if another process writes;
    /// [`Error::Store`], [`Error::Io`]; [`Error::Cancelled`]. The store is then as it was.
    pub fn repair(path: &Path, options: &RepairOptions, progress: &dyn Progress) -> Result<RepairReport, Error> {
        let (damage, quarantined_before) = match examine(path, options.deep, progress) {
            Ok((damage, _)) if damage.is_empty() || options.check_only => {
                return Ok(RepairReport::unchanged(damage, Vec::new()));
            }
            Ok(found) => found,
            Err(error) if error.is_damage() => (vec![damage_of(&error)], Vec::new()),
            Err(error) => return Err(error),
        };
        let temporary = beside(path, ".repairing");
        let outcome = restore(path, &temporary, progress).and_then(|Restored { derived, quarantined, remaining }| {
            let keys = |damage: &[Damage]| -> BTreeSet<(&str, DamageKey)> {
                damage.iter().map(|damage| (damage.table, damage.key.clone())).collect()
            };
            if keys(&remaining) == keys(&damage) && quarantined == quarantined_before {
                return Ok(RepairReport::unchanged(damage, quarantined));
            }
            let original = replace(path, &temporary)?;
            Ok(RepairReport { damage, derived, quarantined, original: Some(display_path(&original)) })
        });
        if !matches!(&outcome, Ok(RepairReport { original: Some(_), .. })) {
            // The outcome is what matters: a temporary file that cannot be removed does no harm.
            let _ = std::fs::remove_file(&temporary);
        }
        outcome
    }
}

/// The damage that verification finds, and the textures of which something was known to be lost before.
fn examine(path: &Path, deep: bool, progress: &dyn Progress) -> Result<(Vec<Damage>, Vec<QuarantinedTexture>), Error> {
    // Opened for writing: a store that was not closed properly is recovered first, and nobody else changes it meanwhile.
    let database = OpenOptions::new().create(false).open(path)?;
    let damage = database.verify(deep, progress)?.damage;
    Ok((damage, database.quarantined().unwrap_or_default()))
}

/// The damage of a file that cannot be opened.
fn damage_of(error: &Error) -> Damage {
    match error {
        Error::Store(StoreError::Damage(damage)) | Error::Open(OpenError::DamagedFile { damage, .. }) => damage.clone(),
        other => Damage::new("(file)", DamageKey::Whole, chain(other)),
    }
}

/// A store made of what is intact of another one.
struct Restored {
    derived: BTreeMap<&'static str, u64>,
    quarantined: Vec<QuarantinedTexture>,
    /// The damage that verification still finds: of textures of which something is lost.
    remaining: Vec<Damage>,
}

/// Makes a store at `temporary` of what is intact of the one at `path`.
fn restore(path: &Path, temporary: &Path, progress: &dyn Progress) -> Result<Restored, Error> {
    if let Err(source) = std::fs::remove_file(temporary)
        && source.kind() != std::io::ErrorKind::NotFound
    {
        return Err(Error::file("removing", temporary, source));
    }
    let damaged = StoreOptions::default().open_damaged(path).map_err(|error| beyond_repair(path, error))?;
    let old_settings = damaged.salvaged_settings()?;
    let salvaged = {
        let target = Store::create(temporary, &restored_settings(&old_settings))?;
        damaged.salvage(&target, progress)?
    };
    let database = OpenOptions::new().create(false).open(temporary)?;
    let mut derived = salvaged.derived.clone();
    count(&mut derived, "settings", u64::from(old_settings.lost));
    let lost = derive(&database, &salvaged, &mut derived, progress)?;
    let remaining = database.verify(false, progress)?.damage;
    let quarantined = database.quarantined()?;
    let is_explained = |damage: &Damage| {
        damage.texture().is_some_and(|id| quarantined.iter().any(|texture| texture.id == id) || lost.contains(&id))
    };
    match remaining.iter().find(|damage| !is_explained(damage)) {
        Some(damage) => Err(StoreError::Damage(damage.clone()).into()),
        None => Ok(Restored { derived, quarantined, remaining }),
    }
}

/// The error for a file that cannot be opened even for salvage: damage means that nothing of it can be read.
fn beyond_repair(path: &Path, source: StoreError) -> Error {
    let is_damage = match &source {
        StoreError::Damage(_) | StoreError::Open(OpenError::DamagedFile { .. }) | StoreError::Engine { .. } => true,
        StoreError::Open(OpenError::Io { source, .. }) => source.kind() == std::io::ErrorKind::UnexpectedEof,
        _ => false,
    };
    if is_damage { MaintenanceError::BeyondRepair { path: path.to_owned(), source }.into() } else { source.into() }
}

/// The settings of the new store. If they are lost, the names of statistics give the views, including those that no texture is
/// large enough for, and fitted spaces give the definitions of user-defined spaces.
fn restored_settings(old: &SalvagedSettings) -> Settings {
    let mut settings = old.settings.clone();
    if !old.lost {
        return settings;
    }
    let mut views: BTreeSet<ViewCode> = settings.views.iter().copied().collect();
    let named = old.statistics.iter().filter_map(|name| name.rsplit_once(':')).flat_map(|(_, views)| views.split(','));
    views.extend(named.filter_map(|name| name.parse::<View>().ok()).map(|view| ViewCode(view.code())));
    settings.views = views.into_iter().collect();
    for space in old.spaces.values().filter_map(|bytes| Space::decode(bytes).ok()) {
        let definition = space.definition();
        if Definition::built_in(&definition.name).is_none()
            && let Err(error) = put_definition(&mut settings, definition)
        {
            tracing::warn!(%error, "the space {} is lost with the settings", definition.name);
        }
    }
    settings
}

/// Derives what is missing in the new store, in one transaction. Returns the textures of which something is lost.
fn derive(
    database: &Database,
    salvaged: &SalvageReport,
    derived: &mut BTreeMap<&'static str, u64>,
    progress: &dyn Progress,
) -> Result<BTreeSet<u64>, Error> {
    let mut transaction = database.store().write()?;
    let undescribed: BTreeSet<u64> = salvaged.undescribed.iter().copied().collect();
    let lost = restore_moments(&mut transaction, &undescribed, progress)?;
    count(derived, "textures described", (undescribed.len() - lost.len()) as u64);

    let scheme = Scheme::of(&transaction);
    let is_stored = |key: &str| matches!(transaction.statistics(key), Ok(Some(_)));
    let has_all = scheme.feature_sets().iter().all(|set| is_stored(&set.key()));
    let mut statistics = StatisticsCache::default();
    let is_intact =
        has_all && lost.is_empty() && salvaged.unreadable.is_empty() && statistics.load_for(&transaction).is_ok();
    if !is_intact && transaction.counts().textures > 0 {
        rebuild(&mut transaction, &mut statistics, Rewrite::Nothing, progress)?;
        statistics.save(&mut transaction)?;
        count(derived, "statistics", statistics.all().len() as u64);
    }
    let is_lost = |name: &str| {
        salvaged.blobs_lost.iter().any(|(table, lost)| *table == "spaces" && (lost == name || lost == "?"))
    };
    let definitions = scheme.definitions();
    if definitions.iter().any(|definition| is_lost(&definition.name)) && !statistics.all().is_empty() {
        let epoch = next_epoch(&transaction)?;
        fit(&mut transaction, statistics.all(), epoch)?;
        count(derived, "spaces", definitions.len() as u64);
    }
    if transaction.counts().rows > 0 {
        store_points(&mut transaction)?;
        count(derived, "points", transaction.counts().rows);
    }
    let voxels = salvaged.voxels_lost.iter().copied().collect();
    quarantine::note(&mut transaction, &lost, &voxels)?;
    transaction.commit()?;
    Ok(lost)
}

fn count(derived: &mut BTreeMap<&'static str, u64>, what: &'static str, more: u64) {
    if more > 0 {
        *derived.entry(what).or_default() += more;
    }
}

/// Replaces the damaged store by the new one. Returns the path that the damaged one has then.
fn replace(path: &Path, temporary: &Path) -> Result<PathBuf, Error> {
    let names = (1..1000).map(|number| match number {
        1 => beside(path, ".damaged"),
        number => beside(path, &format!(".damaged-{number}")),
    });
    let free = names.into_iter().find(|name| name.symlink_metadata().is_err());
    let original = free.ok_or_else(|| OpenError::Exists { path: beside(path, ".damaged-999") })?;
    let failed = |source| Error::file("renaming", temporary, source);
    // The damaged store gets a second name first, so that there is a store at `path` at every moment.
    if std::fs::hard_link(path, &original).is_err() {
        std::fs::rename(path, &original).map_err(failed)?;
    }
    std::fs::rename(temporary, path).map_err(failed)?;
    Ok(original)
}

/// The path with a suffix after its name.
fn beside(path: &Path, suffix: &str) -> PathBuf {
    let mut name = path.file_name().unwrap_or_default().to_os_string();
    name.push(suffix);
    path.with_file_name(name)
}
