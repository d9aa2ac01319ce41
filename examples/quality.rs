//! Retrieval quality of the spaces:
//!
//! ```sh
//! cargo run --release --example quality [RECIPE LABEL]...
//! ```
//!
//! For each recipe (a built-in name or a TOML file; by default `families` and `wide` by `family`, and `paper600` by `class`)
//! every texture is a query against all others, clean and under all nuisances. Spaces are fitted without the families of the
//! query's label: the prior on the other families of `datasets/prior.toml`, and the store's own statistics on textures of
//! other labels (unless there are only two labels). Prints mean average precision and precision at 1 and 30 for each space
//! and for what it was fitted on: the prior alone, own statistics alone, or both.
//!
//! Environment: `SPACES` (names separated by commas), `WEIGHTS` (of the prior, separated by commas), `CLASSES` (if set, the
//! labels with the lowest precision are listed).

use std::collections::{BTreeMap, BTreeSet};
use std::error::Error;

use hlacdb::hlac::View;
use hlacdb::internals::space::{Contribution, Observations, Prior};
use hlacdb::space::{Definition, Descriptor, Features, Space, SpaceKind, Statistics};
use hlacdb::synth::{Nuisance, Recipe, Specimen};
use rayon::prelude::*;

type Failure = Box<dyn Error + Send + Sync>;

/// Copies of each texture of the prior under nuisances, as in the shipped prior.
const COPIES: u64 = 2;

/// A described texture.
struct Texture {
    label: String,
    family: String,
    descriptor: Descriptor,
    contributions: Vec<Contribution>,
}

fn main() -> Result<(), Failure> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let sets: Vec<(String, String)> = match arguments.as_slice() {
        [] => vec![
            ("families".into(), "family".into()),
            ("wide".into(), "family".into()),
            ("paper600".into(), "class".into()),
        ],
        named => named.chunks(2).map(|c| (c[0].clone(), c.get(1).cloned().unwrap_or("family".into()))).collect(),
    };
    let observed = observed()?;
    for (name, label) in sets {
        let recipe = match Recipe::builtin(&name) {
            Ok(recipe) => recipe,
            Err(_) => Recipe::parse(&std::fs::read_to_string(&name)?)?,
        };
        let clean = textures(&recipe.clone().with_nuisance(Nuisance::NONE).specimens(), &label)?;
        let all = textures(&recipe.with_nuisance(Nuisance::ALL).specimens(), &label)?;
        let labels: BTreeSet<&str> = clean.iter().map(|texture| texture.label.as_str()).collect();
        let priors = labels.par_iter().map(|&label| Ok((label.to_owned(), prior_without(label, &clean, &observed)?)));
        let priors: BTreeMap<String, Prior> = priors.collect::<Result<_, Failure>>()?;
        println!("\n{name}: {} textures, {} labels; mAP / P@1 / P@30", clean.len(), labels.len());
        println!("| space | fitted on | clean | all nuisances | nuisance query, clean store |");
        println!("|---|---|---|---|---|");
        let selected = std::env::var("SPACES").ok();
        let wanted = |name: &str| selected.as_ref().is_none_or(|list| list.split(',').any(|one| one == name));
        for name in Definition::BUILT_IN.into_iter().filter(|name| wanted(name)) {
            let definition = Definition::built_in(name).ok_or("unknown built-in space")?;
            for fit in fits(&definition) {
                let clean_scores = scores(&definition, &fit, &priors, &clean, &clean)?;
                let all_scores = scores(&definition, &fit, &priors, &all, &all)?;
                let crossed = scores(&definition, &fit, &priors, &all, &clean)?;
                let [of_clean, of_all, of_crossed] = [&clean_scores, &all_scores, &crossed].map(total);
                println!("| {name} | {} | {of_clean} | {of_all} | {of_crossed} |", fit.name);
                if std::env::var_os("CLASSES").is_some() {
                    list_worst(&clean_scores, &all_scores);
                }
            }
        }
    }
    Ok(())
}

