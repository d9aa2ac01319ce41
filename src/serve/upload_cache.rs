//! The volumes that were uploaded for queries: the last few, in memory only.

use std::collections::VecDeque;
use std::io;
use std::sync::{Arc, Mutex, PoisonError};

use super::tokens::random_token;
use crate::DescribedVolume;
use crate::volume::Volume;

/// How many uploads are kept.
const MAX_UPLOADS: usize = 16;
/// How many bytes of voxels they may have together; the newest is kept even if it has more.
const MAX_BYTES: usize = 256 << 20;

/// A volume that was uploaded for a query.
pub(crate) struct Upload {
    /// Names the upload in later requests; unpredictable.
    pub(crate) token: String,
    pub(crate) name: String,
    pub(crate) volume: Arc<Volume>,
    /// Its description in all views of the store, so that it answers queries in every space.
    pub(crate) described: DescribedVolume,
}

/// The most recently used uploads, most recent first.
#[derive(Default)]
pub(crate) struct UploadCache(Mutex<VecDeque<Arc<Upload>>>);

impl UploadCache {
    /// Adds an upload and evicts those used least recently.
    ///
    /// # Errors
    /// If the operating system gives no random numbers.
    pub(crate) fn insert(&self, name: String, volume: Volume, described: DescribedVolume) -> io::Result<Arc<Upload>> {
        let token = random_token()?;
        let upload = Arc::new(Upload { token, name, volume: Arc::new(volume), described });
        let mut uploads = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        uploads.push_front(Arc::clone(&upload));
        uploads.truncate(MAX_UPLOADS);
        let bytes =
            |uploads: &VecDeque<Arc<Upload>>| uploads.iter().map(|upload| upload.volume.voxels().len()).sum::<usize>();
        while uploads.len() > 1 && bytes(&uploads) > MAX_BYTES {
            uploads.pop_back();
        }
        Ok(upload)
    }

    /// The upload with this token, which becomes the most recently used.
    pub(crate) fn get(&self, token: &str) -> Option<Arc<Upload>> {
        let mut uploads = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        let position = uploads.iter().position(|upload| upload.token == token)?;
        let upload = uploads.remove(position)?;
        uploads.push_front(Arc::clone(&upload));
        Some(upload)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::space::Descriptor;

    #[test]
    fn the_least_recently_used_upload_is_evicted() {
        let cache = UploadCache::default();
        let insert = |name: &str, level: u8| {
            let volume = Volume::new([8; 3], 1, vec![level; 512]).unwrap();
            let described = DescribedVolume::new(&volume, Descriptor::default());
            cache.insert(name.to_owned(), volume, described).unwrap()
        };
        let (first, second) = (insert("first", 0), insert("second", 1));
        for level in 2..MAX_UPLOADS as u8 {
            insert("further", level);
        }
        assert!(cache.get(&first.token).is_some());
        insert("one too many", 99);
        assert!(cache.get(&first.token).is_some() && cache.get(&second.token).is_none());
    }
}
