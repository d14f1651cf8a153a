//! The fixed gain L_fix of one mode, found off-line (method sheet 3.3).
//!
//! The filter runs on nominal data until its row-wise gain has settled. The last gain is kept if the filter with
//! this gain alone is stable and its set stays bounded.

use super::{
    decoupling::Decoupling,
    filter::CoupledFilter,
    modes::FaultMode,
    options::FilterOptions,
    plant::{Command, Measured, Plant},
    state::SetState,
    workspace::Workspace,
};
use crate::{matrix::Matrix, model::LinearModel, spectrum::spectral_radius, zonotope::Reduction};
use nalgebra::DMatrix;
use thiserror::Error;

const DESIGN_STEPS: usize = 400;
const TRIAL_STEPS: usize = 2000;
const SETTLED: f64 = 1e-12;
/// Largest miss of L_fix C F = F, relative to the terms, in a gain that comes from elsewhere.
const ROUNDING: f64 = 1e-9;

/// What the off-line run fixes for one mode.
#[derive(Clone, Debug)]
pub(crate) struct FixedGain {
    /// L_fix, nx x ny, with L_fix C F = F.
    pub gain: Matrix,
    /// The rows matched to the other actuators (ascending) for the last spread; `None` if not visible.
    pub matched_rows: Vec<Option<Vec<f64>>>,
    /// φ for the last spread, rows in the order of the pivots of the decoupling.
    pub estimate_rows: Vec<Vec<f64>>,
    /// Radius of the set of the filter with this gain alone at the end of the trial, length nx.
    pub radius: Vec<f64>,
}

/// Which condition a fixed gain fails.
#[derive(Clone, Debug, PartialEq, Error)]
#[non_exhaustive]
pub enum FixedGainError {
    /// L_fix C F = F is missed.
    #[error("the equality L_fix C F = F is missed by {residual:e} (relative), more than 1e-9")]
    NotDecoupled {
        /// Largest miss, relative to the terms.
        residual: f64,
    },
    /// Φ has an eigenvalue that is not stable.
    #[error("(I - L_fix C) A has the spectral radius {radius}, which must be below 1")]
    NotStable {
        /// Largest modulus.
        radius: f64,
    },
    /// The eigenvalues of Φ cannot be computed.
    #[error("the eigenvalues of (I - L_fix C) A cannot be computed")]
    NoEigenvalues,
    /// The uncertainty lets the set grow beyond all numbers.
    #[error("the state set of the filter grows beyond all numbers within {steps} steps", steps = TRIAL_STEPS)]
    Grows,
}

/// Conditions of the off-line run.
#[derive(Clone, Debug)]
pub(crate) struct Nominal {
    /// Radius of the first set, length nx.
    pub radius: Vec<f64>,
    /// x_nom, typical |x|, length nx.
    pub state: Vec<f64>,
    /// s of the filter.
    pub order: usize,
    /// Reduction of the filter.
    pub reduction: Reduction,
}

impl Nominal {
    /// Starts from the prior, else from the strip, with the configured typical |x| (default zero).
    pub fn new(model: &LinearModel, plant: &Plant, options: &FilterOptions) -> Self {
        let nx = plant.nx();
        Self {
            radius: match (model.initial_state(), &plant.strip) {
                (Some(prior), _) => prior.radius.as_slice().to_vec(),
                (None, Some(strip)) => strip.radius.clone(),
                (None, None) => vec![0.0; nx],
            },
            state: options
                .nominal_state_magnitude
                .clone()
                .unwrap_or_else(|| vec![0.0; nx]),
            order: options.effective_generator_order(),
            reduction: options.effective_reduction(),
        }
    }
}

impl FixedGain {
    /// L_fix of the mode of `filter`, which must be row-wise with sweeps and without fixed candidate; `None` if no
    /// stable gain is found.
    pub fn design(plant: &Plant, filter: &CoupledFilter, nominal: &Nominal) -> Option<Matrix> {
        let mut run = NominalRun::new(plant, filter.mode, nominal);
        let mut last = Matrix::zeros(plant.nx(), plant.ny());
        for _ in 0..DESIGN_STEPS {
            run.predict(nominal);
            filter.choose_gain(&run.plant, &run.measured, true, &mut run.work);
            let change = (run.work.gain.to_dense() - last.to_dense()).amax();
            last.copy_from(&run.work.gain);
            run.correct(filter);
            if run.state.void {
                return None;
            }
            if change < SETTLED * last.to_dense().amax() {
                break;
            }
        }
        let gain = project(&last, &filter.decoupling);
        Self::check(plant, filter, &gain, nominal).is_ok().then_some(gain)
    }

