//! Where the voxels of a response come from: a texture of the store, or an upload.

use std::sync::Arc;

use super::problem::Problem;
use super::state::App;
use super::upload_cache::Upload;
use crate::ContentHash;
use crate::volume::Volume;

/// A volume to be shown, known by the hash of its content before its voxels are read.
pub(crate) struct VolumeSource {
    pub(crate) content: [u8; 32],
    location: Location,
}

enum Location {
    Store(u64),
    Memory(Arc<Volume>),
}

impl VolumeSource {
    /// A texture whose voxels the store keeps.
    pub(crate) fn texture(app: &App, id: u64) -> Result<Self, Problem> {
        let catalogue = app.catalogue()?;
        let (has_voxels, content) = match catalogue.get(id) {
            Some(texture) => (texture.voxels, texture.content),
            // The catalogue may be older than the texture.
            None => {
                let texture = app.database.texture(id)?;
                (texture.stored_bytes.is_some(), texture.content)
            }
        };
        match content {
            Some(ContentHash(content)) if has_voxels => Ok(Self { content, location: Location::Store(id) }),
            _ => Err(no_voxels(id)),
        }
    }

    /// An upload.
    pub(crate) fn upload(app: &App, token: &str) -> Result<Self, Problem> {
        let upload = find_upload(app, token)?;
        Ok(Self { content: upload.described.content().0, location: Location::Memory(Arc::clone(&upload.volume)) })
    }

    /// The voxels, from the cache if it has them.
    pub(crate) fn volume(&self, app: &App) -> Result<Arc<Volume>, Problem> {
        match &self.location {
            Location::Memory(volume) => Ok(Arc::clone(volume)),
            &Location::Store(id) => {
                if let Some(volume) = app.volumes.get(&self.content) {
                    return Ok(volume);
                }
                let volume = Arc::new(app.database.volume(id)?.ok_or_else(|| no_voxels(id))?);
                app.volumes.insert(self.content, Arc::clone(&volume));
                Ok(volume)
            }
        }
    }
}

/// The upload with this token.
pub(crate) fn find_upload(app: &App, token: &str) -> Result<Arc<Upload>, Problem> {
    let gone =
        || Problem::not_found("there is no such upload: only the most recent ones are kept, send the file again");
    app.uploads.get(token).ok_or_else(gone)
}

fn no_voxels(id: u64) -> Problem {
    Problem::not_found(format!("texture {id} was stored without its voxels, so it cannot be shown"))
}
