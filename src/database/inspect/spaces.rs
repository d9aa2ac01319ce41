//! Looking at the spaces of a store.

use std::sync::Arc;

use crate::database::Database;
use crate::database::points::spaces::load;
use crate::database::scheme::Scheme;
use crate::error::Error;
use crate::space::Space;

impl Database {
    /// The spaces that the store can answer in.
    ///
    /// # Errors
    /// [`Error::Store`].
    pub fn space_names(&self) -> Result<Vec<String>, Error> {
        Ok(Scheme::of(&self.store().read()?).names())
    }

    /// Every space that the store can answer in, as it is fitted now. Cheap: no point is looked at.
    ///
    /// # Errors
    /// [`Error::Store`], [`Error::Space`].
    pub fn spaces(&self) -> Result<Vec<Space>, Error> {
        let snapshot = self.store().read()?;
        Scheme::of(&snapshot).definitions().iter().map(|definition| load(&snapshot, &definition.name)).collect()
    }

    /// A space as it is fitted now.
    ///
    /// # Errors
    /// [`Error::NoSuchSpace`], [`Error::Store`].
    pub fn space(&self, name: &str) -> Result<Arc<Space>, Error> {
        Ok(Arc::clone(&self.state(&self.store().read()?, name)?.owner.space))
    }
}
