//! The spaces of a store.

use std::sync::Arc;

use crate::database::handle::Database;
use crate::database::points::spaces::load;
use crate::database::scheme::Scheme;
use crate::error::Error;
use crate::space::Space;

impl Database {
    /// The names of the store's spaces.
    ///
    /// # Errors
    /// [`Error::Store`].
    pub fn space_names(&self) -> Result<Vec<String>, Error> {
        Ok(Scheme::of(&self.store().read()?).names())
    }

    /// All spaces of the store, as they are fitted. Points are not loaded.
    ///
    /// # Errors
    /// [`Error::Store`], [`Error::Space`].
    pub fn spaces(&self) -> Result<Vec<Space>, Error> {
        let snapshot = self.store().read()?;
        Scheme::of(&snapshot).definitions().iter().map(|definition| load(&snapshot, &definition.name)).collect()
    }

    /// A space, as it is fitted. Its points are loaded if they are not in memory.
    ///
    /// # Errors
    /// [`QueryError::NoSuchSpace`](crate::QueryError::NoSuchSpace), [`Error::Store`].
    pub fn space(&self, name: &str) -> Result<Arc<Space>, Error> {
        Ok(Arc::clone(&self.state(&self.store().read()?, name)?.owner.space))
    }
}
