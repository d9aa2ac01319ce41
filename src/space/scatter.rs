//! Exact sums of outer products, kept as the upper triangle.

use std::ops::{AddAssign, SubAssign};

/// `sum of v v'` over integer vectors `v`: the upper triangle, row after row, each from the diagonal on.
///
/// A quantised feature is at most 2^40, a product 2^80: an `i128` holds the sum over 2^40 textures and more.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Scatter {
    dims: usize,
    values: Vec<i128>,
}

/// Vectors whose outer products are added up together.
const TOGETHER: usize = 8;

/// Whether something comes or goes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Sign {
    Add,
    Remove,
}

impl Scatter {
    pub(super) fn new(dims: usize) -> Self {
        Self { dims, values: vec![0; Self::length(dims)] }
    }

    /// Of values as [`Scatter::values`] gives them; `None` where they are not the triangle of `dims`.
    pub(super) fn from_values(dims: usize, values: Vec<i128>) -> Option<Self> {
        (values.len() == Self::length(dims)).then_some(Self { dims, values })
    }

    /// How many values the triangle of `dims` has.
    pub(super) fn length(dims: usize) -> usize {
        dims * (dims + 1) / 2
    }

    pub(super) fn values(&self) -> &[i128] {
        &self.values
    }

    /// The rows, each from the diagonal on.
    pub(super) fn rows(&self) -> impl Iterator<Item = &[i128]> {
        let mut rest = self.values.as_slice();
        (0..self.dims).map(move |row| {
            let (row, below) = rest.split_at(self.dims - row);
            rest = below;
            row
        })
    }

    /// Adds or removes the outer product of one vector.
    pub(super) fn outer(&mut self, vector: &[i64], sign: Sign) {
        let mut values = self.values.iter_mut();
        for (row, &a) in vector.iter().enumerate() {
            let a = i128::from(if sign == Sign::Add { a } else { -a });
            // The shorter of the two ends the loop: the row of the triangle.
            for (&b, value) in vector[row..].iter().zip(&mut values) {
                *value += a * i128::from(b);
            }
        }
    }

    /// Adds the outer products of many vectors.
    ///
    /// Eight at a time: their products are added up in registers, and the sums, half a megabyte of them for moments, are
    /// read and written once for eight vectors instead of for each. The sums are the same: they are integers.
    pub(super) fn outer_all<'a>(&mut self, vectors: impl IntoIterator<Item = &'a [i64]>) {
        let mut columns = vec![[0_i64; TOGETHER]; self.dims];
        let mut filled = 0;
        for vector in vectors {
            for (column, &value) in columns.iter_mut().zip(vector) {
                column[filled] = value;
            }
            filled += 1;
            if filled == TOGETHER {
                self.add_columns(&columns);
                filled = 0;
            }
        }
        if filled > 0 {
            columns.iter_mut().for_each(|column| column[filled..].fill(0));
            self.add_columns(&columns);
        }
    }

    fn add_columns(&mut self, columns: &[[i64; TOGETHER]]) {
        let mut values = self.values.iter_mut();
        for (row, a) in columns.iter().enumerate() {
            for (b, value) in columns[row..].iter().zip(&mut values) {
                *value += a.iter().zip(b).map(|(&a, &b)| i128::from(a) * i128::from(b)).sum::<i128>();
            }
        }
    }

    /// Adds or removes eight times the scatter of eight vectors about their mean, `8 sum q q' - s s'` with `s` their
    /// sum: exact, since nothing is divided.
    pub(super) fn octants(&mut self, vectors: &[[i64; 8]], sign: Sign) {
        let sums: Vec<i64> = vectors.iter().map(|octants| octants.iter().sum()).collect();
        let mut values = self.values.iter_mut();
        for (row, (a, &sum)) in vectors.iter().zip(&sums).enumerate() {
            let factor = if sign == Sign::Add { 8 } else { -8 };
            let (a, sum) = (a.map(|octant| i128::from(factor * octant)), i128::from(sum) * i128::from(factor / 8));
            for ((b, &other), value) in vectors[row..].iter().zip(&sums[row..]).zip(&mut values) {
                let products = a.iter().zip(b).map(|(&a, &b)| a * i128::from(b)).sum::<i128>();
                *value += products - sum * i128::from(other);
            }
        }
    }
}

impl AddAssign<&Scatter> for Scatter {
    fn add_assign(&mut self, other: &Scatter) {
        self.values.iter_mut().zip(&other.values).for_each(|(value, other)| *value += other);
    }
}

impl SubAssign<&Scatter> for Scatter {
    fn sub_assign(&mut self, other: &Scatter) {
        self.values.iter_mut().zip(&other.values).for_each(|(value, other)| *value -= other);
    }
}
