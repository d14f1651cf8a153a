//! Units in which the solver sees a plant: the disturbance in δ, the state in T, T T' = Π (method sheet 3.3).

use super::{ErrorPlant, Time};
use nalgebra::{DMatrix, DVector};
use residual_diagnosis::{
    decomposition::{SingularDecomposition, SymmetricDecomposition},
    riccati::{Covariances, care, dare},
};

/// Measurement noise of the Riccati equation, as a part of δ.
const NOISE: f64 = 1e-2;
/// Process noise that is added if the equation has no stabilising solution, as a part of σ_max(Bd).
const PROCESS_NOISE: f64 = 1e-3;
/// Smallest eigenvalue of Π with a unit diagonal, as a part of the largest.
const FLOOR: f64 = 1e-4;
/// A variance at or below this part of the largest entry of Π says nothing about the unit of its state.
const UNDISTURBED: f64 = 1e-24;

/// A plant in the solver's units, and the way back.
#[derive(Clone, Debug)]
pub(super) struct ScaledPlant {
    a: DMatrix<f64>,
    bd: DMatrix<f64>,
    c: DMatrix<f64>,
    dd: DMatrix<f64>,
    /// δ.
    pub(super) delta: f64,
    t: DMatrix<f64>,
    inverse: DMatrix<f64>,
}

impl ScaledPlant {
    /// A ← T⁻¹AT, Bd ← T⁻¹Bd/δ, C ← CT, Dd ← Dd/δ.
    pub(super) fn new(time: Time, plant: &ErrorPlant<'_>, delta: f64) -> Self {
        let (bd, dd) = (plant.bd / delta, plant.dd / delta);
        let (t, inverse) = state_units(time, plant, &bd, &dd);
        Self {
            a: &inverse * plant.a * &t,
            bd: &inverse * bd,
            c: plant.c * &t,
            dd,
            delta,
            t,
            inverse,
        }
    }

    /// The plant in the solver's units.
    pub(super) fn plant(&self) -> ErrorPlant<'_> {
        ErrorPlant {
            a: &self.a,
            bd: &self.bd,
            c: &self.c,
            dd: &self.dd,
        }
    }

    /// A matrix that drives the state, in the solver's units.
    pub(super) fn input(&self, matrix: &DMatrix<f64>) -> DMatrix<f64> {
        &self.inverse * matrix
    }

    /// The gain in original units, T L̃.
    pub(super) fn gain(&self, scaled: &DMatrix<f64>) -> DMatrix<f64> {
        &self.t * scaled
    }

    /// A Lyapunov matrix in original coordinates, T⁻ᵀ X̃ T⁻¹, still in units of the scaled disturbance.
    pub(super) fn lyapunov(&self, scaled: &DMatrix<f64>) -> DMatrix<f64> {
        let x = self.inverse.transpose() * scaled * &self.inverse;
        (&x + x.transpose()) / 2.0
    }
}

/// T and T⁻¹; the identity if the Riccati equation has no solution or a zero one.
fn state_units(
    time: Time,
    plant: &ErrorPlant<'_>,
    bd: &DMatrix<f64>,
    dd: &DMatrix<f64>,
) -> (DMatrix<f64>, DMatrix<f64>) {
    let (n, q) = (plant.a.nrows(), plant.c.nrows());
    let identity = DMatrix::<f64>::identity(n, n);
    let s = bd * dd.transpose();
    let r = dd * dd.transpose() + DMatrix::identity(q, q) * (NOISE * NOISE);
    let driven = bd * bd.transpose();
    let process = PROCESS_NOISE * SingularDecomposition::new(bd).largest();
    let solution = [0.0, process].into_iter().find_map(|noise| {
        let covariance = &driven + &identity * (noise * noise);
        let noise = Covariances {
            q: &covariance,
            s: &s,
            r: &r,
        };
        let solved = match time {
            Time::Continuous => care(plant.a, plant.c, noise),
            Time::Discrete => dare(plant.a, plant.c, noise),
        };
        solved.ok()
    });
    let Some(pi) = solution.map(|solution| solution.pi) else {
        return (identity.clone(), identity);
    };
    // States in units of their deviation first, so that their original units do not meet the floor.
    let (variances, noticeable) = (pi.diagonal(), UNDISTURBED * pi.amax());
    let Some(least) = variances
        .iter()
        .copied()
        .filter(|&variance| variance > noticeable)
        .reduce(f64::min)
    else {
        return (identity.clone(), identity);
    };
    let units = variances.map(|variance| variance.max(least).sqrt());
    let correlation = DMatrix::from_fn(n, n, |i, j| pi[(i, j)] / (units[i] * units[j]));
    let decomposition = SymmetricDecomposition::new(&correlation);
    let largest = decomposition.eigenvalues.max();
    let roots = decomposition
        .eigenvalues
        .map(|value| value.max(FLOOR * largest).sqrt());
    let vectors = &decomposition.vectors;
    let power = |roots: DVector<f64>| vectors * DMatrix::from_diagonal(&roots) * vectors.transpose();
    let inverse = power(roots.map(|root| 1.0 / root)) * DMatrix::from_diagonal(&units.map(|unit| 1.0 / unit));
    (DMatrix::from_diagonal(&units) * power(roots), inverse)
}
