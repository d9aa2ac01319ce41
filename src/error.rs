//! What can go wrong with a database, and how it is told.

use std::path::{Path, PathBuf};

use crate::index::IndexError;
use crate::space::SpaceError;
use crate::store::StoreError;
use crate::synth::RecipeError;
use crate::volume::{Hint, ReadError, Shape, VolumeError, display_path};

/// Why a call of the database failed. The sentence says what was found and what to do; causes are in `source()`.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// A file gave no volume.
    #[error(transparent)]
    Read(#[from] ReadError),
    /// Voxels are no volume.
    #[error(transparent)]
    Volume(#[from] VolumeError),
    /// A store is so damaged that nothing of it can be read.
    #[error(
        "nothing of the store {} can be restored: what is left of the file is no store; go back to a backup, or ingest the volumes into a new one",
        display_path(path)
    )]
    BeyondRepair {
        /// The store.
        path: std::path::PathBuf,
        /// Why.
        #[source]
        source: StoreError,
    },
    /// The store refused, or is damaged.
    #[error(transparent)]
    Store(#[from] StoreError),
    /// Moments gave no point.
    #[error(transparent)]
    Space(#[from] SpaceError),
    /// A question that no index can answer.
    #[error(transparent)]
    Index(#[from] IndexError),
    /// A recipe that cannot be followed.
    #[error(transparent)]
    Recipe(#[from] RecipeError),
    /// There is no store to open.
    #[error(
        "{}: there is no store here: make one with `hlacdb ingest`, or name another with --store",
        display_path(path)
    )]
    NoStore {
        /// Where it was looked for.
        path: PathBuf,
    },
    /// `k` is 0.
    #[error("k is 0, but a query asks for at least one hit: use -k 1 or more")]
    ZeroK,
    /// A query names no example.
    #[error("the query names no example: give a volume, the id of a texture or a descriptor")]
    NoExample,
    /// `within` is negative or not a number.
    #[error("the distance {found} is no bound: use a number of 0 or more")]
    BadDistance {
        /// What was given.
        found: f64,
    },
    /// No such space.
    #[error("there is no space '{name}'; the store has: {}", known.join(", "))]
    NoSuchSpace {
        /// What was asked for.
        name: String,
        /// The spaces there are.
        known: Vec<String>,
    },
    /// A space of this name is there already.
    #[error(
        "there is a space '{name}' already: choose another name, or remove it first (`hlacdb space remove`; not built-in ones)"
    )]
    SpaceExists {
        /// The name.
        name: String,
    },
    /// Only spaces of the user's own can be removed.
    #[error("'{name}' is no space of your own; of your own there are: {}", if own.is_empty() { "none".to_owned() } else { own.join(", ") })]
    NotOwnSpace {
        /// What was asked for.
        name: String,
        /// The user's own spaces.
        own: Vec<String>,
    },
    /// Nuisances can be learned from voxels only.
    #[error(
        "the store keeps no voxels, so that no nuisance can be tried on its textures: the shipped estimate stays in force"
    )]
    NoVoxels,
    /// An example does not have the views that the space needs.
    #[error("the space '{space}' needs moments of {}, which {what} does not have: choose another with --space", needs.join(", "))]
    MissingViews {
        /// The space.
        space: String,
        /// The views it needs and did not get.
        needs: Vec<String>,
        /// What was asked with.
        what: String,
    },
    /// A volume is smaller than one block.
    #[error("{}: the volume is {} x {} x {} (Z, Y, X), too small for one block of {side} voxels a side: use a smaller --block", display_path(path), shape[0], shape[1], shape[2])]
    BlockTooLarge {
        /// The file.
        path: PathBuf,
        /// Its shape.
        shape: Shape,
        /// The side asked for.
        side: usize,
    },
    /// An array does not have the shape that is needed.
    #[error("{}: the array is {found}, but {expected} is needed", display_path(path))]
    ArrayShape {
        /// The file.
        path: PathBuf,
        /// What was found.
        found: String,
        /// What is needed.
        expected: String,
    },
    /// A folder or tar file is no export of whole textures, or not a whole one.
    #[error("{}: {what}: take a folder or tar file that `hlacdb export --textures` wrote", display_path(path))]
    Exchange {
        /// The folder or file.
        path: PathBuf,
        /// What was found.
        what: String,
    },
    /// A path leads out of the folder that it may name something in.
    #[error(
        "{}: this leads out of the folder that is ingested from: name something in it, and copy what is elsewhere",
        display_path(path)
    )]
    Outside {
        /// The path as it was named, or the link, below the folder.
        path: PathBuf,
    },
    /// A path names nothing.
    #[error("{}: there is nothing of this name in the folder that is ingested from", display_path(path))]
    NotThere {
        /// The path as it was named.
        path: PathBuf,
        /// The system's own words.
        #[source]
        source: std::io::Error,
    },
    /// The textures carry no such tag.
    #[error(
        "fewer than two textures carry a tag '{key}': tag them first (`hlacdb tag ID {key}=VALUE`), or name another --label"
    )]
    NoLabel {
        /// The tag asked for.
        key: String,
    },
    /// All textures that carry a tag have the same value, so that any hit would be a right one.
    #[error(
        "all {textures} textures that carry the tag '{key}' have the value '{value}': every hit would be right, which measures \
         nothing; add textures of another {key}, or name another --label"
    )]
    OneLabel {
        /// The tag.
        key: String,
        /// Its one value.
        value: String,
        /// How many textures carry it.
        textures: usize,
    },
    /// No two textures that carry a tag have the same value, so that no hit could be a right one.
    #[error(
        "no two of the {textures} textures that carry the tag '{key}' have the same value: none has anything to find; name \
         another --label"
    )]
    NoPair {
        /// The tag.
        key: String,
        /// How many textures carry it.
        textures: usize,
    },
    /// The operating system refused.
    #[error("{doing}{} failed", path.as_deref().map_or_else(String::new, |path| format!(" {}", display_path(path))))]
    Io {
        /// What was being done, e.g. `reading`.
        doing: &'static str,
        /// The file or folder, where it was done to one.
        path: Option<PathBuf>,
        /// The system's own words.
        #[source]
        source: std::io::Error,
    },
    /// The caller cancelled; nothing was changed.
    #[error("stopped before the end: nothing was changed")]
    Cancelled,
}

