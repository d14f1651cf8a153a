//! Linear regression: an output as a linear combination of signals at the same and earlier rows.
//!
//! y(k) = Σ_j θ_j s_j(k - l_j) + c + e(k); some θ_j may be given. The free ones are found by least squares with columns of
//! unit norm, from the QR decomposition of all rows of the training runs in which every value was recorded.
//!
//! | symbol | meaning |
//! |---|---|
//! | s_j, l_j, θ_j | signal, lag in rows and coefficient of term j |
//! | e | residual; σ² = Σ e² / (rows - free coefficients) |
//! | standard error | root of the diagonal of σ² (X'X)⁻¹: right if e is white and the signals are known exactly |
//! | condition | ratio of the largest to the smallest singular value of the columns of unit norm |

mod error;
mod fit;
mod realisation;
mod rows;

pub use error::RegressionError;
pub use realisation::{FirstOrder, ShiftRegister};
pub use rows::SignalRun;

use fit::fit;
use nalgebra::{DMatrix, DVector};
use rows::Rows;

/// Groups of runs that are left out in turn.
const FOLDS: usize = 10;
/// Rows needed for each free coefficient.
const ROWS_PER_COEFFICIENT: usize = 3;
/// Ratio of the root mean squares of unseen and seen rows from which on an equation counts as overfitted.
const OVERFITTED: f64 = super::model::OVERFITTED;

/// θ s(k - l).
#[derive(Clone, Debug, PartialEq)]
pub struct Term {
    /// Position of the signal.
    pub signal: usize,
    /// l: rows back, 0 for the same row.
    pub lag: usize,
    /// θ, if it is given.
    pub coefficient: Option<f64>,
}

/// The equation of one output.
#[derive(Clone, Debug, PartialEq)]
pub struct Equation {
    /// Position of the output among the signals.
    pub output: usize,
    /// Its terms.
    pub terms: Vec<Term>,
    /// Whether a free constant c is added.
    pub constant: bool,
}

/// How well an equation predicts some rows.
#[derive(Clone, Debug, PartialEq)]
pub struct Fit {
    /// Number of rows.
    pub rows: usize,
    /// Root mean square of the residual, units of the output.
    pub rms: f64,
    /// R²: the share of the output's variance that is predicted; negative if its mean predicts better.
    pub r_squared: f64,
}

/// An equation with its coefficients.
#[derive(Clone, Debug, PartialEq)]
pub struct FoundEquation {
    /// θ of all terms, given ones included, then c if there is one.
    pub coefficients: Vec<f64>,
    /// Their standard errors; `None` for given ones.
    pub standard_errors: Vec<Option<f64>>,
    /// Condition number; 1 without free coefficients.
    pub condition: f64,
    /// Rows of the training runs that lack a value, those at the start without past included.
    pub skipped: usize,
    /// Correlation of the residual with the one of the row before: standard errors are too small if it is far from 0.
    pub correlation: f64,
    /// Training.
    pub training: Fit,
    /// Each training run by coefficients from other runs.
    pub cross_validation: Fit,
    /// Validation runs, if there are any.
    pub validation: Option<Fit>,
}

impl FoundEquation {
    /// Whether unseen runs are predicted so much worse than those of the fit that it has too many free coefficients.
    pub fn is_overfitted(&self) -> bool {
        self.cross_validation.rms > OVERFITTED * self.training.rms
    }
}

/// Equations from recordings, with their figures.
#[derive(Clone, Debug, PartialEq)]
pub struct Regression {
    /// The equations as asked for.
    pub equations: Vec<Equation>,
    /// What was found of each.
    pub found: Vec<FoundEquation>,
    /// Covariance of the residuals of the equations, over the rows that all of them have.
    pub residual_covariance: DMatrix<f64>,
}

/// Identifies the free coefficients of every equation; validation runs never decide. `signals` are the names of the
/// signals, in the order of the values of a row.
///
/// # Errors
/// [`RegressionError`]: equations or runs that do not fit, or that do not determine the coefficients.
pub fn identify_regression(
    signals: &[String],
    equations: &[Equation],
    training: &[SignalRun],
    validation: &[SignalRun],
) -> Result<Regression, RegressionError> {
    rows::check(signals, equations, training.iter().chain(validation))?;
    match training {
        [] => return Err(RegressionError::NoTrainingRuns),
        [only] => {
            return Err(RegressionError::SingleRun {
                run: only.name.clone(),
            });
        }
        _ => {}
    }
    let mut found = Vec::with_capacity(equations.len());
    for equation in equations {
        found.push(identify_equation(signals, equation, training, validation)?);
    }
    let residual_covariance = residual_covariance(equations, &found, training)?;
    Ok(Regression {
        equations: equations.to_vec(),
        found,
        residual_covariance,
    })
}

