//! From a volume to what a transaction adds: the part of adding that runs on any thread.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use super::Database;
use super::scheme::Scheme;
use crate::error::Error;
use crate::hlac::{self, MASK_COUNT, OctantSums, View};
use crate::space::Contribution;
use crate::store::{
    CompressedVoxels, Content, Cut, NewTexture, Provenance, Reads, RecordedMapping, ViewCode, Volumes, path_bytes,
};
use crate::volume::{Shape, Source, Volume};

/// The place of a texture that was cut out of a larger volume.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize)]
pub struct BlockOf {
    /// The first voxel (Z, Y, X) in the larger volume.
    pub origin: Shape,
    /// The shape (Z, Y, X) of the larger volume.
    pub shape: Shape,
}

/// What is said of a texture when it is added: its name, and where it came from.
#[derive(Clone, Debug, Default)]
pub struct Meta {
    /// The name that answers show; need not be unique.
    pub name: String,
    /// The file or folder it was read from.
    pub path: Option<PathBuf>,
    /// One value per key.
    pub tags: BTreeMap<String, String>,
    /// The kind of file, its samples and how they were mapped to 256 levels.
    pub source: Option<Source>,
    /// Where it was cut from.
    pub block: Option<BlockOf>,
}

impl Meta {
    /// A texture of this name.
    pub fn named(name: impl Into<String>) -> Self {
        Self { name: name.into(), ..Self::default() }
    }

    /// Adds a tag, in place of one with the same key.
    #[must_use]
    pub fn tag(mut self, key: impl Into<String>, value: impl Into<String>) -> Self {
        self.tags.insert(key.into(), value.into());
        self
    }

    /// Sets all tags.
    #[must_use]
    pub fn tags(mut self, tags: BTreeMap<String, String>) -> Self {
        self.tags = tags;
        self
    }

    /// Sets the path it was read from.
    #[must_use]
    pub fn path(mut self, path: impl AsRef<Path>) -> Self {
        self.path = Some(path.as_ref().to_path_buf());
        self
    }

    /// Sets where the voxels came from.
    #[must_use]
    pub fn source(mut self, source: Source) -> Self {
        self.source = Some(source);
        self
    }

    /// Sets the place in a larger volume.
    #[must_use]
    pub fn block(mut self, block: BlockOf) -> Self {
        self.block = Some(block);
        self
    }

    fn into_texture(self) -> NewTexture {
        let provenance = self.source.map(|source| Provenance {
            kind: source.kind.name().to_owned(),
            samples: source.samples.name().to_owned(),
            mapping: source.mapping.map(|mapping| RecordedMapping {
                rule: mapping.rule.to_string(),
                lo: mapping.lo,
                hi: mapping.hi,
            }),
            spacing: source.spacing,
        });
        let wide = |shape: Shape| shape.map(|side| side as u64);
        NewTexture {
            name: self.name,
            path: self.path.as_deref().map(path_bytes),
            tags: self.tags,
            provenance,
            cut: self.block.map(|block| Cut { offset: wide(block.origin), parent: wide(block.shape) }),
            ..NewTexture::default()
        }
    }
}

/// A described texture on its way into the store, made by [`Database::prepare`] on any thread.
#[derive(Debug)]
pub struct Prepared {
    pub(super) content: Content,
    pub(super) texture: NewTexture,
    pub(super) work: Work,
}

/// How far the work on a texture has come.
#[derive(Debug)]
pub(super) enum Work {
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
        let views = views(&snapshot);
        drop(snapshot);
        Prepared { content, texture: meta.into_texture(), work: Work::Described(Vec::new()) }
            .described(volume, volumes, &views)
    }
}

impl Prepared {
    /// With everything that a transaction needs.
    pub(super) fn described(mut self, volume: &Volume, volumes: Volumes, views: &Scheme) -> Result<Self, Error> {
        let described = hlac::describe(volume, &with_full(views));
        let total = |view: &View| described.iter().find(|(other, _)| other == view).map(|(_, octants)| octants.total());
        self.texture.sums = total(&View::Full);
        self.texture.descriptors =
            views.iter().filter_map(|view| Some((ViewCode(view.code()), total(view)?.descriptor()))).collect();
        self.work = Work::Described(contributions(&described, views)?);
        self.texture.voxels = match volumes {
            Volumes::Keep => Some(CompressedVoxels::new(volume)?),
            Volumes::None => None,
        };
        self.texture.content = Some(self.content.clone());
        Ok(self)
    }
}

/// What a described texture adds to the statistics of a store that keeps `views`.
pub(super) fn contributions(described: &[(View, OctantSums)], views: &Scheme) -> Result<Vec<Contribution>, Error> {
    let recipes = views.recipes();
    let contributions = recipes.iter().filter_map(|recipe| Contribution::of_sums(recipe, described).transpose());
    Ok(contributions.collect::<Result<_, _>>()?)
}

/// The views to describe: those that are kept, and `full@1`, whose exact sums are kept in any case.
pub(super) fn with_full(views: &[View]) -> Vec<View> {
    let mut wanted = views.to_vec();
    if !wanted.contains(&View::Full) {
        wanted.push(View::Full);
    }
    wanted
}

/// The views that a store keeps and this version knows, and what its spaces look at.
pub(super) fn views(state: &impl Reads) -> Scheme {
    Scheme::of(state)
}
