//! [`DescribedVolume`]: a volume that is described once for many queries.

use crate::database::handle::Database;
use crate::database::scheme::Scheme;
use crate::database::texture::ContentHash;
use crate::error::Error;
use crate::space::Descriptor;
use crate::volume::Volume;

/// A volume described in all views of a store, by [`Database::describe`]. It can be the example of many queries, in any space.
#[derive(Clone, Debug, PartialEq)]
pub struct DescribedVolume {
    content: ContentHash,
    descriptor: Descriptor,
}

impl DescribedVolume {
    /// A volume with its descriptor.
    pub(crate) fn new(volume: &Volume, descriptor: Descriptor) -> Self {
        Self { content: ContentHash(volume.content_hash()), descriptor }
    }

    /// The hash of the volume.
    pub fn content(&self) -> ContentHash {
        self.content
    }

    /// The moments of the volume in every view that the store keeps and the volume is large enough for.
    pub fn descriptor(&self) -> &Descriptor {
        &self.descriptor
    }
}

impl Database {
    /// Describes a volume, which need not be in the store, in all views of the store.
    ///
    /// ```
    /// use hlacdb::{Database, Meta, Query, volume::Volume};
    /// # let folder = tempfile::tempdir()?;
    /// let database = Database::open(folder.path().join("textures.hlacdb"))?;
    /// let checker = Volume::from_fn([16; 3], |z, y, x| if (z / 4 + y / 4 + x / 4) % 2 == 0 { 200 } else { 40 })?;
    /// database.add(&checker, Meta::named("checker"))?;
    /// let described = database.describe(&checker)?;
    /// for space in ["default", "paper"] {
    ///     assert_eq!(database.query(&Query::described(&described).space(space))?.hits[0].distance, 0.0);
    /// }
    /// assert!(database.query(&Query::described(&described).exclude_self())?.hits.is_empty());
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    ///
    /// # Errors
    /// [`Error::Store`].
    pub fn describe(&self, volume: &Volume) -> Result<DescribedVolume, Error> {
        let scheme = Scheme::of(&self.store().read()?);
        let descriptor = Descriptor::from_sums(&crate::describe(volume, scheme.views()))?;
        Ok(DescribedVolume::new(volume, descriptor))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Meta, Query};

    #[test]
    fn a_described_volume_gives_the_answers_of_the_volume() {
        let folder = tempfile::tempdir().unwrap();
        let database = Database::open(folder.path().join("s.hlacdb")).unwrap();
        let volume = |step| Volume::from_fn([16; 3], |z, y, x| ((z + y * step + x * 3) * 8) as u8).unwrap();
        for step in 1..=5 {
            database.add(&volume(step), Meta::named(format!("{step}"))).unwrap();
        }
        for step in [3, 9] {
            let (volume, described) = (volume(step), database.describe(&volume(step)).unwrap());
            for space in database.space_names().unwrap() {
                let hits = |query: Query<'_>| database.query(&query.space(&space)).unwrap().hits;
                assert_eq!(hits(Query::described(&described)), hits(Query::volume(&volume)));
                let others = hits(Query::described(&described).exclude_self());
                assert_eq!(others, hits(Query::volume(&volume).exclude_self()));
                assert_eq!(others.len(), if step == 3 { 4 } else { 5 });
            }
        }
    }
}
