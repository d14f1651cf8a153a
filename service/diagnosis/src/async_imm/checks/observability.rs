//! Detectability of the state, observability of the amplitudes, separability of the modes in the steady state.

use super::{
    super::{design::ImmDesign, design_error::DesignError},
    CheckReport,
};
use crate::{
    decomposition::{SingularDecomposition, eigenvalues},
    spectrum::{PencilGap, observability_gap},
};
use nalgebra::{Complex, DMatrix};

/// σ_min / σ_max of a test that counts as 0; also Re λ / max(1, |λ|max) that counts as not decaying.
const TOLERANCE: f64 = 1e-9;

pub(super) fn check(design: &ImmDesign) -> Result<CheckReport, DesignError> {
    let h = stacked(design);
    let mut report = CheckReport::default();
    for plant in design.plant.pieces() {
        if let Some((lambda, gap)) = detectability_gap(&plant.a, &h)?
            && !gap.has_full_rank(TOLERANCE)
        {
            return Err(DesignError::NotDetectable {
                re: lambda.re,
                im: lambda.im,
            });
        }
        let directed: Vec<_> = design
            .modes
            .iter()
            .map(|mode| &plant.f * &mode.direction)
            .collect();
        let gap = |columns: &[&DMatrix<f64>]| amplitude_gap(&plant.a, &h, &distinct(columns));
        report.amplitude_gaps.clear();
        for (mode, own) in directed.iter().enumerate().skip(1) {
            // Counted by D, so that a channel that does nothing (a column of F that is zero) is found.
            let active = columns_of(&design.modes[mode].direction).count();
            let gap = gap(&[own]);
            if !gap.has_full_rank(TOLERANCE) || columns_of(own).count() < active {
                return Err(DesignError::AmplitudeNotObservable {
                    mode,
                    name: design.modes[mode].name.clone(),
                });
            }
            report.amplitude_gaps.push(gap.smallest);
        }
        for j in 1..directed.len() {
            for i in 1..j {
                let known = report.separable_by_transients_only.contains(&(i, j));
                if !known && !gap(&[&directed[i], &directed[j]]).has_full_rank(TOLERANCE) {
                    report.separable_by_transients_only.push((i, j));
                }
            }
        }
    }
    Ok(report)
}

/// \[H_1; H_2; …\].
fn stacked(design: &ImmDesign) -> DMatrix<f64> {
    let rows: Vec<_> = design
        .sensors
        .iter()
        .flat_map(|sensor| sensor.measurement_matrix.row_iter())
        .collect();
    DMatrix::from_rows(&rows)
}

/// The eigenvalue that does not decay with the smallest σ_min\[A - λI; H\]; `None` if all decay.
///
/// # Errors
/// [`DesignError::EigenvaluesNotFound`].
pub fn detectability_gap(
    a: &DMatrix<f64>,
    h: &DMatrix<f64>,
) -> Result<Option<(Complex<f64>, PencilGap)>, DesignError> {
    let values = eigenvalues(a).ok_or(DesignError::EigenvaluesNotFound)?;
    let largest = values.iter().map(|value| value.norm()).fold(1.0, f64::max);
    let staying = values
        .into_iter()
        .filter(|value| value.re >= -TOLERANCE * largest);
    let gaps = staying.map(|value| (value, observability_gap(a, h, value)));
    Ok(gaps.min_by(|(_, left), (_, right)| left.smallest.total_cmp(&right.smallest)))
}

/// Singular values of \[A, E; H, 0\] with the directions E of the amplitudes as columns.
pub fn amplitude_gap(a: &DMatrix<f64>, h: &DMatrix<f64>, directions: &DMatrix<f64>) -> PencilGap {
    let (n, d, columns) = (a.nrows(), h.nrows(), directions.ncols());
    let mut block = DMatrix::zeros(n + d, n + columns);
    block.view_mut((0, 0), (n, n)).copy_from(a);
    block.view_mut((0, n), (n, columns)).copy_from(directions);
    block.view_mut((n, 0), (d, n)).copy_from(h);
    let values = SingularDecomposition::new(&block);
    PencilGap {
        smallest: if n + columns > n + d {
            0.0
        } else {
            values.smallest()
        },
        largest: values.largest(),
    }
}

fn columns_of(matrix: &DMatrix<f64>) -> impl Iterator<Item = nalgebra::DVector<f64>> {
    let columns = matrix.column_iter().map(|column| column.into_owned());
    columns.filter(|column| column.iter().any(|entry| *entry != 0.0))
}

/// The different columns that are not zero, side by side.
fn distinct(matrices: &[&DMatrix<f64>]) -> DMatrix<f64> {
    let rows = matrices.first().map_or(0, |matrix| matrix.nrows());
    let mut found: Vec<nalgebra::DVector<f64>> = Vec::new();
    for column in matrices.iter().flat_map(|matrix| columns_of(matrix)) {
        if !found.contains(&column) {
            found.push(column);
        }
    }
    if found.is_empty() {
        DMatrix::zeros(rows, 0)
    } else {
        DMatrix::from_columns(&found)
    }
}
