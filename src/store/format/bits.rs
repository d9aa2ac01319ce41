//! [`Bits`]: one bit per row of a block.

/// One bit per row: row `i` is bit `i % 8` of byte `i / 8`; the bits beyond the last row are 0.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub(crate) struct Bits {
    length: usize,
    bytes: Vec<u8>,
}

impl Bits {
    pub(crate) fn len(&self) -> usize {
        self.length
    }

    pub(crate) fn bytes(&self) -> &[u8] {
        &self.bytes
    }

    pub(crate) fn push(&mut self, bit: bool) {
        if self.length.is_multiple_of(8) {
            self.bytes.push(0);
        }
        self.length += 1;
        self.set(self.length - 1, bit);
    }

    /// The bit at `index`; `false` beyond the last row.
    pub(crate) fn get(&self, index: usize) -> bool {
        index < self.length && self.bytes.get(index / 8).is_some_and(|byte| byte >> (index % 8) & 1 == 1)
    }

    /// Sets the bit at `index`; does nothing beyond the last row.
    pub(crate) fn set(&mut self, index: usize, bit: bool) {
        if index < self.length
            && let Some(byte) = self.bytes.get_mut(index / 8)
        {
            *byte = *byte & !(1 << (index % 8)) | u8::from(bit) << (index % 8);
        }
    }

    pub(crate) fn ones(&self) -> usize {
        self.bytes.iter().map(|byte| byte.count_ones() as usize).sum()
    }

    pub(crate) fn extend(&mut self, other: &Bits) {
        if self.length.is_multiple_of(8) {
            self.bytes.extend_from_slice(&other.bytes);
            self.length += other.length;
        } else {
            (0..other.length).for_each(|index| self.push(other.get(index)));
        }
    }

    /// The first `length` bits of `bytes`, and the bytes after them.
    pub(crate) fn decode(length: usize, bytes: &[u8]) -> Result<(Self, &[u8]), String> {
        let Some((bits, rest)) = bytes.split_at_checked(length.div_ceil(8)) else {
            return Err(format!("the bits of {length} rows are cut short"));
        };
        let spare = if length.is_multiple_of(8) { 0 } else { 0xFF << (length % 8) };
        if bits.last().is_some_and(|last| last & spare != 0) {
            return Err(format!("bits beyond the {length} rows are set"));
        }
        Ok((Self { length, bytes: bits.to_vec() }, rest))
    }
}
