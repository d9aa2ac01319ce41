//! What makes up the distance between two textures.

use serde::Serialize;

use crate::TextureId;
use crate::database::handle::Database;
use crate::database::points::descriptors::{existing_descriptor, features};
use crate::database::scheme::DEFAULT_SPACE;
use crate::error::{Error, ExampleKind};
use crate::space::Explanation;

/// What makes up the distance between two textures.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[non_exhaustive]
pub struct PairExplanation {
    /// One texture.
    pub a: TextureId,
    /// The other texture.
    pub b: TextureId,
    /// The space of the distance.
    pub space: String,
    /// The number of the fit of the space.
    pub epoch: u64,
    /// The parts of the distance.
    #[serde(flatten)]
    pub explanation: Explanation,
}

impl Database {
    /// The parts of the distance between two textures in a space, by default [`DEFAULT_SPACE`]: by view, by number of cells
    /// and by orbit.
    ///
    /// # Errors
    /// [`QueryError::NoSuchSpace`](crate::QueryError::NoSuchSpace);
    /// [`StoreError::NoSuchTexture`](crate::StoreError::NoSuchTexture), in [`Error::Store`];
    /// [`QueryError::MissingViews`](crate::QueryError::MissingViews) if a texture has none of the views that the space uses.
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
            |id: TextureId| features(space, &existing_descriptor(&snapshot, id.get())?, ExampleKind::Texture(id));
        let explanation = space.explain(&features_of(a)?, &features_of(b)?)?;
        Ok(PairExplanation { a, b, space: name.to_owned(), epoch: space.epoch(), explanation })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::volume::Volume;
    use crate::{Meta, Query, QueryError};

    #[test]
    fn the_parts_add_up_to_the_distance_of_a_query() {
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
}
