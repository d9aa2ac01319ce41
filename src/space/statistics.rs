//! Statistics of a store's textures: additive and exact.
//!
//! Features are numbers in [0, 1]; here they are integers in units of 2^-40, and everything kept is a sum of integers
//! or of products of two, in 128 bits. So the order of additions does not matter, parts can be merged, and a texture
//! that is taken back leaves not a trace, to the bit.
//!
//! What is kept depends on the feature set: moments come with their lowest and highest values, roots and pooled roots with
//! the scatter of the textures' octants. Textures that lack a view of the feature set are not counted.

use super::bytes::{Header, Reader, Writer};
use super::linalg::Matrix;
use super::scatter::{Scatter, Sign};
use super::{FeatureForm, FeatureSet, Features, SpaceError};
use crate::hlac::{MASK_COUNT, OctantSums, View};
use crate::volume::Volume;

/// One unit of a quantised feature.
const UNIT: f64 = 1.0 / (1_u64 << 40) as f64;

const STATISTICS: Header = Header { what: "statistics", magic: *b"hSta", version: 1 };
const NUISANCE: Header = Header { what: "nuisance statistics", magic: *b"hNui", version: 1 };

/// The octant scatter is kept eightfold; its estimate of a covariance is a 7th (degrees of freedom) for each texture.
const OCTANT_DIVISOR: f64 = 8.0 * 7.0;

/// A feature in units of 2^-40, to the nearest.
fn quantise(feature: f64) -> i64 {
    (feature / UNIT + 0.5) as i64
}

/// What one texture adds to the statistics of a feature set.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Contribution {
    feature_set: FeatureSet,
    features: Vec<i64>,
    /// The features of the eight octants.
    octants: Option<Vec<[i64; 8]>>,
}

impl Contribution {
    /// Of features alone; `None` where the texture lacks a view.
    pub fn of_features(feature_set: &FeatureSet, features: &Features) -> Option<Self> {
        features.is_complete().then(|| Self {
            feature_set: feature_set.clone(),
            features: features.values().iter().map(|&feature| quantise(feature)).collect(),
            octants: None,
        })
    }

    /// Of moments as [`FeatureSet::features`] takes them, without octants; `None` where the texture lacks a view.
    ///
    /// # Errors
    /// [`SpaceError::NotAMoment`].
    pub fn of_moments<'a>(
        feature_set: &FeatureSet,
        moments: impl Fn(View) -> Option<&'a [f32; MASK_COUNT]>,
    ) -> Result<Option<Self>, SpaceError> {
        Ok(Self::of_features(feature_set, &feature_set.features(moments)?))
    }

    /// Of a described texture, with its octants where the feature set's form uses them and every octant has a window;
    /// `None` where the texture lacks a view. The features are those of the moments as `f32`, as stores keep them.
    ///
    /// # Errors
    /// None that a described volume can give: [`SpaceError::NotAMoment`] for sums that are not of one.
    pub fn of_sums(feature_set: &FeatureSet, described: &[(View, OctantSums)]) -> Result<Option<Self>, SpaceError> {
        let sums_of = |view: View| described.iter().find(|(other, _)| *other == view).map(|(_, sums)| sums);
        let Some(sums) = feature_set.views().iter().map(|&view| sums_of(view)).collect::<Option<Vec<_>>>() else {
            return Ok(None);
        };
        let features = |descriptors: Vec<[f32; MASK_COUNT]>| {
            let at = |view: View| feature_set.views().iter().position(|&other| other == view);
            feature_set.features(|view| descriptors.get(at(view)?))
        };
        let whole = features(sums.iter().map(|sums| sums.total().descriptor()).collect())?;
        let mut contribution = Self::of_features(feature_set, &whole);
        let has_octants = sums.iter().all(|sums| sums.octants().iter().all(|octant| octant.windows > 0));
        if feature_set.form() != FeatureForm::Moments && has_octants {
            let mut octants = vec![[0; 8]; feature_set.dims()];
            for octant in 0..8 {
                let part = features(sums.iter().map(|sums| sums.octants()[octant].descriptor()).collect())?;
                for (out, &feature) in octants.iter_mut().zip(part.values()) {
                    out[octant] = quantise(feature);
                }
            }
            if let Some(contribution) = &mut contribution {
                contribution.octants = Some(octants);
            }
        }
        Ok(contribution)
    }

    /// The feature set.
    pub fn feature_set(&self) -> &FeatureSet {
        &self.feature_set
    }
}

/// The lowest and highest value of each feature.
#[derive(Clone, Debug, PartialEq, Eq)]
struct Extremes {
    lowest: Vec<i64>,
    highest: Vec<i64>,
    /// False once a texture was removed that had one of them: they then only bound the true ones.
    exact: bool,
}

