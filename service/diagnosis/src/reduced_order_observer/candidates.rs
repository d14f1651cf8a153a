//! Gains of the main observer that need no solver (method sheet 3.2, 3.6).

use super::{
    closed_form::{closed_form, is_free},
    decoupling::Decoupling,
    options::{DesignOptions, Gains},
    plant::Plant,
    source::Source,
};
use crate::tables::shaped_matrix;
use nalgebra::DMatrix;

/// Eigenvalues of F that `gains = "auto"` tries.
const TRIED_POLES: [f64; 6] = [0.0, 0.2, 0.4, 0.6, 0.8, 0.9];

/// A gain before its acceptance.
#[derive(Clone, Debug, PartialEq)]
pub struct Candidate {
    /// Where it comes from.
    pub source: Source,
    /// K, nz x p, or why there is none.
    pub k: Result<DMatrix<f64>, String>,
}

/// The gains that need no solver, in the order in which equal ones are preferred.
pub fn closed_forms(plant: &Plant, decoupling: &Decoupling, design: &DesignOptions) -> Vec<Candidate> {
    let given = || Candidate {
        source: Source::Given,
        k: shaped_matrix(
            "design.K",
            design.k.as_deref().unwrap_or_default(),
            (plant.hidden(), plant.outputs()),
            "unmeasured states x outputs",
        )
        .map_err(|error| error.to_string()),
    };
    let placed = |poles: &[f64]| Candidate {
        source: Source::Poles(poles.to_vec()),
        k: closed_form(decoupling, poles).map_err(|error| error.to_string()),
    };
    match design.gains {
        Gains::Given => vec![given()],
        Gains::ClosedForm => vec![placed(design.poles.as_deref().unwrap_or_default())],
        Gains::Auto | Gains::H2 | Gains::Lmi => {
            let mut all = vec![Candidate {
                source: Source::Particular,
                k: Ok(decoupling.k0.clone()),
            }];
            if is_free(decoupling) {
                let poles = |pole| spread_poles(pole, plant.hidden());
                all.extend(TRIED_POLES.iter().map(|pole| placed(&poles(*pole))));
            }
            if design.gains == Gains::Auto && design.k.is_some() {
                all.push(given());
            }
            all
        }
    }
}

/// ρ (1 - 0.1 l) for l = 0, 1, ...: distinct eigenvalues up to ρ.
pub(super) fn spread_poles(largest: f64, count: usize) -> Vec<f64> {
    (0..count).map(|l| largest * (1.0 - 0.1 * l as f64)).collect()
}
