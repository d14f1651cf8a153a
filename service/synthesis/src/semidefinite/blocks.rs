//! Symmetric matrices of blocks, as matrix inequalities are written.

use nalgebra::DMatrix;

/// He(M) = M + M'.
pub fn hermitian(matrix: &DMatrix<f64>) -> DMatrix<f64> {
    matrix + matrix.transpose()
}

/// The symmetric matrix of the blocks on and above the diagonal: `upper[i]` holds blocks (i, i), (i, i + 1), …
///
/// The diagonal blocks must be symmetric; what lies below is the transpose of what lies above.
pub fn symmetric_blocks(upper: &[Vec<DMatrix<f64>>]) -> DMatrix<f64> {
    let starts: Vec<usize> = upper
        .iter()
        .scan(0, |next, row| {
            let start = *next;
            *next += row.first().map_or(0, DMatrix::nrows);
            Some(start)
        })
        .collect();
    let order = upper
        .iter()
        .filter_map(|row| row.first())
        .map(DMatrix::nrows)
        .sum();
    let mut matrix = DMatrix::zeros(order, order);
    for (i, row) in upper.iter().enumerate() {
        for (block, &column) in row.iter().zip(&starts[i..]) {
            let place = (starts[i], column);
            matrix.view_mut(place, block.shape()).copy_from(block);
            if place.0 != place.1 {
                let mut mirrored = matrix.view_mut((place.1, place.0), (block.ncols(), block.nrows()));
                mirrored.tr_copy_from(block);
            }
        }
    }
    matrix
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::dmatrix;

    #[test]
    fn blocks_above_the_diagonal_are_mirrored() {
        let matrix = symmetric_blocks(&[
            vec![
                dmatrix![1.0, 2.0; 2.0, 3.0],
                dmatrix![4.0; 5.0],
                dmatrix![6.0, 7.0; 8.0, 9.0],
            ],
            vec![dmatrix![10.0], dmatrix![11.0, 12.0]],
            vec![dmatrix![13.0, 14.0; 14.0, 15.0]],
        ]);
        let expected = dmatrix![
            1.0, 2.0, 4.0, 6.0, 7.0;
            2.0, 3.0, 5.0, 8.0, 9.0;
            4.0, 5.0, 10.0, 11.0, 12.0;
            6.0, 8.0, 11.0, 13.0, 14.0;
            7.0, 9.0, 12.0, 14.0, 15.0
        ];
        assert_eq!(matrix, expected);
    }
}