fn identify_equation(
    signals: &[String],
    equation: &Equation,
    training: &[SignalRun],
    validation: &[SignalRun],
) -> Result<FoundEquation, RegressionError> {
    let rows = Rows::new(equation, training);
    let output = &signals[equation.output];
    let free = rows.free_count();
    let needed = ROWS_PER_COEFFICIENT * free.max(1);
    if rows.len() < needed {
        return Err(RegressionError::TooFew {
            output: output.clone(),
            rows: rows.len(),
            skipped: rows.skipped,
            coefficients: free,
            needed,
        });
    }
    if rows.is_output_constant() {
        let (signal, value) = (output.clone(), rows.output[0]);
        return Err(RegressionError::Constant { signal, value });
    }
    for (column, name) in rows.regressors.column_iter().zip(rows.names(signals, equation)) {
        if column.iter().all(|value| *value == column[0]) && name != CONSTANT {
            return Err(RegressionError::Constant {
                signal: name,
                value: column[0],
            });
        }
    }
    let solved = fit(&rows).map_err(|dependent| RegressionError::Dependent {
        output: output.clone(),
        regressors: dependent
            .iter()
            .map(|&j| rows.names(signals, equation)[j].clone())
            .collect(),
    })?;
    let residual = rows.residual(&solved.free);
    let folds = FOLDS.min(training.len());
    let mut left_out = Vec::new();
    for fold in 0..folds {
        let group = |own: bool| -> Vec<SignalRun> {
            let chosen = training
                .iter()
                .enumerate()
                .filter(|(run, _)| (run % folds == fold) == own);
            chosen.map(|(_, run)| run.clone()).collect()
        };
        let (own, others) = (
            Rows::new(equation, &group(true)),
            Rows::new(equation, &group(false)),
        );
        let without = fit(&others).map_err(|_| RegressionError::DependentInFold {
            output: output.clone(),
            folds,
        })?;
        left_out.extend(own.residual(&without.free).iter());
    }
    let validated = Rows::new(equation, validation);
    Ok(FoundEquation {
        coefficients: rows.all_coefficients(equation, &solved.free),
        standard_errors: rows.all_errors(equation, &solved.standard_errors),
        condition: solved.condition,
        skipped: rows.skipped,
        correlation: rows.correlation(&residual),
        training: figures(&rows.output, &residual),
        cross_validation: figures(&rows.output, &DVector::from_vec(left_out)),
        validation: (validated.len() > 0)
            .then(|| figures(&validated.output, &validated.residual(&solved.free))),
    })
}

/// What the column of the free constant is called.
const CONSTANT: &str = "the constant";

/// The output may be in another order than the residual; only sums matter.
fn figures(output: &DVector<f64>, residual: &DVector<f64>) -> Fit {
    let rows = residual.len();
    let mean = output.mean();
    let variance = output.map(|value| (value - mean).powi(2)).mean();
    let square = residual.norm_squared() / rows.max(1) as f64;
    Fit {
        rows,
        rms: square.sqrt(),
        r_squared: if variance > 0.0 {
            1.0 - square / variance
        } else {
            f64::NEG_INFINITY
        },
    }
}

fn residual_covariance(
    equations: &[Equation],
    found: &[FoundEquation],
    training: &[SignalRun],
) -> Result<DMatrix<f64>, RegressionError> {
    let mut sum = DMatrix::zeros(equations.len(), equations.len());
    let mut count = 0_usize;
    for run in training {
        for k in 0..run.rows.len() {
            let residuals = equations
                .iter()
                .zip(found)
                .map(|(equation, found)| rows::residual_at(equation, &found.coefficients, run, k));
            if let Some(residuals) = residuals.collect::<Option<Vec<f64>>>() {
                let residuals = DVector::from_vec(residuals);
                sum += &residuals * residuals.transpose();
                count += 1;
            }
        }
    }
    if count <= equations.len() {
        return Err(RegressionError::NoCommonRows { rows: count });
    }
    Ok(sum / count as f64)
}
