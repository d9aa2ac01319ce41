//! Integrity, size and format of the whole.

use std::collections::BTreeMap;
use std::ops::ControlFlow;

use serde::Serialize;

use crate::database::handle::Database;
use crate::database::locks::held;
use crate::database::points::contributions::{contribution_blocks, with_full};
use crate::database::points::stored::{StoredPoints, mapped_points};
use crate::database::points::{spaces, statistics_cache};
use crate::database::quarantine;
use crate::database::scheme::{DEFAULT_SPACE, Scheme};
use crate::error::Error;
use crate::hlac::View;
use crate::progress::Progress;
use crate::store::{self, Damage, OpenError, Reads, Record, Snapshot, StoreError, ViewCode};
use crate::volume::Volume;

/// What [`Database::verify`] found.
#[derive(Clone, Debug, Serialize)]
pub struct VerifyReport {
    /// True where nothing is damaged.
    ok: bool,
    /// How many things of each kind were checked.
    pub checked: BTreeMap<&'static str, u64>,
    /// What is not as it should be.
    pub damage: Vec<DamageReport>,
    /// True where all damage is of textures that are known to have lost something: no repair helps them.
    pub known: bool,
}

impl VerifyReport {
    /// True where nothing is damaged.
    pub fn ok(&self) -> bool {
        self.ok
    }
}

/// One damaged thing.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct DamageReport {
    /// The table.
    pub table: &'static str,
    /// Which entry.
    pub key: String,
    /// What was found and what was expected.
    pub what: String,
}

impl DamageReport {
    /// The texture that is hit, where the damage is of one.
    pub(crate) fn texture(&self) -> Option<u64> {
        Damage { table: self.table, key: self.key.clone(), what: String::new() }.texture()
    }

    /// Of a file that cannot be opened.
    pub(crate) fn of_file(error: &Error) -> Self {
        match error {
            Error::Store(StoreError::Damage(damage)) | Error::Open(OpenError::DamagedFile { damage, .. }) => {
                damage.clone().into()
            }
            other => damaged("(file)", "", crate::error::chain(other)),
        }
    }

    /// The same, as an error.
    pub(crate) fn into_error(self) -> Error {
        StoreError::Damage(Damage { table: self.table, key: self.key, what: self.what }).into()
    }
}

impl From<Damage> for DamageReport {
    fn from(damage: Damage) -> Self {
        Self { table: damage.table, key: damage.key, what: damage.what }
    }
}

/// What [`Database::compact`] did.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct CompactReport {
    /// Rows of removed textures that are gone.
    pub rows_removed: u64,
    /// The file's length before.
    pub bytes_before: u64,
    /// The file's length after.
    pub bytes_after: u64,
}

impl Database {
    /// Checks everything: every checksum, count and link of the store, and that statistics and points are, to the bit,
    /// what the descriptors give. With `deep`, voxels are decompressed, hashed and described anew.
    ///
    /// # Errors
    /// [`Error::Cancelled`]; damage is not an error but part of the report.
    pub fn verify(&self, deep: bool, progress: &dyn Progress) -> Result<VerifyReport, Error> {
        let snapshot = self.store().read()?;
        let mut bridge = ProgressAdapter::new(progress);
        let check = |snapshot: &Snapshot, record: &Record, volume: &Volume| describe_again(snapshot, record, volume);
        let report = snapshot.verify(if deep { Some(&check) } else { None }, &mut |step| bridge.tell(step));
        let report = report?;
        let mut checked = report.checked;
        let mut damage: Vec<DamageReport> = report.damage.into_iter().map(DamageReport::from).collect();
        if damage.is_empty() {
            progress.begin("statistics", None);
            check_statistics(&snapshot, &mut checked, &mut damage)?;
            check_points(&snapshot, &mut checked, &mut damage)?;
        }
        let known = !damage.is_empty() && {
            let lost = quarantine::listed(&snapshot).unwrap_or_default();
            damage.iter().all(|damage| damage.texture().is_some_and(|id| lost.iter().any(|lost| lost.id == id)))
        };
        Ok(VerifyReport { ok: damage.is_empty(), checked, damage, known })
    }

    /// Gives the space of removed textures, and of pages that hold nothing, back to the file system.
    ///
    /// # Errors
    /// [`Error::Cancelled`] before anything was changed; [`Error::Store`], e.g. while another process reads.
    pub fn compact(&self, progress: &dyn Progress) -> Result<CompactReport, Error> {
        let _books = held(self.statistics.lock());
        let mut bridge = ProgressAdapter::new(progress);
        let report = self.store().compact(&mut |step| bridge.tell(step))?;
        Ok(CompactReport {
            rows_removed: report.rows_removed,
            bytes_before: report.bytes_before,
            bytes_after: report.bytes_after,
        })
    }
}

