//! [`Space`]: a fitted definition, from features to points.

use super::bytes::{Header, Reader, Writer};
use super::fit::{Model, Projection, inverse_deviation};
use super::linalg::Matrix;
use super::statistics::{read_recipe, write_recipe};
use super::{
    Definition, Feature, FeatureForm, FeatureSet, Features, Metric, NuisanceStatistics, Prior, SpaceError, SpaceKind,
    Statistics,
};
use crate::hlac::{MASK_COUNT, MASKS, View};

const SPACE: Header = Header { what: "space", magic: *b"hSpa", version: 1 };

/// How many of the features that go with an axis are named.
const NAMED: usize = 3;

/// A fitted space: the map from a texture's features to its point.
///
/// The same features give the same point to the bit, always; a space never gives NaN or infinity. A view that a texture
/// does not have counts as average (`z = 0`); a texture that has none of the views, or is average in every respect, is
/// the origin.
///
/// ```
/// use hlacdb::space::{Definition, Prior, Space, Statistics};
/// use hlacdb::volume::Volume;
/// let definition = Definition::built_in("paper").ok_or("no such space")?;
/// let space = Space::fit(&definition, &Statistics::new(&definition.feature_set), None, &Prior::none())?;
/// let described = hlacdb::describe(&Volume::new([4, 4, 4], 1, vec![2; 64])?, definition.feature_set.views());
/// let moments = described[0].1.total().descriptor();
/// let point = space.point(&space.feature_set().features(|_| Some(&moments))?)?;
/// assert_eq!(point[0], 2.0);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct Space {
    pub(super) definition: Definition,
    epoch: u64,
    pub(super) map: Map,
    origin: Origin,
}

/// From features to a point.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Map {
    /// `x * factor`, divided by twice its sum where `share`.
    Histogram { share: bool },
    /// `(x - mean) * scale`.
    Scaled { mean: Vec<f64>, scale: Vec<f64> },
    /// `(x - mean) weights`, scaled to unit length.
    Likeness(Projection),
}

/// The store's own statistics at the time of the fit, which drift is measured from.
#[derive(Clone, Debug, PartialEq)]
struct Origin {
    /// Textures then; with none, mean and variances are the prior's.
    count: u64,
    mean: Vec<f64>,
    /// Of each coordinate, before the scaling to unit length.
    variances: Vec<f64>,
}

impl Space {
    /// Fits a definition on a store's statistics (of the definition's feature set) and a prior. Nuisance statistics of the
    /// store's own, where given, take the place of the prior's.
    ///
    /// Any statistics will do: with those of no texture the prior carries the space; with neither, all points are the
    /// origin. The epoch is 0: see [`Space::with_epoch`].
    ///
    /// # Errors
    /// Those of [`Definition::check`]; [`SpaceError::FeatureSet`] for statistics of another feature set.
    pub fn fit(
        definition: &Definition,
        statistics: &Statistics,
        nuisance: Option<&NuisanceStatistics>,
        prior: &Prior,
    ) -> Result<Self, SpaceError> {
        definition.check()?;
        for found in
            [Some(statistics.feature_set()), nuisance.map(NuisanceStatistics::feature_set)].into_iter().flatten()
        {
            if *found != definition.feature_set {
                return Err(SpaceError::FeatureSet { expected: definition.feature_set.key(), found: found.key() });
            }
        }
        let map = match definition.kind {
            SpaceKind::Histogram => Map::Histogram { share: false },
            SpaceKind::Intersection => Map::Histogram { share: true },
            SpaceKind::ZScore => {
                let scale = statistics.deviation().iter().map(|d| inverse_deviation(d * d)).collect();
                Map::Scaled { mean: statistics.mean(), scale }
            }
            SpaceKind::Likeness { nuisance: weight, dims } => {
                let known = prior.model(&definition.feature_set);
                let known = known.as_ref().map(|model| (prior.weight(), model));
                Map::Likeness(Projection::fit(Model::combine(statistics, nuisance, known), weight, dims))
            }
        };
        let origin = Origin::of(&map, statistics);
        Ok(Self { definition: definition.clone(), epoch: 0, map, origin })
    }

    /// The same space under another epoch: the number that the owner gives to each fit.
    pub fn with_epoch(self, epoch: u64) -> Self {
        Self { epoch, ..self }
    }

    /// The epoch.
    pub fn epoch(&self) -> u64 {
        self.epoch
    }

    /// The name.
    pub fn name(&self) -> &str {
        &self.definition.name
    }

    /// What it was fitted to be.
    pub fn definition(&self) -> &Definition {
        &self.definition
    }

