//! Λ(h): probabilities of changing from one mode to another over an interval (method sheet 3, step 1).

use super::design::ModeTransition;
use crate::{
    discretise::matrix_exponential,
    matrix::{Matrix, multiply},
};
use nalgebra::DMatrix;

/// Intervals of the table of e^{Γh}: 2^j µs.
const ENTRIES: u32 = 42;

/// log Λ for any interval, without exponentials of matrices on the real-time path.
#[derive(Clone, Debug)]
pub struct TransitionTable {
    rule: Rule,
    lambda: Matrix,
    log: Matrix,
    product: Matrix,
    /// Interval of `lambda`, µs.
    known: Option<i64>,
}

#[derive(Clone, Debug)]
enum Rule {
    /// The same rate r (1/s) to each other mode.
    EqualRate(f64),
    /// e^{Γ 2^j µs}.
    Table(Vec<Matrix>),
    PerStep,
}

impl TransitionTable {
    /// For a (checked) transition among `modes` modes.
    pub fn new(transition: &ModeTransition, modes: usize) -> Self {
        let mut lambda = Matrix::zeros(modes, modes);
        let rule = match transition {
            ModeTransition::Stay {
                probability,
                period_s,
            } => Rule::EqualRate(equal_rate(*probability, *period_s, modes)),
            ModeTransition::Rate(gamma) => Rule::Table(rate_table(gamma)),
            ModeTransition::PerStep(matrix) => {
                lambda = Matrix::from(matrix);
                Rule::PerStep
            }
        };
        Self {
            rule,
            lambda,
            log: Matrix::zeros(modes, modes),
            product: Matrix::zeros(modes, modes),
            known: None,
        }
    }

    /// Λ of `microseconds`.
    pub fn over(&mut self, microseconds: i64) -> &Matrix {
        self.compute(microseconds.clamp(0, (1 << ENTRIES) - 1));
        &self.lambda
    }

    /// log Λ of `microseconds`, -∞ for impossible changes.
    pub fn log_over(&mut self, microseconds: i64) -> &Matrix {
        self.compute(microseconds.clamp(0, (1 << ENTRIES) - 1));
        &self.log
    }

    fn compute(&mut self, microseconds: i64) {
        if self.known == Some(microseconds) {
            return;
        }
        match &self.rule {
            Rule::EqualRate(rate) => equal_rate_matrix(*rate, microseconds as f64 * 1e-6, &mut self.lambda),
            Rule::Table(entries) => {
                identity(&mut self.lambda);
                for (j, entry) in entries.iter().enumerate() {
                    if microseconds >> j & 1 == 1 {
                        multiply(&self.lambda, entry, &mut self.product);
                        self.lambda.copy_from(&self.product);
                    }
                }
                normalise_rows(&mut self.lambda);
            }
            Rule::PerStep => {}
        }
        for i in 0..self.lambda.rows() {
            for (log, value) in self.log.row_mut(i).iter_mut().zip(self.lambda.row(i)) {
                *log = value.ln();
            }
        }
        self.known = Some(microseconds);
    }
}

/// r = -ln(1 - (1 - s) M / (M - 1)) / (M τ); 0 with a single mode.
pub fn equal_rate(stay_probability: f64, period_s: f64, modes: usize) -> f64 {
    if modes < 2 {
        return 0.0;
    }
    let m = modes as f64;
    -(-(1.0 - stay_probability) * m / (m - 1.0)).ln_1p() / (m * period_s)
}

/// Off-diagonal (1 - e^{-Mrh}) / M, rows sum to 1.
fn equal_rate_matrix(rate: f64, seconds: f64, lambda: &mut Matrix) {
    let modes = lambda.rows();
    let m = modes as f64;
    let other = -(-m * rate * seconds).exp_m1() / m;
    lambda.fill(other);
    for i in 0..modes {
        lambda[(i, i)] = 1.0 - (m - 1.0) * other;
    }
}

/// e^{Γ 2^j µs}: as e^{-γh} e^{(Γ + γI)h} with γ = max |Γ_ii| while γh is small, so that no entry can become
/// negative, and squared from there on.
fn rate_table(gamma: &DMatrix<f64>) -> Vec<Matrix> {
    let modes = gamma.nrows();
    let fastest = (0..modes).map(|i| gamma[(i, i)].abs()).fold(0.0, f64::max);
    let shifted = gamma + DMatrix::identity(modes, modes) * fastest;
    let mut entries: Vec<Matrix> = Vec::new();
    for j in 0..ENTRIES {
        let seconds = f64::from(j).exp2() * 1e-6;
        let mut entry = match entries.last() {
            Some(half) if fastest * seconds > 0.5 => {
                let mut square = Matrix::zeros(modes, modes);
                multiply(half, half, &mut square);
                square
            }
            _ => Matrix::from(&(matrix_exponential(&(&shifted * seconds)) * (-fastest * seconds).exp())),
        };
        normalise_rows(&mut entry);
        entries.push(entry);
    }
    entries
}

fn identity(matrix: &mut Matrix) {
    matrix.fill(0.0);
    (0..matrix.rows()).for_each(|i| matrix[(i, i)] = 1.0);
}

fn normalise_rows(matrix: &mut Matrix) {
    for i in 0..matrix.rows() {
        let sum: f64 = matrix.row(i).iter().sum();
        matrix.row_mut(i).iter_mut().for_each(|value| *value /= sum);
    }
}
