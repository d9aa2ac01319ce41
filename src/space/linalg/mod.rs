//! Small dense matrices and the symmetric eigenproblem, in a fixed order of operations.
//!
//! Own code and not a linear-algebra crate's, since those choose instructions at run time: here the same numbers give
//! the same bits on every machine. Loops run over neighbours and are left to the compiler to vectorise.

use std::ops::{Index, IndexMut, Range};

/// A matrix, row-major.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Matrix {
    rows: usize,
    columns: usize,
    values: Vec<f64>,
}

impl Matrix {
    pub(super) fn zero(rows: usize, columns: usize) -> Self {
        Self { rows, columns, values: vec![0.0; rows * columns] }
    }

    /// With the element at (row, column) being `f(row, column)`.
    pub(super) fn from_fn(rows: usize, columns: usize, f: impl Fn(usize, usize) -> f64) -> Self {
        let f = &f;
        Self { rows, columns, values: (0..rows).flat_map(|i| (0..columns).map(move |j| f(i, j))).collect() }
    }

    /// Of `rows * columns` values, row after row.
    pub(super) fn from_values(rows: usize, columns: usize, values: Vec<f64>) -> Self {
        debug_assert_eq!(values.len(), rows * columns);
        Self { rows, columns, values }
    }

    pub(super) fn rows(&self) -> usize {
        self.rows
    }

    pub(super) fn columns(&self) -> usize {
        self.columns
    }

    pub(super) fn row(&self, row: usize) -> &[f64] {
        &self.values[row * self.columns..][..self.columns]
    }

    fn row_mut(&mut self, row: usize) -> &mut [f64] {
        &mut self.values[row * self.columns..][..self.columns]
    }

    /// Two different rows, the first before the second.
    fn two_rows(&mut self, first: usize, second: usize) -> (&mut [f64], &mut [f64]) {
        let (head, tail) = self.values.split_at_mut(second * self.columns);
        (&mut head[first * self.columns..][..self.columns], &mut tail[..self.columns])
    }

    pub(super) fn values(&self) -> &[f64] {
        &self.values
    }

    pub(super) fn into_values(self) -> Vec<f64> {
        self.values
    }

    pub(super) fn transposed(&self) -> Self {
        Self::from_fn(self.columns, self.rows, |i, j| self[(j, i)])
    }

    /// `self other`.
    pub(super) fn times(&self, other: &Self) -> Self {
        let mut product = Self::zero(self.rows, other.columns);
        for i in 0..self.rows {
            let out = &mut product.values[i * other.columns..][..other.columns];
            for (k, &factor) in self.row(i).iter().enumerate() {
                axpy(out, factor, other.row(k));
            }
        }
        product
    }
}

impl Index<(usize, usize)> for Matrix {
    type Output = f64;

    fn index(&self, (row, column): (usize, usize)) -> &f64 {
        &self.values[row * self.columns + column]
    }
}

impl IndexMut<(usize, usize)> for Matrix {
    fn index_mut(&mut self, (row, column): (usize, usize)) -> &mut f64 {
        &mut self.values[row * self.columns + column]
    }
}

/// `out += factor vector`.
pub(super) fn axpy(out: &mut [f64], factor: f64, vector: &[f64]) {
    out.iter_mut().zip(vector).for_each(|(out, value)| *out += factor * value);
}

/// The inner product, in eight interleaved lanes.
pub(super) fn dot(a: &[f64], b: &[f64]) -> f64 {
    let (a, a_rest) = a.as_chunks::<8>();
    let (b, b_rest) = b.as_chunks::<8>();
    let mut lanes = [0.0; 8];
    for (a, b) in a.iter().zip(b) {
        for lane in 0..8 {
            lanes[lane] += a[lane] * b[lane];
        }
    }
    for (lane, (a, b)) in lanes.iter_mut().zip(a_rest.iter().zip(b_rest)) {
        *lane += a * b;
    }
    let pairs = [lanes[0] + lanes[4], lanes[1] + lanes[5], lanes[2] + lanes[6], lanes[3] + lanes[7]];
    (pairs[0] + pairs[2]) + (pairs[1] + pairs[3])
}

/// The eigenvalues of a symmetric matrix, ascending, and its eigenvectors as the rows of a matrix: orthonormal, of
/// either sign.
pub(super) struct Eigen {
    pub(super) values: Vec<f64>,
    pub(super) vectors: Matrix,
}

