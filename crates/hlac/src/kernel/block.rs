//! [`Memory`] and [`Block`]: packed voxels, and the totals that a pass over them adds to.

use std::marker::PhantomData;
use std::mem::MaybeUninit;

use super::lanes::{Lanes, MAX_WORDS};
use super::plan::{ONE, TERMS};

/// The most window planes that are packed at once, and the most window rows of each.
pub(super) const CHUNK: [usize; 2] = [16, 32];

/// The number of rows that a 32-bit lane can sum: each adds two products of at most 32 768 x 255 to it.
pub(super) const BLOCK_ROWS: usize = 128;

/// The number of thirds of the plans: 27 cells and [`ONE`].
pub(super) const THIRDS: usize = ONE + 1;

/// Words, aligned to the widest register.
#[repr(C, align(64))]
pub(super) struct Words<const N: usize>(pub(super) [i16; N]);

/// The working memory of one call of a kernel: about 160 KB of stack, most of which stays in the second-level cache.
///
/// A packed row is three registers: for one register of windows, the voxels at their cells of x = 0, 1 and 2, so that every
/// load is aligned. Lanes without a window are 0.
#[repr(C, align(64))]
pub(super) struct Memory {
    voxels: MaybeUninit<Words<{ (CHUNK[0] + 2) * (CHUNK[1] + 2) * 3 * MAX_WORDS }>>,
    /// 1 in the lanes of windows, 0 in the others.
    pub(super) ones: Words<MAX_WORDS>,
    /// For each packed plane and each (y, x) of a cell, the sums of the rows, and of the products of paired rows.
    planes: MaybeUninit<Words<{ (CHUNK[0] + 2) * 9 * 2 * MAX_WORDS }>>,
    /// For each third, minus the sum over the block of the products of its values in paired rows.
    third_products: Words<{ THIRDS * MAX_WORDS }>,
    /// For each third, the sum of its values, in 64-bit lanes.
    pub(super) third_sums: Words<{ THIRDS * MAX_WORDS }>,
    /// For each term of the plan, its sum, in 64-bit lanes.
    pub(super) totals: Words<{ TERMS * MAX_WORDS }>,
}

impl Memory {
    pub(super) fn new() -> Self {
        Self {
            voxels: MaybeUninit::uninit(),
            ones: Words([0; _]),
            planes: MaybeUninit::uninit(),
            third_products: Words([0; _]),
            third_sums: Words([0; _]),
            totals: Words([0; _]),
        }
    }

    /// A pointer to a packed row.
    #[inline(always)]
    pub(super) fn row<V: Lanes>(&mut self, plane: usize, row: usize) -> *mut i16 {
        debug_assert!(plane < CHUNK[0] + 2 && row < CHUNK[1] + 2, "{plane} {row}");
        self.voxels.as_mut_ptr().cast::<i16>().wrapping_add(plane * plane_words::<V>() + row * row_words::<V>())
    }

    /// A pointer to the two sums of a packed plane.
    #[inline(always)]
    fn plane<V: Lanes>(&mut self, plane: usize, cell: usize) -> *mut i16 {
        debug_assert!(plane < CHUNK[0] + 2 && cell < 9, "{plane} {cell}");
        self.planes.as_mut_ptr().cast::<i16>().wrapping_add((plane * 9 + cell) * 2 * V::WORDS)
    }
}

const fn row_words<V: Lanes>() -> usize {
    3 * V::WORDS
}

const fn plane_words<V: Lanes>() -> usize {
    (CHUNK[1] + 2) * row_words::<V>()
}

/// One row of windows in packed memory.
#[derive(Clone, Copy)]
pub(super) struct Row<V> {
    at: *const i16,
    ones: *const i16,
    lanes: PhantomData<V>,
}

impl<V: Lanes> Row<V> {
    /// The next row of windows.
    #[inline(always)]
    pub(super) fn next(self) -> Self {
        Self { at: self.at.wrapping_add(row_words::<V>()), ..self }
    }

    /// The intensities at a third cell.
    ///
    /// # Safety
    /// The CPU must have the instructions of `V`, and the row must lie inside its block.
    #[inline(always)]
    pub(super) unsafe fn third(self, third: usize) -> V {
        let at = match third {
            ONE => self.ones,
            cell => {
                let offset = cell / 9 * plane_words::<V>() + cell / 3 % 3 * row_words::<V>() + cell % 3 * V::WORDS;
                self.at.wrapping_add(offset)
            }
        };
        // SAFETY: the caller promises the instructions and a row inside its block; `pack` packs the two further rows and planes
        // that the windows of a block reach into.
        unsafe { V::load(at) }
    }

