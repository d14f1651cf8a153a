//! From runs to the rows of a least-squares problem.

use super::{CONSTANT, Equation, RegressionError, Term};
use nalgebra::{DMatrix, DVector};

/// One recording at evenly spaced instants.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct SignalRun {
    /// What the run is called in messages.
    pub name: String,
    /// The signals, one row an instant; NaN = not recorded.
    pub rows: Vec<Vec<f64>>,
}

/// Name of a term.
pub(super) fn term_name(signals: &[String], term: &Term) -> String {
    let name = signals.get(term.signal).map_or("?", String::as_str);
    match term.lag {
        0 => name.to_owned(),
        lag => format!("{name} ({lag} back)"),
    }
}

/// Refuses equations and runs that do not fit each other.
pub(super) fn check<'r>(
    signals: &[String],
    equations: &[Equation],
    runs: impl Iterator<Item = &'r SignalRun>,
) -> Result<(), RegressionError> {
    if equations.is_empty() {
        return Err(RegressionError::NoEquations);
    }
    for equation in equations {
        let output = signals.get(equation.output).cloned().unwrap_or_default();
        if equation.terms.is_empty() && !equation.constant {
            return Err(RegressionError::NoTerms { output });
        }
        for (position, term) in equation.terms.iter().enumerate() {
            let name = term_name(signals, term);
            let same = |other: &Term| (other.signal, other.lag) == (term.signal, term.lag);
            if same(&Term {
                signal: equation.output,
                lag: 0,
                coefficient: None,
            }) {
                return Err(RegressionError::OwnOutput { output });
            }
            if equation.terms[..position].iter().any(same) {
                return Err(RegressionError::Twice { output, term: name });
            }
            if let Some(value) = term.coefficient.filter(|value| !value.is_finite()) {
                return Err(RegressionError::Coefficient {
                    output,
                    term: name,
                    value,
                });
            }
        }
    }
    for run in runs {
        for (row, values) in run.rows.iter().enumerate() {
            if values.len() != signals.len() {
                let (run, actual, expected) = (run.name.clone(), values.len(), signals.len());
                return Err(RegressionError::WrongWidth {
                    run,
                    row,
                    actual,
                    expected,
                });
            }
            if let Some(signal) = values.iter().position(|value| value.is_infinite()) {
                let (run, signal) = (run.name.clone(), signals[signal].clone());
                return Err(RegressionError::Infinite { run, row, signal });
            }
        }
    }
    Ok(())
}

/// s(k - l); `None` before the start of the run or where it was not recorded.
fn value_at(run: &SignalRun, signal: usize, lag: usize, k: usize) -> Option<f64> {
    let value = *run.rows.get(k.checked_sub(lag)?)?.get(signal)?;
    value.is_finite().then_some(value)
}

/// e(k) with these coefficients of all terms and the constant; `None` where a value is missing.
pub(super) fn residual_at(
    equation: &Equation,
    coefficients: &[f64],
    run: &SignalRun,
    k: usize,
) -> Option<f64> {
    let mut residual = value_at(run, equation.output, 0, k)?;
    for (term, coefficient) in equation.terms.iter().zip(coefficients) {
        residual -= coefficient * value_at(run, term.signal, term.lag, k)?;
    }
    let constant = coefficients.get(equation.terms.len());
    Some(residual - constant.copied().unwrap_or(0.0))
}

/// The complete rows of some runs.
pub(super) struct Rows {
    /// Free regressors, the constant last.
    pub regressors: DMatrix<f64>,
    /// The output.
    pub output: DVector<f64>,
    /// The output without the given terms.
    target: DVector<f64>,
    /// Whether a row follows the one before in the same run.
    follows: Vec<bool>,
    /// Rows that are not complete.
    pub skipped: usize,
}

impl Rows {
    pub(super) fn new(equation: &Equation, runs: &[SignalRun]) -> Self {
        let free: Vec<&Term> = equation
            .terms
            .iter()
            .filter(|term| term.coefficient.is_none())
            .collect();
        let given: Vec<f64> = equation
            .terms
            .iter()
            .map(|term| term.coefficient.unwrap_or(0.0))
            .collect();
        let (mut regressors, mut output, mut target, mut follows) =
            (Vec::new(), Vec::new(), Vec::new(), Vec::new());
        let mut skipped = 0;
        for run in runs {
            let mut before = false;
            for k in 0..run.rows.len() {
                let remainder = residual_at(equation, &given, run, k);
                before = match (remainder, value_at(run, equation.output, 0, k)) {
                    (Some(remainder), Some(value)) => {
                        target.push(remainder);
                        output.push(value);
                        follows.push(before);
                        let values = free
                            .iter()
                            .map(|term| value_at(run, term.signal, term.lag, k).unwrap_or(f64::NAN));
                        regressors.extend(values.chain(equation.constant.then_some(1.0)));
                        true
                    }
                    _ => {
                        skipped += 1;
                        false
                    }
                };
            }
        }
        let columns = free.len() + usize::from(equation.constant);
        Self {
            regressors: DMatrix::from_row_slice(output.len(), columns, &regressors),
            output: DVector::from_vec(output),
            target: DVector::from_vec(target),
            follows,
            skipped,
        }
    }

    pub(super) fn len(&self) -> usize {
        self.output.len()
    }

    pub(super) fn free_count(&self) -> usize {
        self.regressors.ncols()
    }

    pub(super) fn target(&self) -> &DVector<f64> {
        &self.target
    }

    pub(super) fn is_output_constant(&self) -> bool {
        self.output.iter().all(|value| *value == self.output[0])
    }

    /// Names of the free regressors.
    pub(super) fn names(&self, signals: &[String], equation: &Equation) -> Vec<String> {
        let free = equation.terms.iter().filter(|term| term.coefficient.is_none());
        free.map(|term| term_name(signals, term))
            .chain(equation.constant.then(|| CONSTANT.to_owned()))
            .collect()
    }

    /// e with these free coefficients.
    pub(super) fn residual(&self, free: &DVector<f64>) -> DVector<f64> {
        &self.target - &self.regressors * free
    }

    /// Correlation of the residual with that of the row before.
    pub(super) fn correlation(&self, residual: &DVector<f64>) -> f64 {
        let pairs = (1..residual.len()).filter(|&row| self.follows[row]);
        let product: f64 = pairs.map(|row| residual[row] * residual[row - 1]).sum();
        let square = residual.norm_squared();
        if square > 0.0 { product / square } else { 0.0 }
    }

    /// Given and free coefficients in the order of the terms, the constant last.
    pub(super) fn all_coefficients(&self, equation: &Equation, free: &DVector<f64>) -> Vec<f64> {
        let mut free = free.iter().copied();
        let terms = equation.terms.iter().map(|term| term.coefficient);
        let all = terms.chain(equation.constant.then_some(None));
        all.map(|given| given.or_else(|| free.next()).unwrap_or(0.0))
            .collect()
    }

    /// Standard errors likewise.
    pub(super) fn all_errors(&self, equation: &Equation, free: &DVector<f64>) -> Vec<Option<f64>> {
        let mut free = free.iter().copied();
        let terms = equation.terms.iter().map(|term| term.coefficient);
        let all = terms.chain(equation.constant.then_some(None));
        all.map(|given| if given.is_some() { None } else { free.next() })
            .collect()
    }
}
