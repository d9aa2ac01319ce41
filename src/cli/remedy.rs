//! What to do about an error, in the words of the program: its flags.

use std::error::Error;

use hlacdb::volume::{Hint, ReadError, VolumeError};

/// What would help against an error, if the library has a hint.
pub(crate) fn remedy(error: &(dyn Error + 'static)) -> Option<String> {
    let hint = if let Some(error) = error.downcast_ref::<hlacdb::Error>() {
        error.hint()
    } else if let Some(error) = error.downcast_ref::<ReadError>() {
        error.hint()
    } else {
        error.downcast_ref::<VolumeError>().and_then(VolumeError::hint)
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

/// A hint with the flags of the program.
fn words(hint: Hint) -> String {
    match hint {
        Hint::RaiseVoxelLimit => "raise --max-voxels if the file is right".into(),
        Hint::RaiseInflatedLimit => "raise --max-inflated if the file is right".into(),
        Hint::GiveRawLayout => "for samples without a header give --raw-shape and --raw-type".into(),
        Hint::CheckRawLayout => "check --raw-shape, --raw-type and --raw-offset".into(),
        Hint::EnableFeature(feature) => format!("build the program with `--features {feature}`"),
        other => other.to_string(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn remedies_name_the_flags() {
        let large = VolumeError::TooLarge { voxels: 9, limit: 8 };
        assert_eq!(remedy(&large).as_deref(), Some("raise --max-voxels if the file is right"));
        let error = ReadError::new("a.npy", large);
        let expected =
            "a.npy: the header promises 9 voxels, more than the limit of 8 (raise --max-voxels if the file is right)";
        assert_eq!(with_remedy(&error), expected);
        assert_eq!(with_remedy(&hlacdb::Error::Read(error)), expected);
        assert_eq!(remedy(&VolumeError::NotAFile), None);
    }
}
