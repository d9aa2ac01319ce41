//! Recipes give the same bytes on every machine.

use std::collections::BTreeMap;

use hlacdb::synth::families::FAMILIES;
use hlacdb::synth::{Nuisance, Recipe, builtin_names};

fn hash(volume: &hlacdb::volume::Volume) -> String {
    volume.content_hash()[..8].iter().map(|byte| format!("{byte:02x}")).collect()
}

/// One small texture of every family, plain and under all nuisances, compared with recorded hashes.
#[test]
fn every_family_has_its_golden_bytes() {
    let golden: BTreeMap<&str, &str> =
        include_str!("../fixtures/synth/golden.txt").lines().filter_map(|line| line.split_once(' ')).collect();
    let mut found = String::new();
    for family in FAMILIES {
        let text = format!(
            "name = \"golden\"\nseed = 1\nsize = [12, 13, 14]\n[[group]]\nfamily = \"{}\"\ncount = 1\n",
            family.name
        );
        let recipe = Recipe::parse(&text).unwrap();
        let plain = hash(&recipe.specimens()[0].volume());
        let changed = hash(&recipe.with_nuisance(Nuisance::ALL).specimens()[0].volume());
        found.push_str(&format!("{} {plain} {changed}\n", family.name));
    }
    for line in found.lines() {
        let (name, hashes) = line.split_once(' ').unwrap();
        assert_eq!(golden.get(name), Some(&hashes), "{name}; all hashes:\n{found}");
    }
    assert_eq!(golden.len(), FAMILIES.len());
}

#[test]
fn specimens_can_be_computed_in_any_order() {
    let recipe = Recipe::builtin("paper600").unwrap();
    let (first, again) = (recipe.specimens(), Recipe::builtin("paper600").unwrap().specimens());
    for at in [599, 0, 301] {
        assert_eq!(first[at].volume(), again[at].volume());
    }
}

#[test]
fn the_papers_data_set_has_300_textures_of_each_class() {
    let recipe = Recipe::builtin("paper600").unwrap();
    let specimens = recipe.specimens();
    let of_class = |class: &str| specimens.iter().filter(|s| s.tags["class"] == class).count();
    assert_eq!((specimens.len(), of_class("a"), of_class("b")), (600, 300, 300));
    assert!(specimens.iter().all(|specimen| specimen.shape == [64, 64, 64]));
}

#[test]
fn the_built_in_data_sets_contain_every_family() {
    assert_eq!(builtin_names().collect::<Vec<_>>(), ["paper600", "families", "wide", "prior"]);
    for name in ["families", "wide", "prior"] {
        let recipe = Recipe::builtin(name).unwrap();
        let mut families: Vec<&str> = recipe.groups().iter().map(|group| group.family.name).collect();
        families.sort_unstable();
        families.dedup();
        assert_eq!(families.len(), FAMILIES.len(), "{name}");
    }
    assert!(FAMILIES.len() >= 30);
}
