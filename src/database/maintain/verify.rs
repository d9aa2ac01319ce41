//! Verification of the whole database, and compaction.

use std::collections::{BTreeMap, BTreeSet};
use std::ops::Range;

use serde::Serialize;

use crate::database::handle::Database;
use crate::database::locks::held;
use crate::database::points::contributions::{contribution_blocks, describe};
use crate::database::points::stored::{StoredPoints, mapped_points};
use crate::database::points::{spaces, statistics_cache};
use crate::database::quarantine;
use crate::database::scheme::{DEFAULT_SPACE, Scheme};
use crate::error::Error;
use crate::hlac::View;
use crate::progress::Progress;
use crate::store::{CompactReport, DESCRIPTOR_ROWS, Damage, DamageKey, Reads, Record, Snapshot, ViewCode};
use crate::volume::Volume;

/// The number of rows whose points are in memory at once while they are checked.
const WINDOW: usize = 16 * DESCRIPTOR_ROWS;
/// The number of wrong points that are named one by one.
const MAX_NAMED: u64 = 100;

/// What [`Database::verify`] found.
#[derive(Clone, Debug, Serialize)]
#[non_exhaustive]
pub struct VerifyReport {
    /// True if nothing is damaged.
    ok: bool,
    /// The number of things of each kind that were checked.
    pub checked: BTreeMap<&'static str, u64>,
    /// What is damaged.
    pub damage: Vec<Damage>,
    /// True if all damage is of textures that are known to have lost something, so that no repair helps.
    pub known: bool,
}

impl VerifyReport {
    /// True if nothing is damaged.
    pub fn ok(&self) -> bool {
        self.ok
    }
}

impl Database {
    /// Checks everything: every checksum, count and link of the store, and that statistics and points are, to the bit, what
    /// the descriptors give. With `deep`, voxels are decompressed, hashed and described again.
    ///
    /// # Errors
    /// [`Error::Cancelled`]; damage is not an error but part of the report.
    pub fn verify(&self, deep: bool, progress: &dyn Progress) -> Result<VerifyReport, Error> {
        verify(&self.store().read()?, deep, progress)
    }

    /// Returns the space of removed textures and of unused pages to the file system.
    ///
    /// # Errors
    /// [`Error::Cancelled`] before anything was changed; [`Error::Store`], e.g. while another process reads.
    pub fn compact(&self, progress: &dyn Progress) -> Result<CompactReport, Error> {
        let _statistics = held(self.statistics.lock());
        Ok(self.store().compact(progress)?)
    }
}

/// Checks one state of a store, as [`Database::verify`].
pub(crate) fn verify(snapshot: &Snapshot, deep: bool, progress: &dyn Progress) -> Result<VerifyReport, Error> {
    let check = |snapshot: &Snapshot, record: &Record, volume: &Volume| describe_again(snapshot, record, volume);
    let report = snapshot.verify(if deep { Some(&check) } else { None }, progress)?;
    let (mut checked, mut damage) = (report.checked, report.damage);
    if damage.is_empty() {
        progress.begin("checking statistics", None);
        check_statistics(snapshot, &mut checked, &mut damage)?;
        if let Some(points) = check_points(snapshot, WINDOW, &mut damage, progress)? {
            checked.insert("points recomputed", points);
        }
    }
    let known = !damage.is_empty() && {
        let lost = quarantine::quarantined(snapshot).unwrap_or_default();
        let lost: BTreeSet<u64> = lost.iter().map(|lost| lost.id.get()).collect();
        damage.iter().all(|damage| damage.texture().is_some_and(|id| lost.contains(&id)))
    };
    Ok(VerifyReport { ok: damage.is_empty(), checked, damage, known })
}

/// Describes the voxels of a texture again and compares sums and moments, to the bit.
fn describe_again(snapshot: &Snapshot, record: &Record, volume: &Volume) -> Vec<Damage> {
    let id = record.id;
    let scheme = Scheme::of(snapshot);
    let mut damage = Vec::new();
    for (view, octants) in describe(volume, &scheme) {
        let total = octants.total();
        if view == View::Full && snapshot.sums(id).is_ok_and(|stored| stored.is_some_and(|stored| stored != total)) {
            damage.push(Damage::new("sums", DamageKey::Texture(id), "the sums are not those of the voxels"));
        }
        let stored = snapshot.descriptor(id, ViewCode(view.code()));
        let expected = scheme.views().contains(&view).then(|| total.descriptor());
        if let Ok(stored) = stored
            && expected.is_some()
            && stored != expected
        {
            let what = format!("the moments of {view} are not those of the voxels");
            damage.push(Damage::new("descriptors", DamageKey::Texture(id), what));
        }
    }
    damage
}

/// Statistics must be, to the bit, what the descriptors give. (Octants are known from the voxels only.)
fn check_statistics(
    snapshot: &Snapshot,
    checked: &mut BTreeMap<&'static str, u64>,
    damage: &mut Vec<Damage>,
) -> Result<(), Error> {
    for feature_set in Scheme::of(snapshot).feature_sets() {
        let key = DamageKey::Name(feature_set.key());
        let stored = match statistics_cache::load(snapshot, &feature_set) {
            Ok(stored) => stored,
            Err(error) => {
                damage.push(Damage::new("statistics", key, error.to_string()));
                continue;
            }
        };
        let mut computed = crate::space::Statistics::new(&feature_set);
        for block in contribution_blocks(snapshot, &feature_set)? {
            computed.add_all(block?.iter())?;
        }
        let same = stored.count() == computed.count()
            && stored.mean() == computed.mean()
            && stored.covariance() == computed.covariance();
        if !same {
            damage.push(Damage::new("statistics", key, "the statistics are not those of the descriptors"));
        }
        *checked.entry("statistics recomputed").or_default() += 1;
    }
    Ok(())
}

