//! From a continuous-time model to a discrete-time one.
//!
//! dx/dt = (A + ΔA) x + B (u + f) + D d, |ΔA| <= A⁺ (1/s), becomes x(k+1) = (A0 + ΔA(k)) x(k) + B (u + f) + D d.
//!
//! | quantity | continuous | Euler | zero-order hold |
//! |---|---|---|---|
//! | A0 | A, per second | I + T A | exp(T A) |
//! | B, D | per second | T B, T D | ∫ exp(sA) ds B, ∫ exp(sA) ds D over [0, T] |
//! | A⁺ | per second | T A⁺ | must be zero |
//! | w, v | units of d and y | unchanged | unchanged |
//!
//! The bound w stays in the unit of d, because T or the integral goes into D; so D d is per step afterwards.
//! Commands, faults and disturbances are taken as constant between two sampling instants. Euler's error (of
//! second order in T), and a disturbance that varies within a period under zero-order hold, are *not* covered
//! by any bound here: whoever needs the guarantee enlarges the disturbance bound by them.

use crate::model::ModelError;
use nalgebra::DMatrix;
use serde::Serialize;

/// The matrices that change with the sampling period.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub(crate) struct Dynamics {
    /// State matrix, nx x nx.
    pub a0: DMatrix<f64>,
    /// Input matrix, nx x nu.
    pub b: DMatrix<f64>,
    /// Disturbance matrix, nx x nd.
    pub d: DMatrix<f64>,
    /// Entrywise bound of the uncertainty of `a0`, nx x nx.
    pub a_plus: DMatrix<f64>,
}

impl Dynamics {
    fn finite(self, sample_time_s: f64) -> Result<Self, ModelError> {
        let finite = [&self.a0, &self.b, &self.d, &self.a_plus]
            .iter()
            .all(|matrix| matrix.iter().all(|entry| entry.is_finite()));
        if finite {
            Ok(self)
        } else {
            Err(ModelError::DiscretisationOverflow { sample_time_s })
        }
    }
}

/// One explicit Euler step of `sample_time_s` seconds.
pub(crate) fn euler(continuous: &Dynamics, sample_time_s: f64) -> Result<Dynamics, ModelError> {
    let nx = continuous.a0.nrows();
    Dynamics {
        a0: DMatrix::identity(nx, nx) + &continuous.a0 * sample_time_s,
        b: &continuous.b * sample_time_s,
        d: &continuous.d * sample_time_s,
        a_plus: &continuous.a_plus * sample_time_s,
    }
    .finite(sample_time_s)
}

/// Exact discretisation for inputs held over `sample_time_s` seconds, from the exponential of the augmented
/// matrix [A, B, D; 0, 0, 0] T, which needs no inverse of A.
pub(crate) fn zero_order_hold(continuous: &Dynamics, sample_time_s: f64) -> Result<Dynamics, ModelError> {
    if continuous.a_plus.iter().any(|bound| *bound != 0.0) {
        return Err(ModelError::UncertaintyWithZeroOrderHold);
    }
    let (nx, nu, nd) = (continuous.a0.nrows(), continuous.b.ncols(), continuous.d.ncols());
    let mut augmented = DMatrix::zeros(nx + nu + nd, nx + nu + nd);
    augmented.view_mut((0, 0), (nx, nx)).copy_from(&continuous.a0);
    augmented.view_mut((0, nx), (nx, nu)).copy_from(&continuous.b);
    augmented
        .view_mut((0, nx + nu), (nx, nd))
        .copy_from(&continuous.d);
    let exponential = matrix_exponential(&(augmented * sample_time_s));
    Dynamics {
        a0: exponential.view((0, 0), (nx, nx)).into_owned(),
        b: exponential.view((0, nx), (nx, nu)).into_owned(),
        d: exponential.view((0, nx + nu), (nx, nd)).into_owned(),
        a_plus: continuous.a_plus.clone(),
    }
    .finite(sample_time_s)
}

