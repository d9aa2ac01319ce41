//! [`Selection`]: the sample at a rank, found by passing over all samples.

/// Finds the key of the sample at a rank, counted from 1, by radix selection.
///
/// Keys are counted by 16 bits at a time, the highest first: one pass over the samples for every 16 bits of a sample, and
/// 65 536 counters of memory, whatever the size of the volume.
pub(super) struct Selection {
    /// The rank among the keys that begin with `prefix`.
    rank: u64,
    /// The bits found so far.
    prefix: u64,
    /// The number of bits after the prefix, a multiple of [`DIGIT`](Self::DIGIT).
    below: u32,
    counts: Vec<u64>,
}

impl Selection {
    const DIGIT: u32 = 16;

    /// For the sample at `rank` among samples of `size` bytes.
    pub(super) fn new(rank: u64, size: usize) -> Self {
        let below = (8 * size as u32).next_multiple_of(Self::DIGIT);
        Self { rank, prefix: 0, below, counts: vec![0; 1 << Self::DIGIT] }
    }

    /// Takes in some keys of a pass.
    pub(super) fn count(&mut self, keys: impl Iterator<Item = u64>) {
        let (prefix, above, shift) = (self.prefix, self.below, self.below - Self::DIGIT);
        for key in keys {
            if key.checked_shr(above).unwrap_or(0) == prefix {
                self.counts[(key >> shift) as usize & ((1 << Self::DIGIT) - 1)] += 1;
            }
        }
    }

    /// Ends a pass over all samples; the key, once all of its bits are found.
    pub(super) fn narrow(&mut self) -> Option<u64> {
        let mut digit = 0;
        for (value, &count) in (0..).zip(&self.counts) {
            digit = value;
            if self.rank <= count {
                break;
            }
            self.rank -= count;
        }
        self.prefix = self.prefix << Self::DIGIT | digit;
        self.below -= Self::DIGIT;
        self.counts.fill(0);
        (self.below == 0).then_some(self.prefix)
    }
}