impl Extremes {
    /// Of no texture: every value is lower than the lowest.
    fn new(dims: usize) -> Self {
        Self { lowest: vec![i64::MAX; dims], highest: vec![i64::MIN; dims], exact: true }
    }

    fn add(&mut self, features: &[i64]) {
        self.widen(features, features);
    }

    fn merge(&mut self, other: &Self) {
        self.widen(&other.lowest, &other.highest);
        self.exact &= other.exact;
    }

    fn widen(&mut self, lowest: &[i64], highest: &[i64]) {
        self.lowest.iter_mut().zip(lowest).for_each(|(lowest, &other)| *lowest = other.min(*lowest));
        self.highest.iter_mut().zip(highest).for_each(|(highest, &other)| *highest = other.max(*highest));
    }

    fn remove(&mut self, features: &[i64]) {
        let inside = features.iter().zip(&self.lowest).zip(&self.highest).all(|((f, l), h)| l < f && f < h);
        self.exact &= inside;
    }
}

/// Additive statistics of the textures of a store under one feature set.
///
/// ```
/// use hlacdb::space::{Contribution, FeatureSet, Statistics};
/// use hlacdb::volume::Volume;
/// let feature_set = FeatureSet::plain();
/// let mut statistics = Statistics::new(&feature_set);
/// for level in [0, 255] {
///     let described = hlacdb::describe(&Volume::new([4, 4, 4], 1, vec![level; 64])?, feature_set.views());
///     statistics.add(&Contribution::of_sums(&feature_set, &described)?.ok_or("too small")?)?;
/// }
/// assert_eq!((statistics.count(), statistics.mean()[0], statistics.deviation()[0]), (2, 0.5, 0.5));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Statistics {
    feature_set: FeatureSet,
    count: u64,
    sums: Vec<i128>,
    products: Scatter,
    octants: Option<(u64, Scatter)>,
    extremes: Option<Extremes>,
}

impl Statistics {
    /// The statistics of no texture.
    pub fn new(feature_set: &FeatureSet) -> Self {
        let dims = feature_set.dims();
        let plain = feature_set.form() == FeatureForm::Moments;
        Self {
            feature_set: feature_set.clone(),
            count: 0,
            sums: vec![0; dims],
            products: Scatter::new(dims),
            octants: (!plain).then(|| (0, Scatter::new(dims))),
            extremes: plain.then(|| Extremes::new(dims)),
        }
    }

    /// The feature set.
    pub fn feature_set(&self) -> &FeatureSet {
        &self.feature_set
    }

    /// How many textures are counted.
    pub fn count(&self) -> u64 {
        self.count
    }

    /// How many of them came with octants.
    pub fn octant_count(&self) -> u64 {
        self.octants.as_ref().map_or(0, |(count, _)| *count)
    }

    /// Counts a texture.
    ///
    /// # Errors
    /// [`SpaceError::FeatureSet`].
    pub fn add(&mut self, texture: &Contribution) -> Result<(), SpaceError> {
        check(&self.feature_set, &texture.feature_set)?;
        self.count += 1;
        self.apply(texture, Sign::Add);
        if let Some(extremes) = &mut self.extremes {
            extremes.add(&texture.features);
        }
        Ok(())
    }