/// exp(M) by scaling and squaring around a Taylor polynomial of degree 18 (truncation error below 1e-21 at
/// norm 1/2). Overflow gives non-finite entries, never a panic.
pub fn matrix_exponential(matrix: &DMatrix<f64>) -> DMatrix<f64> {
    const DEGREE: u32 = 18;
    let n = matrix.nrows();
    let norm = (0..n)
        .map(|i| matrix.row(i).iter().map(|entry| entry.abs()).sum())
        .fold(0.0, f64::max);
    if !norm.is_finite() {
        return DMatrix::from_element(n, n, f64::NAN);
    }
    let halvings = if norm > 0.5 {
        (norm / 0.5).log2().ceil() as i32
    } else {
        0
    };
    let scaled = matrix * 0.5_f64.powi(halvings);
    let identity = DMatrix::identity(n, n);
    let mut sum = identity.clone();
    for degree in (1..=DEGREE).rev() {
        sum = &identity + &scaled * sum / f64::from(degree);
    }
    for _ in 0..halvings {
        sum = &sum * &sum;
    }
    sum
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::dmatrix;

    fn held(a: DMatrix<f64>, b: DMatrix<f64>, period: f64) -> Result<Dynamics, ModelError> {
        let nx = a.nrows();
        let (d, a_plus) = (DMatrix::zeros(nx, 0), DMatrix::zeros(nx, nx));
        zero_order_hold(&Dynamics { a0: a, b, d, a_plus }, period)
    }

    #[test]
    fn zero_order_hold_of_a_double_integrator_is_exact() {
        let discrete = held(dmatrix![0.0, 1.0; 0.0, 0.0], dmatrix![0.0; 1.0], 0.25).unwrap();
        assert_eq!(discrete.a0, dmatrix![1.0, 0.25; 0.0, 1.0]);
        assert_eq!(discrete.b, dmatrix![0.03125; 0.25]);
    }

    #[test]
    fn zero_order_hold_of_an_oscillator_is_a_rotation() {
        let (omega, period) = (40.0, 0.7);
        let discrete = held(dmatrix![0.0, omega; -omega, 0.0], dmatrix![0.0; 1.0], period).unwrap();
        let (sine, cosine) = (omega * period).sin_cos();
        let a0 = dmatrix![cosine, sine; -sine, cosine];
        let b = dmatrix![(1.0 - cosine) / omega; sine / omega];
        assert!((discrete.a0 - a0).amax() < 1e-13 && (discrete.b - b).amax() < 1e-14);
    }

    #[test]
    fn zero_order_hold_of_a_stiff_triangular_system_is_accurate() {
        let (slow, fast, coupling, period) = (-0.1_f64, -2000.0_f64, 5.0, 0.1);
        let discrete = held(dmatrix![slow, coupling; 0.0, fast], dmatrix![0.0; 1.0], period).unwrap();
        let (e_slow, e_fast) = ((slow * period).exp(), (fast * period).exp());
        let a0 = dmatrix![e_slow, coupling * (e_fast - e_slow) / (fast - slow); 0.0, e_fast];
        let b_fast = (e_fast - 1.0) / fast;
        let b_slow = coupling / (fast - slow) * (b_fast - (e_slow - 1.0) / slow);
        assert!((discrete.a0 - a0).amax() < 1e-12);
        assert!((discrete.b - dmatrix![b_slow; b_fast]).amax() < 1e-15);
    }

    #[test]
    fn zero_order_hold_composes_over_two_periods() {
        let a = dmatrix![-0.3, 1.2, 0.0; -4.0, -0.1, 0.7; 0.2, 0.0, -3.0];
        let b = dmatrix![1.0, 0.0; 0.0, 2.0; 0.5, -1.0];
        let one = held(a.clone(), b.clone(), 0.4).unwrap();
        let two = held(a, b, 0.8).unwrap();
        assert!((&one.a0 * &one.a0 - two.a0).amax() < 1e-14);
        assert!((&one.a0 * &one.b + &one.b - two.b).amax() < 1e-14);
    }

    #[test]
    fn euler_multiplies_dynamics_inputs_and_uncertainty_by_the_period() {
        let continuous = Dynamics {
            a0: dmatrix![-2.0],
            b: dmatrix![3.0],
            d: dmatrix![5.0],
            a_plus: dmatrix![7.0],
        };
        let discrete = euler(&continuous, 0.125).unwrap();
        assert_eq!(
            discrete,
            Dynamics {
                a0: dmatrix![0.75],
                b: dmatrix![0.375],
                d: dmatrix![0.625],
                a_plus: dmatrix![0.875]
            }
        );
        assert_eq!(
            zero_order_hold(&continuous, 0.125),
            Err(ModelError::UncertaintyWithZeroOrderHold)
        );
    }

    #[test]
    fn an_exponential_that_overflows_is_an_error() {
        let result = held(dmatrix![1e5], dmatrix![1.0], 1.0);
        assert_eq!(
            result,
            Err(ModelError::DiscretisationOverflow { sample_time_s: 1.0 })
        );
        assert!(held(dmatrix![1e300], dmatrix![1e300], 1e10).is_err());
    }
}