    /// The features it looks at.
    pub fn feature_set(&self) -> &FeatureSet {
        &self.definition.feature_set
    }

    /// The distance between points.
    pub fn metric(&self) -> Metric {
        self.definition.metric()
    }

    /// How many coordinates a point has.
    pub fn dims(&self) -> usize {
        self.definition.dims()
    }

    /// How many textures the store had when the space was fitted.
    pub fn textures_at_fit(&self) -> u64 {
        self.origin.count
    }

    /// The point of a texture with these features: [`Space::dims`] finite numbers.
    ///
    /// # Errors
    /// [`SpaceError::FeatureSet`] for features of another number than the feature set's.
    pub fn point(&self, features: &Features) -> Result<Vec<f32>, SpaceError> {
        Ok(self.exact_point(features)?.iter().map(|&coordinate| coordinate as f32).collect())
    }

    /// The points of many textures, one after the other: `moments(row, view)` are the moments of a view of texture
    /// `row`, as [`FeatureSet::features`] takes them.
    ///
    /// # Errors
    /// [`SpaceError::NotAMoment`].
    pub fn points<'a>(
        &self,
        rows: usize,
        moments: impl Fn(usize, View) -> Option<&'a [f32; MASK_COUNT]>,
    ) -> Result<Vec<f32>, SpaceError> {
        let mut points = Vec::with_capacity(rows * self.dims());
        for row in 0..rows {
            let features = self.feature_set().features(|view| moments(row, view))?;
            points.extend(self.exact_point(&features)?.iter().map(|&coordinate| coordinate as f32));
        }
        Ok(points)
    }

    /// The point before it is rounded.
    pub(super) fn exact_point(&self, features: &Features) -> Result<Vec<f64>, SpaceError> {
        let mut point = self.raw_point(features)?;
        if let Map::Likeness(_) = self.map {
            let length = self.length(&point);
            if length > 0.0 {
                point.iter_mut().for_each(|coordinate| *coordinate /= length);
            }
        }
        Ok(point)
    }

    /// The point before it is scaled to unit length.
    pub(super) fn raw_point(&self, features: &Features) -> Result<Vec<f64>, SpaceError> {
        let feature_set = self.feature_set();
        if features.values().len() != feature_set.dims() {
            let found = format!("{} numbers", features.values().len());
            return Err(SpaceError::FeatureSet { expected: feature_set.key(), found });
        }
        let present = present(feature_set, features);
        Ok(match &self.map {
            Map::Histogram { share } => {
                let mut point: Vec<f64> =
                    features.values().iter().enumerate().map(|(at, x)| x * bin(feature_set, at)).collect();
                let total: f64 = point.iter().sum();
                if *share && total > 0.0 {
                    point.iter_mut().for_each(|bin| *bin /= 2.0 * total);
                }
                point
            }
            Map::Scaled { mean, scale } => {
                let scaled = present.zip(mean).zip(scale);
                scaled.map(|((x, mean), scale)| x.map_or(0.0, |x| (x - mean) * scale)).collect()
            }
            Map::Likeness(projection) => projection.project(present),
        })
    }

    /// The length of a point.
    pub(super) fn length(&self, point: &[f64]) -> f64 {
        point.iter().map(|coordinate| coordinate * coordinate).sum::<f64>().sqrt()
    }

    /// The axes of a likeness space, by falling variance, and what they mean; none for other spaces.
    pub fn axes(&self) -> Vec<SpaceAxis> {
        let Map::Likeness(projection) = &self.map else { return Vec::new() };
        let total: f64 = projection.variances.iter().sum();
        let real = projection.variances.iter().enumerate().filter(|(_, variance)| **variance > 0.0);
        real.map(|(at, &variance)| SpaceAxis {
            variance: variance / total,
            views: self.view_shares(projection, at),
            features: self.named_features(projection, at),
        })
        .collect()
    }

    /// Each view's share of the variance of a coordinate: the covariance of its part of the sum with the whole.
    fn view_shares(&self, projection: &Projection, axis: usize) -> Vec<(View, f64)> {
        let feature_set = self.feature_set();
        let per_view = feature_set.form().per_view();
        let deviation = projection.variances[axis].sqrt();
        let share = |feature: usize| {
            // weight * sd of the feature * correlation * sd of the coordinate, by the variance of the coordinate.
            let weight = projection.weights[(feature, axis)] * projection.deviations[feature];
            weight * projection.correlations[(feature, axis)] / deviation
        };
        let views = feature_set.views().iter().enumerate();
        views.map(|(at, &view)| (view, (at * per_view..(at + 1) * per_view).map(share).sum())).collect()
    }

    /// The features that go most with a coordinate.
    fn named_features(&self, projection: &Projection, axis: usize) -> Vec<(Feature, f64)> {
        let correlation = |feature: usize| projection.correlations[(feature, axis)];
        let mut features: Vec<usize> = (0..self.feature_set().dims()).collect();
        features.sort_by(|&a, &b| correlation(b).abs().total_cmp(&correlation(a).abs()).then(a.cmp(&b)));
        let named = features.into_iter().take(NAMED);
        named.filter_map(|at| Some((self.feature_set().feature(at)?, correlation(at)))).collect()
    }

    /// How far a store's statistics are from those that the space was fitted on; `None` for spaces that are not
    /// fitted, and where one of the two counts no texture and there is no prior.
    ///
    /// # Errors
    /// [`SpaceError::FeatureSet`].
    pub fn drift(&self, now: &Statistics) -> Result<Option<Drift>, SpaceError> {
        if now.feature_set() != self.feature_set() {
            return Err(SpaceError::FeatureSet { expected: self.feature_set().key(), found: now.feature_set().key() });
        }
        let then = &self.origin;
        let total = |variances: &[f64]| variances.iter().sum::<f64>();
        let reference = total(&then.variances);
        if !self.definition.is_fitted() || now.count() == 0 || reference <= 0.0 {
            return Ok(None);
        }
        let shift: Vec<f64> = now.mean().iter().zip(&then.mean).map(|(now, then)| now - then).collect();
        let moved = self.map.apply_to_difference(&shift);
        Ok(Some(Drift {
            textures_at_fit: then.count,
            textures: now.count(),
            shift: (moved.iter().map(|m| m * m).sum::<f64>() / reference).sqrt(),
            spread: (total(&self.map.variances(&now.between())) / reference).sqrt(),
        }))
    }

    /// The bytes that [`Space::decode`] reads: versioned and checked, the same for the same space.
    ///
    /// Name as a list of bytes; feature set (form u8, views as a list of u8 codes); kind u8 (0 histogram, 1 intersection,
    /// 2 z-score, 3 likeness: then nuisance weight f64 and dims u32); epoch u64; count u64, mean and variances at the
    /// fit as lists of f64; then for z-score: mean and scale, for likeness: mean, weights, correlations, deviations and
    /// variances, as lists of f64, matrices row-major with a row a feature.
    pub fn encode(&self) -> Vec<u8> {
        let mut writer = Writer::new(SPACE);
        writer.bytes(self.definition.name.as_bytes());
        write_recipe(&mut writer, &self.definition.feature_set);
        match self.definition.kind {
            SpaceKind::Histogram => writer.u8(0),
            SpaceKind::Intersection => writer.u8(1),
            SpaceKind::ZScore => writer.u8(2),
            SpaceKind::Likeness { nuisance, dims } => {
                writer.u8(3);
                writer.f64(nuisance);
                writer.u32(dims as u32);
            }
        }
        writer.u64(self.epoch);
        writer.u64(self.origin.count);
        writer.f64s(&self.origin.mean);
        writer.f64s(&self.origin.variances);
        match &self.map {
            Map::Histogram { .. } => {}
            Map::Scaled { mean, scale } => [mean, scale].into_iter().for_each(|values| writer.f64s(values)),
            Map::Likeness(projection) => {
                writer.f64s(&projection.mean);
                writer.f64s(projection.weights.values());
                writer.f64s(projection.correlations.values());
                writer.f64s(&projection.deviations);
                writer.f64s(&projection.variances);
            }
        }
        writer.finish()
    }

    /// The space that was encoded.
    ///
    /// # Errors
    /// [`SpaceError::Damaged`], [`SpaceError::Version`].
    pub fn decode(bytes: &[u8]) -> Result<Self, SpaceError> {
        let mut reader = Reader::new(SPACE, bytes)?;
        let name = str::from_utf8(reader.bytes()?).map_err(|_| reader.damaged("its name is no text"))?.to_owned();
        let feature_set = read_recipe(&mut reader)?;
        let kind = match reader.u8()? {
            0 => SpaceKind::Histogram,
            1 => SpaceKind::Intersection,
            2 => SpaceKind::ZScore,
            3 => SpaceKind::Likeness { nuisance: reader.f64()?, dims: reader.u32()? as usize },
            _ => return Err(reader.damaged("it is of an unknown kind")),
        };
        let definition = Definition { name, feature_set, kind };
        definition.check().map_err(|_| reader.damaged("its definition is impossible"))?;
        let (features, dims) = (definition.feature_set.dims(), definition.dims());
        let epoch = reader.u64()?;
        let origin = Origin { count: reader.u64()?, mean: reader.f64s(features)?, variances: reader.f64s(dims)? };
        let map = match kind {
            SpaceKind::Histogram => Map::Histogram { share: false },
            SpaceKind::Intersection => Map::Histogram { share: true },
            SpaceKind::ZScore => Map::Scaled { mean: reader.f64s(features)?, scale: reader.f64s(features)? },
            SpaceKind::Likeness { .. } => Map::Likeness(Projection {
                mean: reader.f64s(features)?,
                weights: Matrix::from_values(features, dims, reader.f64s(features * dims)?),
                correlations: Matrix::from_values(features, dims, reader.f64s(features * dims)?),
                deviations: reader.f64s(features)?,
                variances: reader.f64s(dims)?,
            }),
        };
        reader.finish()?;
        Ok(Self { definition, epoch, map, origin })
    }
}