/// Hands the store's progress on.
pub(crate) struct ProgressAdapter<'a> {
    progress: &'a dyn Progress,
    phase: &'static str,
    done: u64,
}

impl<'a> ProgressAdapter<'a> {
    pub(crate) fn new(progress: &'a dyn Progress) -> Self {
        Self { progress, phase: "", done: 0 }
    }

    pub(crate) fn tell(&mut self, step: store::Progress) -> ControlFlow<()> {
        if step.phase != self.phase {
            self.progress.begin(step.phase, Some(step.total));
            (self.phase, self.done) = (step.phase, 0);
        }
        self.progress.advance(step.done.saturating_sub(self.done));
        self.done = step.done;
        if self.progress.cancelled() { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
    }
}

fn damaged(table: &'static str, key: impl Into<String>, what: impl Into<String>) -> DamageReport {
    DamageReport { table, key: key.into(), what: what.into() }
}

/// Describes a texture's voxels anew and compares sums and moments, to the bit.
fn describe_again(snapshot: &Snapshot, record: &Record, volume: &Volume) -> Vec<Damage> {
    let id = record.id;
    let key = format!("id {id}");
    let wrong = |table, what: String| Damage { table, key: key.clone(), what };
    let views = Scheme::of(snapshot);
    let mut damage = Vec::new();
    for (view, octants) in crate::describe(volume, &with_full(views.views())) {
        let total = octants.total();
        if view == View::Full && snapshot.sums(id).is_ok_and(|kept| kept.is_some_and(|kept| kept != total)) {
            damage.push(wrong("sums", "the sums are not those of the voxels".into()));
        }
        let kept = snapshot.descriptor(id, ViewCode(view.code()));
        let expected = views.views().contains(&view).then(|| total.descriptor());
        if let Ok(kept) = kept
            && expected.is_some()
            && kept != expected
        {
            damage.push(wrong("descriptors", format!("the moments of {view} are not those of the voxels")));
        }
    }
    damage
}

/// Statistics must be, to the bit, what the descriptors give; octants are known only from the voxels.
fn check_statistics(
    snapshot: &Snapshot,
    checked: &mut BTreeMap<&'static str, u64>,
    damage: &mut Vec<DamageReport>,
) -> Result<(), Error> {
    for recipe in Scheme::of(snapshot).recipes() {
        let key = recipe.key();
        let kept = match statistics_cache::load(snapshot, &recipe) {
            Ok(kept) => kept,
            Err(error) => {
                damage.push(damaged("statistics", key, error.to_string()));
                continue;
            }
        };
        let mut anew = crate::space::Statistics::new(&recipe);
        for block in contribution_blocks(snapshot, &recipe)? {
            anew.add_all(block?.iter())?;
        }
        let same = kept.count() == anew.count() && kept.mean() == anew.mean() && kept.covariance() == anew.covariance();
        if !same {
            let what = "the statistics are not those of the descriptors";
            damage.push(damaged("statistics", key, what));
        }
        *checked.entry("statistics recomputed").or_default() += 1;
    }
    Ok(())
}

/// Kept points must be, to the bit, what the space makes of the descriptors.
fn check_points(
    snapshot: &Snapshot,
    checked: &mut BTreeMap<&'static str, u64>,
    damage: &mut Vec<DamageReport>,
) -> Result<(), Error> {
    let space = match spaces::load(snapshot, DEFAULT_SPACE) {
        Ok(space) => space,
        Err(error) => {
            damage.push(damaged("spaces", DEFAULT_SPACE, error.to_string()));
            return Ok(());
        }
    };
    let rows = snapshot.rows()?;
    let mut kept: Vec<(usize, Vec<f32>)> = Vec::new();
    let points = StoredPoints::of(snapshot, DEFAULT_SPACE, &space)?;
    let count = points.as_ref().map_or(0, StoredPoints::rows);
    if let Some(points) = points {
        points.each_checked(|row, point, coded| {
            if rows.is_live(row) && point.iter().all(|coordinate| coordinate.is_finite()) {
                // A wrong code hides the texture from questions: then the point is none that a descriptor gives.
                kept.push((row, if coded { point.to_vec() } else { Vec::new() }));
            }
        })?;
    }
    let mut mapped = mapped_points(snapshot, &space, 0..count)?;
    mapped.retain(|(row, _)| rows.is_live(*row));
    for (kept, mapped) in kept.iter().zip(&mapped) {
        if kept != mapped {
            let id = rows.ids().get(kept.0).copied().unwrap_or_default();
            damage.push(damaged("points", format!("id {id}"), "the point is not that of the descriptor"));
        }
    }
    if kept.len() != mapped.len() {
        let what = format!("there are {} points, expected {}", kept.len(), mapped.len());
        damage.push(damaged("points", DEFAULT_SPACE, what));
    }
    *checked.entry("points recomputed").or_default() += mapped.len() as u64;
    Ok(())
}
