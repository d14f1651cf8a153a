//! Where the level searches look first, and where a level is crossed.

use super::system::System;
use crate::decomposition::{balanced, eigenvalues};
use nalgebra::{Complex, DMatrix, DVector};

/// Logarithmically spaced frequencies of the first look.
const COARSE: usize = 40;
/// And of the grid that stands in where eigenvalues do not converge.
const DENSE: usize = 4000;
/// Random changes of coordinates before the eigenvalue iteration is given up.
const RETRIES: u32 = 4;

/// 0, ∞, the moduli and imaginary parts of the eigenvalues, and a grid around them.
pub(super) fn candidates(poles: &[Complex<f64>]) -> Vec<f64> {
    let mut found = vec![0.0, f64::INFINITY];
    for pole in poles {
        found.extend([pole.norm(), pole.im.abs()]);
    }
    found.extend(grid(poles, COARSE));
    found
}

/// A grid over the frequencies at which the response can change.
pub(super) fn dense_grid(poles: &[Complex<f64>]) -> Vec<f64> {
    grid(poles, DENSE).collect()
}

fn grid(poles: &[Complex<f64>], count: usize) -> impl Iterator<Item = f64> {
    let moduli = poles
        .iter()
        .map(|pole| pole.norm())
        .filter(|modulus| *modulus > 0.0);
    let (low, high) = moduli.fold((f64::INFINITY, 0.0_f64), |(low, high), modulus| {
        (low.min(modulus), high.max(modulus))
    });
    let (low, high) = if high > 0.0 { (low, high) } else { (1.0, 1.0) };
    log_spaced(low * 1e-3, high * 1e3, count)
}

/// `count` frequencies from `low` to `high` with a constant ratio.
pub(super) fn log_spaced(low: f64, high: f64, count: usize) -> impl Iterator<Item = f64> {
    let step = (high / low).ln() / (count.max(2) - 1) as f64;
    (0..count).map(move |i| low * (step * i as f64).exp())
}

/// Frequencies ω >= 0 among which are all at which some singular value of G(jω) equals `level`, in order; `None` if the
/// eigenvalues do not converge.
///
/// A level is crossed at the imaginary eigenvalues of
/// \[a + b R⁻¹d'c, b R⁻¹b'; -c'(I + d R⁻¹d')c, -(a + b R⁻¹d'c)'\], R = level² I - d'd. Close to an extreme two of them
/// meet, and rounding drives them off the axis by the root of its size, or farther where the extreme is flat. So no
/// eigenvalue is left out for its real part: who asks looks at the gain itself, at these frequencies and between them.
pub(super) fn crossings(system: &System, level: f64) -> Option<Vec<f64>> {
    let System { a, b, c, d } = system;
    let (n, m, q) = (a.nrows(), b.ncols(), c.nrows());
    let r = DMatrix::identity(m, m) * (level * level) - d.tr_mul(d);
    let inverse = r.try_inverse()?;
    let upper = a + b * &inverse * d.tr_mul(c);
    let lower = -(c.transpose() * (DMatrix::identity(q, q) + d * &inverse * d.transpose()) * c);
    let mut hamiltonian = DMatrix::zeros(2 * n, 2 * n);
    hamiltonian.view_mut((0, 0), (n, n)).copy_from(&upper);
    hamiltonian
        .view_mut((0, n), (n, n))
        .copy_from(&(b * &inverse * b.transpose()));
    hamiltonian.view_mut((n, 0), (n, n)).copy_from(&lower);
    hamiltonian
        .view_mut((n, n), (n, n))
        .copy_from(&-upper.transpose());
    if hamiltonian.iter().any(|value| !value.is_finite()) {
        return None;
    }
    let values = robust_eigenvalues(&balanced(&hamiltonian))?;
    let mut found: Vec<f64> = values
        .iter()
        .map(|value| value.im)
        .filter(|omega| *omega >= 0.0)
        .collect();
    found.sort_by(f64::total_cmp);
    found.dedup();
    Some(found)
}

/// The crossings with their mid-points and geometric means: where a level set can have its extremes.
pub(super) fn between(crossings: &[f64]) -> Vec<f64> {
    let mut found = crossings.to_vec();
    for pair in crossings.windows(2) {
        found.extend([(pair[0] + pair[1]) / 2.0, (pair[0] * pair[1]).sqrt()]);
    }
    found
}

/// Eigenvalues that also survive matrices on which the QR iteration stalls: after an orthogonal change of
/// coordinates it converges.
fn robust_eigenvalues(matrix: &DMatrix<f64>) -> Option<Vec<Complex<f64>>> {
    let n = matrix.nrows();
    (0..=RETRIES).find_map(|attempt| {
        if attempt == 0 {
            return eigenvalues(matrix);
        }
        let direction = DVector::from_fn(n, |i, _| ((i + 1) as f64 * f64::from(attempt) * 1.7).sin());
        let reflector =
            DMatrix::identity(n, n) - &direction * direction.transpose() * (2.0 / direction.norm_squared());
        eigenvalues(&(&reflector * matrix * &reflector))
    })
}

/// Golden-section steps: the bracket shrinks to 1e-10 of its width.
const SECTIONS: usize = 48;

/// The smallest value between `low` and `high`, if there is one minimum only.
pub(super) fn golden_section(value: impl Fn(f64) -> f64, mut low: f64, mut high: f64) -> f64 {
    let ratio = (5.0_f64.sqrt() - 1.0) / 2.0;
    let (mut left, mut right) = (high - ratio * (high - low), low + ratio * (high - low));
    let (mut at_left, mut at_right) = (value(left), value(right));
    for _ in 0..SECTIONS {
        if at_left < at_right {
            (high, right, at_right) = (right, left, at_left);
            left = high - ratio * (high - low);
            at_left = value(left);
        } else {
            (low, left, at_left) = (left, right, at_right);
            right = low + ratio * (high - low);
            at_right = value(right);
        }
    }
    at_left.min(at_right)
}

/// The smallest value around the best of these frequencies: between its neighbours.
pub(super) fn refined(value: impl Fn(f64) -> f64, frequencies: &[f64]) -> f64 {
    let mut sorted: Vec<f64> = frequencies
        .iter()
        .copied()
        .filter(|omega| omega.is_finite())
        .collect();
    sorted.sort_by(f64::total_cmp);
    sorted.dedup();
    let values: Vec<f64> = sorted.iter().map(|omega| value(*omega)).collect();
    let Some(best) = (0..values.len()).min_by(|i, j| values[*i].total_cmp(&values[*j])) else {
        return f64::INFINITY;
    };
    let (low, high) = (
        sorted[best.saturating_sub(1)],
        sorted[(best + 1).min(sorted.len() - 1)],
    );
    golden_section(value, low, high).min(values[best])
}