/// What a space is fitted on.
struct Fit {
    name: String,
    /// The number of textures that the prior counts as.
    weight: f64,
    /// Whether the store's own statistics are used.
    own: bool,
}

fn fits(definition: &Definition) -> Vec<Fit> {
    let fit = |name: &str, weight, own| Fit { name: name.to_owned(), weight, own };
    if !matches!(definition.kind, SpaceKind::Likeness { .. }) {
        return vec![fit("own", 0.0, true)];
    }
    let weights: Vec<f64> = match std::env::var("WEIGHTS") {
        Ok(list) => list.split(',').filter_map(|weight| weight.parse().ok()).collect(),
        Err(_) => vec![Prior::shipped().weight()],
    };
    let both = weights.into_iter().map(|weight| fit(&format!("prior as {weight}, own"), weight, true));
    [fit("prior", 1.0, false), fit("own, nuisances of the prior", 1e-6, true)].into_iter().chain(both).collect()
}

/// The observations of the prior's recipe, by family.
fn observed() -> Result<BTreeMap<String, Observations>, Failure> {
    let specimens = Recipe::builtin("prior")?.specimens();
    let mut families: BTreeMap<&str, Vec<(u64, &Specimen)>> = BTreeMap::new();
    for (at, specimen) in specimens.iter().enumerate() {
        families.entry(specimen.family.name).or_default().push((at as u64, specimen));
    }
    let observe = |(family, specimens): (&str, Vec<(u64, &Specimen)>)| {
        let mut observations = Observations::default();
        for (at, specimen) in specimens {
            let texture = specimen.plain_volume();
            let copy = |copy| Nuisance::ALL.draw(COPIES * at + copy).apply(&texture);
            observations.add(&texture, &(0..COPIES).map(copy).collect::<Vec<_>>())?;
        }
        Ok((family.to_owned(), observations))
    };
    families.into_par_iter().map(observe).collect()
}

/// The prior without the families of a label.
fn prior_without(
    label: &str,
    textures: &[Texture],
    observed: &BTreeMap<String, Observations>,
) -> Result<Prior, Failure> {
    let of_label = |family: &str| textures.iter().any(|t| t.label == label && t.family == family);
    let mut kept = Observations::default();
    for (_, observations) in observed.iter().filter(|(family, _)| !of_label(family)) {
        kept.merge(observations)?;
    }
    Ok(Prior::decode(&kept.encode())?)
}

fn textures(specimens: &[Specimen], label: &str) -> Result<Vec<Texture>, Failure> {
    let describe = |specimen: &Specimen| {
        let described = hlacdb::describe(&specimen.volume(), &View::STANDARD);
        let recipes: BTreeMap<String, _> = Definition::BUILT_IN
            .iter()
            .filter_map(|name| Definition::built_in(name))
            .map(|definition| (definition.feature_set.key(), definition.feature_set))
            .collect();
        let contributions = recipes.values().filter_map(|r| Contribution::from_sums(r, &described).transpose());
        Ok(Texture {
            label: specimen.tags.get(label).cloned().unwrap_or_default(),
            family: specimen.tags.get("family").cloned().unwrap_or_default(),
            contributions: contributions.collect::<Result<_, _>>()?,
            descriptor: Descriptor::from_sums(&described)?,
        })
    };
    specimens.par_iter().map(describe).collect()
}

/// Retrieval measures, averaged over the queries.
#[derive(Default)]
struct Scores {
    map: f64,
    first: f64,
    thirty: f64,
    queries: f64,
}

impl std::fmt::Display for Scores {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let mean = |sum: f64| sum / self.queries;
        write!(f, "{:.3} / {:.3} / {:.3}", mean(self.map), mean(self.first), mean(self.thirty))
    }
}

