//! Whether the set of a mode stays bounded (method sheet 3.1.5).

use super::{CheckWarning, Decoupling, name, two_norm};
use crate::model::LinearModel;
use crate::unknown_input_filter::modes::FaultMode;
use nalgebra::{Complex, DMatrix, Schur};

/// A warning for each eigenvalue of A_T = (I - L0C)A0 that is not stable and that the test rows do not see.
pub(super) fn unbounded_sets(
    model: &LinearModel,
    mode: FaultMode,
    decoupling: &Decoupling,
) -> Vec<CheckWarning> {
    let (nx, c, a0) = (model.state_count(), model.c(), model.a0());
    let decoupled = (DMatrix::identity(nx, nx) - &decoupling.l0 * c) * a0;
    let tested = decoupling.null_basis.tr_mul(c) * a0;
    let limit = 1e-7 * two_norm(&decoupled).max(two_norm(&(c * a0))).max(1.0);
    let Some(eigenvalues) = eigenvalues(&decoupled) else {
        return vec![CheckWarning::BoundednessUnknown {
            mode,
            name: name(model, mode),
        }];
    };
    let mut warnings = Vec::new();
    for eigenvalue in eigenvalues {
        // Conjugates give the same result: the one with the non-negative imaginary part speaks for both.
        if eigenvalue.im < 0.0 || eigenvalue.norm() < 1.0 - 1e-9 {
            continue;
        }
        if smallest_singular_value(&decoupled, &tested, eigenvalue) <= limit {
            let name = name(model, mode);
            let warning = CheckWarning::UnboundedSet {
                mode,
                name,
                real: eigenvalue.re,
                imaginary: eigenvalue.im,
            };
            if !warnings.contains(&warning) {
                warnings.push(warning);
            }
        }
    }
    warnings
}

/// σ_min of \[λI - A; M\] over the complex numbers.
fn smallest_singular_value(a: &DMatrix<f64>, m: &DMatrix<f64>, eigenvalue: Complex<f64>) -> f64 {
    let nx = a.nrows();
    let stacked = DMatrix::from_fn(nx + m.nrows(), nx, |i, j| {
        if i >= nx {
            return Complex::from(m[(i - nx, j)]);
        }
        let diagonal = if i == j { eigenvalue } else { Complex::from(0.0) };
        diagonal - a[(i, j)]
    });
    stacked.singular_values().min()
}

/// Eigenvalues; `None` if the iteration does not converge even after a change by rounding errors, which breaks
/// the symmetries on which it can stall.
fn eigenvalues(matrix: &DMatrix<f64>) -> Option<Vec<Complex<f64>>> {
    const ITERATIONS: usize = 10_000;
    let schur = |matrix: DMatrix<f64>| Schur::try_new(matrix, f64::EPSILON, ITERATIONS);
    let perturbed = || {
        let size = f64::EPSILON * matrix.amax();
        matrix.map_with_location(|i, j, entry| entry + size * ((7 * i + 3 * j + 1) as f64).sin())
    };
    let schur = schur(matrix.clone()).or_else(|| schur(perturbed()))?;
    Some(schur.complex_eigenvalues().iter().copied().collect())
}
