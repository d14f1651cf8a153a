//! Lyapunov equations by squared Smith iterations: a handful of products, no eigenvalues.

use nalgebra::DMatrix;

/// Each round squares the power of A that is summed: 2⁶⁰ terms.
const ROUNDS: usize = 60;

/// X = A X A' + Q, that is Σ_k Aᵏ Q A'ᵏ; `None` unless A is stable (all eigenvalues inside the unit circle).
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
            return Some((&sum + sum.transpose()) / 2.0);
        }
    }
    None
}

/// A X + X A' + Q = 0, that is ∫ e^{At} Q e^{A't} dt; `None` unless A is stable (all eigenvalues left of the
/// imaginary axis).
pub fn continuous(a: &DMatrix<f64>, q: &DMatrix<f64>) -> Option<DMatrix<f64>> {
    let n = a.nrows();
    let identity = DMatrix::<f64>::identity(n, n);
    // Cayley transform with a shift of the size of A.
    let shift = a.norm().max(f64::MIN_POSITIVE.sqrt());
    let inverse = (&identity * shift - a).try_inverse()?;
    let mapped = &inverse * (identity * shift + a);
    discrete(&mapped, &(&inverse * q * inverse.transpose() * (2.0 * shift)))
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