    /// The products of the intensities at two cells, less 32 768, so that they fit a signed word.
    ///
    /// # Safety
    /// As for [`Row::third`].
    #[inline(always)]
    pub(super) unsafe fn pair(self, [a, b]: [usize; 2]) -> V {
        // SAFETY: the caller promises what `third` requires.
        unsafe { self.third(a).multiply_words(self.third(b)).xor(V::splat(i16::MIN)) }
    }
}

/// Rows of windows, plane after plane. One loop rather than two, so that its end is mispredicted once only.
struct Steps<V> {
    row: Row<V>,
    left: usize,
    left_in_plane: usize,
    /// The number of steps in a plane, the words from one step to the next, and the further words to the next plane.
    in_plane: usize,
    step: usize,
    turn: usize,
}

impl<V: Lanes> Steps<V> {
    #[inline(always)]
    fn new(row: Row<V>, planes: usize, in_plane: usize, rows: usize) -> Self {
        let step = rows * row_words::<V>();
        let turn = plane_words::<V>() - in_plane * step;
        Self { row, left: planes * in_plane, left_in_plane: in_plane, in_plane, step, turn }
    }
}

impl<V: Lanes> Iterator for Steps<V> {
    type Item = Row<V>;

    #[inline(always)]
    fn next(&mut self) -> Option<Row<V>> {
        if self.left == 0 {
            return None;
        }
        let row = self.row;
        self.left -= 1;
        self.left_in_plane -= 1;
        self.row.at = row.at.wrapping_add(self.step);
        if self.left_in_plane == 0 {
            self.left_in_plane = self.in_plane;
            self.row.at = self.row.at.wrapping_add(self.turn);
        }
        Some(row)
    }
}

/// As many packed windows as a 32-bit lane can sum: at most [`BLOCK_ROWS`] rows.
pub(super) struct Block<'a, V> {
    memory: &'a mut Memory,
    first: usize,
    /// The number of window planes.
    planes: usize,
    /// In each plane, the number of row pairs, and of the rows after them that are taken one by one.
    row_pairs: usize,
    single_rows: usize,
    lanes: PhantomData<V>,
}

impl<'a, V: Lanes> Block<'a, V> {
    /// The block of `planes` window planes from the packed plane `first`, each with `2 * row_pairs + single_rows` rows.
    pub(super) fn new(
        memory: &'a mut Memory,
        first: usize,
        planes: usize,
        row_pairs: usize,
        single_rows: usize,
    ) -> Self {
        assert!(planes * (2 * row_pairs + single_rows) <= BLOCK_ROWS, "{planes} planes of {row_pairs} row pairs");
        Self { memory, first, planes, row_pairs, single_rows, lanes: PhantomData }
    }

    /// The first row of each pair of rows.
    #[inline(always)]
    pub(super) fn row_pairs(&mut self) -> impl Iterator<Item = Row<V>> + use<V> {
        Steps::new(self.first_row(), self.planes, self.row_pairs, 2)
    }

    /// The rows that are taken one by one.
    #[inline(always)]
    pub(super) fn single_rows(&mut self) -> impl Iterator<Item = Row<V>> + use<V> {
        let mut row = self.first_row();
        row.at = row.at.wrapping_add(2 * self.row_pairs * row_words::<V>());
        Steps::new(row, self.planes, self.single_rows, 1)
    }

    #[inline(always)]
    fn first_row(&mut self) -> Row<V> {
        let ones = self.memory.ones.0.as_ptr();
        Row { at: self.memory.row::<V>(self.first, 0), ones, lanes: PhantomData }
    }

    /// Minus the sum of the products of a third's values in paired rows.
    ///
    /// # Safety
    /// The CPU must have the instructions of `V`.
    #[inline(always)]
    pub(super) unsafe fn third_products(&self, third: usize) -> V {
        let register = &self.memory.third_products.0[third * V::WORDS..][..V::WORDS];
        // SAFETY: the caller promises the instructions; the words were sliced just above, and are aligned because `Words` is
        // aligned to the widest register and the offset is a whole number of registers.
        unsafe { V::load(register.as_ptr()) }
    }