impl Error {
    /// True where a store's last writer did not end cleanly, so that it must be opened once for writing before it can be
    /// opened read-only.
    pub fn needs_repair(&self) -> bool {
        matches!(self, Self::Store(StoreError::NeedsRepair { .. }))
    }

    /// True where something stored is not what was written: `repair` may restore it.
    pub fn is_damage(&self) -> bool {
        matches!(
            self,
            Self::Store(StoreError::Damage(_) | StoreError::DamagedFile { .. })
                | Self::Space(SpaceError::Damaged { .. } | SpaceError::Version { .. })
        )
    }

    /// The kind of remedy that applies to a file that gave no volume; `None` where none is known.
    pub fn hint(&self) -> Option<Hint> {
        match self {
            Self::Read(error) => error.hint(),
            Self::Volume(error) => error.hint(),
            _ => None,
        }
    }

    /// This error with each of its paths replaced by `shown(path)`.
    ///
    /// Errors name files as the caller named them, or by their full paths. Where an error is shown to somebody who must
    /// not see the folders of this machine, make its paths relative first.
    ///
    /// ```
    /// use hlacdb::{Database, OpenOptions};
    /// use std::path::{Path, PathBuf};
    /// let error = OpenOptions::new().create(false).open("/data/cores/none.hlacdb").unwrap_err();
    /// assert!(error.to_string().contains("/data/cores/none.hlacdb"));
    /// let error = error.map_paths(&|path: &Path| path.file_name().map_or_else(PathBuf::new, PathBuf::from));
    /// assert!(!error.to_string().contains("/data") && error.to_string().contains("none.hlacdb"));
    /// ```
    #[must_use]
    pub fn map_paths(mut self, shown: &dyn Fn(&Path) -> PathBuf) -> Self {
        match &mut self {
            Self::Read(error) => error.path = shown(&error.path),
            Self::Store(error) => error.map_path(shown),
            Self::BeyondRepair { path, source } => {
                *path = shown(path);
                source.map_path(shown);
            }
            Self::NoStore { path }
            | Self::BlockTooLarge { path, .. }
            | Self::ArrayShape { path, .. }
            | Self::Exchange { path, .. }
            | Self::Outside { path }
            | Self::NotThere { path, .. } => *path = shown(path),
            Self::Io { path, .. } => *path = path.as_deref().map(shown),
            // Without paths. No wildcard: a new variant says here whether it has one.
            Self::Volume(_)
            | Self::Space(_)
            | Self::Index(_)
            | Self::Recipe(_)
            | Self::ZeroK
            | Self::NoExample
            | Self::BadDistance { .. }
            | Self::NoSuchSpace { .. }
            | Self::SpaceExists { .. }
            | Self::NotOwnSpace { .. }
            | Self::NoVoxels
            | Self::MissingViews { .. }
            | Self::NoLabel { .. }
            | Self::OneLabel { .. }
            | Self::NoPair { .. }
            | Self::Cancelled => {}
        }
        self
    }

    pub(crate) fn io(doing: &'static str, source: std::io::Error) -> Self {
        Self::Io { doing, path: None, source }
    }

    pub(crate) fn file(doing: &'static str, path: &Path, source: std::io::Error) -> Self {
        Self::Io { doing, path: Some(path.to_owned()), source }
    }
}

/// An error's sentence, then its causes, joined by `: `.
pub fn chain(error: &dyn std::error::Error) -> String {
    let mut text = error.to_string();
    let mut cause = error.source();
    while let Some(error) = cause {
        text.push_str(": ");
        text.push_str(&error.to_string());
        cause = error.source();
    }
    text
}