impl Eigen {
    /// Of a symmetric matrix of finite numbers: Householder's reduction to tridiagonal form, then implicit QL steps.
    ///
    /// Eigenvalues are right to about 1e-15 of the largest, as always with this method.
    pub(super) fn of(matrix: Matrix) -> Self {
        let mut reduced = Tridiagonal::of(matrix);
        reduced.diagonalise();
        let mut order: Vec<usize> = (0..reduced.diagonal.len()).collect();
        order.sort_by(|&a, &b| reduced.diagonal[a].total_cmp(&reduced.diagonal[b]));
        Self {
            values: order.iter().map(|&at| reduced.diagonal[at]).collect(),
            vectors: Matrix::from_fn(order.len(), order.len(), |i, j| reduced.vectors[(order[i], j)]),
        }
    }
}

/// A tridiagonal matrix, and the rows of the orthogonal matrix that leads there: `vectors A vectors'`.
struct Tridiagonal {
    diagonal: Vec<f64>,
    /// The element right of each diagonal one; the last is 0.
    beside: Vec<f64>,
    vectors: Matrix,
}

impl Tridiagonal {
    fn of(mut a: Matrix) -> Self {
        let n = a.rows;
        let (mut beside, mut reflections) = (Vec::with_capacity(n), Vec::with_capacity(n));
        for k in 0..n {
            let (reflection, length) = Reflection::of(&a.row(k)[k + 1..]);
            reflection.apply_to_both_sides(&mut a, k + 1..n);
            beside.push(length);
            reflections.push(reflection);
        }
        let diagonal = (0..n).map(|k| a[(k, k)]).collect();
        // Backwards, so that each reflection meets only what lies behind its own row.
        let mut product = Matrix::from_fn(n, n, |i, j| f64::from(i == j));
        for (k, reflection) in reflections.iter().enumerate().rev() {
            reflection.apply_from_the_left(&mut product, k + 1..n);
        }
        Self { diagonal, beside, vectors: product.transposed() }
    }

    /// Turns the off-diagonal to 0, eigenvalue after eigenvalue.
    fn diagonalise(&mut self) {
        /// Three are usual, thirty the folklore's limit; what is not finite would never end.
        const MOST_STEPS: usize = 60;
        let n = self.diagonal.len();
        for first in 0..n {
            for _ in 0..MOST_STEPS {
                let last = (first..n - 1).find(|&at| self.is_split(at)).unwrap_or(n - 1);
                if last == first {
                    break;
                }
                self.step(first, last);
            }
        }
    }

    /// Whether the element right of diagonal element `at` is nothing beside its neighbours.
    fn is_split(&self, at: usize) -> bool {
        let size = self.diagonal[at].abs() + self.diagonal[at + 1].abs();
        self.beside[at].abs() <= f64::EPSILON * size
    }

    /// One implicit QL step with Wilkinson's shift on the block from `first` to `last`: a rotation at its end starts a
    /// bulge, and each rotation after it chases the bulge one row up.
    fn step(&mut self, first: usize, last: usize) {
        let (d, e) = (&mut self.diagonal, &mut self.beside);
        let half = (d[first + 1] - d[first]) / (2.0 * e[first]);
        let shift = d[first] - e[first] / (half + half.signum() * libm::hypot(half, 1.0));
        let (mut sine, mut cosine) = (1.0, 1.0);
        let mut moved = 0.0;
        let mut bulge = d[last] - shift;
        for at in (first..last).rev() {
            let (across, along) = (sine * e[at], cosine * e[at]);
            let length = libm::hypot(across, bulge);
            e[at + 1] = length;
            if length == 0.0 {
                // The block splits here by itself.
                d[at + 1] -= moved;
                e[last] = 0.0;
                return;
            }
            (sine, cosine) = (across / length, bulge / length);
            let rest = d[at + 1] - moved;
            let turned = (d[at] - rest) * sine + 2.0 * cosine * along;
            moved = sine * turned;
            d[at + 1] = rest + moved;
            bulge = cosine * turned - along;
            let (upper, lower) = self.vectors.two_rows(at, at + 1);
            rotate(upper, lower, cosine, sine);
        }
        d[first] -= moved;
        e[first] = bulge;
        e[last] = 0.0;
    }
}

/// Turns the plane of two rows.
fn rotate(upper: &mut [f64], lower: &mut [f64], cosine: f64, sine: f64) {
    for (upper, lower) in upper.iter_mut().zip(lower) {
        let (a, b) = (*upper, *lower);
        *upper = cosine * a - sine * b;
        *lower = sine * a + cosine * b;
    }
}

/// `I - factor vector vector'`: a reflection that takes a given vector to the first axis.
struct Reflection {
    vector: Vec<f64>,
    factor: f64,
}

