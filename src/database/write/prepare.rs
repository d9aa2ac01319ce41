//! From a volume to what a transaction adds: the part of adding that runs on any thread.

use crate::database::handle::Database;
use crate::database::points::contributions::{contributions, full_sums, with_full};
use crate::database::scheme::Scheme;
use crate::database::texture::Meta;
use crate::error::Error;
use crate::hlac::{MASK_COUNT, View};
use crate::space::{Contribution, Descriptor};
use crate::store::{CompressedVoxels, Content, NewTexture, Reads, ViewCode, Volumes};
use crate::volume::Volume;

/// A described texture on its way into the store, made by [`Database::prepare`] on any thread.
#[derive(Debug)]
pub struct Prepared {
    pub(crate) content: Content,
    pub(crate) texture: NewTexture,
    pub(crate) work: Work,
}

/// How far the work on a texture has come.
#[derive(Debug)]
pub(crate) enum Work {
    /// All that a transaction needs; what the texture adds to the statistics, one per recipe.
    Described(Vec<Contribution>),
    /// The content was in the store already, so that nothing was described. Should it have been removed by the time of
    /// the commit, it is described then.
    Known(Box<Volume>, Volumes),
}

impl Prepared {
    /// About how many bytes it will take in the store.
    pub fn stored_bytes(&self) -> usize {
        let voxels = self.texture.voxels.as_ref().map_or(0, |voxels| voxels.bytes() as usize);
        voxels + self.texture.descriptors.len() * MASK_COUNT * 4
    }
}

impl Database {
    /// Describes a volume for [`Database::commit`]. This is the costly part of adding, and runs on any thread.
    ///
    /// A volume whose content is in the store already is not described.
    ///
    /// # Errors
    /// [`Error::Store`] where the store cannot be read.
    pub fn prepare(&self, volume: &Volume, meta: Meta, volumes: Volumes) -> Result<Prepared, Error> {
        let content = Content::of(volume);
        let snapshot = self.store().read()?;
        if snapshot.find(&content.hash)?.is_some() {
            let work = Work::Known(Box::new(volume.clone()), volumes);
            return Ok(Prepared { content, texture: meta.into_texture(), work });
        }
        let views = Scheme::of(&snapshot);
        drop(snapshot);
        Prepared { content, texture: meta.into_texture(), work: Work::Described(Vec::new()) }
            .described(volume, volumes, &views)
    }
}

impl Prepared {
    /// With everything that a transaction needs.
    pub(crate) fn described(mut self, volume: &Volume, volumes: Volumes, views: &Scheme) -> Result<Self, Error> {
        let described = crate::describe(volume, &with_full(views.views()));
        let descriptor = Descriptor::from_sums(&described)?;
        self.texture.sums = full_sums(&described);
        let moments = |&view: &View| Some((ViewCode(view.code()), *descriptor.get(view)?));
        self.texture.descriptors = views.views().iter().filter_map(moments).collect();
        self.work = Work::Described(contributions(&described, views)?);
        self.texture.voxels = match volumes {
            Volumes::Keep => Some(CompressedVoxels::new(volume)?),
            Volumes::None => None,
        };
        self.texture.content = Some(self.content.clone());
        Ok(self)
    }
}
