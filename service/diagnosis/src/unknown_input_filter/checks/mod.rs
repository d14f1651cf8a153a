//! Whether each mode of a bank can be tested, isolated and kept bounded (method sheet 3.1).
//!
//! All ranks are decided by singular values, in the coordinates of the model: scale states and outputs to
//! comparable size first.

mod boundedness;
mod isolability;
mod report;

pub use report::{CheckError, CheckReport, CheckWarning, Isolability};

use super::modes::FaultMode;
use super::options::{Form, MissingPolicy, UnknownInputFilterOptions};
use crate::decomposition::SingularDecomposition;
use crate::model::LinearModel;
use nalgebra::{DMatrix, DVector};

/// Relative size below which the output of a fault column is zero (checks 1 and 6).
const VISIBLE: f64 = 1e-9;
/// Smallest singular value of normalised columns that counts as independent (checks 2 and 4).
const INDEPENDENT: f64 = 1e-6;

/// Does the checks of method sheet 3.1 for the given modes.
///
/// # Errors
/// [`CheckError`] for a mode that can never be falsified, unless `bank.allow_untestable_modes` is set (then it is
/// listed as untestable), and for a matrix S that makes every test vacuous.
pub fn check_modes(
    model: &LinearModel,
    options: &UnknownInputFilterOptions,
    modes: &[FaultMode],
) -> Result<CheckReport, CheckError> {
    let mut report = CheckReport::default();
    for &mode in modes {
        let testable = match check_testable(model, mode) {
            Ok(()) => true,
            Err(_) if options.bank.allow_untestable_modes => false,
            Err(error) => return Err(error),
        };
        report.testable.push(testable);
        if !testable {
            report.warnings.push(CheckWarning::UntestableMode {
                mode,
                name: name(model, mode),
            });
            continue;
        }
        if !mode.is_empty() {
            check_isolability(model, options, mode, &mut report);
        }
        let decoupling = Decoupling::new(model, mode);
        report
            .warnings
            .extend(boundedness::unbounded_sets(model, mode, &decoupling));
        if options.filter.form == Form::Paper && !mode.is_empty() {
            check_test_rows(model, options, mode, &decoupling)?;
        }
    }
    if loss_not_recoverable(model, options) {
        report.warnings.push(CheckWarning::LossNotRecoverable {
            form: options.filter.form,
        });
    }
    Ok(report)
}

/// L0 = F(CF)⁺, P = I - CF(CF)⁺ and an orthonormal basis Z of null((CF)') of a mode that passed checks 1 to 3.
struct Decoupling {
    l0: DMatrix<f64>,
    projector: DMatrix<f64>,
    null_basis: DMatrix<f64>,
}

impl Decoupling {
    fn new(model: &LinearModel, mode: FaultMode) -> Self {
        let f = mode.unknown_input_matrix(model.b());
        let ny = model.output_count();
        let identity = DMatrix::identity(ny, ny);
        if f.ncols() == 0 {
            let l0 = DMatrix::zeros(model.state_count(), ny);
            return Self {
                l0,
                projector: identity.clone(),
                null_basis: identity,
            };
        }
        let qr = (model.c() * &f).qr();
        let (q, r) = (qr.q(), qr.r());
        let inverse = r
            .solve_upper_triangular(&q.transpose())
            .unwrap_or_else(|| DMatrix::zeros(f.ncols(), ny));
        let projector = identity - &q * q.transpose();
        let null_basis = orthonormal_range(&projector, 0.5);
        Self {
            l0: f * inverse,
            projector,
            null_basis,
        }
    }
}

/// Checks 1 to 3: visible faults, independent in the outputs, with an output left for a test.
fn check_testable(model: &LinearModel, mode: FaultMode) -> Result<(), CheckError> {
    let (b, c, ny) = (model.b(), model.c(), model.output_count());
    let norm = two_norm(c);
    for actuator in mode.actuators() {
        let column = b.column(actuator);
        let visible = (c * column).norm() > VISIBLE * norm * column.norm() && column.norm() > 0.0;
        if !visible {
            let name = model.actuators()[actuator].name.clone();
            return Err(CheckError::FaultNotVisible { actuator, name });
        }
    }
    let sigma_min = smallest_singular_value(&normalised_outputs(model, mode.actuators()));
    if mode.len() > ny || sigma_min < INDEPENDENT {
        return Err(CheckError::FaultsNotDecouplable {
            mode,
            name: name(model, mode),
            sigma_min,
        });
    }
    if mode.len() == ny {
        return Err(CheckError::NoTestRow {
            mode,
            name: name(model, mode),
            outputs: ny,
        });
    }
    Ok(())
}

