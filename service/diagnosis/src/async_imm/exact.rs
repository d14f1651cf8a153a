//! Exact discretisation of a time-invariant plant over one interval (method sheet 3, step 2). Off-line.

use super::{interval::Interval, plant::LinearPlant};
use crate::{discretise::matrix_exponential, matrix::Matrix};
use nalgebra::DMatrix;

/// ‖A‖₁h₀ at which the exponentials are taken; longer intervals are doubled up from there.
const LARGEST_NORM: f64 = 0.5;
/// More doublings cover no finite number.
const MOST_DOUBLINGS: f64 = 1100.0;

/// Φ, \[Υ, Ξ\] and Ω of the plant over `seconds`.
///
/// Exponentials are taken over h₀ = h/2^s with ‖A‖₁h₀ <= 1/2, Ω by Van Loan's formula Ω = V₂₂'V₁₂, and doubled s
/// times; so e^{-Ah} never grows beyond e^{1/2} and a pole at -1000 1/s over hours is no difficulty. [B, F] and
/// GQG' enter linearly and are scaled to the size of A beforehand: they take no part in the scaling of the
/// exponential. Overflow gives entries that are not finite.
pub fn discretise(plant: &LinearPlant, seconds: f64) -> Interval {
    let n = plant.a.nrows();
    let norm = norm_1(&plant.a) * seconds;
    let doublings = if norm > LARGEST_NORM {
        (norm / LARGEST_NORM).log2().ceil().min(MOST_DOUBLINGS)
    } else {
        0.0
    };
    let h0 = seconds * (-doublings).exp2();
    let (mut phi, mut gain) = transition_and_gain(plant, h0);
    let mut omega = noise_integral(plant, h0);
    for _ in 0..doublings as u32 {
        omega = &phi * &omega * phi.transpose() + &omega;
        gain = &phi * &gain + &gain;
        phi = &phi * &phi;
    }
    omega = (&omega + omega.transpose()) / 2.0;
    debug_assert_eq!(phi.nrows(), n);
    Interval {
        phi: Matrix::from(&phi),
        gain: Matrix::from(&gain),
        omega: Matrix::from(&omega),
    }
}

/// exp([A, E; 0, 0] h) = [Φ, ∫ e^{Aτ} dτ E; 0, I] with E = [B, F].
fn transition_and_gain(plant: &LinearPlant, h: f64) -> (DMatrix<f64>, DMatrix<f64>) {
    let (n, nu, nf) = (plant.a.nrows(), plant.b.ncols(), plant.f.ncols());
    let mut inputs = DMatrix::zeros(n, nu + nf);
    inputs.columns_mut(0, nu).copy_from(&plant.b);
    inputs.columns_mut(nu, nf).copy_from(&plant.f);
    let scale = unit_scale(&inputs, h);
    let mut block = DMatrix::zeros(n + nu + nf, n + nu + nf);
    block.view_mut((0, 0), (n, n)).copy_from(&(&plant.a * h));
    block
        .view_mut((0, n), (n, nu + nf))
        .copy_from(&(inputs * (h / scale)));
    let exponential = matrix_exponential(&block);
    (
        exponential.view((0, 0), (n, n)).into_owned(),
        exponential.view((0, n), (n, nu + nf)) * scale,
    )
}

/// Van Loan: exp([-A, GQG'; 0, A'] h) = [·, V₁₂; 0, V₂₂], Ω = V₂₂'V₁₂.
fn noise_integral(plant: &LinearPlant, h: f64) -> DMatrix<f64> {
    let n = plant.a.nrows();
    let scale = unit_scale(&plant.noise, h);
    let mut block = DMatrix::zeros(2 * n, 2 * n);
    block.view_mut((0, 0), (n, n)).copy_from(&(&plant.a * -h));
    block
        .view_mut((0, n), (n, n))
        .copy_from(&(&plant.noise * (h / scale)));
    block
        .view_mut((n, n), (n, n))
        .copy_from(&(plant.a.transpose() * h));
    let exponential = matrix_exponential(&block);
    let (v12, v22) = (exponential.view((0, n), (n, n)), exponential.view((n, n), (n, n)));
    v22.tr_mul(&v12.into_owned()) * scale
}

/// The power of two that brings ‖M‖₁h below [`LARGEST_NORM`]; exact to divide by and to multiply with.
fn unit_scale(matrix: &DMatrix<f64>, h: f64) -> f64 {
    let norm = norm_1(matrix) * h;
    if norm > 0.0 && norm.is_finite() {
        (norm / LARGEST_NORM).log2().ceil().clamp(-900.0, 900.0).exp2()
    } else {
        1.0
    }
}

fn norm_1(matrix: &DMatrix<f64>) -> f64 {
    matrix
        .column_iter()
        .map(|column| column.iter().map(|entry| entry.abs()).sum())
        .fold(0.0, f64::max)
}
