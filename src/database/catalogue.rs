//! The list of all textures in memory, for whoever pages, sorts and searches it many times: a page, a program.
//!
//! A [`Catalogue`] is one state of the store and never changes. [`Database::catalogue`] gives the newest one and reads the
//! store again only where it has changed.

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

/// A texture as a list shows it.
#[derive(Clone, Debug, Serialize)]
#[cfg_attr(feature = "serve", derive(utoipa::ToSchema))]
pub struct Listed {
    /// Its id.
    #[cfg_attr(feature = "serve", schema(value_type = u64))]
    pub id: TextureId,
    /// Its name.
    pub name: Box<str>,
    /// Axis lengths (Z, Y, X); `None` where only moments were imported.
    #[cfg_attr(feature = "serve", schema(value_type = Option<[usize; 3]>))]
    pub shape: Option<Shape>,
    /// 1 (grey) or 3 (RGB); 0 where that is not known.
    pub channels: u8,
    /// Key and value, ascending by key; a JSON object.
    #[serde(serialize_with = "as_map")]
    #[cfg_attr(feature = "serve", schema(value_type = BTreeMap<String, String>))]
    pub tags: Vec<(Arc<str>, Arc<str>)>,
    /// Whether its voxels are kept.
    pub voxels: bool,
    /// The identity of its content.
    #[serde(skip)]
    pub content: Option<ContentHash>,
}

fn as_map<S: Serializer>(tags: &[(Arc<str>, Arc<str>)], serializer: S) -> Result<S::Ok, S::Error> {
    serializer.collect_map(tags.iter().map(|(key, value)| (&**key, &**value)))
}

impl Listed {
    /// The value of a tag.
    pub fn tag(&self, key: &str) -> Option<&str> {
        self.tags.iter().find(|(other, _)| **other == *key).map(|(_, value)| &**value)
    }

    fn voxel_count(&self) -> u128 {
        self.shape.map_or(0, |shape| shape.iter().map(|&side| side as u128).product())
    }

    /// Whether the name or the value of a tag contains the text, which is in lower case.
    fn contains(&self, text: &str) -> bool {
        let within = |word: &str| word.to_lowercase().contains(text);
        within(&self.name) || self.tags.iter().any(|(_, value)| within(value))
    }
}

/// By what a list is ordered; where that is equal, by id.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum Order {
    /// By id: the order in which textures came.
    #[default]
    Id,
    /// By name, numbers in it by their value.
    Name,
    /// By the number of voxels.
    Size,
}

/// Which textures of a catalogue, and in which order.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Selection {
    /// Conditions that must all hold.
    pub filters: Vec<TagFilter>,
    /// A part of the name or of a tag's value, in upper or lower case; everything where it is empty.
    pub text: String,
    /// By what the list is ordered.
    pub order: Order,
    /// The other way round, ids included.
    pub descending: bool,
}

/// The values of a tag, and how many textures carry each.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct TagValues {
    /// The tag's key.
    pub key: Arc<str>,
    /// Value and number of textures, by falling number and then by value.
    pub values: Vec<(Arc<str>, u64)>,
}

/// So many selections are remembered: paging through a list sorts and searches once.
const REMEMBERED: usize = 16;

/// Every texture of one state of the store.
#[derive(Debug)]
pub struct Catalogue {
    pub(crate) revision: u64,
    /// By ascending id.
    textures: Vec<Listed>,
    tags: OnceLock<Vec<TagValues>>,
    selected: Mutex<VecDeque<(Selection, Arc<[u32]>)>>,
    /// When it was begun, and how long it took.
    began: Instant,
    cost: Duration,
}

impl Catalogue {
    pub(crate) fn read(snapshot: &Snapshot) -> Result<Self, Error> {
        let began = Instant::now();
        let mut words = Words::default();
        let mut textures = Vec::with_capacity(usize::try_from(snapshot.counts().textures).unwrap_or(0).min(1 << 20));
        for record in snapshot.records() {
            match record {
                Ok(record) => textures.push(words.listed(record)),
                Err(StoreError::Damage(damage)) => tracing::warn!(%damage, "a texture is left out of the list"),
                Err(error) => return Err(error.into()),
            }
        }
        let (tags, selected) = (OnceLock::new(), Mutex::default());
        Ok(Self { revision: snapshot.revision(), textures, tags, selected, began, cost: began.elapsed() })
    }

