//! [`Scatter`]: exact sums of outer products.

use std::ops::{AddAssign, SubAssign};

use super::SpaceError;
use super::codec::Reader;
use super::linalg::Matrix;

/// The sum of `v v'` over integer vectors `v`: its upper triangle, row by row, each row from the diagonal on.
///
/// A quantised feature is at most 2^40 and a product 2^80, so an `i128` holds the sum over more than 2^40 textures.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Scatter {
    dims: usize,
    values: Vec<i128>,
}

/// Vectors whose outer products are added in one pass.
const BATCH: usize = 8;

/// Whether something is added or removed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Sign {
    Add,
    Remove,
}

impl Scatter {
    pub(super) fn new(dims: usize) -> Self {
        Self { dims, values: vec![0; Self::length(dims)] }
    }

    /// Reads the packed values of a triangle of `dims` rows.
    pub(super) fn read(reader: &mut Reader<'_>, dims: usize) -> Result<Self, SpaceError> {
        Ok(Self { dims, values: reader.packed(Self::length(dims))? })
    }

    /// The number of values in the triangle of `dims` rows.
    pub(super) fn length(dims: usize) -> usize {
        dims * (dims + 1) / 2
    }

    /// The values of the triangle, row by row.
    pub(super) fn values(&self) -> &[i128] {
        &self.values
    }

    /// The rows of the triangle, each from the diagonal on.
    pub(super) fn rows(&self) -> impl Iterator<Item = &[i128]> {
        let mut rest = self.values.as_slice();
        (0..self.dims).map(move |row| {
            let (row, below) = rest.split_at(self.dims - row);
            rest = below;
            row
        })
    }

    /// The full symmetric matrix whose elements are `value(sum, row, column)`.
    pub(super) fn to_matrix(&self, value: impl Fn(i128, usize, usize) -> f64) -> Matrix {
        let mut matrix = Matrix::zero(self.dims, self.dims);
        for (row, sums) in self.rows().enumerate() {
            for (at, &sum) in sums.iter().enumerate() {
                let value = value(sum, row, row + at);
                matrix[(row, row + at)] = value;
                matrix[(row + at, row)] = value;
            }
        }
        matrix
    }

    /// Adds or removes the outer product of one vector.
    pub(super) fn outer(&mut self, vector: &[i64], sign: Sign) {
        let mut values = self.values.iter_mut();
        for (row, &a) in vector.iter().enumerate() {
            let a = i128::from(if sign == Sign::Add { a } else { -a });
            // Ends with the row of the triangle.
            for (&b, value) in vector[row..].iter().zip(&mut values) {
                *value += a * i128::from(b);
            }
        }
    }

    /// Adds the outer products of many vectors.
    ///
    /// Eight at a time: their products are added in registers, and the sums (half a megabyte for moments) are read and
    /// written once for eight vectors. The result is the same, since the sums are integers.
    pub(super) fn outer_all<'a>(&mut self, vectors: impl IntoIterator<Item = &'a [i64]>) {
        let mut columns = vec![[0_i64; BATCH]; self.dims];
        let mut filled = 0;
        for vector in vectors {
            for (column, &value) in columns.iter_mut().zip(vector) {
                column[filled] = value;
            }
            filled += 1;
            if filled == BATCH {
                self.add_columns(&columns);
                filled = 0;
            }
        }
        if filled > 0 {
            columns.iter_mut().for_each(|column| column[filled..].fill(0));
            self.add_columns(&columns);
        }
    }

    fn add_columns(&mut self, columns: &[[i64; BATCH]]) {
        let mut values = self.values.iter_mut();
        for (row, a) in columns.iter().enumerate() {
            for (b, value) in columns[row..].iter().zip(&mut values) {
                *value += a.iter().zip(b).map(|(&a, &b)| i128::from(a) * i128::from(b)).sum::<i128>();
            }
        }
    }

    /// Adds or removes eight times the scatter of eight vectors `q` about their mean: `8 sum q q' - s s'`, where `s` is
    /// their sum. Exact, since nothing is divided.
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
