//! What to do about an error, in the words of the program: its flags.

use std::error::Error;

use hlacdb::Hint;
use hlacdb::volume::{Hint as ReadHint, ReadError, VolumeError};

/// What would help against an error, if the library has a hint.
pub(crate) fn remedy(error: &(dyn Error + 'static)) -> Option<String> {
    let hint = if let Some(error) = error.downcast_ref::<hlacdb::Error>() {
        error.hint()
    } else if let Some(error) = error.downcast_ref::<ReadError>() {
        error.hint().map(Hint::Read)
    } else {
        error.downcast_ref::<VolumeError>().and_then(VolumeError::hint).map(Hint::Read)
    };
    hint.map(words)
}

/// An error and its causes in one line, with the remedy in brackets.
pub(crate) fn with_remedy(error: &(dyn Error + 'static)) -> String {
    let chain = hlacdb::chain(error);
    match remedy(error) {
        Some(remedy) => format!("{chain} ({remedy})"),
        None => chain,
    }
}

/// A hint in the words of the program: its commands and flags.
fn words(hint: Hint) -> String {
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
        Hint::Read(hint) => return read_words(hint),
        other => return other.to_string(),
    };
    words.to_owned()
}

/// What to do about a file that could not be read.
fn read_words(hint: ReadHint) -> String {
    match hint {
        ReadHint::RaiseVoxelLimit => "raise --max-voxels if the file is right".into(),
        ReadHint::RaiseInflatedLimit => "raise --max-inflated if the file is right".into(),
        ReadHint::GiveRawLayout => "for samples without a header give --raw-shape and --raw-type".into(),
        ReadHint::CheckRawLayout => "check --raw-shape, --raw-type and --raw-offset".into(),
        ReadHint::EnableFeature(feature) => format!("build the program with `--features {feature}`"),
        other => other.to_string(),
    }
}

#[cfg(test)]
mod tests {
    use hlacdb::StoreError;

    use super::*;

    #[test]
    fn remedies_name_the_flags() {
        let large = VolumeError::TooLarge { voxels: 9, limit: 8 };
        assert_eq!(remedy(&large).as_deref(), Some("raise --max-voxels if the file is right"));
        let error = ReadError::new("a.npy", large);
        let expected =
            "a.npy: the header promises 9 voxels, more than the limit of 8 (raise --max-voxels if the file is right)";
        assert_eq!(with_remedy(&error), expected);
        assert_eq!(with_remedy(&hlacdb::Error::from(error)), expected);
        let missing = hlacdb::Error::from(StoreError::NoSuchTexture { id: 7 });
        assert_eq!(with_remedy(&missing), "there is no texture with id 7 (`hlacdb list` shows the ids)");
        assert_eq!(remedy(&VolumeError::NotAFile), None);
    }
}
