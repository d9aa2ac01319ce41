//! The sums of an independent implementation (numpy), to the bit.

use hlacdb::hlac::kernel::scalar;
use hlacdb::volume::Volume;
use serde_json::Value;

use crate::support::shared;

fn integers(value: &Value) -> Vec<u64> {
    value.as_array().unwrap().iter().map(|v| v.as_u64().unwrap()).collect()
}

fn grey_npy(path: &std::path::Path) -> Volume {
    let file = npyz::NpyFile::new(std::fs::File::open(path).unwrap()).unwrap();
    let shape: Vec<usize> = file.shape().iter().map(|&n| n as usize).collect();
    Volume::new(shape.try_into().unwrap(), 1, file.into_vec::<u8>().unwrap()).unwrap()
}

#[test]
fn sums_equal_the_reference_to_the_bit() {
    let Some(path) = shared("reference_sums.json") else { return };
    let reference: Value = serde_json::from_slice(&std::fs::read(&path).unwrap()).unwrap();
    for (name, expected) in reference.as_object().unwrap() {
        let volume = grey_npy(&path.with_file_name(name));
        let octants = hlacdb::octant_sums(&volume);
        assert_eq!(octants, scalar::octants(volume.shape(), volume.voxels()), "{name}");
        let total = octants.total();
        assert_eq!(total.windows, expected["windows"].as_u64().unwrap(), "{name}");
        assert_eq!(total.values.to_vec(), integers(&expected["sums"]), "{name}");
    }
}
