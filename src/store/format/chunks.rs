//! How long values are cut so that the engine's power-of-two page runs waste little.
//!
//! One value takes one run of 2^k pages of 4 KiB. A value of 2^k bytes would need the next longer run for the few
//! bytes of the engine's own head, and waste half of it; so runs are filled up to [`SLACK`] bytes under 2^k.

use crate::store::format::frame;

/// What is left free of a run for the engine's head and key.
pub(in crate::store) const SLACK: usize = 256;
/// The longest run that is used, as a power of two: 1 MiB.
const LONGEST: u32 = 20;
/// The shortest run: one page.
const SHORTEST: u32 = 12;

/// The payload bytes that a frame may have so that its value fills a run of 2^`power` bytes.
pub(in crate::store) const fn capacity(power: u32) -> usize {
    (1 << power) - SLACK - frame::HEAD
}

/// The lengths of the pieces that `length` bytes are cut into, where each piece's payload starts with `overhead` bytes
/// of its own. At least one piece, so that nothing is something too.
pub(in crate::store) fn cut(length: usize, overhead: usize) -> Vec<usize> {
    let mut pieces = Vec::new();
    let mut left = length;
    loop {
        let fits = |power: u32| capacity(power) - overhead;
        let piece = match (SHORTEST..=LONGEST).find(|&power| fits(power) >= left) {
            // All that is left, where the run that holds it is nearly full or as short as can be.
            Some(power) if power == SHORTEST || fits(power) - left <= fits(power) / 8 => left,
            Some(power) => fits(power - 1),
            None => fits(LONGEST),
        };
        pieces.push(piece);
        left -= piece;
        if left == 0 {
            return pieces;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pieces_add_up_and_waste_less_than_a_ninth_and_a_page() {
        for length in (0..300_000).step_by(97).chain([1 << 20, 5_000_000, 123_456_789]) {
            let pieces = cut(length, 16);
            assert_eq!(pieces.iter().sum::<usize>(), length);
            let runs: usize =
                pieces.iter().map(|piece| (piece + 16 + frame::HEAD + SLACK).next_power_of_two().max(4096)).sum();
            assert!(runs <= length + length / 7 + 4096 + 512, "{length}: {runs}");
        }
        assert_eq!(cut(0, 16), [0]);
    }
}
