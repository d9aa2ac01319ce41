//! Masks and sums of an independent implementation in numpy, to the bit.

use hlac::MASKS;
use hlac::kernels::{self, Kernel};

use crate::support::{fixture, integers, json, npy};

#[test]
fn the_masks_are_those_of_the_paper() {
    let letters: Vec<String> = MASKS.iter().map(|mask| mask.letters()).collect();
    assert_eq!(letters.join("\n") + "\n", std::fs::read_to_string(fixture("masks.txt")).unwrap());
}

#[test]
fn sums_equal_the_reference_to_the_bit() {
    let reference = json("reference_sums.json");
    assert_eq!(reference.as_object().unwrap().len(), 5);
    for (name, expected) in reference.as_object().unwrap() {
        let volume = npy(name);
        let octants = hlac::extract(volume.as_voxels());
        let total = octants.total();
        assert_eq!(total.windows, expected["windows"].as_u64().unwrap(), "{name}");
        assert_eq!(total.values.to_vec(), integers(&expected["sums"]), "{name}");
        for kernel in kernels::available() {
            assert_eq!(kernel.octants(volume.as_voxels()), octants, "{name} by {kernel}");
        }
    }
    assert!(kernels::available().any(|kernel| kernel == Kernel::Scalar));
}
