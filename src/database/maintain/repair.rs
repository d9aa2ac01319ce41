//! Repair: a damaged store becomes one that is whole but for what nothing can tell any more.
//!
//! Nothing that the damaged file holds is changed (opening it for writing, which keeps others from doing so, rewrites the
//! engine's own bookkeeping). What is whole of it goes into a new store; what other entries tell (hashes, tags,
//! rows, counters from records; settings from statistics and spaces; moments and sums from voxels; statistics from both; spaces and points from statistics
//! and moments) is derived again; the new store is verified, takes the old one's name, and the old file is kept beside it.
//!
//! A texture whose record or moments nothing can tell is *quarantined*: it keeps its id and whatever is left of it, is
//! named by `verify` and `stats`, and is never an answer.

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

use serde::Serialize;

use crate::database::fit::rebuild::{Rewrite, describe_anew, rebuild};
use crate::database::fit::spaces::fit;
use crate::database::handle::Database;
use crate::database::open::OpenOptions;
use crate::database::points::spaces::{keep_points, next_epoch};
use crate::database::points::statistics_cache::StatisticsCache;
use crate::database::quarantine::{self, Quarantined};
use crate::database::scheme::{Scheme, set_down};
use crate::error::{Error, MaintenanceError};
use crate::hlac::View;
use crate::progress::Progress;
use crate::space::{Definition, Space};
use crate::store::{
    Damage, DamageKey, OpenError, Reads, SalvageReport, SalvagedSettings, Settings, Store, StoreError, StoreOptions,
    ViewCode,
};
use crate::volume::display_path;

/// How [`Database::repair`] goes about it.
#[derive(Clone, Copy, Debug, Default)]
pub struct RepairOptions {
    /// Look for damage as [`Database::verify`] does with `deep`: voxels are decompressed and described anew.
    pub deep: bool,
    /// Only tell what is damaged.
    pub check_only: bool,
}

/// What [`Database::repair`] found and did.
#[derive(Clone, Debug, Serialize)]
pub struct RepairReport {
    /// What was damaged; empty where there was nothing to repair.
    pub damage: Vec<Damage>,
    /// How many entries of each kind were derived again.
    pub derived: BTreeMap<&'static str, u64>,
    /// Textures of which something is lost.
    pub quarantined: Vec<Quarantined>,
    /// Where the damaged file is kept; `None` where nothing was done.
    pub original: Option<String>,
}

impl Database {
    /// Repairs the store at `path`. Where `verify` finds nothing wrong, nothing is done. Else a new store is made of all that is
    /// whole and all that can be derived from it, verified, and put in the place of the damaged one, which is kept beside
    /// it as `NAME.damaged`. Where nothing that is damaged can be restored (as after an earlier repair that had to leave
    /// something lost) the store stays as it is. Takes as much room on the disk as the store has.
    ///
    /// # Errors
    /// [`MaintenanceError::BeyondRepair`] where not even the beginnings of the file can be read; [`Error::Store`] where another process
    /// writes or there is no room; [`Error::Cancelled`]. The store is then as it was.
    pub fn repair(path: &Path, options: &RepairOptions, progress: &dyn Progress) -> Result<RepairReport, Error> {
        let (damage, known) = match examine(path, options.deep, progress) {
            Ok((damage, _)) if damage.is_empty() || options.check_only => {
                return Ok(RepairReport { damage, derived: BTreeMap::new(), quarantined: Vec::new(), original: None });
            }
            Ok(found) => found,
            Err(error) if error.is_damage() => (vec![damage_of(&error)], Vec::new()),
            Err(error) => return Err(error),
        };
        let passing = beside(path, ".repairing");
        let outcome = restore(path, &passing, progress).and_then(|Restored { derived, quarantined, left }| {
            let places = |damage: &[Damage]| -> BTreeSet<(&str, DamageKey)> {
                damage.iter().map(|damage| (damage.table, damage.key.clone())).collect()
            };
            // What an earlier repair could not restore none can: a copy of the store would help nobody.
            if places(&left) == places(&damage) && quarantined == known {
                return Ok(RepairReport { damage, derived: BTreeMap::new(), quarantined, original: None });
            }
            let original = take_place(path, &passing)?;
            Ok(RepairReport { damage, derived, quarantined, original: Some(display_path(&original)) })
        });
        if !matches!(&outcome, Ok(RepairReport { original: Some(_), .. })) {
            // The outcome is what matters; what is left of the attempt is in nobody's way.
            let _ = std::fs::remove_file(&passing);
        }
        outcome
    }
}

