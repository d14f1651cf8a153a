//! Lyapunov equations by squared Smith iterations: a handful of products, no eigenvalues. No solution is returned whose
//! residual was not checked.

use nalgebra::DMatrix;

/// Each round squares the power of A that is summed: 2⁶⁰ terms.
const ROUNDS: usize = 60;

/// Largest relative residual of an accepted solution.
const RESIDUAL: f64 = 1e-8;

/// X = A X A' + Q, that is Σ_k Aᵏ Q A'ᵏ; `None` unless A is stable (all eigenvalues inside the unit circle) and the
/// relative [residual](discrete_residual) is at most 1e-8.
pub fn discrete(a: &DMatrix<f64>, q: &DMatrix<f64>) -> Option<DMatrix<f64>> {
    let (mut power, mut sum) = (a.clone(), q.clone());
    for _ in 0..ROUNDS {
        let change = &power * &sum * power.transpose();
        sum += &change;
        power = &power * &power;
        if !sum.amax().is_finite() || !power.amax().is_finite() {
            return None;
        }
        if power.amax() < 1e-40 {
            let solution = (&sum + sum.transpose()) / 2.0;
            return (discrete_residual(a, &solution, q) <= RESIDUAL).then_some(solution);
        }
    }
    None
}

/// A X + X A' + Q = 0, that is ∫ e^{At} Q e^{A't} dt; `None` unless A is stable (all eigenvalues left of the
/// imaginary axis) and the relative [residual](continuous_residual) is at most 1e-8.
pub fn continuous(a: &DMatrix<f64>, q: &DMatrix<f64>) -> Option<DMatrix<f64>> {
    let n = a.nrows();
    let identity = DMatrix::<f64>::identity(n, n);
    // Cayley transform with a shift of the size of A.
    let shift = a.norm().max(f64::MIN_POSITIVE.sqrt());
    let inverse = (&identity * shift - a).try_inverse()?;
    let mapped = &inverse * (identity * shift + a);
    let solution = discrete(&mapped, &(&inverse * q * inverse.transpose() * (2.0 * shift)))?;
    (continuous_residual(a, &solution, q) <= RESIDUAL).then_some(solution)
}

/// Largest entry of A X A' + Q - X relative to that of X.
pub fn discrete_residual(a: &DMatrix<f64>, x: &DMatrix<f64>, q: &DMatrix<f64>) -> f64 {
    relative(&(a * x * a.transpose() + q - x), x.amax())
}

/// Largest entry of A X + X A' + Q relative to the larger of A X and Q.
pub fn continuous_residual(a: &DMatrix<f64>, x: &DMatrix<f64>, q: &DMatrix<f64>) -> f64 {
    let flow = a * x;
    relative(&(&flow + flow.transpose() + q), flow.amax().max(q.amax()))
}

fn relative(residual: &DMatrix<f64>, scale: f64) -> f64 {
    if scale > 0.0 {
        residual.amax() / scale
    } else {
        residual.amax()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::dmatrix;

    #[test]
    fn the_solutions_satisfy_their_equations() {
        let a = dmatrix![-1.0, 5.0, 0.0; -2.0, -0.3, 0.4; 0.0, 0.1, -7.0];
        let q = dmatrix![2.0, 0.3, 0.0; 0.3, 1.0, -0.2; 0.0, -0.2, 0.5];
        let x = continuous(&a, &q).unwrap();
        assert!((&a * &x + &x * a.transpose() + &q).amax() < 1e-13);
        let a = a / 8.0;
        let x = discrete(&a, &q).unwrap();
        assert!((&a * &x * a.transpose() + &q - &x).amax() < 1e-13);
    }

    #[test]
    fn an_unstable_matrix_has_no_solution() {
        let q = dmatrix![1.0];
        assert!(discrete(&dmatrix![1.0], &q).is_none() && discrete(&dmatrix![-1.1], &q).is_none());
        assert!(continuous(&dmatrix![0.0], &q).is_none() && continuous(&dmatrix![0.2], &q).is_none());
    }
}
