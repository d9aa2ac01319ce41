//! Changes: every one a transaction, statistics and points included.

use rayon::prelude::*;

use super::books::Books;
use super::prepare::{Meta, Prepared, Work, views};
use super::spaces::{contributions_of, fit, keep_points, last_fit};
use super::textures::Texture;
use super::{Database, held};
use crate::error::Error;
use crate::hlac::View;
use crate::space::{Contribution, Recipe, Statistics};
use crate::store::{DESCRIPTOR_ROWS, NewTexture, Reads, StoreError, Transaction};
use crate::volume::Volume;

/// What became of a texture that was added.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Added {
    /// It is in the store, under this id.
    New(u64),
    /// The same content was in the store already, under this id; nothing changed.
    Duplicate(u64),
}

impl Added {
    /// The texture's id.
    pub fn id(self) -> u64 {
        match self {
            Self::New(id) | Self::Duplicate(id) => id,
        }
    }
}

impl Database {
    /// Adds a texture, durably: when this returns it survives a crash. The same content is never added twice.
    ///
    /// For many textures, [`Database::prepare`] on several threads and [`Database::commit`] in batches is quicker, and
    /// [`crate::ingest`] does that for files.
    ///
    /// # Errors
    /// [`Error::Store`].
    pub fn add(&self, volume: &Volume, meta: Meta) -> Result<Added, Error> {
        let volumes = self.store().read()?.settings().volumes;
        let added = self.commit(vec![self.prepare(volume, meta, volumes)?])?;
        Ok(added.first().copied().unwrap_or(Added::Duplicate(0)))
    }

    /// Adds prepared textures in one transaction, in their order: all of them, durably, or none.
    ///
    /// # Errors
    /// [`Error::Store`].
    pub fn commit(&self, prepared: Vec<Prepared>) -> Result<Vec<Added>, Error> {
        if prepared.is_empty() {
            return Ok(Vec::new());
        }
        self.change_if(|transaction, books| {
            let mut fits = Fits::new(transaction)?;
            let mut added = Vec::with_capacity(prepared.len());
            for texture in prepared {
                added.push(add_one(transaction, books, texture)?);
                fits.after(books);
            }
            fits.finish(transaction)?;
            let changed = added.iter().any(|outcome| matches!(outcome, Added::New(_)));
            Ok((added, changed))
        })
    }

    /// Removes textures, durably: all of them, or, where one is not there, none. Returns the ids removed, each once. One whose
    /// record cannot be read is removed with all that lies under its id, after which its content can be added anew.
    ///
    /// # Errors
    /// [`StoreError::NoSuchTexture`], in [`Error::Store`].
    pub fn remove(&self, ids: &[u64]) -> Result<Vec<u64>, Error> {
        let mut ids = ids.to_vec();
        ids.sort_unstable();
        ids.dedup();
        self.change(|transaction, books| {
            let views = views(transaction);
            for &id in &ids {
                let whole = match transaction.record(id) {
                    Ok(None) => return Err(StoreError::NoSuchTexture { id }.into()),
                    Ok(Some(_)) => true,
                    Err(StoreError::Damage(_)) => false,
                    Err(error) => return Err(error.into()),
                };
                let parts = contributions_of(transaction, id, &views)?;
                match whole {
                    true => drop(transaction.remove(id)?),
                    false => transaction.discard(id)?,
                }
                books.remove(&parts)?;
            }
            renew_extremes(transaction, books)
        })?;
        Ok(ids)
    }

    /// Sets and takes off tags of a texture, durably; returns it as it is then.
    ///
    /// # Errors
    /// [`StoreError::NoSuchTexture`]; [`StoreError::Invalid`] for an empty key, in [`Error::Store`].
    pub fn tag(&self, id: u64, set: &[(String, String)], unset: &[String]) -> Result<Texture, Error> {
        self.change_records(|transaction| {
            for key in unset {
                transaction.unset_tag(id, key)?;
            }
            for (key, value) in set {
                transaction.set_tag(id, key, value)?;
            }
            Ok(transaction.record(id)?.ok_or(StoreError::NoSuchTexture { id })?.into())
        })
    }

