//! [`Catalogue`]: the list of all textures in memory, to page through, sort and search many times.
//!
//! A catalogue is of one revision of the store and never changes. [`Database::catalogue`](crate::Database::catalogue)
//! returns the newest one, and reads the store again only if it has changed.

use std::collections::{BTreeMap, HashSet, VecDeque};
use std::sync::{Arc, Mutex, OnceLock};
use std::time::{Duration, Instant};

use serde::{Serialize, Serializer};

use super::locks::held;
use super::texture::ContentHash;
use crate::error::Error;
use crate::store::{Reads, Record, Snapshot, StoreError};
use crate::volume::{Shape, natural_cmp};
use crate::{TagFilter, TextureId};

/// A texture in a [`Catalogue`].
#[derive(Clone, Debug, Serialize)]
#[cfg_attr(feature = "serve", derive(utoipa::ToSchema))]
#[non_exhaustive]
pub struct CatalogueEntry {
    /// Its id.
    #[cfg_attr(feature = "serve", schema(value_type = u64))]
    pub id: TextureId,
    /// Its name.
    pub name: Box<str>,
    /// Axis lengths (Z, Y, X) in voxels; `None` if only moments were imported.
    #[cfg_attr(feature = "serve", schema(value_type = Option<[usize; 3]>))]
    pub shape: Option<Shape>,
    /// 1 (grey) or 3 (RGB); 0 if only moments were imported.
    pub channels: u8,
    /// Key and value, ascending by key. Serialised as a JSON object.
    #[serde(serialize_with = "as_map")]
    #[cfg_attr(feature = "serve", schema(value_type = BTreeMap<String, String>))]
    pub tags: Vec<(Arc<str>, Arc<str>)>,
    /// Whether its voxels are stored.
    pub voxels: bool,
    /// The identity of its content.
    #[serde(skip)]
    pub content: Option<ContentHash>,
}

fn as_map<S: Serializer>(tags: &[(Arc<str>, Arc<str>)], serializer: S) -> Result<S::Ok, S::Error> {
    serializer.collect_map(tags.iter().map(|(key, value)| (&**key, &**value)))
}

impl CatalogueEntry {
    /// The value of a tag.
    pub fn tag(&self, key: &str) -> Option<&str> {
        self.tags.iter().find(|(other, _)| **other == *key).map(|(_, value)| &**value)
    }

    fn voxel_count(&self) -> u128 {
        self.shape.map_or(0, |shape| shape.iter().map(|&side| side as u128).product())
    }

    /// Whether the name or the value of a tag contains `text`, which is in lower case.
    fn contains(&self, text: &str) -> bool {
        let matches = |word: &str| word.to_lowercase().contains(text);
        matches(&self.name) || self.tags.iter().any(|(_, value)| matches(value))
    }
}

/// The order of a selection. Ties are in order of ids.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub enum CatalogueOrder {
    /// By id, the order in which textures were added.
    #[default]
    Id,
    /// By name, in which numbers are compared by their value.
    Name,
    /// By the number of voxels.
    Size,
}

/// Which textures of a catalogue are selected, and in which order. The default is all, by ascending id.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct CatalogueQuery {
    filters: Vec<TagFilter>,
    text: String,
    order: CatalogueOrder,
    descending: bool,
}

impl CatalogueQuery {
    /// All textures, by ascending id.
    pub fn new() -> Self {
        Self::default()
    }

    /// Only textures for which all of these conditions hold as well.
    #[must_use]
    pub fn filters(mut self, filters: impl IntoIterator<Item = TagFilter>) -> Self {
        self.filters.extend(filters);
        self
    }

    /// Only textures whose name, or the value of one of whose tags, contains this text. Case and white space around it are
    /// ignored; an empty text matches all.
    #[must_use]
    pub fn text(mut self, text: impl Into<String>) -> Self {
        self.text = text.into();
        self
    }

    /// The order.
    #[must_use]
    pub fn order(mut self, order: CatalogueOrder) -> Self {
        self.order = order;
        self
    }

    /// Reverses the order, ties included.
    #[must_use]
    pub fn descending(mut self, descending: bool) -> Self {
        self.descending = descending;
        self
    }
}

/// The values of a tag, with the number of textures that have each.
#[derive(Clone, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub struct TagValues {
    /// The key of the tag.
    pub key: Arc<str>,
    /// Value and number of textures, by descending number, then by value.
    pub values: Vec<(Arc<str>, u64)>,
}

/// The number of cached results: paging through a list sorts and searches once.
const CACHED_QUERIES: usize = 16;

/// All textures of one revision of the store.
#[derive(Debug)]
pub struct Catalogue {
    pub(crate) revision: u64,
    /// By ascending id.
    textures: Vec<CatalogueEntry>,
    tags: OnceLock<Vec<TagValues>>,
    selected: Mutex<VecDeque<(CatalogueQuery, Arc<[u32]>)>>,
    /// When reading it began, and how long it took.
    began: Instant,
    cost: Duration,
}

impl Catalogue {
    pub(crate) fn read(snapshot: &Snapshot) -> Result<Self, Error> {
        let began = Instant::now();
        let mut words = SharedWords::default();
        let mut textures = Vec::with_capacity(usize::try_from(snapshot.counts().textures).unwrap_or(0).min(1 << 20));
        for record in snapshot.records() {
            match record {
                Ok(record) => textures.push(words.entry(record)),
                Err(StoreError::Damage(damage)) => tracing::warn!("{damage}: the texture is left out of the catalogue"),
                Err(error) => return Err(error.into()),
            }
        }
        let (tags, selected) = (OnceLock::new(), Mutex::default());
        Ok(Self { revision: snapshot.revision(), textures, tags, selected, began, cost: began.elapsed() })
    }