/// Stored points must be, to the bit, what the space makes of the descriptors. Returns the number of points, if the space can
/// be read. The points of `window` rows are in memory at once, whatever the size of the store.
fn check_points(
    snapshot: &Snapshot,
    window: usize,
    damage: &mut Vec<Damage>,
    progress: &dyn Progress,
) -> Result<Option<u64>, Error> {
    let space = match spaces::load(snapshot, DEFAULT_SPACE) {
        Ok(space) => space,
        Err(error) => {
            damage.push(Damage::new("spaces", DamageKey::Name(DEFAULT_SPACE.into()), error.to_string()));
            return Ok(None);
        }
    };
    let Some(stored) = StoredPoints::of(snapshot, DEFAULT_SPACE, &space)? else { return Ok(Some(0)) };
    let rows = snapshot.rows()?;
    let mut reader = stored.checked_rows();
    let (mut points, mut wrong) = (0, 0);
    progress.begin("checking points", Some(stored.rows() as u64));
    for range in windows(stored.rows(), window) {
        if progress.cancelled() {
            return Err(Error::Cancelled);
        }
        let mapped = mapped_points(snapshot, &space, range.clone())?;
        let mut mapped = mapped.into_iter().peekable();
        progress.advance(range.len() as u64);
        for row in range {
            let expected = mapped.next_if(|(mapped, _)| *mapped == row).map(|(_, point)| point);
            let Some(&id) = rows.ids().get(row).filter(|_| rows.is_live(row)) else { continue };
            points += u64::from(expected.is_some());
            // A wrong code would hide the texture from queries, so it counts as a wrong point.
            let matches = match (reader.row(row)?, expected) {
                (Some((point, coded)), Some(expected)) => coded && point == expected,
                (None, None) => true,
                _ => false,
            };
            if !matches {
                wrong += 1;
                if wrong <= MAX_NAMED {
                    let what = "the point is not that of the descriptors";
                    damage.push(Damage::new("points", DamageKey::Texture(id), what));
                }
            }
        }
    }
    if wrong > MAX_NAMED {
        let what = format!("{} more points are not those of the descriptors", wrong - MAX_NAMED);
        damage.push(Damage::new("points", DamageKey::Space(DEFAULT_SPACE.into()), what));
    }
    Ok(Some(points))
}

/// The rows of a store, `window` at a time.
fn windows(rows: usize, window: usize) -> impl Iterator<Item = Range<usize>> {
    (0..rows).step_by(window.max(1)).map(move |first| first..(first + window).min(rows))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::database::texture::Meta;

    /// A store of `textures` small textures.
    fn filled(folder: &std::path::Path, textures: usize) -> Database {
        let database = Database::open(folder.join("textures.hlacdb")).unwrap();
        let volume = |n: usize| {
            Volume::from_fn([9, 9, 9], |z, y, x| ((z * (n + 1) + y * (n / 3 + 2) + x * 5) * 13 % (50 + n * 7)) as u8)
        };
        let prepare = |n| database.prepare(volume(n).unwrap(), Meta::named("t"), Default::default()).unwrap();
        database.commit((0..textures).map(prepare).collect()).unwrap();
        database
    }

    /// Stores the codes (part 0) and points (part 1) of all rows as `change` leaves them.
    fn rewrite_points(database: &Database, change: impl FnOnce(&mut [Vec<f32>], &[u16])) {
        let mut transaction = database.store().write().unwrap();
        let layout = transaction.points_layout(DEFAULT_SPACE).unwrap().unwrap();
        let read = |part| transaction.points(DEFAULT_SPACE, &layout, part, 0).unwrap();
        let mut parts = vec![read(0), read(1)];
        change(&mut parts, &layout.widths);
        transaction.begin_points(DEFAULT_SPACE, &layout.widths).unwrap();
        transaction.append_points(DEFAULT_SPACE, &[&parts[0], &parts[1]]).unwrap();
        transaction.commit().unwrap();
    }

    #[test]
    fn wrong_points_are_found_a_few_rows_at_a_time() {
        let folder = tempfile::tempdir().unwrap();
        let database = filled(folder.path(), 11);
        let check = |window| {
            let mut damage = Vec::new();
            let points = check_points(&database.store().read().unwrap(), window, &mut damage, &()).unwrap();
            (points, damage.iter().map(|damage| damage.texture().unwrap()).collect::<Vec<_>>())
        };
        assert_eq!(check(4), (Some(11), vec![]));
        rewrite_points(&database, |parts, widths| {
            let [codes, points] = parts else { panic!("two parts") };
            let (code_width, width) = (usize::from(widths[0]), usize::from(widths[1]));
            points[2 * width] = f32::NAN;
            points[5 * width + 1] += 1e-3;
            codes[9 * code_width] = f32::from_bits(codes[9 * code_width].to_bits() ^ 1);
        });
        for window in [1, 4, WINDOW] {
            assert_eq!(check(window), (Some(11), vec![3, 6, 10]), "window {window}");
        }
        assert!(!database.verify(false, &()).unwrap().ok());
    }

    #[test]
    fn windows_cover_every_row_once() {
        for (rows, window) in [(0, 4), (1, 4), (8, 4), (9, 4), (5000, WINDOW)] {
            let ranges: Vec<_> = windows(rows, window).collect();
            assert!(ranges.iter().all(|range| range.len() <= window));
            assert_eq!(ranges.into_iter().flatten().collect::<Vec<_>>(), (0..rows).collect::<Vec<_>>());
        }
    }
}
