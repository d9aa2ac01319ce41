//! Fits the prior that is shipped with the program:
//!
//! ```sh
//! cargo run --release --example fit_prior [RECIPE.toml [OUT.bin]]
//! ```
//!
//! Uses the textures of `datasets/prior.toml` and two copies of each under all nuisances (seeds 2 i and 2 i + 1 for texture i),
//! and writes `src/space/prior.bin`. The same recipe gives the same bytes on every machine.

use std::error::Error;
use std::path::PathBuf;

use hlacdb::internals::space::Observations;
use hlacdb::synth::{Nuisance, Recipe};
use rayon::prelude::*;

/// Copies of each texture under nuisances.
const COPIES: u64 = 2;

fn main() -> Result<(), Box<dyn Error>> {
    let mut arguments = std::env::args_os().skip(1);
    let recipe = match arguments.next() {
        Some(path) => Recipe::parse(&std::fs::read_to_string(path)?)?,
        None => Recipe::builtin("prior")?,
    };
    let out =
        arguments.next().map_or(PathBuf::from(concat!(env!("CARGO_MANIFEST_DIR"), "/src/space/prior.bin")), Into::into);
    let specimens = recipe.specimens();
    let observe = |mut part: Observations, (at, specimen): (usize, &hlacdb::synth::Specimen)| {
        let texture = specimen.plain_volume();
        let copy = |copy| Nuisance::ALL.draw(COPIES * at as u64 + copy).apply(&texture);
        part.add(&texture, &(0..COPIES).map(copy).collect::<Vec<_>>())?;
        Ok(part)
    };
    let merge = |mut all: Observations, part: Observations| {
        all.merge(&part)?;
        Ok::<_, hlacdb::space::SpaceError>(all)
    };
    let parts = specimens.par_iter().enumerate().with_min_len(16).try_fold(Observations::default, observe);
    let bytes = parts.try_reduce(Observations::default, merge)?.encode();
    std::fs::write(&out, &bytes)?;
    println!("{}: {} textures, {} bytes", out.display(), specimens.len(), bytes.len());
    Ok(())
}
