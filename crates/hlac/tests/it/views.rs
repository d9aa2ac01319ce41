//! Views and octants of an independent implementation in numpy, to the bit.

use hlac::View;

use crate::support::{integers, json, npy};

#[test]
fn all_views_and_octants_equal_the_reference() {
    let reference = json("reference_views.json");
    assert_eq!(reference.as_object().unwrap().len(), 3);
    for (name, expected) in reference.as_object().unwrap() {
        let volume = npy(name);
        let described = hlac::describe(volume.as_voxels(), &View::ALL);
        let views = expected["views"].as_object().unwrap();
        assert_eq!(described.len(), views.len(), "{name}");
        for (view, octants) in &described {
            let (sums, expected) = (octants.total(), &views[view.name()]);
            let shape = view.apply(volume.as_voxels()).unwrap().shape().map(|side| side as u64);
            assert_eq!(shape.to_vec(), integers(&expected["shape"]), "{name} {view}");
            assert_eq!(Some(sums.windows), expected["windows"].as_u64(), "{name} {view}");
            assert_eq!(sums.values.to_vec(), integers(&expected["sums"]), "{name} {view}");
        }
        let octants = hlac::extract(volume.as_voxels());
        let expected = expected["octant_sums_full@1"].as_array().unwrap();
        assert_eq!(expected.len(), 8);
        for (octant, (sums, expected)) in octants.octants().iter().zip(expected).enumerate() {
            assert_eq!(sums.values.to_vec(), integers(expected), "{name} octant {octant}");
        }
    }
}
