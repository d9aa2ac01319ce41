//! Whether distorted copies of textures find their own family, and how distances are distributed:
//!
//! ```sh
//! cargo run --release --example copies
//! ```
//!
//! Generates the textures of `datasets/families.toml`, fits a store on them, and queries with a copy of each: rotated by a
//! right angle, 5 to 15 % brighter, with 2 to 5 % noise. Prints how many copies have a texture of their own family as their
//! nearest neighbour, and the distribution of distances in the default space for pairs of one family and of two families.

use std::collections::BTreeMap;
use std::error::Error;

use hlacdb::synth::{Nuisance, ParameterRange, Recipe};
use hlacdb::{Database, Query, ReindexOptions, TextureId, ingest};

fn main() -> Result<(), Box<dyn Error + Send + Sync>> {
    let folder = tempfile::tempdir()?;
    let database = Database::open(folder.path().join("families.hlacdb"))?;
    let recipe = Recipe::builtin("families")?;
    ingest::ingest_recipe(&database, &recipe.clone().with_nuisance(Nuisance::NONE), &(), &mut |_| {})?;
    database.reindex(&ReindexOptions::default(), &())?;

    let nuisance = Nuisance {
        brightness: Some(ParameterRange { low: 0.05, high: 0.15 }),
        noise: Some(ParameterRange { low: 0.02, high: 0.05 }),
        rotation: true,
        ..Nuisance::NONE
    };
    let (mut found, mut queries) = (0, 0);
    for specimen in recipe.with_nuisance(nuisance).specimens() {
        let answer = database.query(&Query::volume(&specimen.volume()).k(1))?;
        found += usize::from(answer.hits.iter().any(|hit| hit.tags.get("family") == specimen.tags.get("family")));
        queries += 1;
    }
    println!("{found} of {queries} copies find their own family first");

    let families: BTreeMap<TextureId, Option<String>> =
        database.textures(&[])?.into_iter().map(|texture| (texture.id, texture.tags.get("family").cloned())).collect();
    let (mut same, mut different) = (Vec::new(), Vec::new());
    for (id, family) in &families {
        for hit in database.query(&Query::texture(*id).within(2.0))?.hits.iter().filter(|hit| hit.id > *id) {
            if hit.tags.get("family") == family.as_ref() { &mut same } else { &mut different }.push(hit.distance);
        }
    }
    for (what, mut distances) in [("one family", same), ("two families", different)] {
        distances.sort_by(f64::total_cmp);
        let at = |share: f64| distances.get((distances.len() as f64 * share) as usize).copied().unwrap_or(f64::NAN);
        println!(
            "{} pairs of {what}: percentile 1 at {:.2}, 50 at {:.2}, 95 at {:.2}",
            distances.len(),
            at(0.01),
            at(0.5),
            at(0.95)
        );
    }
    Ok(())
}