    /// The revision of the store.
    pub fn revision(&self) -> u64 {
        self.revision
    }

    /// Every texture, by ascending id.
    pub fn textures(&self) -> &[CatalogueEntry] {
        &self.textures
    }

    /// One texture.
    pub fn get(&self, id: impl Into<TextureId>) -> Option<&CatalogueEntry> {
        let id = id.into();
        let position = self.textures.binary_search_by_key(&id, |texture| texture.id).ok()?;
        self.textures.get(position)
    }

    /// The positions in [`Catalogue::textures`] of the selected textures, in the order of the selection.
    ///
    /// ```
    /// use hlacdb::{CatalogueOrder, CatalogueQuery, Database, Meta, volume::Volume};
    /// # let folder = tempfile::tempdir()?;
    /// let database = Database::open(folder.path().join("textures.hlacdb"))?;
    /// for step in [10, 9] {
    ///     let stripes = Volume::from_fn([16; 3], |z, y, x| ((z + y * step + x) * 8) as u8)?;
    ///     database.add(&stripes, Meta::named(format!("stripes {step}")))?;
    /// }
    /// let catalogue = database.catalogue(0)?;
    /// let by_name = CatalogueQuery::new().text("STRIPES").order(CatalogueOrder::Name);
    /// let names: Vec<&str> =
    ///     catalogue.select(&by_name).iter().map(|&at| &*catalogue.textures()[at as usize].name).collect();
    /// assert_eq!(names, ["stripes 9", "stripes 10"]);
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn select(&self, query: &CatalogueQuery) -> Arc<[u32]> {
        if let Some((_, positions)) = held(self.selected.lock()).iter().find(|(other, _)| other == query) {
            return Arc::clone(positions);
        }
        let positions: Arc<[u32]> = self.find(query).into();
        let mut selected = held(self.selected.lock());
        selected.truncate(CACHED_QUERIES - 1);
        selected.push_front((query.clone(), Arc::clone(&positions)));
        positions
    }

    fn find(&self, query: &CatalogueQuery) -> Vec<u32> {
        let text = query.text.trim().to_lowercase();
        let wanted = |texture: &CatalogueEntry| {
            query.filters.iter().all(|filter| texture.tag(filter.key()) == Some(filter.value()))
                && (text.is_empty() || texture.contains(&text))
        };
        let mut found: Vec<(u32, &CatalogueEntry)> =
            (0..).zip(&self.textures).filter(|(_, texture)| wanted(texture)).collect();
        // The sorts are stable, and positions ascend with ids.
        match query.order {
            CatalogueOrder::Id => {}
            CatalogueOrder::Name => found.sort_by(|(_, a), (_, b)| natural_cmp((*a.name).as_ref(), (*b.name).as_ref())),
            CatalogueOrder::Size => found.sort_by_key(|(_, texture)| texture.voxel_count()),
        }
        if query.descending {
            found.reverse();
        }
        found.into_iter().map(|(position, _)| position).collect()
    }

    /// All tags with their values, by ascending key.
    pub fn tags(&self) -> &[TagValues] {
        self.tags.get_or_init(|| {
            let mut counts: BTreeMap<&Arc<str>, BTreeMap<&Arc<str>, u64>> = BTreeMap::new();
            for (key, value) in self.textures.iter().flat_map(|texture| &texture.tags) {
                *counts.entry(key).or_default().entry(value).or_default() += 1;
            }
            let by_count = |values: BTreeMap<&Arc<str>, u64>| {
                let mut values: Vec<_> = values.into_iter().map(|(value, count)| (Arc::clone(value), count)).collect();
                values.sort_by_key(|&(_, count)| std::cmp::Reverse(count));
                values
            };
            counts
                .into_iter()
                .map(|(key, values)| TagValues { key: Arc::clone(key), values: by_count(values) })
                .collect()
        })
    }

    /// Whether it is too new to read the store again: a catalogue that took long to read is used for three times as long
    /// after that, so that a busy writer does not make its readers read all the time.
    pub(crate) fn is_fresh(&self) -> bool {
        self.cost > Duration::from_millis(2) && self.began.elapsed() < 4 * self.cost
    }
}

/// Keys and values of tags that many textures share, each in memory once.
#[derive(Default)]
struct SharedWords(HashSet<Arc<str>>);

impl SharedWords {
    fn shared(&mut self, word: &str) -> Arc<str> {
        if let Some(shared) = self.0.get(word) {
            return Arc::clone(shared);
        }
        let word: Arc<str> = word.into();
        self.0.insert(Arc::clone(&word));
        word
    }

    fn entry(&mut self, record: Record) -> CatalogueEntry {
        let tags = record.tags.iter().map(|(key, value)| (self.shared(key), self.shared(value))).collect();
        let content = record.content.as_ref();
        CatalogueEntry {
            id: record.id.into(),
            shape: content.and_then(|content| content.volume_shape()),
            channels: content.map_or(0, |content| content.channels),
            tags,
            voxels: record.voxels.is_some(),
            content: content.map(|content| ContentHash(content.hash)),
            name: record.name.into(),
        }
    }
}
