//! What to do about an error, in the words of this program: its commands and flags.

use std::error::Error as StdError;

use hlacdb::hlac::ExtractError;
use hlacdb::ingest::ExtractFileError;
use hlacdb::volume::{Hint as ReadHint, ReadError, VolumeError};
use hlacdb::{Error, Hint, QueryError};

/// An error as it is printed: its message, a remedy, and its causes.
pub(super) struct Advice {
    message: String,
    remedy: Option<String>,
    /// The causes, nearest first.
    causes: Vec<String>,
}

impl Advice {
    pub(super) fn on(error: &(dyn StdError + 'static)) -> Self {
        let causes = std::iter::successors(error.source(), |&cause| cause.source()).map(ToString::to_string);
        Self { message: error.to_string(), remedy: remedy(error), causes: causes.collect() }
    }

    /// Everything on one line: `message: cause: remedy`.
    pub(super) fn line(&self) -> String {
        let parts = std::iter::once(&self.message).chain(&self.causes).chain(&self.remedy);
        parts.map(String::as_str).collect::<Vec<_>>().join(": ")
    }

    /// `message: remedy`, and every cause on a line of its own.
    pub(super) fn lines(&self) -> String {
        let first: Vec<&str> = std::iter::once(&self.message).chain(&self.remedy).map(String::as_str).collect();
        let causes = self.causes.iter().map(|cause| format!("\n  because {cause}"));
        std::iter::once(first.join(": ")).chain(causes).collect()
    }
}

/// What the user can do about an error.
fn remedy(error: &(dyn StdError + 'static)) -> Option<String> {
    if let Some(error) = error.downcast_ref::<Error>() {
        return match error {
            Error::Query(QueryError::ZeroK) => Some("use -k 1 or more".into()),
            other => other.hint().map(of_hint),
        };
    }
    if let Some(error) = error.downcast_ref::<ReadError>() {
        return error.hint().map(of_file);
    }
    if let Some(error) = error.downcast_ref::<VolumeError>() {
        return error.hint().map(of_file);
    }
    match error.downcast_ref::<ExtractFileError>()? {
        ExtractFileError::Read(error) => error.hint().map(of_file),
        ExtractFileError::Extract { error, .. } => of_extract(error),
        _ => None,
    }
}

/// A hint of the library in commands and flags.
fn of_hint(hint: Hint) -> String {
    let words = match hint {
        Hint::CreateStore => "create one with `hlacdb ingest`, or name another with --store",
        Hint::MigrateStore => "run `hlacdb migrate` once",
        Hint::WaitForWriter => {
            "wait for that process or end it (`hlacdb serve` writes until it ends, unless started with --read-only); reading \
             (query, list, stats, ...) works in the meantime"
        }
        Hint::RepairStore => "run `hlacdb repair`, or restore a backup",
        Hint::ReopenStore => "run the command again",
        Hint::ListTextures => "`hlacdb list` shows the ids",
        Hint::ChooseSpace => "choose another space with --space",
        Hint::RenameSpace => {
            "choose another name, or remove that space with `hlacdb space remove`, unless it is built in"
        }
        Hint::TagTextures => "tag textures with `hlacdb tag ID KEY=VALUE`, or name another tag with --label",
        Hint::ChooseLabel => "name another tag with --label, or add textures with other values",
        Hint::SmallerBlock => "use a smaller --block",
        Hint::Reindex => "run `hlacdb reindex`",
        Hint::UseArchive => "name a folder or tar file that `hlacdb export --textures` wrote",
        Hint::KeepVoxels => "ingest with --volumes keep",
        Hint::Read(hint) => return of_file(hint),
        other => return other.to_string(),
    };
    words.to_owned()
}

/// What the user can do about a file that cannot be read.
fn of_file(hint: ReadHint) -> String {
    match hint {
        ReadHint::RaiseVoxelLimit => "raise --max-voxels if the file is right".into(),
        ReadHint::RaiseInflatedLimit => "raise --max-inflated if the file is right".into(),
        ReadHint::GiveRawLayout => "for samples without a header give --raw-shape and --raw-type".into(),
        ReadHint::CheckRawLayout => "check --raw-shape, --raw-type and --raw-offset".into(),
        ReadHint::EnableFeature(feature) => format!("build the program with `--features {feature}`"),
        other => other.to_string(),
    }
}

/// What the user can do about sums that cannot be computed.
fn of_extract(error: &ExtractError) -> Option<String> {
    match error {
        ExtractError::TooSmall { spacing: 2.., .. } => Some("use a smaller --spacing".into()),
        ExtractError::TooManyWindows { .. } => {
            Some("use a smaller --windows, or --variant exact, which is cheaper".into())
        }
        _ => error.hint().map(ToOwned::to_owned),
    }
}

#[cfg(test)]
mod tests {
    use hlacdb::StoreError;

    use super::*;

    #[test]
    fn remedies_name_flags() {
        let large = VolumeError::TooLarge { voxels: 9, limit: 8 };
        let error = ReadError::new("a.npy", large);
        let expected =
            "a.npy: the volume would have 9 voxels, more than the limit of 8: raise --max-voxels if the file is right";
        assert_eq!(Advice::on(&error).line(), expected);
        assert_eq!(Advice::on(&Error::from(error)).lines(), expected);
        let missing = Error::from(StoreError::NoSuchTexture { id: 7 });
        assert_eq!(Advice::on(&missing).line(), "there is no texture with id 7: `hlacdb list` shows the ids");
        assert_eq!(Advice::on(&VolumeError::NotAFile).remedy, None);
    }

    #[test]
    fn causes_have_lines_of_their_own() {
        let source = std::io::Error::other("disk on fire");
        let error = Error::Io { doing: "writing", path: Some("a.npy".into()), source };
        assert_eq!(Advice::on(&error).lines(), "writing a.npy failed\n  because disk on fire");
        assert_eq!(Advice::on(&error).line(), "writing a.npy failed: disk on fire");
    }
}
