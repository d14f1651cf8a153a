//! Dense matrices for the real-time path: allocated once, rows contiguous, no check that can panic on data.
//!
//! A [`Matrix`] keeps the room it was created with and can be reshaped within it. The kernels write into
//! buffers of the caller and run over whole rows, so that the compiler can vectorise them; their order of
//! summation is fixed, so that equal inputs give equal bits.

pub(crate) mod blocks;
pub(crate) mod columns;
mod kernels;
mod products;
mod stored;
mod triangular;
pub(crate) mod vectors;

pub use kernels::{
    absolute_dot, absolute_sum, add_combination, add_scaled, all_finite, apply, combination, dot, lower_gram,
    multiply_transposed,
};
pub use products::{difference_row_sums, multiply, product_row_sums, row_sums, subtract_product};

pub use triangular::{forward_substitution, triangularise};

use std::ops::{Index, IndexMut};

use nalgebra::DMatrix;
use serde::Deserialize;

/// A row-major matrix that can be reshaped within the room it was created with.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(try_from = "stored::StoredMatrix")]
pub struct Matrix {
    rows: usize,
    columns: usize,
    stride: usize,
    data: Box<[f64]>,
}

impl Matrix {
    /// A zero matrix with room for exactly its own shape.
    pub fn zeros(rows: usize, columns: usize) -> Self {
        Self {
            rows,
            columns,
            stride: columns,
            data: vec![0.0; rows * columns].into_boxed_slice(),
        }
    }

    /// A matrix with room for `rows` x `column_capacity` and no column yet.
    pub fn with_capacity(rows: usize, column_capacity: usize) -> Self {
        Self {
            columns: 0,
            ..Self::zeros(rows, column_capacity)
        }
    }

    /// The shape (rows, columns).
    pub fn shape(&self) -> (usize, usize) {
        (self.rows, self.columns)
    }

    /// Number of rows.
    pub fn rows(&self) -> usize {
        self.rows
    }

    /// Number of columns.
    pub fn columns(&self) -> usize {
        self.columns
    }

    /// Largest number of columns.
    pub fn column_capacity(&self) -> usize {
        self.stride
    }

    /// Whether the room is that of another matrix, whatever the shapes.
    pub fn has_room_of(&self, other: &Self) -> bool {
        self.stride == other.stride && self.data.len() == other.data.len()
    }

    /// Changes the shape within the room; the elements keep their places, new ones hold whatever was there.
    pub fn reshape(&mut self, rows: usize, columns: usize) {
        debug_assert!(columns <= self.stride && rows * self.stride <= self.data.len());
        self.rows = rows;
        self.columns = columns;
    }

    /// Row `i`.
    #[inline]
    pub fn row(&self, i: usize) -> &[f64] {
        &self.data[i * self.stride..i * self.stride + self.columns]
    }

    /// Row `i`, to be written.
    #[inline]
    pub fn row_mut(&mut self, i: usize) -> &mut [f64] {
        &mut self.data[i * self.stride..i * self.stride + self.columns]
    }

    /// Row `i` to be read and row `j` > `i` to be written.
    pub(crate) fn two_rows(&mut self, i: usize, j: usize) -> (&[f64], &mut [f64]) {
        debug_assert!(i < j);
        let (before, after) = self.data.split_at_mut(j * self.stride);
        let first = i * self.stride;
        (&before[first..first + self.columns], &mut after[..self.columns])
    }

    /// All rows in order.
    pub fn iter_rows(&self) -> impl Iterator<Item = &[f64]> {
        (0..self.rows).map(|i| self.row(i))
    }

    /// Takes shape and elements of `source`, which must fit into the room.
    pub fn copy_from(&mut self, source: &Self) {
        self.reshape(source.rows, source.columns);
        for i in 0..source.rows {
            self.row_mut(i).copy_from_slice(source.row(i));
        }
    }

    /// Sets every element.
    pub fn fill(&mut self, value: f64) {
        for i in 0..self.rows {
            self.row_mut(i).fill(value);
        }
    }

    /// Appends the square block diag(`diagonal`) on the right.
    pub fn append_diagonal(&mut self, diagonal: &[f64]) {
        let first = self.columns;
        self.reshape(self.rows, first + diagonal.len());
        for (i, value) in diagonal.iter().enumerate() {
            self.row_mut(i)[first..].fill(0.0);
            self[(i, first + i)] = *value;
        }
    }

    /// Appends the columns of `source` on the right.
    pub fn append(&mut self, source: &Self) {
        let first = self.columns;
        self.reshape(self.rows, first + source.columns);
        for i in 0..self.rows {
            self.row_mut(i)[first..].copy_from_slice(source.row(i));
        }
    }

    /// Appends `source` diag(`scale`) on the right.
    pub fn append_scaled(&mut self, source: &Self, scale: &[f64]) {
        let first = self.columns;
        self.reshape(self.rows, first + source.columns);
        for i in 0..self.rows {
            for (target, (value, factor)) in self.row_mut(i)[first..]
                .iter_mut()
                .zip(source.row(i).iter().zip(scale))
            {
                *target = value * factor;
            }
        }
    }

    /// The transposed matrix (allocates; off-line).
    pub fn transpose(&self) -> Self {
        let mut out = Self::zeros(self.columns, self.rows);
        for i in 0..self.rows {
            for j in 0..self.columns {
                out[(j, i)] = self[(i, j)];
            }
        }
        out
    }

    /// The matrix of absolute values (allocates; off-line).
    pub fn absolute(&self) -> Self {
        let mut out = self.clone();
        out.data.iter_mut().for_each(|value| *value = value.abs());
        out
    }

    /// The same matrix for off-line work (allocates).
    pub fn to_dense(&self) -> DMatrix<f64> {
        DMatrix::from_fn(self.rows, self.columns, |i, j| self[(i, j)])
    }
}

impl From<&DMatrix<f64>> for Matrix {
    fn from(dense: &DMatrix<f64>) -> Self {
        let mut out = Self::zeros(dense.nrows(), dense.ncols());
        for i in 0..dense.nrows() {
            for j in 0..dense.ncols() {
                out[(i, j)] = dense[(i, j)];
            }
        }
        out
    }
}

impl Index<(usize, usize)> for Matrix {
    type Output = f64;

    #[inline]
    fn index(&self, (i, j): (usize, usize)) -> &f64 {
        &self.data[i * self.stride + j]
    }
}

impl IndexMut<(usize, usize)> for Matrix {
    #[inline]
    fn index_mut(&mut self, (i, j): (usize, usize)) -> &mut f64 {
        &mut self.data[i * self.stride + j]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_reshaped_matrix_keeps_its_rows() {
        let mut matrix = Matrix::with_capacity(2, 5);
        matrix.append_diagonal(&[1.0, 2.0]);
        let mut source = Matrix::zeros(2, 3);
        source[(1, 2)] = 0.5;
        matrix.append_scaled(&source, &[1.0, 2.0, 3.0]);
        assert_eq!(matrix.shape(), (2, 5));
        assert_eq!(matrix.row(1)[..2], [0.0, 2.0]);
        assert_eq!(matrix[(1, 4)], 1.5);
    }
}
