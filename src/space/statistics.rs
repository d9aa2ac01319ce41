//! [`Statistics`] of a store's textures: additive and exact.
//!
//! Features are numbers in [0, 1]; here they are integers in units of 2^-40, and all sums are sums of integers, or of
//! products of two, in 128 bits. The order of additions therefore does not matter, partial sums can be merged, and
//! removing a texture restores the statistics without it, to the bit.
//!
//! Statistics of moments include the lowest and highest value of each feature; those of degree roots and of pooled
//! features include the scatter of each texture's octants. Textures that lack a view of the feature set are not counted.

use super::codec::{Header, Reader, Writer, read_feature_set, write_feature_set};
use super::contribution::UNIT;
use super::linalg::Matrix;
use super::scatter::{Scatter, Sign};
use super::{Contribution, FeatureForm, FeatureSet, SpaceError};

const STATISTICS: Header = Header { what: "statistics", magic: *b"hSta", version: 1 };

/// The octant scatter is stored times 8, and the covariance of eight octants about their mean has 7 degrees of freedom.
const OCTANT_DIVISOR: f64 = 8.0 * 7.0;

/// The lowest and highest value of each feature.
#[derive(Clone, Debug, PartialEq, Eq)]
struct Extremes {
    lowest: Vec<i64>,
    highest: Vec<i64>,
    /// False once a texture with an extreme value was removed: the values then only bound the true ones.
    exact: bool,
}

impl Extremes {
    /// The extremes of no texture: any value replaces them.
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
    #[doc(hidden)]
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

    /// The number of textures.
    pub fn count(&self) -> u64 {
        self.count
    }

    /// The number of textures that were added with octants.
    pub fn octant_count(&self) -> u64 {
        self.octants.as_ref().map_or(0, |(count, _)| *count)
    }

    /// Adds a texture.
    ///
    /// # Errors
    /// [`SpaceError::FeatureSet`].
    #[doc(hidden)]
    pub fn add(&mut self, texture: &Contribution) -> Result<(), SpaceError> {
        self.feature_set.require(&texture.feature_set)?;
        self.count += 1;
        self.apply(texture, Sign::Add);
        if let Some(extremes) = &mut self.extremes {
            extremes.add(&texture.features);
        }
        Ok(())
    }