    /// Takes over a gain that fulfils L C F = F to rounding, after moving it onto this equality.
    ///
    /// # Errors
    /// [`FixedGainError`] unless the equality holds, (I - LC) A0 is stable and the set stays bounded with this gain.
    pub fn check(
        plant: &Plant,
        filter: &CoupledFilter,
        stated: &Matrix,
        nominal: &Nominal,
    ) -> Result<Self, FixedGainError> {
        let residual = miss(plant, filter, stated);
        let decoupled = residual <= ROUNDING;
        if !decoupled {
            return Err(FixedGainError::NotDecoupled { residual });
        }
        let gain = project(stated, &filter.decoupling);
        let radius = spectral_radius(&transition(plant, &gain)).ok_or(FixedGainError::NoEigenvalues)?;
        let stable = radius < 1.0;
        if !stable {
            return Err(FixedGainError::NotStable { radius });
        }
        let mut run = NominalRun::new(plant, filter.mode, nominal);
        for _ in 0..TRIAL_STEPS {
            run.predict(nominal);
            run.work.gain.copy_from(&gain);
            run.correct(filter);
            if run.state.void {
                return Err(FixedGainError::Grows);
            }
        }
        let (matched_rows, estimate_rows) = run.rows(filter);
        Ok(Self {
            gain,
            matched_rows,
            estimate_rows,
            radius: run.state.radius,
        })
    }
}

/// Largest miss of L C F = F, relative to the largest term.
fn miss(plant: &Plant, filter: &CoupledFilter, gain: &Matrix) -> f64 {
    let (c, f, gain) = (
        plant.c.to_dense(),
        filter.fault_matrix.to_dense(),
        gain.to_dense(),
    );
    if f.is_empty() {
        return 0.0;
    }
    let terms = gain.abs() * c.abs() * f.abs() + f.abs();
    (gain * c * &f - f).amax() / terms.amax()
}

/// Φ = (I - LC) A0.
pub(crate) fn transition(plant: &Plant, gain: &Matrix) -> DMatrix<f64> {
    let identity = DMatrix::identity(plant.nx(), plant.nx());
    (identity - gain.to_dense() * plant.c.to_dense()) * plant.a0.to_dense()
}

/// L0 + (L - L0) P: the same gain with L C F = F to rounding.
pub(crate) fn project(gain: &Matrix, decoupling: &Decoupling) -> Matrix {
    let basis = decoupling.null_basis.to_dense();
    let start = decoupling.gain.to_dense();
    Matrix::from(&(&start + (gain.to_dense() - &start) * basis.transpose() * basis))
}

/// The filter of one mode on nominal data without innovation.
struct NominalRun {
    plant: Plant,
    state: SetState,
    work: Workspace,
    command: Command,
    measured: Measured,
}

impl NominalRun {
    fn new(plant: &Plant, mode: FaultMode, nominal: &Nominal) -> Self {
        let mut plant = plant.clone();
        plant.epsilon = 0.0;
        let mut state = SetState::new(plant.nx(), plant.column_capacity(nominal.order, mode.len()));
        state.set_box(&nominal.state, &nominal.radius);
        let mut command = Command::new(&plant);
        command.receive(&plant, &vec![0.0; plant.nu()]);
        let mut measured = Measured::new(&plant);
        measured.receive(&plant, &vec![0.0; plant.ny()]);
        let work = Workspace::new(&plant, nominal.order, mode.len(), nominal.reduction);
        Self {
            plant,
            state,
            work,
            command,
            measured,
        }
    }

    fn predict(&mut self, nominal: &Nominal) {
        self.state.centre.copy_from_slice(&nominal.state);
        self.work
            .prediction
            .predict(&self.plant, &self.state, &self.command, None);
        self.work.prediction.observe(&self.plant, &self.measured);
    }

    fn correct(&mut self, filter: &CoupledFilter) {
        self.work.prediction.innovation.fill(0.0);
        filter.correct(&self.plant, &self.measured, true, &mut self.state, &mut self.work);
    }

    fn rows(&mut self, filter: &CoupledFilter) -> (Vec<Option<Vec<f64>>>, Vec<Vec<f64>>) {
        let (plant, decoupling) = (&self.plant, &filter.decoupling);
        self.work
            .choice
            .prepare(decoupling, &self.work.prediction.spread, &plant.noise);
        let mut row = vec![0.0; plant.ny()];
        let matched = filter.mode.other_actuators(plant.nu()).map(|actuator| {
            let signature: Vec<f64> = (0..plant.ny()).map(|j| plant.cb[(j, actuator)]).collect();
            let visible = self.work.choice.matched_row(decoupling, &signature, &mut row);
            visible.then(|| row.clone())
        });
        let matched = matched.collect();
        let estimates = (0..decoupling.rank()).map(|k| {
            self.work.choice.estimate_row(decoupling, k, &mut row);
            row.clone()
        });
        (matched, estimates.collect())
    }
}
