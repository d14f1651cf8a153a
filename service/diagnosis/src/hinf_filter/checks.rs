//! Checks of a plant (method sheet 3.1).

use super::{
    error::HinfFilterError,
    plant::{Plant, SampledPlant},
};
use crate::{decomposition::eigenvalues, spectrum::observability_gap};
use nalgebra::{Complex, DMatrix};

/// An eigenvalue counts as not decaying from this margin on.
const MARGIN: f64 = 1e-9;
/// Rank tolerance of the observability test.
const RANK: f64 = 1e-9;

/// Refuses plants whose state cannot be observed, and unstable plants if `require_stable`.
///
/// # Errors
/// [`HinfFilterError::NotDetectable`] before [`HinfFilterError::NotStable`], each with the eigenvalue.
pub fn check_plant(
    plant: &Plant,
    sampled: &SampledPlant,
    require_stable: bool,
) -> Result<(), HinfFilterError> {
    let poles = eigenvalues(&plant.a).ok_or(HinfFilterError::Eigenvalues { matrix: "`model.A`" })?;
    let largest = poles.iter().fold(1.0_f64, |most, pole| most.max(pole.norm()));
    let growing: Vec<_> = poles
        .into_iter()
        .filter(|pole| pole.re >= -MARGIN * largest)
        .collect();
    for pole in &growing {
        if hidden(&plant.a, &plant.c, *pole) {
            return Err(HinfFilterError::NotDetectable {
                matrix: "`model.A`",
                eigenvalue: describe(*pole),
                hint: "",
            });
        }
    }
    let matrix = "the sampled A";
    let poles = eigenvalues(&sampled.ad).ok_or(HinfFilterError::Eigenvalues { matrix })?;
    for pole in poles.iter().filter(|pole| pole.norm() >= 1.0 - MARGIN) {
        if hidden(&sampled.ad, &plant.c, *pole) {
            return Err(HinfFilterError::NotDetectable {
                matrix,
                eigenvalue: describe(*pole),
                hint: "; with another `sample_time_s` sampling may not hide it",
            });
        }
    }
    match growing.first() {
        Some(pole) if require_stable => Err(HinfFilterError::NotStable {
            eigenvalue: describe(*pole),
        }),
        _ => Ok(()),
    }
}

fn hidden(a: &DMatrix<f64>, c: &DMatrix<f64>, pole: Complex<f64>) -> bool {
    let gap = observability_gap(a, c, pole);
    gap.smallest <= RANK * gap.largest.max(1.0)
}

/// An eigenvalue for people.
pub(super) fn describe(value: Complex<f64>) -> String {
    if value.im == 0.0 {
        format!("{:.6}", value.re)
    } else {
        format!("{:.6} {:+.6}i", value.re, value.im)
    }
}