impl Reflection {
    /// The reflection for `x`, and where it takes it along the first axis.
    fn of(x: &[f64]) -> (Self, f64) {
        let length = dot(x, x).sqrt();
        let mut vector = x.to_vec();
        let (Some(first), true) = (vector.first_mut(), length > 0.0) else {
            return (Self { vector, factor: 0.0 }, 0.0);
        };
        // Away from the axis' own side, so that nothing cancels.
        let target = if *first > 0.0 { -length } else { length };
        *first -= target;
        let factor = -1.0 / (target * *first);
        (Self { vector, factor }, target)
    }

    /// `a <- H a H` on the symmetric block of the rows and columns in `range`.
    fn apply_to_both_sides(&self, a: &mut Matrix, range: Range<usize>) {
        let v = &self.vector;
        let mut w: Vec<f64> = range.clone().map(|row| self.factor * dot(&a.row(row)[range.clone()], v)).collect();
        let half = 0.5 * self.factor * dot(&w, v);
        axpy(&mut w, -half, v);
        for (at, row) in range.clone().enumerate() {
            let out = &mut a.row_mut(row)[range.clone()];
            let (of_w, of_v) = (v[at], w[at]);
            for ((out, w), v) in out.iter_mut().zip(&w).zip(v) {
                *out -= of_w * w + of_v * v;
            }
        }
    }

    /// `a <- H a` on the block of the rows and columns in `range`.
    fn apply_from_the_left(&self, a: &mut Matrix, range: Range<usize>) {
        let mut along = vec![0.0; range.len()];
        for (&v, row) in self.vector.iter().zip(range.clone()) {
            axpy(&mut along, v, &a.row(row)[range.clone()]);
        }
        for (&v, row) in self.vector.iter().zip(range.clone()) {
            axpy(&mut a.row_mut(row)[range.clone()], -self.factor * v, &along);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn symmetric(n: usize, rank: usize, numbers: &[f64]) -> Matrix {
        let factor = Matrix::from_fn(n, rank, |i, j| numbers[(i * rank + j) % numbers.len()] * 4_f64.powi(-(j as i32)));
        factor.times(&factor.transposed())
    }

    proptest! {
        #![proptest_config(hlacdb_testing::cases(48))]

        #[test]
        fn eigenvectors_rebuild_the_matrix(
            n in 1..24_usize, rank in 1..24_usize, numbers in proptest::collection::vec(-1.0..1.0_f64, 576),
        ) {
            let matrix = symmetric(n, rank, &numbers);
            let Eigen { values, vectors } = Eigen::of(matrix.clone());
            prop_assert!(values.is_sorted());
            let scaled = Matrix::from_fn(n, n, |i, j| values[i] * vectors[(i, j)]);
            let rebuilt = vectors.transposed().times(&scaled);
            let unit = vectors.times(&vectors.transposed());
            let size = values[n - 1].abs().max(1e-300);
            for i in 0..n {
                for j in 0..n {
                    prop_assert!((rebuilt[(i, j)] - matrix[(i, j)]).abs() < 1e-13 * size);
                    prop_assert!((unit[(i, j)] - f64::from(i == j)).abs() < 1e-13);
                }
            }
        }
    }

    #[test]
    fn special_matrices_are_no_trouble() {
        assert!(Eigen::of(Matrix::zero(0, 0)).values.is_empty());
        assert_eq!(Eigen::of(Matrix::zero(5, 5)).values, [0.0; 5]);
        let diagonal = Eigen::of(Matrix::from_fn(4, 4, |i, j| if i == j { [3.0, 1.0, 2.0, 1.0][i] } else { 0.0 }));
        assert_eq!(diagonal.values, [1.0, 1.0, 2.0, 3.0]);
        let ones = Eigen::of(Matrix::from_fn(6, 6, |_, _| 1.0));
        assert!((ones.values[5] - 6.0).abs() < 1e-14 && ones.values[..5].iter().all(|value| value.abs() < 1e-14));
    }

    #[test]
    fn a_known_spectrum_is_found() {
        // The path of n nodes: 2 - 2 cos(k pi / (n + 1)).
        let n = 60;
        let path = Matrix::from_fn(n, n, |i, j| match i.abs_diff(j) {
            0 => 2.0,
            1 => -1.0,
            _ => 0.0,
        });
        for (k, value) in Eigen::of(path).values.iter().enumerate() {
            let exact = 2.0 - 2.0 * ((k + 1) as f64 * std::f64::consts::PI / (n + 1) as f64).cos();
            assert!((value - exact).abs() < 1e-13, "{k}");
        }
    }
}