/// What `verify` finds, and the textures of which something was known to be lost before.
fn examine(path: &Path, deep: bool, progress: &dyn Progress) -> Result<(Vec<Damage>, Vec<Quarantined>), Error> {
    // For writing: a store that a crash left is recovered first, and nobody else changes it meanwhile.
    let database = OpenOptions::new().create(false).open(path)?;
    let damage = database.verify(deep, progress)?.damage;
    let known = database.store().read().map_err(Error::from).and_then(|snapshot| quarantine::listed(&snapshot));
    Ok((damage, known.unwrap_or_default()))
}

/// The damage of a file that cannot be opened.
fn damage_of(error: &Error) -> Damage {
    match error {
        Error::Store(StoreError::Damage(damage)) | Error::Open(OpenError::DamagedFile { damage, .. }) => damage.clone(),
        other => Damage::new("(file)", DamageKey::Whole, crate::error::chain(other)),
    }
}

/// A store made of what is whole of another.
struct Restored {
    derived: BTreeMap<&'static str, u64>,
    quarantined: Vec<Quarantined>,
    /// What `verify` still finds: of textures of which something is lost.
    left: Vec<Damage>,
}

/// Makes a store of what is whole of the one at `path` at `passing`.
fn restore(path: &Path, passing: &Path, progress: &dyn Progress) -> Result<Restored, Error> {
    if let Err(source) = std::fs::remove_file(passing)
        && source.kind() != std::io::ErrorKind::NotFound
    {
        return Err(Error::file("removing", passing, source));
    }
    let beyond = |source: StoreError| -> Error {
        match source {
            StoreError::Damage(_) | StoreError::Open(OpenError::DamagedFile { .. }) | StoreError::Engine { .. } => {
                MaintenanceError::BeyondRepair { path: path.to_owned(), source }.into()
            }
            StoreError::Open(OpenError::Io { source: ref cause, .. })
                if cause.kind() == std::io::ErrorKind::UnexpectedEof =>
            {
                MaintenanceError::BeyondRepair { path: path.to_owned(), source }.into()
            }
            other => other.into(),
        }
    };
    let old = StoreOptions::default().open_damaged(path).map_err(beyond)?;
    let told = old.salvaged_settings()?;
    let settings = settings(&told);
    let salvaged = {
        let target = Store::create(passing, &settings)?;
        old.salvage(&target, progress)?
    };
    let database = OpenOptions::new().create(false).open(passing)?;
    let mut derived = salvaged.derived.clone();
    count(&mut derived, "settings", u64::from(told.lost));
    let lost = derive(&database, &salvaged, &mut derived, progress)?;
    let left = database.verify(false, progress)?.damage;
    let quarantined = quarantine::listed(&database.store().read()?)?;
    let explained = |damage: &Damage| {
        damage.texture().is_some_and(|id| quarantined.iter().any(|held| held.id == id) || lost.contains(&id))
    };
    match left.iter().find(|damage| !explained(damage)) {
        Some(damage) => Err(StoreError::Damage(damage.clone()).into()),
        None => Ok(Restored { derived, quarantined, left }),
    }
}

