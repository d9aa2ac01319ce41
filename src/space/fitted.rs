//! [`Space`]: a fitted definition, which maps features to points.

use super::codec::{Header, Reader, Writer, read_feature_set, write_feature_set};
use super::fit::{Model, Projection, inverse_deviation};
use super::linalg::Matrix;
use super::{
    Definition, Descriptor, Feature, FeatureForm, FeatureSet, Features, Metric, NuisanceStatistics, Prior, SpaceError,
    SpaceKind, Statistics,
};
use crate::hlac::{MASK_COUNT, MASKS, View};

const SPACE: Header = Header { what: "space", magic: *b"hSpa", version: 1 };

/// The number of features that are named for each axis.
const NAMED: usize = 3;

/// A fitted space: the map from a texture's features to its point.
///
/// The same features give the same point, to the bit, on every machine. Coordinates are always finite. A view that a
/// texture does not have counts as average (`z = 0`); a texture without any of the views, or average in every feature,
/// is mapped to the origin.
///
/// ```
/// use hlacdb::{Database, space::Descriptor, volume::Volume};
/// # let folder = tempfile::tempdir()?;
/// # let path = folder.path().join("textures.hlacdb");
/// let database = Database::open(&path)?;
/// let space = database.space("paper")?;
/// let described = hlacdb::describe(&Volume::new([4, 4, 4], 1, vec![2; 64])?, space.feature_set().views());
/// let point = space.point(&Descriptor::from_sums(&described)?.features(space.feature_set()))?;
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

/// The map from features to a point.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Map {
    /// `x * 255^cells`; if `normalised`, divided by twice the sum.
    Histogram { normalised: bool },
    /// `(x - mean) * scale`.
    Scaled { mean: Vec<f64>, scale: Vec<f64> },
    /// `(x - mean) weights`, scaled to unit length.
    Likeness(Projection),
}

/// The store's statistics at the time of the fit, the reference for drift.
#[derive(Clone, Debug, PartialEq)]
struct Origin {
    /// The number of textures. If it is 0, mean and variances are those of the prior.
    count: u64,
    mean: Vec<f64>,
    /// The variance of each coordinate before points are scaled to unit length.
    variances: Vec<f64>,
}

impl Space {
    /// Fits a definition on a store's statistics and a prior. Nuisance statistics of the store, if given, replace those
    /// of the prior.
    ///
    /// Statistics of no texture are allowed: the prior then determines the space, and without a prior every point is the
    /// origin. The epoch is 0; see [`Space::with_epoch`].
    ///
    /// # Errors
    /// As [`Definition::check`]; [`SpaceError::FeatureSet`] for statistics of another feature set than the definition's.
    #[doc(hidden)]
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
            SpaceKind::Histogram => Map::Histogram { normalised: false },
            SpaceKind::Intersection => Map::Histogram { normalised: true },
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

    /// The same space with another epoch: the number by which its owner tells one fit from the next.
    #[doc(hidden)]
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

    /// The definition that was fitted.
    pub fn definition(&self) -> &Definition {
        &self.definition
    }

    /// The features that it uses.
    pub fn feature_set(&self) -> &FeatureSet {
        &self.definition.feature_set
    }

    /// The metric of its points.
    pub fn metric(&self) -> Metric {
        self.definition.metric()
    }

    /// The number of coordinates of a point.
    pub fn dims(&self) -> usize {
        self.definition.dims()
    }

    /// The number of textures in the statistics that it was fitted on.
    pub fn textures_at_fit(&self) -> u64 {
        self.origin.count
    }

    /// The point of a texture with these features: [`Space::dims`] finite coordinates.
    ///
    /// # Errors
    /// [`SpaceError::FeatureSet`] for features of another feature set.
    pub fn point(&self, features: &Features) -> Result<Vec<f32>, SpaceError> {
        Ok(self.exact_point(features)?.iter().map(|&coordinate| coordinate as f32).collect())
    }

