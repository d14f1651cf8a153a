//! Choice of the correction gain L = L0 + S'Z' (method sheet 4.2, steps 4 and 5).
//!
//! | symbol | here | shape |
//! |---|---|---|
//! | G, Γ | arguments | nx x q, m x q |
//! | T0 = \[G - L0Γ, -L0V\] | `rest` | nx x (q + m) |
//! | b = Z'\[Γ, V\] | `basis` | z x (q + m) |
//! | K = b b' | `inverse` holds K⁻¹ | z x z |
//! | S' | `coefficients` | nx x z |
//!
//! Row i of the corrected set has the half width Σ_c |T0 - S'b|_ic, so that every row of S' can be chosen on its
//! own. The Frobenius gain is the least-squares solution S'_F = T0 b' K⁻¹.

use super::decoupling::Decoupling;
use crate::{
    factor::{cholesky, cholesky_solve},
    matrix::{
        Matrix, absolute_sum, add_combination, combination, difference_row_sums, dot, lower_gram, multiply,
        multiply_transposed,
    },
};

/// Rows of S' that compete with the Frobenius row.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Candidates<'a> {
    /// (C⁺ - L0) Z and the half widths |C⁺| v that it gives.
    pub strip: Option<(&'a Matrix, &'a [f64])>,
    /// (L_fix - L0) Z.
    pub fixed: Option<&'a Matrix>,
    /// Reweighted least-squares sweeps.
    pub sweeps: usize,
}

/// Room for choosing a gain.
#[derive(Clone, Debug)]
pub(crate) struct GainChoice {
    rest: Matrix,
    basis: Matrix,
    /// (CF)⁺\[Γ, V\], r x (q + m).
    own: Matrix,
    factor: Matrix,
    inverse: Matrix,
    /// T0 b', nx x z.
    projections: Matrix,
    coefficients: Matrix,
    /// Half widths of the rows of `coefficients` and of others.
    least: Vec<f64>,
    half_widths: Vec<f64>,
    candidate: Vec<f64>,
    best: Vec<f64>,
    residual: Vec<f64>,
    weighted: Vec<f64>,
    weighted_factor: Matrix,
}

impl GainChoice {
    /// Room for `nx` states, `ny` outputs and generator matrices of up to `columns` columns.
    pub fn new(nx: usize, ny: usize, columns: usize) -> Self {
        let columns = columns + ny;
        Self {
            rest: Matrix::zeros(nx, columns),
            basis: Matrix::zeros(ny, columns),
            own: Matrix::zeros(ny, columns),
            factor: Matrix::zeros(ny, ny),
            inverse: Matrix::zeros(ny, ny),
            projections: Matrix::zeros(nx, ny),
            coefficients: Matrix::zeros(nx, ny),
            least: vec![0.0; nx],
            half_widths: vec![0.0; nx],
            candidate: vec![0.0; ny],
            best: vec![0.0; ny],
            residual: vec![0.0; columns],
            weighted: vec![0.0; columns],
            weighted_factor: Matrix::zeros(ny, ny),
        }
    }

    /// Computes b and K⁻¹ for the spread Γ of the predicted outputs and the noise bounds v.
    pub fn prepare(&mut self, decoupling: &Decoupling, spread: &Matrix, noise: &[f64]) {
        let (m, q) = spread.shape();
        let z = decoupling.null_basis.rows();
        extend_by_noise(&decoupling.null_basis, spread, noise, &mut self.basis);
        extend_by_noise(&decoupling.inverse, spread, noise, &mut self.own);
        debug_assert_eq!(self.basis.shape(), (z, q + m));
        lower_gram(&self.basis, &mut self.factor);
        let trace: f64 = (0..z).map(|i| self.factor[(i, i)]).sum();
        if !cholesky(&mut self.factor) {
            // Any S' is valid, so that a slightly regularised K only costs width.
            lower_gram(&self.basis, &mut self.factor);
            for i in 0..z {
                self.factor[(i, i)] += 1e-12 * trace / z as f64 + f64::MIN_POSITIVE;
            }
            if !cholesky(&mut self.factor) {
                self.factor.fill(0.0);
                (0..z).for_each(|i| self.factor[(i, i)] = 1.0);
            }
        }
        self.inverse.reshape(z, z);
        self.inverse.fill(0.0);
        for i in 0..z {
            self.inverse[(i, i)] = 1.0;
            cholesky_solve(&self.factor, self.inverse.row_mut(i));
        }
    }

    /// Chooses S' row by row and writes L = L0 + S'Z' into `gain` (nx x m). Needs [`Self::prepare`].
    pub fn choose(
        &mut self,
        decoupling: &Decoupling,
        generators: &Matrix,
        spread: &Matrix,
        candidates: Candidates<'_>,
        gain: &mut Matrix,
    ) {
        let (m, q) = spread.shape();
        let (nx, z) = (generators.rows(), self.basis.rows());
        self.rest.reshape(nx, q + m);
        for i in 0..nx {
            let rest = self.rest.row_mut(i);
            rest[..q].copy_from_slice(generators.row(i));
            rest[q..].fill(0.0);
            let own = &mut self.candidate[..decoupling.rank()];
            for (target, value) in own.iter_mut().zip(decoupling.columns.row(i)) {
                *target = -value;
            }
            add_combination(rest, own, &self.own);
        }
        // S'_F = T0 b' K⁻¹.
        multiply_transposed(&self.rest, &self.basis, &mut self.projections);
        multiply(&self.projections, &self.inverse, &mut self.coefficients);
        if z > 0 {
            self.improve(candidates);
        }
        gain.copy_from(&decoupling.gain);
        for i in 0..nx {
            add_combination(gain.row_mut(i), self.coefficients.row(i), &decoupling.null_basis);
        }
    }

