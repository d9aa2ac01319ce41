//! Does a changed copy of a texture find its family? And how far apart is what is alike, and what is not?
//!
//! `cargo run --release --example copies` makes the textures of `datasets/families.toml`, fits a store on them, and asks with
//! a copy of each, turned by a right angle, 5 to 15 % brighter and with noise of 2 to 5 %: printed is how many copies have a
//! texture of their own family nearest. Then the distances of all pairs in the default space, of one family and of two.

use std::collections::BTreeMap;
use std::error::Error;

use hlacdb::synth::{Nuisance, ParameterRange, Recipe};
use hlacdb::{Database, Query, ReindexOptions, TextureId, ingest};

fn main() -> Result<(), Box<dyn Error + Send + Sync>> {
    let folder = tempfile::tempdir()?;
    let database = Database::open(folder.path().join("families.hlacdb"))?;
    let recipe = Recipe::builtin("families")?;
    ingest::synthesise(&database, &recipe.clone().with_nuisance(Nuisance::NONE), &(), &mut |_| {})?;
    database.reindex(&ReindexOptions::default(), &())?;

    let nuisance = Nuisance {
        brightness: Some(ParameterRange { low: 0.05, high: 0.15 }),
        noise: Some(ParameterRange { low: 0.02, high: 0.05 }),
        rotation: true,
        ..Nuisance::NONE
    };
    let (mut found, mut asked) = (0, 0);
    for specimen in recipe.with_nuisance(nuisance).specimens() {
        let answer = database.query(&Query::volume(&specimen.volume()).k(1))?;
        found += usize::from(answer.hits.iter().any(|hit| hit.tags.get("family") == specimen.tags.get("family")));
        asked += 1;
    }
    println!("{found} of {asked} copies find their own family first");

    let families: BTreeMap<TextureId, Option<String>> =
        database.textures(&[])?.into_iter().map(|texture| (texture.id, texture.tags.get("family").cloned())).collect();
    let (mut alike, mut other) = (Vec::new(), Vec::new());
    for (id, family) in &families {
        for hit in database.query(&Query::texture(*id).within(2.0))?.hits.iter().filter(|hit| hit.id > *id) {
            if hit.tags.get("family") == family.as_ref() { &mut alike } else { &mut other }.push(hit.distance);
        }
    }
    for (what, mut distances) in [("one family", alike), ("two families", other)] {
        distances.sort_by(f64::total_cmp);
        let at = |share: f64| distances.get((distances.len() as f64 * share) as usize).copied().unwrap_or(f64::NAN);
        println!(
            "{} pairs of {what}: 1 % nearer than {:.2}, half than {:.2}, 95 % than {:.2}",
            distances.len(),
            at(0.01),
            at(0.5),
            at(0.95)
        );
    }
    Ok(())
}