/// The settings. Where they are lost the names of statistics tell the views, those included that no texture is large enough
/// for, and fitted spaces of the user's own tell their definitions.
fn settings(told: &SalvagedSettings) -> Settings {
    let mut settings = told.settings.clone();
    if !told.lost {
        return settings;
    }
    let mut views: BTreeSet<ViewCode> = settings.views.iter().copied().collect();
    let listed = told.statistics.iter().filter_map(|name| name.rsplit_once(':')).flat_map(|(_, list)| list.split(','));
    views.extend(listed.filter_map(|name| name.parse::<View>().ok()).map(|view| ViewCode(view.code())));
    settings.views = views.into_iter().collect();
    for space in told.spaces.values().filter_map(|bytes| Space::decode(bytes).ok()) {
        let definition = space.definition();
        if Definition::built_in(&definition.name).is_none()
            && let Err(error) = set_down(&mut settings, definition)
        {
            tracing::warn!(%error, "the space {} is lost with the settings", definition.name);
        }
    }
    settings
}

/// What can be derived again, in one transaction. Returns the textures of which something is lost.
fn derive(
    database: &Database,
    salvaged: &SalvageReport,
    derived: &mut BTreeMap<&'static str, u64>,
    progress: &dyn Progress,
) -> Result<BTreeSet<u64>, Error> {
    let mut transaction = database.store().write()?;
    let unreadable: BTreeSet<u64> = salvaged.unreadable.iter().copied().collect();
    let undescribed: BTreeSet<u64> = salvaged.undescribed.iter().copied().collect();
    let lost = describe_anew(&mut transaction, &undescribed, progress)?;
    count(derived, "textures described", (undescribed.len() - lost.len()) as u64);

    let views = Scheme::of(&transaction);
    let kept = |key: &str| matches!(transaction.statistics(key), Ok(Some(_)));
    let mut statistics_cache = StatisticsCache::default();
    let gone = views.recipes().iter().any(|recipe| !kept(&recipe.key()));
    let whole = !gone && lost.is_empty() && unreadable.is_empty() && statistics_cache.open(&transaction).is_ok();
    if !whole && transaction.counts().textures > 0 {
        rebuild(&mut transaction, &mut statistics_cache, &Rewrite::These(&BTreeSet::new()), progress)?;
        statistics_cache.save(&mut transaction)?;
        count(derived, "statistics", statistics_cache.all().len() as u64);
    }
    let torn = |name: &str| {
        salvaged.blobs_lost.iter().any(|(table, lost)| *table == "spaces" && (lost == name || lost == "?"))
    };
    let fitted = views.definitions();
    if fitted.iter().any(|definition| torn(&definition.name)) && !statistics_cache.all().is_empty() {
        let epoch = next_epoch(&transaction)?;
        fit(&mut transaction, statistics_cache.all(), epoch)?;
        count(derived, "spaces", fitted.len() as u64);
    }
    if transaction.counts().rows > 0 {
        keep_points(&mut transaction)?;
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

/// Puts the repaired store in the place of the damaged one; the path the latter has from now on.
fn take_place(path: &Path, passing: &Path) -> Result<PathBuf, Error> {
    let kept = (1..1000).map(|number| match number {
        1 => beside(path, ".damaged"),
        number => beside(path, &format!(".damaged-{number}")),
    });
    let kept = kept.into_iter().find(|kept| kept.symlink_metadata().is_err());
    let kept = kept.ok_or_else(|| StoreError::Open(OpenError::Exists { path: beside(path, ".damaged-999") }))?;
    let failed = |source| Error::file("renaming to the store's name", passing, source);
    // A second name first, then one step from old to new: at no moment is there no store.
    if std::fs::hard_link(path, &kept).is_err() {
        std::fs::rename(path, &kept).map_err(failed)?;
    }
    std::fs::rename(passing, path).map_err(failed)?;
    Ok(kept)
}

/// The path with something after its name.
fn beside(path: &Path, suffix: &str) -> PathBuf {
    let mut name = path.file_name().unwrap_or_default().to_os_string();
    name.push(suffix);
    path.with_file_name(name)
}
