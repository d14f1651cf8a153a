//! Matrix variables, and points at which constraints are evaluated.

use nalgebra::DMatrix;

/// A matrix variable of a program.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct MatrixVariable {
    /// Place of its first unknown.
    first: usize,
    rows: usize,
    columns: usize,
    symmetric: bool,
}

impl MatrixVariable {
    pub(super) fn symmetric(first: usize, order: usize) -> Self {
        Self {
            first,
            rows: order,
            columns: order,
            symmetric: true,
        }
    }

    pub(super) fn full(first: usize, rows: usize, columns: usize) -> Self {
        Self {
            first,
            rows,
            columns,
            symmetric: false,
        }
    }

    /// Number of its unknowns.
    pub(super) fn unknowns(self) -> usize {
        match self.symmetric {
            true => self.rows * (self.rows + 1) / 2,
            false => self.rows * self.columns,
        }
    }

    /// Place of entry (i, j) among all unknowns.
    fn place(self, i: usize, j: usize) -> usize {
        let (row, column) = (i.min(j), i.max(j));
        self.first
            + match self.symmetric {
                true => column * (column + 1) / 2 + row,
                false => j * self.rows + i,
            }
    }

    /// Places of the diagonal entries.
    pub(super) fn diagonal(self) -> impl Iterator<Item = usize> {
        (0..self.rows.min(self.columns)).map(move |i| self.place(i, i))
    }

    /// Its value where all unknowns have the given values; 0 where there is none.
    pub(super) fn value(self, unknowns: &[f64]) -> DMatrix<f64> {
        DMatrix::from_fn(self.rows, self.columns, |i, j| {
            unknowns.get(self.place(i, j)).copied().unwrap_or(0.0)
        })
    }
}

/// Values of all variables.
#[derive(Clone, Copy, Debug)]
pub struct Point<'a> {
    pub(super) unknowns: &'a [f64],
}

impl Point<'_> {
    /// The value of a variable.
    pub fn matrix(&self, variable: MatrixVariable) -> DMatrix<f64> {
        variable.value(self.unknowns)
    }

    /// The value of a scalar; of a matrix the sum of its diagonal.
    pub fn number(&self, scalar: MatrixVariable) -> f64 {
        self.matrix(scalar).diagonal().sum()
    }
}