impl Map {
    /// What becomes of a difference of features; nothing is scaled to unit length.
    fn apply_to_difference(&self, difference: &[f64]) -> Vec<f64> {
        match self {
            Self::Histogram { .. } => difference.to_vec(),
            Self::Scaled { scale, .. } => difference.iter().zip(scale).map(|(d, scale)| d * scale).collect(),
            Self::Likeness(projection) => projection.apply(difference.iter().map(|&d| Some(d))),
        }
    }

    /// The variance of each coordinate, of features with this covariance.
    fn variances(&self, covariance: &Matrix) -> Vec<f64> {
        match self {
            Self::Histogram { .. } => vec![0.0; covariance.rows()],
            Self::Scaled { scale, .. } => {
                scale.iter().enumerate().map(|(at, scale)| covariance[(at, at)] * scale * scale).collect()
            }
            Self::Likeness(projection) => {
                let product = covariance.times(&projection.weights);
                let variance = |at: usize| {
                    (0..product.rows()).map(|feature| product[(feature, at)] * projection.weights[(feature, at)]).sum()
                };
                (0..product.columns()).map(variance).collect()
            }
        }
    }
}

impl Origin {
    fn of(map: &Map, statistics: &Statistics) -> Self {
        match map {
            // Nothing is fitted, and so nothing drifts.
            Map::Histogram { .. } => {
                let zeros = vec![0.0; statistics.feature_set().dims()];
                Self { count: statistics.count(), mean: zeros.clone(), variances: zeros }
            }
            // Before there are textures, the prior stands for them.
            Map::Likeness(projection) if statistics.count() == 0 => {
                Self { count: 0, mean: projection.mean.clone(), variances: projection.variances.clone() }
            }
            _ => Self {
                count: statistics.count(),
                mean: statistics.mean(),
                variances: map.variances(&statistics.between()),
            },
        }
    }
}