/// Check 4 for every actuator outside the mode.
fn check_isolability(
    model: &LinearModel,
    options: &UnknownInputFilterOptions,
    mode: FaultMode,
    report: &mut CheckReport,
) {
    let longest = options
        .bank
        .max_isolation_window
        .unwrap_or(4 * model.state_count());
    for actuator in mode.other_actuators(model.actuator_count()) {
        let columns = normalised_outputs(model, mode.actuators().chain([actuator]));
        let sigma_min = smallest_singular_value(&columns);
        let immediate = sigma_min >= INDEPENDENT;
        let samples = match immediate {
            true => Some(1),
            false => isolability::first_separating_window(model, mode, actuator, longest),
        };
        report.isolability.push(Isolability {
            mode,
            actuator,
            sigma_min,
            samples,
        });
        if immediate {
            continue;
        }
        let (name, fault) = (name(model, mode), model.actuators()[actuator].name.clone());
        report.warnings.push(match samples {
            Some(length) => CheckWarning::IsolableAfter {
                mode,
                name,
                actuator,
                fault,
                length,
            },
            None => CheckWarning::NotIsolable {
                mode,
                name,
                actuator,
                fault,
                longest,
            },
        });
    }
}

/// Check 6: S must not make C T B_j = (I - CS) P C B_j vanish for every foreign actuator.
fn check_test_rows(
    model: &LinearModel,
    options: &UnknownInputFilterOptions,
    mode: FaultMode,
    decoupling: &Decoupling,
) -> Result<(), CheckError> {
    let Some(s) = &options.filter.s else { return Ok(()) };
    let (nx, ny, c) = (model.state_count(), model.output_count(), model.c());
    let s = DMatrix::from_fn(nx, ny, |i, j| {
        s.get(i).and_then(|row| row.get(j)).copied().unwrap_or(0.0)
    });
    let rows = (DMatrix::identity(ny, ny) - c * s) * &decoupling.projector;
    let norm = two_norm(c);
    let vanishes = |j: usize| {
        let column = model.b().column(j);
        (&rows * (c * column)).norm() <= VISIBLE * norm * column.norm()
    };
    let mut others = mode.other_actuators(model.actuator_count()).peekable();
    if others.peek().is_some() && others.all(vanishes) {
        return Err(CheckError::VacuousTest {
            mode,
            name: name(model, mode),
        });
    }
    Ok(())
}

/// Whether a lost measurement can leave a set that never becomes bounded again.
fn loss_not_recoverable(model: &LinearModel, options: &UnknownInputFilterOptions) -> bool {
    let unbounded = match options.filter.form {
        Form::Coupled => options.missing.policy == MissingPolicy::UnboundedFault,
        Form::Paper => true,
        Form::Kalman3Sigma => false,
    };
    unbounded && model.strip_gain().is_none() && model.state_box().is_none()
}

/// C B_j of the given actuators, each divided by its norm; a column without effect stays zero.
fn normalised_outputs(model: &LinearModel, actuators: impl Iterator<Item = usize>) -> DMatrix<f64> {
    let columns: Vec<DVector<f64>> = actuators
        .map(|j| {
            let column = model.c() * model.b().column(j);
            let norm = column.norm();
            if norm > 0.0 { column / norm } else { column }
        })
        .collect();
    if columns.is_empty() {
        DMatrix::zeros(model.output_count(), 0)
    } else {
        DMatrix::from_columns(&columns)
    }
}

/// σ_min over the columns: 0 with more columns than rows, infinite without columns.
fn smallest_singular_value(matrix: &DMatrix<f64>) -> f64 {
    SingularDecomposition::new(matrix).smallest()
}

fn two_norm(matrix: &DMatrix<f64>) -> f64 {
    SingularDecomposition::new(matrix).largest()
}

/// Orthonormal basis of the range: left singular vectors with σ > `tolerance` σ_max.
fn orthonormal_range(matrix: &DMatrix<f64>, tolerance: f64) -> DMatrix<f64> {
    let decomposition = SingularDecomposition::new(matrix);
    decomposition.range(tolerance * decomposition.largest())
}

fn name(model: &LinearModel, mode: FaultMode) -> String {
    let names: Vec<&str> = model
        .actuators()
        .iter()
        .map(|actuator| actuator.name.as_str())
        .collect();
    mode.describe(&names)
}

#[cfg(test)]
mod tests;