    /// Adds many textures: the same as [`Statistics::add`] one by one, to the bit, and much faster.
    ///
    /// # Errors
    /// [`SpaceError::FeatureSet`]; nothing is added then.
    #[doc(hidden)]
    pub fn add_all<'a>(&mut self, textures: impl Iterator<Item = &'a Contribution> + Clone) -> Result<(), SpaceError> {
        textures.clone().try_for_each(|texture| self.feature_set.require(&texture.feature_set))?;
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

    /// Removes a texture. Afterwards the statistics are, to the bit, as if it had never been added, except for the
    /// extremes (see [`Statistics::extremes`]). A contribution without octants removes the features only; octants that
    /// were added stay until the statistics are rebuilt.
    ///
    /// # Errors
    /// [`SpaceError::FeatureSet`]; [`SpaceError::Overdrawn`] where the statistics count no texture.
    #[doc(hidden)]
    pub fn remove(&mut self, texture: &Contribution) -> Result<(), SpaceError> {
        self.feature_set.require(&texture.feature_set)?;
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

    /// The part that adding and removing share.
    fn apply(&mut self, texture: &Contribution, sign: Sign) {
        self.products.outer(&texture.features, sign);
        self.apply_small(texture, sign);
    }

    /// As `apply`, without the products of features.
    fn apply_small(&mut self, texture: &Contribution, sign: Sign) {
        for (sum, &feature) in self.sums.iter_mut().zip(&texture.features) {
            *sum += i128::from(if sign == Sign::Add { feature } else { -feature });
        }
        if let (Some((count, scatter)), Some(octants)) = (&mut self.octants, &texture.octants) {
            *count = if sign == Sign::Add { *count + 1 } else { *count - 1 };
            scatter.octants(octants, sign);
        }
    }

    /// Adds the textures of `other`.
    ///
    /// # Errors
    /// [`SpaceError::FeatureSet`].
    #[doc(hidden)]
    pub fn merge(&mut self, other: &Self) -> Result<(), SpaceError> {
        self.feature_set.require(&other.feature_set)?;
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

    /// The mean of each feature; 0 where no texture is counted.
    pub fn mean(&self) -> Vec<f64> {
        let count = self.count.max(1) as f64;
        self.sums.iter().map(|&sum| sum as f64 * UNIT / count).collect()
    }

    /// The standard deviation of each feature over the textures (the population's: divided by their number).
    pub fn deviation(&self) -> Vec<f64> {
        let centred = Centred::of(self);
        self.products.rows().enumerate().map(|(at, row)| centred.at(row[0], at, at).max(0.0).sqrt()).collect()
    }

    /// The covariance matrix of the features over the textures (divided by their number): row-major, `dims * dims`.
    pub fn covariance(&self) -> Vec<f64> {
        self.between().into_values()
    }

    /// The covariance over the textures.
    pub(super) fn between(&self) -> Matrix {
        let centred = Centred::of(self);
        self.products.to_matrix(|value, row, column| centred.at(value, row, column))
    }

    /// The covariance of an octant about the mean of its texture's octants; `None` for moments, which have no octants.
    pub(super) fn within(&self) -> Option<Matrix> {
        let (count, scatter) = self.octants.as_ref()?;
        let scale = UNIT * UNIT / (OCTANT_DIVISOR * (*count).max(1) as f64);
        Some(scatter.to_matrix(|value, _, _| value as f64 * scale))
    }

    /// The lowest and the highest value of each feature, of moments; other forms have none.
    ///
    /// `None` also where no texture is counted, and after a texture with an extreme value was removed, until
    /// [`Statistics::renew_extremes`] computes them again.
    pub fn extremes(&self) -> Option<(Vec<f64>, Vec<f64>)> {
        let extremes = self.extremes.as_ref().filter(|extremes| extremes.exact && self.count > 0)?;
        let numbers = |values: &[i64]| values.iter().map(|&value| value as f64 * UNIT).collect();
        Some((numbers(&extremes.lowest), numbers(&extremes.highest)))
    }

    /// Whether the extremes must be computed again by [`Statistics::renew_extremes`].
    pub fn extremes_are_stale(&self) -> bool {
        self.extremes.as_ref().is_some_and(|extremes| !extremes.exact)
    }

    /// Computes the extremes again from all textures that are counted, in any order; octants are not used. Does nothing
    /// for forms without extremes.
    ///
    /// # Errors
    /// The first error among the textures; [`SpaceError::FeatureSet`]; [`SpaceError::Overdrawn`] where their number is
    /// not [`Statistics::count`]. The extremes are unchanged then.
    #[doc(hidden)]
    pub fn renew_extremes<E: From<SpaceError>>(
        &mut self,
        textures: impl IntoIterator<Item = Result<Contribution, E>>,
    ) -> Result<(), E> {
        let mut renewed = Extremes::new(self.sums.len());
        let mut count = 0;
        for texture in textures {
            let texture = texture?;
            self.feature_set.require(&texture.feature_set)?;
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

    /// The bytes that [`Statistics::decode`] reads: versioned, with a checksum, the same for the same statistics.
    ///
    /// Feature set (form u8, views as a list of u8 codes), count u64, sums and products packed; then for moments: 1 where
    /// extremes are exact, else 0 (u8), lowest and highest packed; for other forms: octant count u64, scatter packed.
    #[doc(hidden)]
    pub fn encode(&self) -> Vec<u8> {
        let mut writer = Writer::new(STATISTICS);
        write_feature_set(&mut writer, &self.feature_set);
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

    /// Reads what [`Statistics::encode`] wrote.
    ///
    /// # Errors
    /// [`SpaceError::Damaged`], [`SpaceError::Version`].
    #[doc(hidden)]
    pub fn decode(bytes: &[u8]) -> Result<Self, SpaceError> {
        let mut reader = Reader::new(STATISTICS, bytes)?;
        let mut statistics = Self::new(&read_feature_set(&mut reader)?);
        let dims = statistics.feature_set.dims();
        statistics.count = reader.u64()?;
        statistics.sums = reader.packed(dims)?;
        statistics.products = Scatter::read(&mut reader, dims)?;
        if let Some(extremes) = &mut statistics.extremes {
            extremes.exact = reader.u8()? != 0;
            for values in [&mut extremes.lowest, &mut extremes.highest] {
                let narrow: Result<_, _> = reader.packed(dims)?.into_iter().map(i64::try_from).collect();
                *values = narrow.map_err(|_| reader.damaged("an extreme in it is too large"))?;
            }
        }
        if let Some(octants) = &mut statistics.octants {
            *octants = (reader.u64()?, Scatter::read(&mut reader, dims)?);
        }
        reader.finish()?;
        Ok(statistics)
    }
}

/// Sums of integers, with which products can be centred exactly.
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
    /// With `sum = count * mean + rest`, everything large is subtracted in integers; only the rest is divided in `f64`.
    fn at(&self, value: i128, row: usize, column: usize) -> f64 {
        let (a, b) = (self.sums[row], self.sums[column]);
        let (mean, other) = (a.div_euclid(self.count), b.div_euclid(self.count));
        let (rest, other_rest) = (a.rem_euclid(self.count), b.rem_euclid(self.count));
        let large = value - mean * b - other * rest;
        let count = self.count as f64;
        (large as f64 - rest as f64 * (other_rest as f64 / count)) / count * (UNIT * UNIT)
    }
}

#[cfg(test)]
mod tests;
