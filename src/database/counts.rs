//! What there is how much of.

use super::Database;
use crate::error::Error;
use crate::store::Reads;

impl Database {
    /// The number of textures.
    ///
    /// # Errors
    /// [`Error::Store`].
    pub fn len(&self) -> Result<u64, Error> {
        Ok(self.store().read()?.counts().textures)
    }

    /// True where there is no texture.
    ///
    /// # Errors
    /// [`Error::Store`].
    pub fn is_empty(&self) -> Result<bool, Error> {
        Ok(self.len()? == 0)
    }
}
