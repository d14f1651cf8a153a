//! Energy of the response to an initial state.

use crate::{decomposition::SingularDecomposition, lyapunov};
use nalgebra::DMatrix;

/// Wo of a discrete-time pair, Wo = A' Wo A + C'C; `None` unless A is stable.
pub fn observability_gramian(a: &DMatrix<f64>, c: &DMatrix<f64>) -> Option<DMatrix<f64>> {
    lyapunov::discrete(&a.transpose(), &c.tr_mul(c))
}

/// √λ_max(Wo): the L2 norm of C e^{At} x0 is at most this times ‖x0‖₂, and some x0 reaches it. In units of the
/// output times √s per unit of the state; `None` unless A is stable.
pub fn initial_error_gain_continuous(a: &DMatrix<f64>, c: &DMatrix<f64>) -> Option<f64> {
    let gramian = lyapunov::continuous(&a.transpose(), &c.tr_mul(c))?;
    Some(SingularDecomposition::new(&gramian).largest().sqrt())
}

/// √(Ts λ_max(Wo)) of the sampled response C Aᵏ x0, Ts in s; `None` unless A is stable.
pub fn initial_error_gain_discrete(a: &DMatrix<f64>, c: &DMatrix<f64>, sample_time_s: f64) -> Option<f64> {
    let gramian = observability_gramian(a, c)?;
    Some((sample_time_s * SingularDecomposition::new(&gramian).largest()).sqrt())
}