/// Scores queries against a store. Query n is not compared with texture n of the store.
fn scores(
    definition: &Definition,
    fit: &Fit,
    priors: &BTreeMap<String, Prior>,
    queries: &[Texture],
    store: &[Texture],
) -> Result<ByLabel, Failure> {
    let contributions = |textures: &[Texture]| -> Vec<Contribution> {
        let of = |texture: &Texture| {
            texture.contributions.iter().find(|c| *c.feature_set() == definition.feature_set).cloned()
        };
        textures.iter().filter_map(of).collect()
    };
    let stored = contributions(store);
    let mut whole = Statistics::new(&definition.feature_set);
    stored.iter().try_for_each(|texture| whole.add(texture))?;
    let features = |textures: &[Texture]| -> Vec<Features> {
        textures.iter().map(|texture| texture.descriptor.features(&definition.feature_set)).collect()
    };
    let (query_features, store_features) = (features(queries), features(store));
    // The paper's experiment has two classes, so leaving one out would leave out half of the store.
    let labels: BTreeSet<&str> = queries.iter().map(|texture| texture.label.as_str()).collect();
    let statistics_without = |label: &str| -> Result<Statistics, Failure> {
        let mut statistics = if fit.own { whole.clone() } else { Statistics::new(&definition.feature_set) };
        if fit.own && labels.len() > 2 && definition.kind != SpaceKind::ZScore {
            let removed = store.iter().zip(&stored).filter(|(texture, _)| texture.label == label);
            removed.map(|(_, contribution)| contribution).try_for_each(|texture| statistics.remove(texture))?;
        }
        Ok(statistics)
    };
    let per_label = labels.par_iter().map(|&label| {
        let prior = priors.get(label).cloned().unwrap_or(Prior::none()).with_weight(fit.weight);
        let space = Space::fit(definition, &statistics_without(label)?, None, &prior)?;
        let points = |features: &[Features]| features.iter().map(|f| space.point(f)).collect::<Result<Vec<_>, _>>();
        let (query_points, store_points) = (points(&query_features)?, points(&store_features)?);
        let mut scores = Scores::default();
        for (at, query) in queries.iter().enumerate().filter(|(_, query)| query.label == label) {
            let mut hits: Vec<(f64, bool)> = Vec::new();
            for (other, texture) in store.iter().enumerate().filter(|(other, _)| *other != at) {
                let distance = space.metric().distance(&query_points[at], &store_points[other]);
                hits.push((distance, texture.label == query.label));
            }
            hits.sort_by(|a, b| a.0.total_cmp(&b.0));
            scores.count(&hits);
        }
        Ok((label.to_owned(), scores))
    });
    per_label.collect()
}

type ByLabel = BTreeMap<String, Scores>;

/// The measures over all queries.
fn total(scores: &ByLabel) -> Scores {
    scores.values().fold(Scores::default(), |a, b| Scores {
        map: a.map + b.map,
        first: a.first + b.first,
        thirty: a.thirty + b.thirty,
        queries: a.queries + b.queries,
    })
}

/// Prints the 24 labels with the lowest mean average precision under all nuisances.
fn list_worst(clean: &ByLabel, all: &ByLabel) {
    let map = |scores: &Scores| scores.map / scores.queries;
    let mut labels: Vec<&String> = all.keys().collect();
    labels.sort_by(|a, b| map(&all[*a]).total_cmp(&map(&all[*b])));
    for label in labels.into_iter().take(24) {
        println!("    {label:12} {:.3} clean, {:.3} all nuisances", map(&clean[label]), map(&all[label]));
    }
}

impl Scores {
    /// Adds a query whose hits are in order of distance; the flag of a hit says whether it is relevant.
    fn count(&mut self, hits: &[(f64, bool)]) {
        let (mut found, mut precisions) = (0.0, 0.0);
        for (rank, (_, relevant)) in hits.iter().enumerate() {
            if *relevant {
                found += 1.0;
                precisions += found / (rank + 1) as f64;
            }
        }
        self.map += if found > 0.0 { precisions / found } else { 0.0 };
        let precision = |k: usize| hits.iter().take(k).filter(|hit| hit.1).count() as f64 / k as f64;
        self.first += precision(1);
        self.thirty += precision(30);
        self.queries += 1.0;
    }
}
