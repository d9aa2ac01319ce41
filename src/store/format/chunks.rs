//! How long values are cut into chunks so that the engine's power-of-two page runs waste little.
//!
//! The engine stores one value in a run of 2^k pages of 4 KiB. A value of exactly 2^k bytes would need the next longer
//! run for the few bytes of the engine's own head, and waste half of it; runs are therefore filled up to [`SLACK`] bytes
//! below 2^k.

use crate::store::format::frame;

/// The bytes of a run that are left free for the engine's head and key.
pub(crate) const SLACK: usize = 256;
/// The longest run that is used, as a power of two: 1 MiB.
const LONGEST: u32 = 20;
/// The shortest run: one page.
const SHORTEST: u32 = 12;

/// The payload bytes that fit a frame whose value fills a run of 2^`power` bytes.
pub(crate) const fn capacity(power: u32) -> usize {
    (1 << power) - SLACK - frame::HEAD
}

/// The lengths of the chunks that `length` bytes are cut into, if the payload of each chunk begins with `overhead` bytes
/// of its own. There is at least one chunk, so that an empty value is distinguishable from none.
pub(crate) fn cut(length: usize, overhead: usize) -> Vec<usize> {
    let mut chunks = Vec::new();
    let mut left = length;
    loop {
        let fits = |power: u32| capacity(power) - overhead;
        let chunk = match (SHORTEST..=LONGEST).find(|&power| fits(power) >= left) {
            // The rest, if the run that holds it is nearly full or the shortest there is.
            Some(power) if power == SHORTEST || fits(power) - left <= fits(power) / 8 => left,
            Some(power) => fits(power - 1),
            None => fits(LONGEST),
        };
        chunks.push(chunk);
        left -= chunk;
        if left == 0 {
            return chunks;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn chunks_add_up_and_waste_less_than_a_ninth_and_a_page() {
        for length in (0..300_000).step_by(97).chain([1 << 20, 5_000_000, 123_456_789]) {
            let chunks = cut(length, 16);
            assert_eq!(chunks.iter().sum::<usize>(), length);
            let runs: usize =
                chunks.iter().map(|chunk| (chunk + 16 + frame::HEAD + SLACK).next_power_of_two().max(4096)).sum();
            assert!(runs <= length + length / 7 + 4096 + 512, "{length}: {runs}");
        }
        assert_eq!(cut(0, 16), [0]);
    }
}