    /// Adds the sum of a term to its total.
    ///
    /// # Safety
    /// The CPU must have the instructions of `V`.
    #[inline(always)]
    pub(super) unsafe fn add_total(&mut self, term: usize, sum: V) {
        let total = self.memory.totals.0[term * V::WORDS..][..V::WORDS].as_mut_ptr();
        // SAFETY: the caller promises the instructions; the words were sliced just above, and are aligned because `Words` is
        // aligned to the widest register and the offset is a whole number of registers.
        unsafe { V::load(total).add_widened(sum).store(total) }
    }

    /// Computes [`Block::third_products`] from the sums of the planes.
    ///
    /// # Safety
    /// The CPU must have the instructions of `V`, and [`sum_planes`] must have run on the planes.
    #[inline(always)]
    pub(super) unsafe fn prepare(&mut self) {
        let products = self.memory.third_products.0.as_mut_ptr();
        // SAFETY: the caller promises the instructions; there are `THIRDS` registers of products, aligned like `Words`.
        unsafe {
            for third in 0..ONE {
                let mut sum = V::zero();
                for plane in 0..self.planes {
                    let plane = self.memory.plane::<V>(self.first + plane + third / 9, third % 9);
                    sum = sum.subtract(V::load(plane.wrapping_add(V::WORDS)));
                }
                sum.store(products.add(third * V::WORDS));
            }
            let ones = V::load(self.memory.ones.0.as_ptr());
            let pairs = V::splat((self.planes * self.row_pairs) as i16);
            V::zero().subtract(V::zero().multiply_add(ones, pairs)).store(products.add(ONE * V::WORDS));
        }
    }
}

/// Sums the rows of each packed plane, and adds them to the sums of the thirds.
///
/// The sums of two cells that differ in y alone differ by the first and last rows, and a plane serves up to three layers of
/// cells: this takes a few additions per row instead of 27.
///
/// # Safety
/// The CPU must have the instructions of `V`; `planes + 2` planes of `rows + 2` rows must be packed.
#[inline(always)]
pub(super) unsafe fn sum_planes<V: Lanes, const FOLD: bool>(memory: &mut Memory, planes: usize, rows: usize) {
    let row_pairs = if FOLD { rows / 2 } else { 0 };
    // SAFETY: the caller promises the instructions and that the rows and planes are packed; there are `THIRDS` registers of
    // sums.
    unsafe {
        for plane in 0..planes + 2 {
            let start = memory.row::<V>(plane, 0);
            let row = |y: usize, x: usize| V::load(start.wrapping_add(y * row_words::<V>() + x * V::WORDS));
            let mut sums = [V::zero(); 3];
            let (mut even, mut odd) = ([V::zero(); 3], [V::zero(); 3]);
            for pair in 0..row_pairs {
                for x in 0..3 {
                    let [a, b, c] = [row(2 * pair, x), row(2 * pair + 1, x), row(2 * pair + 2, x)];
                    sums[x] = sums[x].add_words(a).add_words(b);
                    even[x] = even[x].multiply_add(a, b);
                    odd[x] = odd[x].multiply_add(b, c);
                }
            }
            for y in 2 * row_pairs..rows {
                sums = [0, 1, 2].map(|x| sums[x].add_words(row(y, x)));
            }
            for (x, mut sum) in sums.into_iter().enumerate() {
                let mut products = [even[x], odd[x], even[x]];
                if row_pairs > 0 {
                    let y = 2 * row_pairs;
                    let first = V::zero().multiply_add(row(0, x), row(1, x));
                    products[2] = even[x].multiply_add(row(y, x), row(y + 1, x)).subtract(first);
                }
                for (y, product) in products.into_iter().enumerate() {
                    let at = memory.plane::<V>(plane, 3 * y + x);
                    V::zero().multiply_add(sum, V::splat(1)).store(at);
                    product.store(at.wrapping_add(V::WORDS));
                    if y < 2 {
                        sum = sum.add_words(row(rows + y, x)).subtract_words(row(y, x));
                    }
                }
            }
        }
        let totals = memory.third_sums.0.as_mut_ptr();
        for third in 0..ONE {
            let mut sum = V::zero();
            for plane in 0..planes {
                sum = sum.add(V::load(memory.plane::<V>(plane + third / 9, third % 9)));
            }
            let total = totals.add(third * V::WORDS);
            V::load(total).add_widened(sum).store(total);
        }
        let windows = V::zero().multiply_add(V::load(memory.ones.0.as_ptr()), V::splat((planes * rows) as i16));
        let total = totals.add(ONE * V::WORDS);
        V::load(total).add_widened(windows).store(total);
    }
}
