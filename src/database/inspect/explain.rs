//! Why two textures are as far apart as they are.

use serde::Serialize;

use crate::TextureId;
use crate::database::handle::Database;
use crate::database::points::descriptors::{features, known_descriptor};
use crate::database::scheme::{DEFAULT_SPACE, Scheme};
use crate::error::{Error, ExampleKind};
use crate::space::{Descriptor, Explanation};
use crate::volume::Volume;

/// The distance between two textures, taken apart.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct PairExplanation {
    /// The one texture.
    pub a: TextureId,
    /// The other.
    pub b: TextureId,
    /// The space the distance is in.
    pub space: String,
    /// Which fit of the space.
    pub epoch: u64,
    /// What makes the distance.
    #[serde(flatten)]
    pub explanation: Explanation,
}

impl Database {
    /// What makes the distance between two textures: by view, by number of cells, by orbit. In the default space unless
    /// one is named.
    ///
    /// # Errors
    /// [`QueryError::NoSuchSpace`](crate::QueryError::NoSuchSpace); [`crate::store::StoreError::NoSuchTexture`], in [`Error::Store`];
    /// [`QueryError::MissingViews`](crate::QueryError::MissingViews) where one of them has none of the views that the space looks at.
    pub fn explain(
        &self,
        a: impl Into<TextureId>,
        b: impl Into<TextureId>,
        space: Option<&str>,
    ) -> Result<PairExplanation, Error> {
        let (a, b) = (a.into(), b.into());
        let snapshot = self.store().read()?;
        let name = space.unwrap_or(DEFAULT_SPACE);
        let state = self.state(&snapshot, name)?;
        let space = &state.owner.space;
        let features_of =
            |id: TextureId| features(space, &known_descriptor(&snapshot, id.get())?, ExampleKind::Texture(id));
        let explanation = space.explain(&features_of(a)?, &features_of(b)?)?;
        Ok(PairExplanation { a, b, space: name.to_owned(), epoch: space.epoch(), explanation })
    }

    /// The descriptor of a volume that need not be in the store, in every view that the store keeps and the volume is
    /// large enough for: an example for [`crate::Query::descriptor`], computed once for many queries.
    ///
    /// # Errors
    /// [`Error::Store`].
    pub fn describe(&self, volume: &Volume) -> Result<Descriptor, Error> {
        let scheme = Scheme::of(&self.store().read()?);
        Ok(Descriptor::from_sums(&crate::describe(volume, scheme.views()))?)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Meta, Query, QueryError};

    #[test]
    fn the_distance_explained_is_that_of_a_query() {
        let folder = tempfile::tempdir().unwrap();
        let database = Database::open(folder.path().join("s.hlacdb")).unwrap();
        for step in 1..=5 {
            let volume = Volume::from_fn([16; 3], |z, y, x| ((z + y * step + x * 3) * 8) as u8).unwrap();
            database.add(&volume, Meta::named(format!("{step}"))).unwrap();
        }
        for space in database.space_names().unwrap() {
            let hits = database.query(&Query::texture(2).space(&space).exclude_self()).unwrap().hits;
            let explained = database.explain(2, hits[1].id, Some(&space)).unwrap();
            assert!((explained.explanation.distance / hits[1].distance - 1.0).abs() < 1e-4, "{space}");
        }
        assert!(matches!(database.explain(1, 2, Some("none")), Err(Error::Query(QueryError::NoSuchSpace { .. }))));
        let missing = database.explain(1, 99, None).unwrap_err();
        assert!(missing.to_string().contains("99"), "{missing}");
    }

    #[test]
    fn a_description_asks_the_same_question_as_its_volume() {
        let folder = tempfile::tempdir().unwrap();
        let database = Database::open(folder.path().join("s.hlacdb")).unwrap();
        let volume = |step| Volume::from_fn([16; 3], |z, y, x| ((z + y * step + x * 3) * 8) as u8).unwrap();
        for step in 1..=5 {
            database.add(&volume(step), Meta::named(format!("{step}"))).unwrap();
        }
        let example = volume(9);
        let by_descriptor = database.query(&Query::descriptor(database.describe(&example).unwrap())).unwrap();
        assert_eq!(by_descriptor.hits, database.query(&Query::volume(&example)).unwrap().hits);
    }
}