    /// Adds textures that come with moments and without octants, in one transaction.
    pub(super) fn add_described(&self, textures: Vec<NewTexture>) -> Result<Vec<u64>, Error> {
        self.change(|transaction, books| {
            let recipes = views(transaction).recipes();
            let contributions: Vec<Vec<Contribution>> = textures
                .par_iter()
                .map(|texture| described_contributions(texture, &recipes))
                .collect::<Result<_, _>>()?;
            let mut fits = Fits::new(transaction)?;
            // Counting and writing do not wait for one another.
            let (counted, ids) = rayon::join(
                || fits.count_all(books, &contributions),
                || textures.into_iter().map(|texture| transaction.add(texture)).collect::<Result<Vec<u64>, _>>(),
            );
            counted?;
            let ids = ids?;
            fits.finish(transaction)?;
            Ok(ids)
        })
    }

    /// One transaction, with the books kept and the new points written; an error leaves everything as it was.
    pub(super) fn change<T>(
        &self,
        act: impl FnOnce(&mut Transaction, &mut Books) -> Result<T, Error>,
    ) -> Result<T, Error> {
        self.change_if(|transaction, books| Ok((act(transaction, books)?, true)))
    }

    /// As [`Database::change`], and statistics that are not whole do not stop it: `act` is told whether they are, and builds
    /// them anew.
    pub(super) fn change_mending<T>(
        &self,
        act: impl FnOnce(&mut Transaction, &mut Books, bool) -> Result<T, Error>,
    ) -> Result<T, Error> {
        self.change_with(true, |transaction, books, whole| Ok((act(transaction, books, whole)?, true)))
    }

    /// A change that touches no numbers: statistics and points are neither read nor written.
    fn change_records<T>(&self, act: impl FnOnce(&mut Transaction) -> Result<T, Error>) -> Result<T, Error> {
        let mut books = held(self.books.lock());
        let mut transaction = self.store().write()?;
        let before = transaction.revision();
        let value = act(&mut transaction)?;
        let revision = transaction.commit()?;
        books.follow(before, revision);
        Ok(value)
    }

    /// As [`Database::change`]; nothing is written where `act` says that nothing changed.
    fn change_if<T>(
        &self,
        act: impl FnOnce(&mut Transaction, &mut Books) -> Result<(T, bool), Error>,
    ) -> Result<T, Error> {
        self.change_with(false, |transaction, books, _| act(transaction, books))
    }

    fn change_with<T>(
        &self,
        mending: bool,
        act: impl FnOnce(&mut Transaction, &mut Books, bool) -> Result<(T, bool), Error>,
    ) -> Result<T, Error> {
        let mut books = held(self.books.lock());
        let mut transaction = self.store().write()?;
        let opened = match books.open(&transaction) {
            Err(error) if mending && error.is_damage() => {
                tracing::warn!("{}: the statistics are built anew", crate::error::chain(&error));
                Ok(false)
            }
            opened => opened.map(|()| true),
        };
        let done = opened.and_then(|whole| act(&mut transaction, &mut books, whole)).and_then(|(value, changed)| {
            if changed {
                books.save(&mut transaction)?;
                keep_points(&mut transaction)?;
                let revision = transaction.commit()?;
                books.close(revision);
            }
            Ok(value)
        });
        if done.is_err() {
            // What was counted in memory is no longer what is on disk.
            *books = Books::default();
        }
        done
    }
}

/// What a texture that comes with moments adds to the statistics of each recipe.
fn described_contributions(texture: &NewTexture, recipes: &[Recipe]) -> Result<Vec<Contribution>, Error> {
    let of =
        |view: View| texture.descriptors.iter().find(|(code, _)| code.0 == view.code()).map(|(_, moments)| moments);
    let parts = recipes.iter().filter_map(|recipe| Contribution::of_moments(recipe, of).transpose());
    Ok(parts.collect::<Result<_, _>>()?)
}

