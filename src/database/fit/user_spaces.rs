//! User-defined spaces: their definitions are stored in the settings, and they are fitted and queried like the built-in ones.

use super::rebuild::{Rewrite, rebuild};
use crate::database::handle::Database;
use crate::database::points::fitting::{fit_one, nuisance_key};
use crate::database::points::spaces::{last_fit, load};
use crate::database::scheme::{SETTING, Scheme, put_definition, user_definitions};
use crate::error::{Error, MaintenanceError};
use crate::hlac::View;
use crate::progress::Progress;
use crate::space::{Definition, Space};
use crate::store::{Reads, Transaction};

impl Database {
    /// Adds a user-defined space and fits it on all textures. If no other space has its feature set, every texture is read
    /// once; octants are described from the voxels that are stored.
    ///
    /// # Errors
    /// [`MaintenanceError::SpaceExists`]; [`MaintenanceError::ViewsNotStored`]; [`Error::Space`] if the definition is not
    /// valid; [`Error::Cancelled`], after which nothing has changed; [`Error::Store`].
    pub fn add_space(&self, definition: &Definition, progress: &dyn Progress) -> Result<Space, Error> {
        definition.check()?;
        self.change(|transaction, statistics| {
            check_can_add(transaction, definition)?;
            let mut settings = transaction.settings().clone();
            put_definition(&mut settings, definition)
                .map_err(|error| Error::io("writing the definition of the space", error.into()))?;
            transaction.put_settings(settings)?;
            if statistics.get(&definition.feature_set).is_none() {
                rebuild(transaction, statistics, Rewrite::Nothing, progress)?;
            }
            let (epoch, _) = last_fit(transaction)?;
            if let Some(statistics) = statistics.get(&definition.feature_set) {
                fit_one(transaction, definition, statistics, epoch)?;
            }
            load(transaction, &definition.name)
        })
    }

    /// Removes a user-defined space.
    ///
    /// # Errors
    /// [`MaintenanceError::NotUserDefined`] if it is built in or does not exist; [`Error::Store`].
    pub fn remove_space(&self, name: &str) -> Result<(), Error> {
        self.change(|transaction, statistics| {
            let mut settings = transaction.settings().clone();
            if settings.further.remove(&format!("{SETTING}{name}")).is_none() {
                let user_defined = user_definitions(&settings).into_iter().map(|definition| definition.name).collect();
                return Err(MaintenanceError::NotUserDefined { name: name.to_owned(), user_defined }.into());
            }
            transaction.put_settings(settings)?;
            transaction.drop_space(name)?;
            // Statistics that no space uses would not be kept up to date.
            let wanted = Scheme::of(transaction).feature_sets();
            for feature_set in statistics.retain(&wanted) {
                transaction.drop_statistics(&feature_set.key())?;
                transaction.drop_statistics(&nuisance_key(&feature_set))?;
            }
            Ok(())
        })
    }
}

/// Checks that the name is free and that the store keeps the views.
fn check_can_add(transaction: &Transaction, definition: &Definition) -> Result<(), Error> {
    let name = &definition.name;
    let is_taken = transaction.settings().further.contains_key(&format!("{SETTING}{name}"));
    if is_taken || Definition::built_in(name).is_some() {
        return Err(MaintenanceError::SpaceExists { name: name.clone() }.into());
    }
    let scheme = Scheme::of(transaction);
    let views = definition.feature_set.views().iter().copied();
    let needs: Vec<View> = views.filter(|view| !scheme.views().contains(view)).collect();
    if needs.is_empty() {
        return Ok(());
    }
    Err(MaintenanceError::ViewsNotStored { space: name.clone(), needs }.into())
}
