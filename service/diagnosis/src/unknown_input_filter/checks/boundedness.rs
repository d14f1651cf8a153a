//! Whether the set of a mode stays bounded (method sheet 3.1.5).

use super::{CheckWarning, Decoupling, name, two_norm};
use crate::decomposition::{SingularDecomposition, eigenvalues};
use crate::model::LinearModel;
use crate::unknown_input_filter::modes::FaultMode;
use nalgebra::{Complex, DMatrix};

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

/// σ_min of \[λI - A; M\] over the complex numbers, from its real form \[Re, -Im; Im, Re\], which has every singular
/// value twice.
fn smallest_singular_value(a: &DMatrix<f64>, m: &DMatrix<f64>, eigenvalue: Complex<f64>) -> f64 {
    let (nx, rows) = (a.nrows(), a.nrows() + m.nrows());
    let mut stacked = DMatrix::zeros(2 * rows, 2 * nx);
    for part in 0..2 {
        stacked
            .view_mut((part * rows, part * nx), (nx, nx))
            .copy_from(&-a);
        stacked
            .view_mut((part * rows + nx, part * nx), m.shape())
            .copy_from(m);
    }
    for i in 0..nx {
        stacked[(i, i)] += eigenvalue.re;
        stacked[(rows + i, nx + i)] += eigenvalue.re;
        stacked[(i, nx + i)] -= eigenvalue.im;
        stacked[(rows + i, i)] += eigenvalue.im;
    }
    SingularDecomposition::new(&stacked).smallest()
}
