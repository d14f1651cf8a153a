//! Least squares with columns of unit norm.

use super::rows::Rows;
use nalgebra::{DMatrix, DVector};
use residual_diagnosis::decomposition::SingularDecomposition;

/// Smallest singular value, relative to the largest, of independent columns.
const RANK: f64 = 1e-9;
/// Share of a dependency below which a column does not take part in it.
const SHARE: f64 = 1e-6;

/// Free coefficients with their figures.
pub(super) struct Solved {
    pub free: DVector<f64>,
    pub standard_errors: DVector<f64>,
    pub condition: f64,
}

/// Solves for the free coefficients; the columns that depend on each other otherwise.
pub(super) fn fit(rows: &Rows) -> Result<Solved, Vec<usize>> {
    let count = rows.free_count();
    if count == 0 {
        let none = DVector::zeros(0);
        return Ok(Solved {
            free: none.clone(),
            standard_errors: none,
            condition: 1.0,
        });
    }
    let norms = DVector::from_fn(count, |j, _| rows.regressors.column(j).norm());
    let unit = norms.map(|norm| if norm > 0.0 { norm.recip() } else { 0.0 });
    let scaled = &rows.regressors * DMatrix::from_diagonal(&unit);
    if rows.len() < count {
        return Err((0..count).collect());
    }
    let (q, r) = scaled.qr().unpack();
    let decomposition = SingularDecomposition::new(&r);
    let largest = decomposition.largest();
    let dependent = decomposition.null_space(RANK * largest);
    if dependent.ncols() > 0 {
        let takes_part = |j: &usize| dependent.row(*j).amax() > SHARE;
        return Err((0..count).filter(takes_part).collect());
    }
    let inverse = decomposition
        .left_inverse(RANK)
        .ok_or_else(|| (0..count).collect::<Vec<_>>())?;
    let free = (&inverse * q.tr_mul(rows.target())).component_mul(&unit);
    let freedom = rows.len().saturating_sub(count).max(1);
    let variance = rows.residual(&free).norm_squared() / freedom as f64;
    let standard_errors = DVector::from_fn(count, |j, _| inverse.row(j).norm() * unit[j] * variance.sqrt());
    Ok(Solved {
        free,
        standard_errors,
        condition: largest / decomposition.smallest(),
    })
}
