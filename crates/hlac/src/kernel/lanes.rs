//! [`Lanes`]: the vector operations that the kernels need, and their implementation in plain Rust.
//!
//! One register type serves as 16-bit words, as 32-bit lanes (two words each) and as 64-bit lanes. `body.rs` is written
//! over this trait; each instruction set has one file that implements it.

/// A vector register.
///
/// # Safety
/// - Every function may use instructions that only some CPUs have. The caller must have checked that the CPU has those of
///   the implementing file.
/// - Pointers must be valid for [`Lanes::WORDS`] elements and, except in `widen`, aligned to the register.
///
/// Functions are `#[inline(always)]`, so that they become part of a caller for which the instructions are enabled.
pub(super) trait Lanes: Copy {
    /// The number of 16-bit words in a register; at most [`MAX_WORDS`].
    const WORDS: usize;
    /// [`multiply_add`](Lanes::multiply_add) and [`add_widened`](Lanes::add_widened) together add the products of words
    /// `GROUP * i .. GROUP * (i + 1)` to the 64-bit lanes `GROUP / 4 * i .. GROUP / 4 * (i + 1)`.
    const GROUP: usize;

    /// All bits 0.
    unsafe fn zero() -> Self;
    /// The same word in all places.
    unsafe fn splat(word: i16) -> Self;
    /// Reads words.
    unsafe fn load(from: *const i16) -> Self;
    /// Writes words.
    unsafe fn store(self, to: *mut i16);
    /// Reads bytes into words, 0 to 255.
    unsafe fn widen(from: *const u8) -> Self;
    /// Bitwise and.
    unsafe fn and(self, other: Self) -> Self;
    /// Bitwise exclusive or.
    unsafe fn xor(self, other: Self) -> Self;
    /// The wrapping sum of words.
    unsafe fn add_words(self, other: Self) -> Self;
    /// The wrapping difference of words.
    unsafe fn subtract_words(self, other: Self) -> Self;
    /// The low 16 bits of the products of words.
    unsafe fn multiply_words(self, other: Self) -> Self;
    /// The wrapping sum of 32-bit lanes.
    unsafe fn add(self, other: Self) -> Self;
    /// The wrapping difference of 32-bit lanes.
    unsafe fn subtract(self, other: Self) -> Self;
    /// Adds the sums of neighbouring 32-bit lanes, with their signs, to 64-bit lanes.
    unsafe fn add_widened(self, sums: Self) -> Self;
    /// Adds the products of signed words to 32-bit lanes, wrapping. The lane of a word depends on [`Lanes::GROUP`].
    unsafe fn multiply_add(self, a: Self, b: Self) -> Self;
}

/// The widest register, in words.
pub(super) const MAX_WORDS: usize = 32;

/// Eight words in plain Rust, for CPUs without a vector kernel.
///
/// A `GROUP` of 4 adds neighbouring products, as x86 does. A `GROUP` of 8 adds products four apart, as Arm does, so that
/// tests cover that order on any CPU. Nothing is inlined, because the loops of the plans would grow very long.
#[derive(Clone, Copy)]
#[repr(align(16))]
pub(super) struct Portable<const GROUP: usize = 4>([i16; WORDS]);

/// The number of words in a portable register.
const WORDS: usize = 8;

impl<const GROUP: usize> Portable<GROUP> {
    #[inline(always)]
    fn words(self, other: Self, f: impl Fn(i16, i16) -> i16) -> Self {
        Self(std::array::from_fn(|i| f(self.0[i], other.0[i])))
    }

    #[inline(always)]
    fn integers(self, f: impl Fn(usize, i32) -> i32) -> Self {
        let mut words = [0; WORDS];
        for lane in 0..WORDS / 2 {
            let value = f(lane, self.integer(lane));
            words[2 * lane] = value as i16;
            words[2 * lane + 1] = (value >> 16) as i16;
        }
        Self(words)
    }

    #[inline(always)]
    fn integer(self, lane: usize) -> i32 {
        i32::from(self.0[2 * lane + 1]) << 16 | i32::from(self.0[2 * lane] as u16)
    }
}

impl<const GROUP: usize> Lanes for Portable<GROUP> {
    const WORDS: usize = WORDS;
    const GROUP: usize = GROUP;

    #[inline(never)]
    unsafe fn zero() -> Self {
        Self([0; WORDS])
    }
    #[inline(never)]
    unsafe fn splat(word: i16) -> Self {
        Self([word; WORDS])
    }
    #[inline(never)]
    unsafe fn load(from: *const i16) -> Self {
        // SAFETY: by the contract of the trait, there are `WORDS` readable, aligned words.
        unsafe { from.cast::<Self>().read() }
    }
    #[inline(never)]
    unsafe fn store(self, to: *mut i16) {
        // SAFETY: by the contract of the trait, there are `WORDS` writable, aligned words.
        unsafe { to.cast::<Self>().write(self) }
    }
    #[inline(never)]
    unsafe fn widen(from: *const u8) -> Self {
        // SAFETY: by the contract of the trait, there are `WORDS` readable bytes; bytes need no alignment.
        let bytes = unsafe { from.cast::<[u8; WORDS]>().read() };
        Self(bytes.map(i16::from))
    }
    #[inline(never)]
    unsafe fn and(self, other: Self) -> Self {
        self.words(other, |a, b| a & b)
    }
    #[inline(never)]
    unsafe fn xor(self, other: Self) -> Self {
        self.words(other, |a, b| a ^ b)
    }
    #[inline(never)]
    unsafe fn add_words(self, other: Self) -> Self {
        self.words(other, i16::wrapping_add)
    }
    #[inline(never)]
    unsafe fn subtract_words(self, other: Self) -> Self {
        self.words(other, i16::wrapping_sub)
    }
    #[inline(never)]
    unsafe fn multiply_words(self, other: Self) -> Self {
        self.words(other, i16::wrapping_mul)
    }
    #[inline(never)]
    unsafe fn add(self, other: Self) -> Self {
        self.integers(|lane, value| value.wrapping_add(other.integer(lane)))
    }
    #[inline(never)]
    unsafe fn subtract(self, other: Self) -> Self {
        self.integers(|lane, value| value.wrapping_sub(other.integer(lane)))
    }
    #[inline(never)]
    unsafe fn add_widened(self, sums: Self) -> Self {
        let mut words = [0; WORDS];
        for lane in 0..WORDS / 4 {
            let parts = [0, 1, 2, 3].map(|word| u64::from(self.0[4 * lane + word] as u16) << (16 * word));
            let sum = i64::from(sums.integer(2 * lane)) + i64::from(sums.integer(2 * lane + 1));
            let value = parts.iter().sum::<u64>().wrapping_add(sum as u64);
            for word in 0..4 {
                words[4 * lane + word] = (value >> (16 * word)) as i16;
            }
        }
        Self(words)
    }
    #[inline(never)]
    unsafe fn multiply_add(self, a: Self, b: Self) -> Self {
        let product = |word: usize| i32::from(a.0[word]) * i32::from(b.0[word]);
        self.integers(|lane, value| {
            let words = if GROUP == 8 { [lane, lane + 4] } else { [2 * lane, 2 * lane + 1] };
            words.into_iter().fold(value, |sum, word| sum.wrapping_add(product(word)))
        })
    }
}