    /// Counts many textures: the same as [`Statistics::add`] one by one, to the bit, and much quicker.
    ///
    /// # Errors
    /// [`SpaceError::FeatureSet`], and nothing is counted.
    pub fn add_all<'a>(&mut self, textures: impl Iterator<Item = &'a Contribution> + Clone) -> Result<(), SpaceError> {
        textures.clone().try_for_each(|texture| check(&self.feature_set, &texture.feature_set))?;
        self.products.outer_all(textures.clone().map(|texture| texture.features.as_slice()));
        for texture in textures {
            self.count += 1;
            self.apply_small(texture, Sign::Add);
            if let Some(extremes) = &mut self.extremes {
                extremes.add(&texture.features);
            }
        }
        Ok(())
    }

    /// Takes a texture back: afterwards the statistics are, to the bit, as if it had never been added, extremes
    /// excepted (see [`Statistics::extremes`]). A contribution without octants takes the features back only; the
    /// octants stay until the statistics are built anew.
    ///
    /// # Errors
    /// [`SpaceError::FeatureSet`]; [`SpaceError::Overdrawn`] where no texture is left to take.
    pub fn remove(&mut self, texture: &Contribution) -> Result<(), SpaceError> {
        check(&self.feature_set, &texture.feature_set)?;
        let overdrawn =
            self.count == 0 || (texture.octants.is_some() && self.octants.is_some() && self.octant_count() == 0);
        if overdrawn {
            return Err(SpaceError::Overdrawn { feature_set: self.feature_set.key() });
        }
        self.count -= 1;
        self.apply(texture, Sign::Remove);
        match &mut self.extremes {
            Some(extremes) if self.count == 0 => *extremes = Extremes::new(self.sums.len()),
            Some(extremes) => extremes.remove(&texture.features),
            None => {}
        }
        Ok(())
    }

    /// What adding and removing have in common.
    fn apply(&mut self, texture: &Contribution, sign: Sign) {
        self.products.outer(&texture.features, sign);
        self.apply_small(texture, sign);
    }

    /// The same but for the products of features.
    fn apply_small(&mut self, texture: &Contribution, sign: Sign) {
        for (sum, &feature) in self.sums.iter_mut().zip(&texture.features) {
            *sum += i128::from(if sign == Sign::Add { feature } else { -feature });
        }
        if let (Some((count, scatter)), Some(octants)) = (&mut self.octants, &texture.octants) {
            *count = if sign == Sign::Add { *count + 1 } else { *count - 1 };
            scatter.octants(octants, sign);
        }
    }

    /// Adds the textures that `other` counts.
    ///
    /// # Errors
    /// [`SpaceError::FeatureSet`].
    pub fn merge(&mut self, other: &Self) -> Result<(), SpaceError> {
        check(&self.feature_set, &other.feature_set)?;
        self.count += other.count;
        self.sums.iter_mut().zip(&other.sums).for_each(|(sum, other)| *sum += other);
        self.products += &other.products;
        if let (Some((count, scatter)), Some((other_count, other))) = (&mut self.octants, &other.octants) {
            *count += other_count;
            *scatter += other;
        }
        if let (Some(extremes), Some(other)) = (&mut self.extremes, &other.extremes) {
            extremes.merge(other);
        }
        Ok(())
    }

    /// The mean of each feature; 0 where there is no texture.
    pub fn mean(&self) -> Vec<f64> {
        let count = self.count.max(1) as f64;
        self.sums.iter().map(|&sum| sum as f64 * UNIT / count).collect()
    }

    /// The standard deviation of each feature over the textures (divided by their number).
    pub fn deviation(&self) -> Vec<f64> {
        let centred = Centred::of(self);
        self.products.rows().enumerate().map(|(at, row)| centred.at(row[0], at, at).max(0.0).sqrt()).collect()
    }

    /// The covariance matrix over the textures (divided by their number), row-major.
    pub fn covariance(&self) -> Vec<f64> {
        self.between().into_values()
    }

    pub(super) fn between(&self) -> Matrix {
        let centred = Centred::of(self);
        symmetric(&self.products, |value, row, column| centred.at(value, row, column))
    }

    /// The covariance of an octant about its texture's mean over octants.
    pub(super) fn within(&self) -> Option<Matrix> {
        let (count, scatter) = self.octants.as_ref()?;
        let scale = UNIT * UNIT / (OCTANT_DIVISOR * (*count).max(1) as f64);
        Some(symmetric(scatter, |value, _, _| value as f64 * scale))
    }

    /// The lowest and the highest value of each feature (of moments; other forms have none).
    ///
    /// `None` also where there is no texture, and where one was removed that had an extreme value: then
    /// [`Statistics::renew_extremes`] with all that are left gives them back.
    pub fn extremes(&self) -> Option<(Vec<f64>, Vec<f64>)> {
        let extremes = self.extremes.as_ref().filter(|extremes| extremes.exact && self.count > 0)?;
        let numbers = |values: &[i64]| values.iter().map(|&value| value as f64 * UNIT).collect();
        Some((numbers(&extremes.lowest), numbers(&extremes.highest)))
    }

    /// Whether the extremes have to be made anew by [`Statistics::renew_extremes`].
    pub fn extremes_are_stale(&self) -> bool {
        self.extremes.as_ref().is_some_and(|extremes| !extremes.exact)
    }

    /// Makes the extremes anew from all the textures that are counted (octants are not looked at). Other forms than
    /// moments have none, and nothing happens. The textures are looked at one after the other, as they come.
    ///
    /// # Errors
    /// Those that the textures come with; [`SpaceError::FeatureSet`]; [`SpaceError::Overdrawn`] where it is not as many
    /// textures as are counted. The extremes are then as they were.
    pub fn renew_extremes<E: From<SpaceError>>(
        &mut self,
        textures: impl IntoIterator<Item = Result<Contribution, E>>,
    ) -> Result<(), E> {
        let mut renewed = Extremes::new(self.sums.len());
        let mut count = 0;
        for texture in textures {
            let texture = texture?;
            check(&self.feature_set, &texture.feature_set)?;
            renewed.add(&texture.features);
            count += 1;
        }
        if count != self.count {
            return Err(SpaceError::Overdrawn { feature_set: self.feature_set.key() }.into());
        }
        if let Some(extremes) = &mut self.extremes {
            *extremes = renewed;
        }
        Ok(())
    }

    /// The bytes that [`Statistics::decode`] reads: versioned and checked, the same for the same statistics.
    ///
    /// Feature set (form u8, views as a list of u8 codes), count u64, sums and products packed; then for moments: 1 where
    /// extremes are exact, else 0 (u8), lowest and highest packed; for other forms: octant count u64, scatter packed.
    pub fn encode(&self) -> Vec<u8> {
        let mut writer = Writer::new(STATISTICS);
        write_recipe(&mut writer, &self.feature_set);
        writer.u64(self.count);
        writer.packed(&self.sums);
        writer.packed(self.products.values());
        if let Some(extremes) = &self.extremes {
            let wide = |values: &[i64]| values.iter().map(|&value| i128::from(value)).collect::<Vec<_>>();
            writer.u8(u8::from(extremes.exact));
            writer.packed(&wide(&extremes.lowest));
            writer.packed(&wide(&extremes.highest));
        }
        if let Some((count, scatter)) = &self.octants {
            writer.u64(*count);
            writer.packed(scatter.values());
        }
        writer.finish()
    }

    /// The statistics that were encoded.
    ///
    /// # Errors
    /// [`SpaceError::Damaged`], [`SpaceError::Version`].
    pub fn decode(bytes: &[u8]) -> Result<Self, SpaceError> {
        let mut reader = Reader::new(STATISTICS, bytes)?;
        let mut statistics = Self::new(&read_recipe(&mut reader)?);
        let dims = statistics.feature_set.dims();
        statistics.count = reader.u64()?;
        statistics.sums = reader.packed(dims)?;
        statistics.products = read_scatter(&mut reader, dims)?;
        if let Some(extremes) = &mut statistics.extremes {
            extremes.exact = reader.u8()? != 0;
            for values in [&mut extremes.lowest, &mut extremes.highest] {
                let narrow: Result<_, _> = reader.packed(dims)?.into_iter().map(i64::try_from).collect();
                *values = narrow.map_err(|_| reader.damaged("an extreme in it is too large"))?;
            }
        }
        if let Some(octants) = &mut statistics.octants {
            *octants = (reader.u64()?, read_scatter(&mut reader, dims)?);
        }
        reader.finish()?;
        Ok(statistics)
    }
}

