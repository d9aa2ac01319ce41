//! Spaces of the user's own: kept in the store's settings, fitted and answered like the built-in ones.

use super::nuisance;
use super::rebuild::{Rewrite, rebuild};
use super::spaces::fit_one;
use crate::database::handle::Database;
use crate::database::points::spaces::{last_fit, load};
use crate::database::points::statistics_cache::StatisticsCache;
use crate::database::scheme::{SETTING, Scheme, definitions, set_down};
use crate::error::{Error, MaintenanceError};
use crate::hlac::View;
use crate::progress::Progress;
use crate::space::{Definition, Space};
use crate::store::{Reads, Transaction};

impl Database {
    /// Adds a space of one's own and fits it on all there is. Where no other space has its features, every texture is
    /// looked at once: octants are described from the voxels that are kept.
    ///
    /// # Errors
    /// [`MaintenanceError::SpaceExists`] for a name that is taken; [`MaintenanceError::ViewsNotStored`] for views that the store does not keep;
    /// [`Error::Space`] for a definition that cannot be fitted; [`Error::Cancelled`], after which nothing has changed;
    /// [`Error::Store`].
    pub fn add_space(&self, definition: &Definition, progress: &dyn Progress) -> Result<Space, Error> {
        definition.check()?;
        self.change(|transaction, statistics_cache| {
            check_room(transaction, definition)?;
            let mut settings = transaction.settings().clone();
            set_down(&mut settings, definition)
                .map_err(|error| Error::io("writing the space's definition", error.into()))?;
            transaction.put_settings(settings)?;
            if !statistics_cache.all().iter().any(|kept| *kept.feature_set() == definition.feature_set) {
                rebuild(transaction, statistics_cache, &Rewrite::These(&Default::default()), progress)?;
            }
            fit_of_books(transaction, statistics_cache, definition)?;
            load(transaction, &definition.name)
        })
    }

    /// Removes a space of one's own.
    ///
    /// # Errors
    /// [`MaintenanceError::NotUserDefined`] where it is built in or not there; [`Error::Store`].
    pub fn remove_space(&self, name: &str) -> Result<(), Error> {
        self.change(|transaction, statistics_cache| {
            let mut settings = transaction.settings().clone();
            if settings.further.remove(&format!("{SETTING}{name}")).is_none() {
                let user_defined = definitions(&settings).into_iter().map(|definition| definition.name).collect();
                return Err(MaintenanceError::NotUserDefined { name: name.to_owned(), user_defined }.into());
            }
            transaction.put_settings(settings)?;
            transaction.drop_space(name)?;
            // Statistics that no space looks at any more would only grow stale.
            let wanted = Scheme::of(transaction).recipes();
            for recipe in statistics_cache.forget_others(&wanted) {
                transaction.drop_statistics(&recipe.key())?;
                transaction.drop_statistics(&nuisance::key(&recipe))?;
            }
            Ok(())
        })
    }
}

/// That the name is free and the views are kept.
fn check_room(transaction: &Transaction, definition: &Definition) -> Result<(), Error> {
    let name = &definition.name;
    let taken = transaction.settings().further.contains_key(&format!("{SETTING}{name}"));
    if taken || Definition::built_in(name).is_some() {
        return Err(MaintenanceError::SpaceExists { name: name.clone() }.into());
    }
    let kept = Scheme::of(transaction);
    let views = definition.feature_set.views().iter().copied();
    let needs: Vec<View> = views.filter(|view| !kept.views().contains(view)).collect();
    if needs.is_empty() {
        return Ok(());
    }
    Err(MaintenanceError::ViewsNotStored { space: name.clone(), needs }.into())
}

fn fit_of_books(
    transaction: &mut Transaction,
    statistics_cache: &StatisticsCache,
    definition: &Definition,
) -> Result<(), Error> {
    let epoch = last_fit(transaction)?.0;
    match statistics_cache.all().iter().find(|kept| *kept.feature_set() == definition.feature_set) {
        Some(statistics) => fit_one(transaction, definition, statistics, epoch),
        None => Ok(()),
    }
}
