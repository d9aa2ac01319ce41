//! Degree roots: the k-th root of a moment of k cells, which grows in proportion to the intensity.
//!
//! The loops have no branches, so that the compiler vectorises them, and use exactly rounded operations only, so that
//! the results have the same bits on every machine.

use crate::hlac::{MASK_COUNT, MASKS_BY_ORDER};

/// The degree roots of moments in [0, 1]. Moments may come in any order in which those of one cell precede those of
/// two cells, and these those of three.
pub(super) fn degree_roots(moments: &[f32; MASK_COUNT]) -> [f64; MASK_COUNT] {
    const PAIRS: usize = MASKS_BY_ORDER[0];
    const TRIPLES: usize = PAIRS + MASKS_BY_ORDER[1];
    let mut roots = moments.map(f64::from);
    for root in &mut roots[PAIRS..TRIPLES] {
        *root = root.sqrt();
    }
    for (root, &moment) in roots[TRIPLES..].iter_mut().zip(&moments[TRIPLES..]) {
        *root = cube_root(moment);
    }
    roots
}

/// The cube root of a number in [0, 1], with a relative error below 1e-13; 0 for numbers below 1e-36, which no moment
/// other than 0 is.
fn cube_root(value: f32) -> f64 {
    const SMALLEST: f32 = 1e-36;
    /// Two thirds of the bits of 1.0, lowered to balance the error over one octave.
    const BIAS: u32 = 709_958_130;
    let x = value.max(SMALLEST);
    // The bits of a float, read as an integer, approximate its logarithm: a third of them gives a root within 5 %. Each
    // step of Halley's method triples the number of correct digits: 5 %, 1e-5 (where `f32` suffices), 1e-14.
    let guess = f32::from_bits(x.to_bits() / 3 + BIAS);
    let cube = guess * guess * guess;
    let near = f64::from(guess * ((x + x + cube) / (x + cube + cube)));
    let (x, cube) = (f64::from(x), near * near * near);
    let root = near * ((x + x + cube) / (x + cube + cube));
    if value < SMALLEST { 0.0 } else { root }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cube_roots_are_accurate_over_the_whole_range() {
        let mut worst = 0.0_f64;
        for bits in (1e-36_f32.to_bits()..=1.0_f32.to_bits()).step_by(9973) {
            let value = f32::from_bits(bits);
            let exact = libm::cbrt(f64::from(value));
            worst = worst.max((cube_root(value) / exact - 1.0).abs());
        }
        assert!(worst < 1e-13, "{worst:e}");
        assert_eq!(
            [0.0, 1e-40, 0.125, 1.0].map(cube_root).map(|root| (root * 1e12).round() / 1e12),
            [0.0, 0.0, 0.5, 1.0]
        );
    }

    #[test]
    fn the_degree_of_the_root_is_the_number_of_cells() {
        let roots = degree_roots(&[0.25; MASK_COUNT]);
        assert_eq!((roots[0], roots[1], roots[13]), (0.25, 0.5, 0.5));
        assert!((roots[14] - 0.25_f64.cbrt()).abs() < 1e-13);
    }
}