    /// The points of several textures, one after another: [`Space::dims`] coordinates each.
    pub fn points<'a>(&self, descriptors: impl IntoIterator<Item = &'a Descriptor>) -> Vec<f32> {
        let features = descriptors.into_iter().map(|descriptor| descriptor.features(self.feature_set()));
        let points = features.flat_map(|features| self.scaled(self.unscaled(&features)));
        points.map(|coordinate| coordinate as f32).collect()
    }

    /// The point before it is rounded to `f32`.
    pub(super) fn exact_point(&self, features: &Features) -> Result<Vec<f64>, SpaceError> {
        Ok(self.scaled(self.raw_point(features)?))
    }

    /// The point before it is scaled to unit length.
    pub(super) fn raw_point(&self, features: &Features) -> Result<Vec<f64>, SpaceError> {
        let (expected, found) = (self.feature_set(), features.values().len());
        if found != expected.dims() {
            return Err(SpaceError::FeatureSet { expected: expected.key(), found: format!("{found} numbers") });
        }
        Ok(self.unscaled(features))
    }

    /// A point of a likeness space scaled to unit length, other points as they are.
    fn scaled(&self, mut point: Vec<f64>) -> Vec<f64> {
        if let Map::Likeness(_) = self.map {
            let length = self.length(&point);
            if length > 0.0 {
                point.iter_mut().for_each(|coordinate| *coordinate /= length);
            }
        }
        point
    }

    /// As [`Space::raw_point`], of features whose number has been checked.
    fn unscaled(&self, features: &Features) -> Vec<f64> {
        let feature_set = self.feature_set();
        let present = present(feature_set, features);
        match &self.map {
            Map::Histogram { normalised } => {
                let mut point: Vec<f64> =
                    features.values().iter().enumerate().map(|(at, x)| x * bin(feature_set, at)).collect();
                let total: f64 = point.iter().sum();
                if *normalised && total > 0.0 {
                    point.iter_mut().for_each(|bin| *bin /= 2.0 * total);
                }
                point
            }
            Map::Scaled { mean, scale } => {
                let scaled = present.zip(mean).zip(scale);
                scaled.map(|((x, mean), scale)| x.map_or(0.0, |x| (x - mean) * scale)).collect()
            }
            Map::Likeness(projection) => projection.project(present),
        }
    }

    /// The Euclidean length of a point.
    pub(super) fn length(&self, point: &[f64]) -> f64 {
        point.iter().map(|coordinate| coordinate * coordinate).sum::<f64>().sqrt()
    }

    /// The axes of a likeness space, by falling variance. Empty for other spaces.
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

    /// The share of each view in the variance of a coordinate: the covariance of the view's part with the coordinate.
    fn view_shares(&self, projection: &Projection, axis: usize) -> Vec<(View, f64)> {
        let feature_set = self.feature_set();
        let per_view = feature_set.form().per_view();
        let deviation = projection.variances[axis].sqrt();
        let share = |feature: usize| {
            // weight * sd of the feature * correlation * sd of the coordinate / variance of the coordinate.
            let weight = projection.weights[(feature, axis)] * projection.deviations[feature];
            weight * projection.correlations[(feature, axis)] / deviation
        };
        let views = feature_set.views().iter().enumerate();
        views.map(|(at, &view)| (view, (at * per_view..(at + 1) * per_view).map(share).sum())).collect()
    }

    /// The features with the strongest correlation with a coordinate.
    fn named_features(&self, projection: &Projection, axis: usize) -> Vec<(Feature, f64)> {
        let correlation = |feature: usize| projection.correlations[(feature, axis)];
        let mut features: Vec<usize> = (0..self.feature_set().dims()).collect();
        features.sort_by(|&a, &b| correlation(b).abs().total_cmp(&correlation(a).abs()).then(a.cmp(&b)));
        let named = features.into_iter().take(NAMED);
        named.filter_map(|at| Some((self.feature_set().feature(at)?, correlation(at)))).collect()
    }

    /// How far statistics have moved from those that the space was fitted on. `None` for histogram spaces, for
    /// statistics of no texture, and for a space that was fitted on no texture and no prior.
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

    /// The bytes that [`Space::decode`] reads: versioned, with a checksum, the same for the same space.
    ///
    /// Name as a list of bytes; feature set (form u8, views as a list of u8 codes); kind u8 (0 histogram, 1 intersection,
    /// 2 z-score, 3 likeness: then nuisance weight f64 and dims u32); epoch u64; count u64, mean and variances at the
    /// fit as lists of f64; then for z-score: mean and scale, for likeness: mean, weights, correlations, deviations and
    /// variances, as lists of f64, matrices row-major with a row a feature.
    #[doc(hidden)]
    pub fn encode(&self) -> Vec<u8> {
        let mut writer = Writer::new(SPACE);
        writer.bytes(self.definition.name.as_bytes());
        write_feature_set(&mut writer, &self.definition.feature_set);
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

    /// Reads what [`Space::encode`] wrote.
    ///
    /// # Errors
    /// [`SpaceError::Damaged`], [`SpaceError::Version`].
    #[doc(hidden)]
    pub fn decode(bytes: &[u8]) -> Result<Self, SpaceError> {
        let mut reader = Reader::new(SPACE, bytes)?;
        let name = str::from_utf8(reader.bytes()?).map_err(|_| reader.damaged("its name is not UTF-8"))?.to_owned();
        let feature_set = read_feature_set(&mut reader)?;
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
            SpaceKind::Histogram => Map::Histogram { normalised: false },
            SpaceKind::Intersection => Map::Histogram { normalised: true },
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
    /// Maps a difference of features, without scaling to unit length.
    fn apply_to_difference(&self, difference: &[f64]) -> Vec<f64> {
        match self {
            Self::Histogram { .. } => difference.to_vec(),
            Self::Scaled { scale, .. } => difference.iter().zip(scale).map(|(d, scale)| d * scale).collect(),
            Self::Likeness(projection) => projection.apply(difference.iter().map(|&d| Some(d))),
        }
    }

    /// The variance of each coordinate of features with this covariance.
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
            // Histogram spaces are not fitted and do not drift.
            Map::Histogram { .. } => {
                let zeros = vec![0.0; statistics.feature_set().dims()];
                Self { count: statistics.count(), mean: zeros.clone(), variances: zeros }
            }
            // Without textures the prior is the reference.
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

/// The features in order; `None` for those of missing views.
pub(super) fn present<'a>(
    feature_set: &FeatureSet,
    features: &'a Features,
) -> impl Iterator<Item = Option<f64>> + use<'a> {
    let per_view = feature_set.form().per_view();
    let views: Vec<bool> = feature_set.views().iter().map(|view| !features.missing().contains(view)).collect();
    features.values().iter().enumerate().map(move |(at, &x)| views[at / per_view].then_some(x))
}

