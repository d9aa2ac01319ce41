//! Descriptors, statistics, spaces and points.

use super::walk::Walk;
use crate::store::access::blobs;
use crate::store::access::reads::{Reads, sealed::Source as _};
use crate::store::damage::DamageKey;
use crate::store::error::StoreError;
use crate::store::format::blobs::{Blobs, SPACES, STATISTICS};
use crate::store::format::descriptors::{DESCRIPTOR_ROWS, DescriptorBlock, ViewCode};
use crate::store::format::tables::{DESCRIPTORS, POINTS};
use crate::store::format::{blobs as stored_blobs, points};

impl Walk<'_> {
    /// Checks all of them.
    pub(crate) fn blocks(&mut self) -> Result<(), StoreError> {
        self.table(Self::descriptors)?;
        self.table(|walk| walk.blobs(STATISTICS, "checking statistics"))?;
        self.table(|walk| walk.blobs(SPACES, "checking spaces"))?;
        self.table(Self::points)
    }

    fn descriptors(&mut self) -> Result<(), StoreError> {
        let name = DESCRIPTORS.name;
        let tables = self.snapshot.tables();
        let table = tables.source.table(DESCRIPTORS)?;
        self.begin(name, "checking descriptors", table.len()?)?;
        for entry in table.entries()? {
            let entry = entry?;
            let (view, block) = entry.key()?;
            self.count(name)?;
            match DescriptorBlock::open(ViewCode(view), block, entry.value()?) {
                Ok(rows) => {
                    if let Err(what) = check_block(&rows, block, tables.state.rows) {
                        self.damage(name, DamageKey::DescriptorBlock { view, block }, what);
                    }
                }
                Err(damage) => self.contain(Err(damage.into()))?,
            }
        }
        Ok(())
    }

    fn blobs(&mut self, blobs: Blobs, stage: &'static str) -> Result<(), StoreError> {
        let name = blobs.table.name;
        let source = self.snapshot.tables().source;
        let table = source.table(blobs.table)?;
        self.begin(name, stage, table.len()?)?;
        for blob in blobs::names(source, blobs)? {
            let found = blobs::get(source, blobs, &blob).map(|bytes| bytes.is_some());
            if let Ok(false) = found {
                self.damage(name, DamageKey::Name(blob), "the first chunk is missing");
            }
            self.contain(found.map(drop))?;
        }
        // Chunks behind a gap are not reached by name.
        let mut next: Option<(String, u32)> = None;
        for entry in table.entries()? {
            let entry = entry?;
            let key = entry.key()?;
            self.count(name)?;
            let parsed = stored_blobs::parse(key).map(|(blob, n)| (blob.to_owned(), n));
            match (parsed, &next) {
                (Some((blob, n)), Some((last, expected))) if blob == *last && n == *expected => {
                    next = Some((blob, n + 1));
                }
                (Some((blob, 0)), _) => next = Some((blob, 1)),
                _ => self.damage(name, DamageKey::Bytes(key.to_vec()), "the chunk belongs to no blob"),
            }
        }
        Ok(())
    }

    fn points(&mut self) -> Result<(), StoreError> {
        let name = POINTS.name;
        let tables = self.snapshot.tables();
        let total = tables.source.table(POINTS)?.len()?;
        self.begin(name, "checking points", total)?;
        let mut reachable = 0;
        for space in self.snapshot.spaces_with_points()? {
            let layout = match self.snapshot.points_layout(&space) {
                Ok(layout) => layout,
                Err(error) => {
                    self.contain(Err(error))?;
                    continue;
                }
            };
            let Some(layout) = layout else {
                self.damage(name, DamageKey::Space(space), "the layout is missing");
                continue;
            };
            reachable += 1;
            self.count(name)?;
            if layout.rows > tables.state.rows {
                let what = format!("there are {} rows of points, the store has {}", layout.rows, tables.state.rows);
                self.damage(name, DamageKey::Space(space.clone()), what);
            }
            for part in (0..=u8::MAX).take(layout.widths.len()) {
                for block in 0..layout.blocks(part) {
                    reachable += 1;
                    self.count(name)?;
                    let read = self.snapshot.points(&space, &layout, part, block);
                    self.contain(read.map(drop))?;
                }
            }
        }
        if reachable == total {
            return Ok(());
        }
        let table = tables.source.table(POINTS)?;
        for entry in table.entries()? {
            let entry = entry?;
            let key = entry.key()?;
            let belongs = match points::parse(key) {
                Some((_, None)) => true,
                Some((space, Some((part, block)))) => {
                    // A layout that cannot be read is reported already, and says nothing about its blocks.
                    self.snapshot.points_layout(space).map_or(true, |l| l.is_some_and(|l| block < l.blocks(part)))
                }
                None => false,
            };
            if !belongs {
                self.damage(name, DamageKey::Bytes(key.to_vec()), "the block is in no layout");
            }
        }
        Ok(())
    }
}

/// Checks the rows of a descriptor block against the number of rows of the store.
fn check_block(rows: &DescriptorBlock, block: u32, all: u64) -> Result<(), String> {
    let until = u64::from(block) * DESCRIPTOR_ROWS as u64 + rows.len() as u64;
    if until > all {
        return Err(format!("the block has rows up to {until}, the store {all}"));
    }
    if rows.present() == 0 {
        return Err("the block has no row that is present".into());
    }
    match rows.values().iter().all(|value| value.is_finite()) {
        true => Ok(()),
        false => Err("a moment is not finite".into()),
    }
}