/// The features that are there, in order.
pub(super) fn present<'a>(
    feature_set: &FeatureSet,
    features: &'a Features,
) -> impl Iterator<Item = Option<f64>> + use<'a> {
    let per_view = feature_set.form().per_view();
    let views: Vec<bool> = feature_set.views().iter().map(|view| !features.missing().contains(view)).collect();
    features.values().iter().enumerate().map(move |(at, &x)| views[at / per_view].then_some(x))
}

/// What a moment is multiplied by in the paper's histogram: `255^cells`; 1 for features that are no moments.
pub(super) fn bin(feature_set: &FeatureSet, feature: usize) -> f64 {
    match feature_set.form() {
        FeatureForm::Moments => f64::from(255_u32.pow(MASKS[feature % MASK_COUNT].order() as u32)),
        _ => 1.0,
    }
}

/// One axis of a likeness space.
#[derive(Clone, Debug, PartialEq)]
pub struct SpaceAxis {
    /// Its share of the variance of all coordinates (before the scaling to unit length); the shares add up to 1.
    pub variance: f64,
    /// How much of the axis comes from each view; the shares add up to 1, and one below 0 works against the others.
    pub views: Vec<(View, f64)>,
    /// The features that go most with it, and their correlation with the coordinate over the textures.
    pub features: Vec<(Feature, f64)>,
}

/// How far a store has moved since a space was fitted.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Drift {
    /// Textures when the space was fitted; 0 means that the prior stood for them.
    pub textures_at_fit: u64,
    /// Textures now.
    pub textures: u64,
    /// How far the mean texture has moved, in units of the spread of the textures then; 0 means not at all.
    pub shift: f64,
    /// The spread of the textures now by that of then; 1 means no change.
    pub spread: f64,
}

#[cfg(test)]
mod tests;