/// The factor of a feature in the paper's histogram: `255^cells` for a moment, 1 for other features.
pub(super) fn bin(feature_set: &FeatureSet, feature: usize) -> f64 {
    match feature_set.form() {
        FeatureForm::Moments => f64::from(255_u32.pow(MASKS[feature % MASK_COUNT].order() as u32)),
        _ => 1.0,
    }
}

/// One axis of a likeness space.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct SpaceAxis {
    /// The share of the variance of all coordinates before points are scaled to unit length. The shares of all axes add
    /// up to 1.
    pub variance: f64,
    /// The share of each view in the variance of the axis. The shares add up to 1; a negative one counteracts the others.
    pub views: Vec<(View, f64)>,
    /// The features with the strongest correlation with the axis over the textures, and that correlation.
    pub features: Vec<(Feature, f64)>,
}

/// How far a store has moved since a space was fitted.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct Drift {
    /// The number of textures at the fit; 0 means that the prior is the reference.
    pub textures_at_fit: u64,
    /// The number of textures now.
    pub textures: u64,
    /// How far the mean texture has moved, in units of the spread at the fit; 0 means not at all.
    pub shift: f64,
    /// The spread of the textures now, divided by that at the fit; 1 means no change.
    pub spread: f64,
}

#[cfg(test)]
mod tests;