    /// The revision of the store that this is.
    pub fn revision(&self) -> u64 {
        self.revision
    }

    /// Every texture, by ascending id.
    pub fn textures(&self) -> &[Listed] {
        &self.textures
    }

    /// One texture.
    pub fn get(&self, id: impl Into<TextureId>) -> Option<&Listed> {
        let id = id.into();
        let place = self.textures.binary_search_by_key(&id, |texture| texture.id).ok()?;
        self.textures.get(place)
    }

    /// The places in [`Catalogue::textures`] of those that are asked for, in order.
    ///
    /// ```
    /// use hlacdb::{Database, Meta, Order, Selection, volume::Volume};
    /// # let folder = tempfile::tempdir()?;
    /// let database = Database::open(folder.path().join("textures.hlacdb"))?;
    /// for step in [10, 9] {
    ///     let stripes = Volume::from_fn([16; 3], |z, y, x| ((z + y * step + x) * 8) as u8)?;
    ///     database.add(&stripes, Meta::named(format!("stripes {step}")))?;
    /// }
    /// let catalogue = database.catalogue(0)?;
    /// let by_name = Selection { text: "STRIPES".into(), order: Order::Name, ..Selection::default() };
    /// let names: Vec<&str> =
    ///     catalogue.select(&by_name).iter().map(|&at| &*catalogue.textures()[at as usize].name).collect();
    /// assert_eq!(names, ["stripes 9", "stripes 10"]);
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn select(&self, selection: &Selection) -> Arc<[u32]> {
        if let Some((_, places)) = held(self.selected.lock()).iter().find(|(other, _)| other == selection) {
            return Arc::clone(places);
        }
        let places: Arc<[u32]> = self.find(selection).into();
        let mut selected = held(self.selected.lock());
        selected.truncate(REMEMBERED - 1);
        selected.push_front((selection.clone(), Arc::clone(&places)));
        places
    }

    fn find(&self, selection: &Selection) -> Vec<u32> {
        let text = selection.text.trim().to_lowercase();
        let wanted = |texture: &Listed| {
            selection.filters.iter().all(|filter| texture.tag(filter.key()) == Some(filter.value()))
                && (text.is_empty() || texture.contains(&text))
        };
        let mut found: Vec<(u32, &Listed)> = (0..).zip(&self.textures).filter(|(_, texture)| wanted(texture)).collect();
        // The sorts are stable, and the places ascend with the ids.
        match selection.order {
            Order::Id => {}
            Order::Name => found.sort_by(|(_, a), (_, b)| natural_cmp((*a.name).as_ref(), (*b.name).as_ref())),
            Order::Size => found.sort_by_key(|(_, texture)| texture.voxel_count()),
        }
        if selection.descending {
            found.reverse();
        }
        found.into_iter().map(|(place, _)| place).collect()
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

    /// Whether it is new enough that reading the store again is not worth it yet: where reading takes long, a state is
    /// shown for three times as long, so that a busy writer does not make its readers read all the time.
    pub(crate) fn is_fresh(&self) -> bool {
        self.cost > Duration::from_millis(2) && self.began.elapsed() < 4 * self.cost
    }
}

/// Words that many textures share, each kept once.
#[derive(Default)]
struct Words(HashSet<Arc<str>>);

impl Words {
    fn shared(&mut self, word: &str) -> Arc<str> {
        if let Some(known) = self.0.get(word) {
            return Arc::clone(known);
        }
        let word: Arc<str> = word.into();
        self.0.insert(Arc::clone(&word));
        word
    }

    fn listed(&mut self, record: Record) -> Listed {
        let tags = record.tags.iter().map(|(key, value)| (self.shared(key), self.shared(value))).collect();
        let content = record.content.as_ref();
        Listed {
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