/// The mean of integers, split so that products with it stay exact.
struct Centred {
    count: i128,
    sums: Vec<i128>,
}

impl Centred {
    fn of(statistics: &Statistics) -> Self {
        Self { count: i128::from(statistics.count.max(1)), sums: statistics.sums.clone() }
    }

    /// A covariance from the sum of products `value`: `(value - sum sum' / count) / count`.
    ///
    /// With `sum = count mean + rest` all that is large is subtracted in integers; what is left is divided in `f64`.
    fn at(&self, value: i128, row: usize, column: usize) -> f64 {
        let (a, b) = (self.sums[row], self.sums[column]);
        let (mean, other) = (a.div_euclid(self.count), b.div_euclid(self.count));
        let (rest, other_rest) = (a.rem_euclid(self.count), b.rem_euclid(self.count));
        let large = value - mean * b - other * rest;
        let count = self.count as f64;
        (large as f64 - rest as f64 * (other_rest as f64 / count)) / count * (UNIT * UNIT)
    }
}

/// A full matrix from a triangle.
fn symmetric(scatter: &Scatter, value: impl Fn(i128, usize, usize) -> f64) -> Matrix {
    let dims = scatter.rows().count();
    let mut matrix = Matrix::zero(dims, dims);
    for (row, values) in scatter.rows().enumerate() {
        for (at, &scatter) in values.iter().enumerate() {
            let value = value(scatter, row, row + at);
            matrix[(row, row + at)] = value;
            matrix[(row + at, row)] = value;
        }
    }
    matrix
}

fn check(expected: &FeatureSet, found: &FeatureSet) -> Result<(), SpaceError> {
    if expected == found {
        return Ok(());
    }
    Err(SpaceError::FeatureSet { expected: expected.key(), found: found.key() })
}

pub(super) fn write_recipe(writer: &mut Writer, feature_set: &FeatureSet) {
    writer.u8(feature_set.form().code());
    writer.bytes(&feature_set.views().iter().map(|view| view.code()).collect::<Vec<_>>());
}

