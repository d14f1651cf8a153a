//! How long a constant fault must last before a mode cannot imitate it (method sheet 3.1.4).
//!
//! A certificate of L = n transitions that responds to fault j exists exactly when the linear functional
//! Σ B_j'λ_k does not vanish on the solutions of the certificate's equalities. By duality it vanishes exactly
//! when some start and some own faults imitate the fault: x(k+1) = A0 x(k) + F f(k) + B_j α with α ≠ 0 and
//! C x(k) = 0 for k = 0..=n. The set S_k of all (x(k), α) of such trajectories is a subspace; it is carried along
//! as an orthonormal basis.

use super::{orthonormal_range, two_norm};
use crate::decomposition::SingularDecomposition;
use crate::model::LinearModel;
use crate::unknown_input_filter::modes::FaultMode;
use nalgebra::DMatrix;

/// Relative tolerance of every rank decision; all bases are orthonormal and all columns normalised.
const RANK_TOLERANCE: f64 = 1e-9;

/// The smallest L <= `longest` at which a constant fault of `actuator`, lasting L transitions, can falsify `mode`.
pub(super) fn first_separating_window(
    model: &LinearModel,
    mode: FaultMode,
    actuator: usize,
    longest: usize,
) -> Option<usize> {
    let nx = model.state_count();
    let fault = model.b().column(actuator);
    let size = fault.norm();
    if size == 0.0 {
        return None;
    }
    let mut step = DMatrix::identity(nx + 1, nx + 1);
    step.view_mut((0, 0), (nx, nx)).copy_from(model.a0());
    step.view_mut((0, nx), (nx, 1)).copy_from(&(fault / size));
    let own = orthonormal_range(&mode.unknown_input_matrix(model.b()), RANK_TOLERANCE).insert_row(nx, 0.0);
    let outputs = (model.c() / two_norm(model.c()).max(f64::MIN_POSITIVE)).insert_column(nx, 0.0);

    let mut trajectories = without_output(&DMatrix::identity(nx + 1, nx + 1), &outputs);
    for length in 1..=longest {
        let moved = &step * &trajectories;
        let mut all = DMatrix::zeros(nx + 1, moved.ncols() + own.ncols());
        all.columns_mut(0, moved.ncols()).copy_from(&moved);
        all.columns_mut(moved.ncols(), own.ncols()).copy_from(&own);
        trajectories = without_output(&orthonormal_range(&all, RANK_TOLERANCE), &outputs);
        if trajectories.row(nx).norm() <= RANK_TOLERANCE {
            return Some(length);
        }
    }
    None
}

/// Orthonormal basis of the part of the span of `basis` (orthonormal) that `outputs` maps to zero.
fn without_output(basis: &DMatrix<f64>, outputs: &DMatrix<f64>) -> DMatrix<f64> {
    let columns = basis.ncols();
    if columns == 0 {
        return basis.clone();
    }
    let silent = SingularDecomposition::new(&(outputs * basis)).null_space(RANK_TOLERANCE);
    basis * silent
}
