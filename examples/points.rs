//! Writes moments and the points computed from them, which `benches/peers/points.py` checks:
//!
//! ```sh
//! cargo run --release --example points -- DIR
//! ```
//!
//! Input, f32, of the seven views of the default space: moments.npy (textures, views, 251), octants.npy (textures, 8, views,
//! 251), and copies.npy (like moments.npy, of one copy of each texture under all nuisances). Output, the points of the
//! default space (textures, 32): points_own.npy, fitted on the textures and copies alone; points_prior.npy, fitted on the
//! shipped prior alone; and points_both.npy, fitted on textures and prior.

use std::error::Error;
use std::path::Path;

use hlacdb::hlac::{MASK_COUNT, OctantSums, View};
use hlacdb::internals::space::{Contribution, NuisanceStatistics, Prior};
use hlacdb::space::{Definition, Descriptor, Space, Statistics};
use hlacdb::synth::families::FAMILIES;
use hlacdb::synth::{Nuisance, Recipe};
use rayon::prelude::*;

type Failure = Box<dyn Error + Send + Sync>;
type Described = Vec<(View, OctantSums)>;

const RECIPE: &str = "name = \"points\"\nseed = 99\nsize = 40\n";

fn main() -> Result<(), Failure> {
    let folder = std::env::args_os().nth(1).ok_or("give a folder: cargo run --release --example points -- DIR")?;
    let folder = Path::new(&folder);
    std::fs::create_dir_all(folder)?;
    let groups: Vec<String> =
        FAMILIES.iter().map(|family| format!("[[group]]\nfamily = \"{}\"\ncount = 8\n", family.name)).collect();
    let specimens = Recipe::parse(&format!("{RECIPE}{}", groups.concat()))?.specimens();
    let definition = Definition::built_in("default").ok_or("there is no default space")?;
    let views = definition.feature_set.views();
    let described: Vec<(Described, Described)> = specimens
        .par_iter()
        .enumerate()
        .map(|(at, specimen)| {
            let volume = specimen.volume();
            let copy = Nuisance::ALL.draw(at as u64).apply(&volume);
            (hlacdb::describe(&volume, views), hlacdb::describe(&copy, views))
        })
        .collect();

    let mut statistics = Statistics::new(&definition.feature_set);
    let mut nuisance = NuisanceStatistics::new(&definition.feature_set);
    for (texture, copy) in &described {
        let [texture, copy] = [texture, copy].map(|d| Contribution::from_sums(&definition.feature_set, d));
        let (Some(texture), Some(copy)) = (texture?, copy?) else { return Err("a texture lacks a view".into()) };
        statistics.add(&texture)?;
        nuisance.add(&texture, &copy)?;
    }
    let empty = Statistics::new(&definition.feature_set);
    let points = |space: Space| -> Result<Vec<f32>, Failure> {
        let descriptors = described.iter().map(|(texture, _)| Descriptor::from_sums(texture));
        Ok(space.points(&descriptors.collect::<Result<Vec<_>, _>>()?))
    };
    let shape = |inner: &[usize]| [&[described.len()], inner].concat();
    let prior = Prior::shipped();
    for (name, space) in [
        ("own", Space::fit(&definition, &statistics, Some(&nuisance), &Prior::none())?),
        ("prior", Space::fit(&definition, &empty, None, &prior)?),
        ("both", Space::fit(&definition, &statistics, None, &prior)?),
    ] {
        let dims = space.dims();
        write(folder, &format!("points_{name}.npy"), &shape(&[dims]), &points(space)?)?;
    }
    let totals = |d: &Described| d.iter().flat_map(|(_, sums)| sums.total().descriptor()).collect::<Vec<_>>();
    let inner = [views.len(), MASK_COUNT];
    let moments: Vec<f32> = described.iter().flat_map(|(texture, _)| totals(texture)).collect();
    let copies: Vec<f32> = described.iter().flat_map(|(_, copy)| totals(copy)).collect();
    let octant =
        |d: &Described, o: usize| d.iter().flat_map(move |(_, s)| s.octants()[o].descriptor()).collect::<Vec<_>>();
    let octants: Vec<f32> = described.iter().flat_map(|(d, _)| (0..8).flat_map(|o| octant(d, o))).collect();
    write(folder, "moments.npy", &shape(&inner), &moments)?;
    write(folder, "copies.npy", &shape(&inner), &copies)?;
    write(folder, "octants.npy", &shape(&[8, views.len(), MASK_COUNT]), &octants)?;
    println!("{} textures; prior of {} as {}", described.len(), prior.textures(), prior.weight());
    Ok(())
}

fn write(folder: &Path, name: &str, shape: &[usize], values: &[f32]) -> Result<(), Failure> {
    Ok(hlacdb::arrays::write_npy(&folder.join(name), shape, values)?)
}
