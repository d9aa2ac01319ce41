//! Volumes that were asked with: in memory only, the last few of them.

use std::collections::VecDeque;
use std::hash::{BuildHasher, RandomState};
use std::sync::{Arc, Mutex, PoisonError};

use crate::space::Descriptor;
use crate::volume::Volume;

/// So many are kept, ...
const MOST: usize = 16;
/// ... in so many bytes.
const BYTES: usize = 256 << 20;

/// A volume that was asked with.
pub(crate) struct Upload {
    /// By which it is named: nobody guesses it.
    pub(crate) token: String,
    pub(crate) name: String,
    pub(crate) volume: Arc<Volume>,
    pub(crate) content: [u8; 32],
    /// Its descriptor in the views of the store.
    pub(crate) descriptor: Descriptor,
}

/// The volumes that were asked with last.
#[derive(Default)]
pub(crate) struct Uploads(Mutex<VecDeque<Arc<Upload>>>);

impl Uploads {
    /// Keeps an upload; older ones make room for it.
    pub(crate) fn keep(&self, name: String, volume: Volume, descriptor: Descriptor) -> Arc<Upload> {
        let content = volume.content_hash();
        let token = format!("{:016x}{:016x}", RandomState::new().hash_one(content), RandomState::new().hash_one(&name));
        let upload = Arc::new(Upload { token, name, volume: Arc::new(volume), content, descriptor });
        let mut kept = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        kept.push_front(Arc::clone(&upload));
        kept.truncate(MOST);
        let bytes =
            |kept: &VecDeque<Arc<Upload>>| kept.iter().map(|upload| upload.volume.voxels().len()).sum::<usize>();
        while kept.len() > 1 && bytes(&kept) > BYTES {
            kept.pop_back();
        }
        upload
    }

    pub(crate) fn get(&self, token: &str) -> Option<Arc<Upload>> {
        let mut kept = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        let place = kept.iter().position(|upload| upload.token == token)?;
        // What is asked with again stays longest.
        let upload = kept.remove(place)?;
        kept.push_front(Arc::clone(&upload));
        Some(upload)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_last_few_are_kept() {
        let uploads = Uploads::default();
        let volume = |level| Volume::new([8; 3], 1, vec![level; 512]).unwrap();
        let first = uploads.keep("first".into(), volume(0), Descriptor::default());
        let second = uploads.keep("second".into(), volume(1), Descriptor::default());
        assert_ne!(first.token, second.token);
        for level in 2..MOST as u8 {
            uploads.keep("more".into(), volume(level), Descriptor::default());
        }
        assert!(uploads.get(&first.token).is_some());
        uploads.keep("one too many".into(), volume(99), Descriptor::default());
        assert!(uploads.get(&first.token).is_some() && uploads.get(&second.token).is_none());
    }
}
