//! Parity certificates by linear algebra: not the most sensitive ones, but true ones, for any plant.

use nalgebra::{DMatrix, DVector, SVD};
use residual_diagnosis::model::LinearModel;
use residual_diagnosis::unknown_input_filter::{certificate::ParityCertificate, modes::FaultMode};

/// The certificate of smallest norm per response to a constant fault over `n` transitions, if there is one.
///
/// The unknowns are λ_0..λ_{n-1}, then μ_0..μ_n; the response is projected on the solutions of the equalities.
pub fn certificate(
    model: &LinearModel,
    mode: FaultMode,
    fault: usize,
    n: usize,
) -> Option<ParityCertificate> {
    let (nx, ny) = (model.state_count(), model.output_count());
    let f = mode.unknown_input_matrix(model.b());
    let unknowns = nx * n + ny * (n + 1);
    let mut equalities = DMatrix::zeros(nx * (n + 1) + f.ncols() * n, unknowns);
    for k in 0..=n {
        let row = nx * k;
        if k > 0 {
            equalities
                .view_mut((row, nx * (k - 1)), (nx, nx))
                .fill_with_identity();
        }
        if k < n {
            equalities
                .view_mut((row, nx * k), (nx, nx))
                .copy_from(&-model.a0().transpose());
            let own = nx * (n + 1) + f.ncols() * k;
            equalities
                .view_mut((own, nx * k), (f.ncols(), nx))
                .copy_from(&f.transpose());
        }
        equalities
            .view_mut((row, nx * n + ny * k), (nx, ny))
            .copy_from(&-model.c().transpose());
    }
    let mut response = DVector::zeros(unknowns);
    for k in 0..n {
        response.rows_mut(nx * k, nx).copy_from(&model.b().column(fault));
    }
    // Zero rows make the matrix at least square, so that all right singular vectors come out.
    let rows = equalities.nrows().max(unknowns);
    let svd = SVD::try_new(
        equalities.resize_vertically(rows, 0.0),
        false,
        true,
        f64::EPSILON,
        10_000,
    )?;
    let limit = 1e-9 * svd.singular_values.max();
    let solutions = svd.v_t?.select_rows(
        &(0..unknowns)
            .filter(|&i| svd.singular_values[i] <= limit)
            .collect::<Vec<_>>(),
    );
    let best = solutions.transpose() * (&solutions * &response);
    let gain = best.dot(&response);
    if gain <= 1e-6 * response.norm_squared() {
        return None;
    }
    let best = best / gain;
    let part = |start: usize, width: usize| best.as_slice()[start..start + width].to_vec();
    Some(ParityCertificate {
        mode,
        fault,
        length: n,
        lambda: (0..n).map(|k| part(nx * k, nx)).collect(),
        mu: (0..=n).map(|k| part(nx * n + ny * k, ny)).collect(),
    })
}
