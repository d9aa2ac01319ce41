//! The views against figures of an independent implementation.

use std::fs::File;

use hlacdb::hlac::{OctantSums, Sums, View};
use hlacdb::volume::Volume;
use serde_json::Value;

use crate::support::shared;

fn volume(name: &str) -> Option<Volume> {
    let array = npyz::NpyFile::new(File::open(shared(name)?).unwrap()).unwrap();
    let shape: Vec<usize> = array.shape().iter().map(|&side| side as usize).collect();
    Some(Volume::new(shape.try_into().unwrap(), 1, array.into_vec().unwrap()).unwrap())
}

fn integers(value: &Value) -> Vec<u64> {
    value.as_array().unwrap().iter().map(|number| number.as_u64().unwrap()).collect()
}

#[test]
fn all_views_and_octants_equal_the_reference() {
    let Some(path) = shared("reference_views.json") else { return };
    let reference: Value = serde_json::from_reader(File::open(path).unwrap()).unwrap();
    for (name, expected) in reference.as_object().unwrap() {
        let Some(volume) = volume(name) else { return };
        let described = hlacdb::describe(&volume, &View::ALL);
        let expected_views = expected["views"].as_object().unwrap();
        assert_eq!(described.len(), expected_views.len(), "{name}");
        for (view, octants) in &described {
            let (sums, expected) = (octants.total(), &expected_views[view.name()]);
            let shape: Vec<u64> = view.shape_of(volume.shape()).unwrap().iter().map(|&s| s as u64).collect();
            assert_eq!(shape, integers(&expected["shape"]), "{name} {view}");
            assert_eq!(Some(sums.windows), expected["windows"].as_u64(), "{name} {view}");
            assert_eq!(sums.values.to_vec(), integers(&expected["sums"]), "{name} {view}");
        }
        assert_octants(name, &described, expected);
    }
}

fn assert_octants(name: &str, described: &[(View, OctantSums)], expected: &Value) {
    for (view, octants) in described {
        let Some(expected) = expected.get(format!("octant_sums_{view}")) else { continue };
        for (octant, (Sums { values, .. }, expected)) in octants.0.iter().zip(expected.as_array().unwrap()).enumerate()
        {
            let sums = expected.get("sums").unwrap_or(expected);
            assert_eq!(values.to_vec(), integers(sums), "{name} {view} octant {octant}");
        }
    }
}
