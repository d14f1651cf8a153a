//! What happens to the plant over one interval of time, and how intervals follow each other.

use crate::matrix::{Matrix, multiply, multiply_transposed};

/// Φ, the input gain and Ω over an interval of length h.
///
/// The columns of `gain` are, in a table for any command, \[Υ, Ξ\] (n_x x (n_u + n_f)); once the command is
/// known, \[Υu, Ξ\] (n_x x (1 + n_f)).
#[derive(Clone, Debug, PartialEq)]
pub struct Interval {
    /// Φ = e^{Ah}, n x n.
    pub phi: Matrix,
    /// Integrals over the interval of what enters with a constant factor, n x columns.
    pub gain: Matrix,
    /// Ω = ∫ e^{Aτ} G Q G' e^{A'τ} dτ, n x n.
    pub omega: Matrix,
}

/// Room for [`Interval::follow`].
#[derive(Clone, Debug)]
pub struct IntervalWork {
    square: Matrix,
    product: Matrix,
    gain: Matrix,
}

impl IntervalWork {
    /// Room for intervals of `n` states and `columns` columns of gain.
    pub fn new(n: usize, columns: usize) -> Self {
        Self {
            square: Matrix::zeros(n, n),
            product: Matrix::zeros(n, n),
            gain: Matrix::zeros(n, columns),
        }
    }
}

impl Interval {
    /// The empty interval: Φ = I, no gain, Ω = 0.
    pub fn empty(n: usize, columns: usize) -> Self {
        let mut interval = Self {
            phi: Matrix::zeros(n, n),
            gain: Matrix::zeros(n, columns),
            omega: Matrix::zeros(n, n),
        };
        interval.clear();
        interval
    }

    /// Becomes the empty interval.
    pub fn clear(&mut self) {
        self.phi.fill(0.0);
        (0..self.phi.rows()).for_each(|i| self.phi[(i, i)] = 1.0);
        self.gain.fill(0.0);
        self.omega.fill(0.0);
    }

    /// Takes the contents of an interval of the same shape.
    pub fn copy_from(&mut self, other: &Self) {
        self.phi.copy_from(&other.phi);
        self.gain.copy_from(&other.gain);
        self.omega.copy_from(&other.omega);
    }

    /// Appends `next` (method sheet 3, step 3): Ω ← ΦjΩΦj' + Ωj, \[Υ, Ξ\] ← Φj\[Υ, Ξ\] + \[Υj, Ξj\], Φ ← ΦjΦ.
    pub fn follow(&mut self, next: &Self, work: &mut IntervalWork) {
        multiply(&next.phi, &self.omega, &mut work.product);
        multiply_transposed(&work.product, &next.phi, &mut work.square);
        add(&work.square, &next.omega, &mut self.omega);
        symmetrise(&mut self.omega);
        multiply(&next.phi, &self.gain, &mut work.gain);
        add(&work.gain, &next.gain, &mut self.gain);
        multiply(&next.phi, &self.phi, &mut work.square);
        self.phi.copy_from(&work.square);
    }
}

/// `out` = `left` + `right`, all of one shape.
fn add(left: &Matrix, right: &Matrix, out: &mut Matrix) {
    for i in 0..out.rows() {
        let terms = left.row(i).iter().zip(right.row(i));
        for (sum, (a, b)) in out.row_mut(i).iter_mut().zip(terms) {
            *sum = a + b;
        }
    }
}

/// (M + M') / 2 in place.
pub(super) fn symmetrise(matrix: &mut Matrix) {
    for i in 0..matrix.rows() {
        for j in 0..i {
            let mean = 0.5 * (matrix[(i, j)] + matrix[(j, i)]);
            matrix[(i, j)] = mean;
            matrix[(j, i)] = mean;
        }
    }
}
