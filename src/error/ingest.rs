//! Errors of ingesting volumes.

use std::path::{Path, PathBuf};

use crate::synth::RecipeError;
use crate::volume::{ReadError, Shape, VolumeError, display_path};

/// Why a file, a volume or a recipe gave no texture.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum IngestError {
    /// The file cannot be read as a volume.
    #[error(transparent)]
    Read(#[from] ReadError),
    /// The voxels are not a volume.
    #[error(transparent)]
    Volume(#[from] VolumeError),
    /// The recipe is not valid.
    #[error(transparent)]
    Recipe(#[from] RecipeError),
    /// The volume is smaller than one block.
    #[error(
        "{}: the volume is {} x {} x {} (Z, Y, X), smaller than one block of {side} x {side} x {side}",
        display_path(path), shape[0], shape[1], shape[2]
    )]
    BlockTooLarge {
        /// The file.
        path: PathBuf,
        /// The shape (Z, Y, X) of the volume.
        shape: Shape,
        /// The side of a block.
        side: usize,
    },
    /// The path, or a link below it, leads out of the folder that it must stay in.
    #[error("{}: this path leads out of the folder that is ingested from", display_path(path))]
    OutsideFolder {
        /// The path as the caller gave it, or the link, relative to the folder.
        path: PathBuf,
    },
    /// Nothing in the folder has this path.
    #[error("{}: there is no such file in the folder that is ingested from", display_path(path))]
    NotFound {
        /// The path as the caller gave it.
        path: PathBuf,
        /// What the operating system reported.
        #[source]
        source: std::io::Error,
    },
}

impl IngestError {
    /// Replaces the path, where there is one, by `shown(path)`.
    pub(super) fn map_path(&mut self, shown: &dyn Fn(&Path) -> PathBuf) {
        match self {
            Self::Read(error) => error.path = shown(&error.path),
            Self::BlockTooLarge { path, .. } | Self::OutsideFolder { path } | Self::NotFound { path, .. } => {
                *path = shown(path);
            }
            Self::Volume(_) | Self::Recipe(_) => {}
        }
    }
}
