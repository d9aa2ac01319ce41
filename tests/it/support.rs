//! Small textures, files of them, and random numbers.

use std::path::Path;

use hlacdb::volume::Volume;

/// A cube of slanting stripes; `step` says how they slant.
pub(crate) fn stripes(side: usize, step: usize) -> Volume {
    Volume::from_fn([side; 3], |z, y, x| ((z * 3 + y * step * 7 + x * 11) % 17 * 15) as u8).unwrap()
}

/// A cube with a soft ball in it.
pub(crate) fn ball(side: usize, radius: usize) -> Volume {
    let centre = side as i64 / 2;
    Volume::from_fn([side; 3], |z, y, x| {
        let distance: i64 = [z, y, x].iter().map(|&c| (c as i64 - centre).pow(2)).sum();
        (250 - distance * 250 / (radius * radius * 4) as i64).clamp(0, 250) as u8
    })
    .unwrap()
}

/// Writes a volume as a numpy file.
pub(crate) fn write_npy(path: &Path, volume: &Volume) {
    hlacdb::arrays::write_volume(path, volume).unwrap();
}

/// Numbers that look random and depend on `seed` alone.
pub(crate) fn noise(seed: u64) -> impl FnMut() -> u64 {
    let mut state = seed.wrapping_mul(0x9E37_79B9_7F4A_7C15) | 1;
    move || {
        state ^= state << 13;
        state ^= state >> 7;
        state ^= state << 17;
        state >> 16
    }
}
