//! Orthogonal iteration: the leading eigenvectors of a matrix that is only known by its products.

use super::dot_in_order;

/// A vector that loses more than this part of its length to the others is replaced: what is left of it is rounding.
const LEAST_PART: f64 = 1e-6;

/// An approximate eigenvector.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Direction {
    /// Unit length; all zeros where the matrix takes it to zero and no coordinate was left to replace it.
    pub(crate) vector: Vec<f64>,
    /// The length of the last product, less what lies along the directions before: the eigenvalue's magnitude, of the
    /// first direction at least. 0 where `vector` is zero.
    pub(crate) eigenvalue: f64,
}

/// The leading eigenvectors of a positive semi-definite matrix, one for each vector of `start`, by falling eigenvalue.
///
/// Each of `rounds` rounds multiplies all vectors by the matrix (`product`) and makes them orthonormal again, in order.
/// One start vector makes this power iteration. A vector without a component of its own is replaced by the unit vector
/// of the first coordinate in `replacements` that has one; without any it becomes zero. Vectors are orthonormal to
/// about 1e-13 whatever the matrix is; how near they are to eigenvectors depends on `rounds` and the gaps between
/// eigenvalues.
pub(crate) fn orthogonal_iteration(
    start: Vec<Vec<f64>>,
    rounds: usize,
    product: impl Fn(&[f64]) -> Vec<f64>,
    replacements: &[usize],
) -> Vec<Direction> {
    let mut directions: Vec<Direction> =
        start.into_iter().map(|vector| Direction { vector, eigenvalue: 0.0 }).collect();
    for _ in 0..rounds {
        for direction in &mut directions {
            direction.vector = product(&direction.vector);
        }
        orthonormalise(&mut directions, replacements);
    }
    directions
}

/// Gram-Schmidt, each projection done twice, since once leaves what rounding left.
fn orthonormalise(directions: &mut [Direction], replacements: &[usize]) {
    for at in 0..directions.len() {
        let (done, rest) = directions.split_at_mut(at);
        let Some(Direction { vector, eigenvalue }) = rest.first_mut() else { return };
        let mut replacements = replacements.iter();
        loop {
            let length = dot_in_order(vector, vector).sqrt();
            for _ in 0..2 {
                for Direction { vector: other, .. } in done.iter() {
                    let along = dot_in_order(vector, other);
                    vector.iter_mut().zip(other).for_each(|(value, other)| *value -= along * other);
                }
            }
            let left = dot_in_order(vector, vector).sqrt();
            if left > length * LEAST_PART && left.is_normal() {
                vector.iter_mut().for_each(|value| *value /= left);
                *eigenvalue = left;
                break;
            }
            let Some(&coordinate) = replacements.next() else {
                vector.fill(0.0);
                *eigenvalue = 0.0;
                break;
            };
            vector.fill(0.0);
            vector[coordinate] = 1.0;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::space::linalg::{Eigen, Matrix};

    fn times(matrix: &Matrix) -> impl Fn(&[f64]) -> Vec<f64> {
        |vector| (0..matrix.rows()).map(|row| dot_in_order(matrix.row(row), vector)).collect()
    }

    #[test]
    fn directions_are_the_leading_eigenvectors() {
        let matrix = Matrix::from_fn(12, 12, |i, j| 0.5_f64.powi(i.abs_diff(j) as i32) * (1.0 + (i * j) as f64));
        let exact = Eigen::of(matrix.clone());
        let start = (0..3).map(|i| (0..12).map(|j| f64::from(i == j) + 0.1).collect()).collect();
        for (at, found) in orthogonal_iteration(start, 200, times(&matrix), &[]).iter().enumerate() {
            let last = 11 - at;
            assert!((found.eigenvalue / exact.values[last] - 1.0).abs() < 1e-9, "{at}");
            assert!((dot_in_order(&found.vector, exact.vectors.row(last)).abs() - 1.0).abs() < 1e-9, "{at}");
        }
    }

    #[test]
    fn a_vector_without_a_part_of_its_own_is_replaced_or_zero() {
        // Rank one: the second vector is lost at once.
        let matrix = Matrix::from_fn(4, 4, |_, _| 1.0);
        let start = || vec![vec![1.0, 0.0, 0.0, 0.0], vec![0.0, 1.0, 0.0, 0.0]];
        let lost = orthogonal_iteration(start(), 3, times(&matrix), &[]);
        assert_eq!((lost[1].vector.as_slice(), lost[1].eigenvalue), ([0.0; 4].as_slice(), 0.0));
        let replaced = orthogonal_iteration(start(), 3, times(&matrix), &[2, 3]);
        assert!((dot_in_order(&replaced[1].vector, &replaced[1].vector) - 1.0).abs() < 1e-14);
        assert!(dot_in_order(&replaced[0].vector, &replaced[1].vector).abs() < 1e-14);
        let nothing = orthogonal_iteration(start(), 2, times(&Matrix::zero(4, 4)), &[]);
        assert!(nothing.iter().all(|direction| direction.vector == [0.0; 4] && direction.eigenvalue == 0.0));
    }
}
