//! Preparing a texture: everything about adding it that needs no transaction, on any thread.

use std::borrow::Cow;

use crate::database::handle::Database;
use crate::database::points::contributions::{self, contributions, full_sums};
use crate::database::scheme::Scheme;
use crate::database::texture::Meta;
use crate::error::Error;
use crate::hlac::{MASK_COUNT, View};
use crate::space::{Contribution, Descriptor};
use crate::store::{CompressedVoxels, Content, NewTexture, Reads, ViewCode, Volumes};
use crate::volume::Volume;

/// A described texture that is ready to be added: made by [`Database::prepare`] on any thread, added by
/// [`Database::commit`].
#[derive(Debug)]
pub struct PreparedTexture(pub(crate) Preparation<'static>);

impl PreparedTexture {
    /// The approximate number of bytes that the texture will take in the store.
    pub fn stored_bytes(&self) -> usize {
        let texture = &self.0.texture;
        let voxels = texture.voxels.as_ref().map_or(0, |voxels| voxels.bytes() as usize);
        voxels + texture.descriptors.len() * MASK_COUNT * 4
    }
}

/// A texture that may still have to be described. Its volume is hashed once, when this is made.
#[derive(Debug)]
pub(crate) struct Preparation<'a> {
    pub(crate) content: Content,
    pub(crate) texture: NewTexture,
    pub(crate) state: PreparationState<'a>,
}

/// How far a texture is prepared.
#[derive(Debug)]
pub(crate) enum PreparationState<'a> {
    /// Described, with its contributions to the statistics, one per feature set.
    Described(Vec<Contribution>),
    /// Not described, since its content was in the store already. If that texture is removed before the commit, the volume
    /// is described during the commit.
    Duplicate(Cow<'a, Volume>, Volumes),
}

impl Database {
    /// Describes a volume for [`Database::commit`]. This is the expensive part of adding, and may run on any thread.
    ///
    /// A volume whose content is in the store already is not described.
    ///
    /// # Errors
    /// [`Error::Store`] if the store cannot be read.
    pub fn prepare(&self, volume: Volume, meta: Meta, volumes: Volumes) -> Result<PreparedTexture, Error> {
        let content = Content::of(&volume);
        self.prepare_hashed(Cow::Owned(volume), content, meta.into_texture(), volumes).map(PreparedTexture)
    }

    /// As [`Database::prepare`], for a volume whose hash is known already.
    pub(crate) fn prepare_hashed<'a>(
        &self,
        volume: Cow<'a, Volume>,
        content: Content,
        texture: NewTexture,
        volumes: Volumes,
    ) -> Result<Preparation<'a>, Error> {
        let snapshot = self.store().read()?;
        if snapshot.find(&content.hash)?.is_some() {
            return Ok(Preparation { content, texture, state: PreparationState::Duplicate(volume, volumes) });
        }
        let scheme = Scheme::of(&snapshot);
        drop(snapshot);
        let (texture, contributions) = describe(&volume, content.clone(), texture, volumes, &scheme)?;
        Ok(Preparation { content, texture, state: PreparationState::Described(contributions) })
    }
}

/// The texture with everything that is stored of its volume, and its contributions to the statistics.
pub(crate) fn describe(
    volume: &Volume,
    content: Content,
    mut texture: NewTexture,
    volumes: Volumes,
    scheme: &Scheme,
) -> Result<(NewTexture, Vec<Contribution>), Error> {
    let described = contributions::describe(volume, scheme);
    let descriptor = Descriptor::from_sums(&described)?;
    texture.sums = full_sums(&described);
    let moments = |&view: &View| Some((ViewCode(view.code()), *descriptor.get(view)?));
    texture.descriptors = scheme.views().iter().filter_map(moments).collect();
    texture.voxels = match volumes {
        Volumes::Keep => Some(CompressedVoxels::with_content(volume, content.clone())?),
        Volumes::None => None,
    };
    texture.content = Some(content);
    Ok((texture, contributions(&described, scheme)?))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::store::hashes_made;

    fn volume(seed: usize) -> Volume {
        Volume::from_fn([12; 3], |z, y, x| ((z * seed + y * 3 + x * x) * 7) as u8).unwrap()
    }

    #[test]
    fn a_volume_is_hashed_once_however_it_is_added() {
        let folder = tempfile::tempdir().unwrap();
        let database = Database::open(folder.path().join("a.hlacdb")).unwrap();
        let hashes = |act: &dyn Fn()| {
            let before = hashes_made();
            act();
            hashes_made() - before
        };
        let add = || assert_eq!(database.add(&volume(1), Meta::named("one")).unwrap().id(), 1);
        assert_eq!(hashes(&add), 1, "a new texture");
        assert_eq!(hashes(&add), 1, "a duplicate");
        let prepare = || {
            let prepared = database.prepare(volume(2), Meta::named("two"), Volumes::Keep).unwrap();
            database.commit(vec![prepared]).unwrap();
        };
        assert_eq!(hashes(&prepare), 1);
        let archive = folder.path().join("out");
        database.export_textures(&archive, &()).unwrap();
        let other = Database::open(folder.path().join("b.hlacdb")).unwrap();
        let import = || assert_eq!(other.import_textures(&archive, &()).unwrap().added, 2);
        assert_eq!(hashes(&import), 2, "two textures");
    }

    #[test]
    fn a_duplicate_keeps_its_volume_without_a_copy_and_is_described_if_the_other_is_removed() {
        let folder = tempfile::tempdir().unwrap();
        let database = Database::open(folder.path().join("a.hlacdb")).unwrap();
        let id = database.add(&volume(1), Meta::named("one")).unwrap().id();
        let volume = volume(1);
        let voxels = volume.voxels().as_ptr();
        let prepared = database.prepare(volume.clone(), Meta::named("again"), Volumes::Keep).unwrap();
        let again = database.prepare(volume, Meta::named("again"), Volumes::Keep).unwrap();
        match &again.0.state {
            PreparationState::Duplicate(kept, _) => assert_eq!(kept.voxels().as_ptr(), voxels),
            other => panic!("{other:?}"),
        }
        assert_eq!(database.commit(vec![prepared]).unwrap(), [crate::Added::Duplicate(id)]);
        database.remove([id]).unwrap();
        let added = database.commit(vec![again]).unwrap();
        assert_eq!(added, [crate::Added::New((id.get() + 1).into())]);
        assert!(database.verify(true, &()).unwrap().ok());
    }
}
