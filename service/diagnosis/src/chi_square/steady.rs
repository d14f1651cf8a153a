//! The filter of a constant model after many steps (method sheet 3).

use super::{
    filter::{Correction, Filter, FilterWork},
    plant::Plant,
    step_model::StepModel,
};
use crate::matrix::{Matrix, dot};
use nalgebra::DMatrix;

/// Steps within which the filter has to become steady.
const STEADY_STEPS: usize = 20_000;

/// The filter of a constant model with complete data, after many steps.
#[derive(Clone, Debug, PartialEq)]
pub struct SteadyState {
    /// Steps until two successive factors of P agreed.
    pub steps: usize,
    /// P⁻, n x n.
    pub prediction_covariance: DMatrix<f64>,
    /// P, n x n.
    pub covariance: DMatrix<f64>,
    /// S, m x m.
    pub innovation_covariance: DMatrix<f64>,
    /// K, n x m.
    pub gain: DMatrix<f64>,
    /// Factor of P.
    pub(super) factor: Matrix,
}

/// Whether two successive factors agree, rows scaled to unit norm.
pub(super) fn has_settled(before: &Matrix, after: &Matrix, tolerance: f64) -> bool {
    before.iter_rows().zip(after.iter_rows()).all(|(before, after)| {
        let norm = dot(after, after).sqrt();
        let mut pairs = before.iter().zip(after);
        pairs.all(|(before, after)| (before - after).abs() <= tolerance * norm)
    })
}

/// Runs the covariance part with all rows until it is steady; `None` if it does not become so.
pub(super) fn steady_state(plant: &Plant, tolerance: f64) -> Option<SteadyState> {
    let model = plant.models.first()?;
    let [n, p, m, r] = model.counts();
    let (input, z) = (vec![0.0; p], vec![0.0; m]);
    let mut filter = Filter::new(&vec![0.0; n], &plant.initial_factor);
    let (mut work, mut update) = (FilterWork::new(n, m, r), Correction::new(n, m, r));
    for steps in 1..=STEADY_STEPS {
        let before = filter.covariance_factor.clone();
        filter.step(model, &input, &input, &z, &mut work, &mut update);
        if !filter.is_finite() {
            return None;
        }
        if has_settled(&before, &filter.covariance_factor, tolerance) {
            return Some(SteadyState::new(steps, model, &filter, &update));
        }
    }
    None
}

impl SteadyState {
    fn new(steps: usize, model: &StepModel, filter: &Filter, update: &Correction) -> Self {
        let factor = filter.covariance_factor.to_dense();
        let covariance = &factor * factor.transpose();
        let (phi, g) = (model.transition.to_dense(), model.noise_factor.to_dense());
        let innovation_factor = update.innovation_factor.to_dense();
        // K = K̄ L_S⁻¹: solve L_S' K' = K̄'.
        let gain = innovation_factor
            .tr_solve_lower_triangular(&update.gain.to_dense().transpose())
            .unwrap_or_else(|| DMatrix::zeros(update.gain.columns(), update.gain.rows()))
            .transpose();
        Self {
            steps,
            prediction_covariance: &phi * &covariance * phi.transpose() + &g * g.transpose(),
            covariance,
            innovation_covariance: &innovation_factor * innovation_factor.transpose(),
            gain,
            factor: filter.covariance_factor.clone(),
        }
    }
}