    /// Lets the candidates compete with the Frobenius rows, which `coefficients` holds.
    fn improve(&mut self, candidates: Candidates<'_>) {
        if candidates.strip.is_none() && candidates.fixed.is_none() && candidates.sweeps == 0 {
            return;
        }
        let (rest, basis) = (&self.rest, &self.basis);
        difference_row_sums(rest, &self.coefficients, basis, &mut self.least);
        if let Some((rows, half_widths)) = candidates.strip {
            take_narrower(&mut self.coefficients, &mut self.least, rows, half_widths);
        }
        if let Some(rows) = candidates.fixed {
            difference_row_sums(rest, rows, basis, &mut self.half_widths);
            take_narrower(&mut self.coefficients, &mut self.least, rows, &self.half_widths);
        }
        if candidates.sweeps > 0 {
            (0..self.rest.rows()).for_each(|i| self.sweep(i, candidates.sweeps));
        }
    }

    /// Lets reweighted least-squares rows compete for state row `i`.
    fn sweep(&mut self, i: usize, sweeps: usize) {
        let z = self.basis.rows();
        self.candidate[..z].copy_from_slice(self.coefficients.row(i));
        for _ in 0..sweeps {
            if !self.reweight(i) {
                break;
            }
            let width = self.half_width(i);
            if width < self.least[i] {
                self.least[i] = width;
                self.coefficients.row_mut(i).copy_from_slice(&self.candidate[..z]);
            }
        }
    }

    /// Half width of state row `i` with the row `candidate` of S'; leaves the row of T0 - S'b in `residual`.
    fn half_width(&mut self, i: usize) -> f64 {
        let (z, width) = self.basis.shape();
        let residual = &mut self.residual[..width];
        combination(residual, &self.candidate[..z], &self.basis);
        for (value, rest) in residual.iter_mut().zip(self.rest.row(i)) {
            *value = rest - *value;
        }
        absolute_sum(residual)
    }

    /// One sweep of iteratively reweighted least squares from `candidate`; false if it cannot be solved.
    fn reweight(&mut self, i: usize) -> bool {
        let (z, width) = self.basis.shape();
        let mean = self.half_width(i) / width as f64;
        for value in &mut self.residual[..width] {
            *value = 1.0 / (value.abs() + 1e-3 * mean + 1e-300);
        }
        self.weighted_factor.reshape(z, z);
        for k in 0..z {
            for (target, (value, weight)) in self.weighted[..width]
                .iter_mut()
                .zip(self.basis.row(k).iter().zip(&self.residual))
            {
                *target = value * weight;
            }
            for j in 0..=k {
                self.weighted_factor[(k, j)] = dot(&self.weighted[..width], self.basis.row(j));
            }
            self.candidate[k] = dot(&self.weighted[..width], self.rest.row(i));
        }
        if !cholesky(&mut self.weighted_factor) {
            return false;
        }
        cholesky_solve(&self.weighted_factor, &mut self.candidate[..z]);
        true
    }

    /// Row (Z K⁻¹ Z' `signature`)', normalised: the test row matched to a fault with this signature in the
    /// received outputs. False if the fault cannot be seen. Needs [`Self::prepare`].
    pub fn matched_row(&mut self, decoupling: &Decoupling, signature: &[f64], row: &mut [f64]) -> bool {
        let z = self.basis.rows();
        for (target, basis) in self.candidate[..z]
            .iter_mut()
            .zip(decoupling.null_basis.iter_rows())
        {
            *target = dot(basis, signature);
        }
        combination(&mut self.best[..z], &self.candidate[..z], &self.inverse);
        combination(row, &self.best[..z], &decoupling.null_basis);
        let size = dot(&self.best[..z], &self.best[..z]).sqrt();
        let scale: f64 = self
            .inverse
            .iter_rows()
            .map(|row| dot(row, row))
            .sum::<f64>()
            .sqrt();
        if !(size > 1e-9 * scale * dot(signature, signature).sqrt() && size.is_finite()) {
            return false;
        }
        row.iter_mut().for_each(|value| *value /= size);
        true
    }

    /// Row `k` of φ = (CF)⁺ - (CF)⁺ΨZK⁻¹Z', the fault estimate of smallest spread. Needs [`Self::prepare`].
    pub fn estimate_row(&mut self, decoupling: &Decoupling, k: usize, row: &mut [f64]) {
        let z = self.basis.rows();
        for (target, basis) in self.candidate[..z].iter_mut().zip(self.basis.iter_rows()) {
            *target = -dot(self.own.row(k), basis);
        }
        combination(&mut self.best[..z], &self.candidate[..z], &self.inverse);
        row.copy_from_slice(decoupling.inverse.row(k));
        add_combination(row, &self.best[..z], &decoupling.null_basis);
    }
}

/// Takes over those rows of `others` whose half widths are smaller.
fn take_narrower(rows: &mut Matrix, least: &mut [f64], others: &Matrix, half_widths: &[f64]) {
    for (i, (least, width)) in least.iter_mut().zip(half_widths).enumerate() {
        if width < least {
            *least = *width;
            rows.row_mut(i).copy_from_slice(others.row(i));
        }
    }
}

/// `out` = `rows` \[spread, diag(noise)\].
fn extend_by_noise(rows: &Matrix, spread: &Matrix, noise: &[f64], out: &mut Matrix) {
    multiply(rows, spread, out);
    out.append_scaled(rows, noise);
}
