//! An observer with its tests and their tables: everything about it that data do not change.

use super::{
    directions::{null_space, orientation},
    floors::fault_floors,
    observer::Observer,
    options::ReducedOrderObserverOptions,
    plant::Plant,
    reach::Reach,
};
use crate::decomposition::eigenvalues;
use nalgebra::{Complex, DMatrix, DVector};

/// An observer, the set its errors reach, its test rows and their half widths.
#[derive(Clone, Debug, PartialEq)]
pub struct ObserverDesign {
    /// The observers' matrices.
    pub observer: Observer,
    /// The errors they reach.
    pub reach: Reach,
    /// Test rows, nw x p.
    pub tests: DMatrix<f64>,
    /// t: row j the half widths of all tests at age j; the last row is that of every later age.
    pub thresholds: DMatrix<f64>,
    /// The actuator whose fault z2 does not see: members and estimators.
    pub actuator: Option<usize>,
}

impl ObserverDesign {
    /// The tables of an observer with these test rows.
    pub fn new(observer: Observer, reach: Reach, tests: DMatrix<f64>, actuator: Option<usize>) -> Self {
        Self {
            thresholds: reach.test_half_widths(&tests),
            observer,
            reach,
            tests,
            actuator,
        }
    }

    /// The same observer with other test rows.
    pub fn with_tests(self, tests: DMatrix<f64>) -> Self {
        Self::new(self.observer, self.reach, tests, self.actuator)
    }

    /// t_inf: the half widths of all tests in the steady state.
    pub fn steady(&self) -> DVector<f64> {
        self.thresholds.row(self.thresholds.nrows() - 1).transpose()
    }

    /// t_inf of the outputs, the first p rows of the main observer's tests.
    pub fn hull(&self) -> DVector<f64> {
        self.steady().rows(0, self.outputs()).into_owned()
    }

    /// p, the number of outputs.
    pub fn outputs(&self) -> usize {
        self.observer.m.nrows()
    }

    /// Per actuator the smallest constant fault that certainly alarms, by all rows.
    pub fn set_floors(&self) -> DVector<f64> {
        fault_floors(&self.observer, &self.tests, &self.steady())
    }

    /// The same by the outputs alone.
    pub fn hull_floors(&self) -> DVector<f64> {
        let rows = self.tests.rows(0, self.outputs()).into_owned();
        fault_floors(&self.observer, &rows, &self.hull())
    }

    /// The eigenvalues of F, if they can be computed.
    pub fn eigenvalues(&self) -> Option<Vec<Complex<f64>>> {
        eigenvalues(&self.observer.f)
    }
}

/// The largest |eig F| that the main observer may have.
pub(super) fn convergence_limit(options: &ReducedOrderObserverOptions) -> f64 {
    options.design.spectral_radius_max + 1e-9
}

/// The largest modulus of the eigenvalues; infinite if they cannot be computed, as those of very large numbers.
pub(super) fn largest_modulus(matrix: &DMatrix<f64>) -> f64 {
    let moduli =
        eigenvalues(matrix).map(|values| values.iter().map(|value| value.norm()).collect::<Vec<_>>());
    match moduli {
        Some(moduli) if moduli.iter().all(|modulus| modulus.is_finite()) => {
            moduli.into_iter().fold(0.0, f64::max)
        }
        _ => f64::INFINITY,
    }
}

/// Which of K and M keeps the observer from converging fast enough, ρ(F) <= `limit` and ρ(M) < 1, and why; `None` if
/// it converges.
pub(super) fn convergence_reason(observer: &Observer, limit: f64) -> Option<(&'static str, String)> {
    let (f, m) = (largest_modulus(&observer.f), largest_modulus(&observer.m));
    if !(f <= limit) {
        return Some(("K", format!("|eig F| reaches {f:.6}, above {limit}")));
    }
    if !(m < 1.0) {
        return Some(("M", format!("|eig M| reaches {m:.6}, M must be Schur")));
    }
    None
}

/// Rows that do not see the columns of `unseen` (p x qu): orthonormal, with the sign of test directions.
pub(super) fn blind_rows(unseen: &DMatrix<f64>) -> DMatrix<f64> {
    let mut rows = null_space(unseen).transpose();
    for mut row in rows.row_iter_mut() {
        let sign = orientation(&row.iter().copied().collect::<Vec<_>>());
        row *= sign;
    }
    rows
}

/// The noise-free and disturbance-free check that the tables can be used.
pub(super) fn reach(plant: &Plant, observer: &Observer) -> Result<Reach, String> {
    Reach::new(plant, observer).ok_or_else(|| "the errors do not stay bounded by finite tables".to_owned())
}
