//! The catalogue of a database.

use std::sync::Arc;

use crate::database::catalogue::Catalogue;
use crate::database::handle::Database;
use crate::database::locks::held;
use crate::error::Error;
use crate::store::Reads;

impl Database {
    /// The list of all textures. It is kept in memory, and read again when the store has changed. Textures whose records are
    /// damaged are left out, with a warning in the log.
    ///
    /// If reading takes long and the store changes often, the list may be a little old, but never older than revision
    /// `at_least`: pass the revision of a change to see it, or 0.
    ///
    /// # Errors
    /// [`Error::Store`].
    pub fn catalogue(&self, at_least: u64) -> Result<Arc<Catalogue>, Error> {
        let is_fresh = |catalogue: &Arc<Catalogue>| catalogue.revision >= at_least && catalogue.is_fresh();
        let cached = || held(self.catalogue.read()).clone();
        if let Some(catalogue) = cached().filter(is_fresh) {
            return Ok(catalogue);
        }
        let snapshot = self.store().read()?;
        let is_current = |catalogue: &Arc<Catalogue>| catalogue.revision >= snapshot.revision();
        if let Some(catalogue) = cached().filter(is_current) {
            return Ok(catalogue);
        }
        let _reading = held(self.reading_catalogue.lock());
        // Another thread may have read it meanwhile.
        if let Some(catalogue) = cached().filter(|catalogue| is_current(catalogue) || is_fresh(catalogue)) {
            return Ok(catalogue);
        }
        let catalogue = Arc::new(Catalogue::read(&snapshot)?);
        *held(self.catalogue.write()) = Some(Arc::clone(&catalogue));
        Ok(catalogue)
    }

    /// The revision of the store: the number of the last commit. It rises by one with every change.
    ///
    /// # Errors
    /// [`Error::Store`].
    pub fn revision(&self) -> Result<u64, Error> {
        Ok(self.store().read()?.revision())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::database::catalogue::{CatalogueOrder, CatalogueQuery};
    use crate::volume::Volume;
    use crate::{Meta, TagEdit, TagFilter};

    fn names(catalogue: &Catalogue, query: &CatalogueQuery) -> Vec<String> {
        catalogue.select(query).iter().map(|&at| catalogue.textures()[at as usize].name.to_string()).collect()
    }

    #[test]
    fn a_catalogue_is_filtered_searched_and_ordered() {
        let folder = tempfile::tempdir().unwrap();
        let database = Database::open(folder.path().join("s.hlacdb")).unwrap();
        for (at, (name, stone, side)) in
            [("s10", "Marble", 8), ("s9", "granite", 9), ("core", "Basalt", 8)].into_iter().enumerate()
        {
            let volume = Volume::from_fn([side; 3], |z, y, x| (z * 9 + y * 5 + x * 3 + at * 31) as u8).unwrap();
            database.add(&volume, Meta::named(name).tag("stone", stone).tag("set", "a")).unwrap();
        }
        let catalogue = database.catalogue(0).unwrap();
        let all = CatalogueQuery::new();
        assert_eq!(names(&catalogue, &all), ["s10", "s9", "core"]);
        let by = |order, descending| CatalogueQuery::new().order(order).descending(descending);
        assert_eq!(names(&catalogue, &by(CatalogueOrder::Id, true)), ["core", "s9", "s10"]);
        assert_eq!(names(&catalogue, &by(CatalogueOrder::Name, false)), ["core", "s9", "s10"]);
        assert_eq!(names(&catalogue, &by(CatalogueOrder::Size, true)), ["s9", "core", "s10"]);
        let text = |text: &str| CatalogueQuery::new().text(text);
        assert_eq!(names(&catalogue, &text(" MARB ")), ["s10"]);
        assert_eq!(names(&catalogue, &text("S1")), ["s10"]);
        let filters = [TagFilter::equals("stone", "granite"), TagFilter::equals("set", "a")];
        assert_eq!(names(&catalogue, &CatalogueQuery::new().filters(filters)), ["s9"]);
        let filters = [TagFilter::equals("colour", "red")];
        assert!(names(&catalogue, &CatalogueQuery::new().filters(filters)).is_empty());
        let tags: Vec<_> = catalogue.tags().iter().map(|tag| (&*tag.key, tag.values.len())).collect();
        assert_eq!(tags, [("set", 1), ("stone", 3)]);
        assert_eq!(catalogue.tags()[0].values, [("a".into(), 3)]);
    }

    #[test]
    fn a_catalogue_is_read_once_and_follows_changes() {
        let folder = tempfile::tempdir().unwrap();
        let database = Database::open(folder.path().join("s.hlacdb")).unwrap();
        let volume = Volume::from_fn([8; 3], |z, y, x| (z * 9 + y * 5 + x * 3) as u8).unwrap();
        let id = database.add(&volume, Meta::named("one")).unwrap().id();
        let first = database.catalogue(0).unwrap();
        assert!(Arc::ptr_eq(&first, &database.catalogue(0).unwrap()));
        database.tag(id, &TagEdit::new().set("a", "b")).unwrap();
        let second = database.catalogue(database.revision().unwrap()).unwrap();
        assert_eq!((first.get(id).unwrap().tag("a"), second.get(id).unwrap().tag("a")), (None, Some("b")));
        database.remove([id]).unwrap();
        assert!(database.catalogue(database.revision().unwrap()).unwrap().textures().is_empty());
    }
}
