//! Room for one filter step, shared by the filters of a bank.

use super::{
    gain::GainChoice, kalman::KalmanWorkspace, missing::MissingData, plant::Plant, prediction::Prediction,
};
use crate::{
    matrix::Matrix,
    zonotope::{Reducer, Reduction},
};

/// Room that the filters of a bank share, since they step one after the other.
#[derive(Clone, Debug)]
pub(crate) struct Workspace {
    pub prediction: Prediction,
    pub choice: GainChoice,
    pub missing: MissingData,
    pub reducer: Reducer,
    pub gain: Matrix,
    /// Rows of W and φ that are found at every step.
    pub rows: Matrix,
    /// Radii R(wΓ) of test rows.
    pub spreads: Vec<f64>,
    pub signature: Vec<f64>,
    /// |e| + R(Γ) + v.
    pub spread_radius: Vec<f64>,
    /// f̄.
    pub own_fault: Vec<f64>,
    /// (I - LC)A0H with a fixed gain.
    pub corrected: Matrix,
    /// η.
    pub error: Vec<f64>,
    /// CH⁻H⁻'C' + V² of the paper's form, ny x ny.
    pub square: Matrix,
    pub kalman: KalmanWorkspace,
}

impl Workspace {
    /// Room for filters of generator order `order` and modes of up to `own` actuators.
    pub fn new(plant: &Plant, order: usize, own: usize, reduction: Reduction) -> Self {
        let (nx, ny) = (plant.nx(), plant.ny());
        let columns = plant.column_capacity(order, own);
        Self {
            prediction: Prediction::new(plant, columns),
            choice: GainChoice::new(nx, ny, columns),
            missing: MissingData::new(plant, own),
            reducer: Reducer::new(reduction, nx, columns),
            gain: Matrix::zeros(nx, ny),
            rows: Matrix::zeros(plant.nu() + ny, ny),
            spreads: vec![0.0; ny + plant.nu() + ny],
            signature: vec![0.0; ny],
            spread_radius: vec![0.0; ny],
            own_fault: vec![0.0; ny],
            corrected: Matrix::with_capacity(nx, columns),
            error: vec![0.0; nx],
            square: Matrix::zeros(ny, ny),
            kalman: KalmanWorkspace::new(plant),
        }
    }
}