fn add_one(transaction: &mut Transaction, books: &mut Books, texture: Prepared) -> Result<Added, Error> {
    if let Some(id) = transaction.find(&texture.content.hash)? {
        return Ok(Added::Duplicate(id));
    }
    let texture = match texture.work {
        Work::Described(_) => texture,
        Work::Known(ref volume, volumes) => {
            let volume = volume.clone();
            texture.described(&volume, volumes, &views(transaction))?
        }
    };
    let id = transaction.add(texture.texture)?;
    if let Work::Described(parts) = &texture.work {
        books.add(parts)?;
    }
    Ok(Added::New(id))
}

/// Fits that become due while textures are added: at each doubling, on the statistics of that very moment, so that one
/// batch and many give the same.
struct Fits {
    epoch: u64,
    count: u64,
    due: Option<Vec<Statistics>>,
}

impl Fits {
    fn new(transaction: &Transaction) -> Result<Self, Error> {
        let (epoch, count) = last_fit(transaction)?;
        Ok(Self { epoch, count, due: None })
    }

    /// Notes the statistics where the store has just doubled.
    fn after(&mut self, books: &Books) {
        let textures = books.textures();
        if textures > 0 && textures >= 2 * self.count {
            self.count = textures;
            self.epoch += 1;
            self.due = Some(books.all().to_vec());
        }
    }

    /// Counts textures in, and notes the statistics at the last doubling among them: earlier ones would be replaced.
    fn count_all(&mut self, books: &mut Books, textures: &[Vec<Contribution>]) -> Result<(), Error> {
        let (mut counted, mut last) = (books.textures(), None);
        for (at, texture) in textures.iter().enumerate() {
            counted += u64::from(books.counts(texture));
            if counted > 0 && counted >= 2 * self.count {
                self.count = counted;
                self.epoch += 1;
                last = Some(at + 1);
            }
        }
        let (before, after) = textures.split_at(last.unwrap_or(0));
        books.add_all(before)?;
        if last.is_some() {
            self.due = Some(books.all().to_vec());
        }
        books.add_all(after)
    }

    /// Fits on what was noted last; earlier fits of the same batch would have been replaced by it.
    fn finish(self, transaction: &mut Transaction) -> Result<(), Error> {
        match self.due {
            Some(statistics) => fit(transaction, &statistics, self.epoch),
            None => Ok(()),
        }
    }
}

/// Looks for lowest and highest moments anew where a removed texture had one of them.
fn renew_extremes(transaction: &Transaction, books: &mut Books) -> Result<(), Error> {
    for statistics in books.stale_extremes() {
        let recipe = statistics.recipe().clone();
        let blocks = contribution_blocks(transaction, &recipe)?;
        let parts = blocks.flat_map(|block| match block {
            Ok(parts) => parts.into_iter().map(Ok).collect(),
            Err(error) => vec![Err(error)],
        });
        statistics.renew_extremes(parts)?;
    }
    Ok(())
}

/// What every texture adds to the statistics of a recipe, without octants: block by block, so that memory does not grow
/// with the store.
pub(super) fn contribution_blocks<'a>(
    state: &'a impl Reads,
    recipe: &'a Recipe,
) -> Result<impl Iterator<Item = Result<Vec<Contribution>, Error>> + 'a, Error> {
    let rows = state.rows()?;
    Ok((0..state.descriptor_blocks()).map(move |block| {
        let moments = super::kept::BlockMoments::read(state, recipe, block)?;
        let first = block as usize * DESCRIPTOR_ROWS;
        let live = (first..first + DESCRIPTOR_ROWS).filter(|&row| rows.is_live(row));
        let parts =
            live.filter_map(|row| Contribution::of_moments(recipe, |view| moments.row(view, row - first)).transpose());
        Ok(parts.collect::<Result<_, _>>()?)
    }))
}