pub(super) fn read_recipe(reader: &mut Reader<'_>) -> Result<FeatureSet, SpaceError> {
    let form = FeatureForm::from_code(reader.u8()?).ok_or(reader.damaged("it names an unknown form"))?;
    let views: Option<Vec<_>> = reader.bytes()?.iter().map(|&code| View::from_code(code)).collect();
    let views = views.ok_or(reader.damaged("it names an unknown view"))?;
    // In the one order that a feature set has: the same statistics have the same bytes only.
    let feature_set = FeatureSet::new(form, &views).ok().filter(|feature_set| feature_set.views() == views);
    feature_set.ok_or(reader.damaged("its views are not in order"))
}

fn read_scatter(reader: &mut Reader<'_>, dims: usize) -> Result<Scatter, SpaceError> {
    let values = reader.packed(Scatter::length(dims))?;
    Scatter::from_values(dims, values).ok_or(reader.damaged("a list in it has the wrong length"))
}

/// How much features change under what should not matter: pairs of a texture and a copy of it under nuisances.
///
/// Additive and exact, like [`Statistics`].
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct NuisanceStatistics {
    feature_set: FeatureSet,
    count: u64,
    scatter: Scatter,
}

impl NuisanceStatistics {
    /// Of no pair.
    pub fn new(feature_set: &FeatureSet) -> Self {
        Self { feature_set: feature_set.clone(), count: 0, scatter: Scatter::new(feature_set.dims()) }
    }

    /// The feature set.
    pub fn feature_set(&self) -> &FeatureSet {
        &self.feature_set
    }

    /// How many pairs were seen.
    pub fn count(&self) -> u64 {
        self.count
    }

    /// Counts a texture and a copy of it. Octants are not looked at.
    ///
    /// # Errors
    /// [`SpaceError::FeatureSet`].
    pub fn add(&mut self, texture: &Contribution, copy: &Contribution) -> Result<(), SpaceError> {
        check(&self.feature_set, &texture.feature_set)?;
        check(&self.feature_set, &copy.feature_set)?;
        let difference: Vec<i64> = texture.features.iter().zip(&copy.features).map(|(a, b)| a - b).collect();
        self.scatter.outer(&difference, Sign::Add);
        self.count += 1;
        Ok(())
    }

    /// Describes a texture and a copy of it and counts the pair; false where they lack a view and nothing is counted.
    ///
    /// # Errors
    /// None that volumes can give.
    pub fn observe(&mut self, texture: &Volume, copy: &Volume) -> Result<bool, SpaceError> {
        let contribution =
            |volume| Contribution::of_sums(&self.feature_set, &crate::describe(volume, self.feature_set.views()));
        let pair = contribution(texture)?.zip(contribution(copy)?);
        pair.as_ref().map_or(Ok(()), |(texture, copy)| self.add(texture, copy))?;
        Ok(pair.is_some())
    }

    /// Adds the pairs that `other` counts.
    ///
    /// # Errors
    /// [`SpaceError::FeatureSet`].
    pub fn merge(&mut self, other: &Self) -> Result<(), SpaceError> {
        check(&self.feature_set, &other.feature_set)?;
        self.count += other.count;
        self.scatter += &other.scatter;
        Ok(())
    }

    /// Half the mean outer product of the differences: the covariance of a copy about its texture.
    pub(super) fn covariance(&self) -> Matrix {
        let scale = UNIT * UNIT / (2.0 * self.count.max(1) as f64);
        symmetric(&self.scatter, |value, _, _| value as f64 * scale)
    }

    /// The bytes that [`NuisanceStatistics::decode`] reads: feature set (form u8, views as a list of u8 codes), count u64, scatter
    /// packed.
    pub fn encode(&self) -> Vec<u8> {
        let mut writer = Writer::new(NUISANCE);
        write_recipe(&mut writer, &self.feature_set);
        writer.u64(self.count);
        writer.packed(self.scatter.values());
        writer.finish()
    }

    /// What was encoded.
    ///
    /// # Errors
    /// [`SpaceError::Damaged`], [`SpaceError::Version`].
    pub fn decode(bytes: &[u8]) -> Result<Self, SpaceError> {
        let mut reader = Reader::new(NUISANCE, bytes)?;
        let feature_set = read_recipe(&mut reader)?;
        let count = reader.u64()?;
        let scatter = read_scatter(&mut reader, feature_set.dims())?;
        reader.finish()?;
        Ok(Self { feature_set, count, scatter })
    }
}

#[cfg(test)]
mod tests;
