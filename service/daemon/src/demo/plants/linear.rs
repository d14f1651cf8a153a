//! A sampled linear plant: x(k+1) = A x + B u + E d + F f, y = C x + D u + D_d d + D_f f + v.

use nalgebra::{DMatrix, DVector};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

/// Matrices of a sampled plant with n states, m commands, p outputs, q disturbances and l faults.
#[derive(Clone, Debug)]
pub struct LinearPlant {
    /// A, n x n.
    pub a: DMatrix<f64>,
    /// B, n x m.
    pub b: DMatrix<f64>,
    /// E, n x q.
    pub e: DMatrix<f64>,
    /// F, n x l.
    pub f: DMatrix<f64>,
    /// C, p x n.
    pub c: DMatrix<f64>,
    /// D, p x m.
    pub d: DMatrix<f64>,
    /// D_d, p x q.
    pub d_d: DMatrix<f64>,
    /// D_f, p x l.
    pub d_f: DMatrix<f64>,
    /// x, n.
    pub state: DVector<f64>,
}

impl LinearPlant {
    /// The noise-free output y(k).
    pub fn output(&self, u: &DVector<f64>, d: &DVector<f64>, f: &DVector<f64>) -> DVector<f64> {
        &self.c * &self.state + &self.d * u + &self.d_d * d + &self.d_f * f
    }

    /// Goes on from k to k + 1.
    pub fn advance(&mut self, u: &DVector<f64>, d: &DVector<f64>, f: &DVector<f64>) {
        self.state = &self.a * &self.state + &self.b * u + &self.e * d + &self.f * f;
    }
}

/// exp of \[A, B; 0, 0\] T: the images (A_d, B_d) of a continuous plant whose inputs are held over T seconds.
pub fn zero_order_hold(a: &DMatrix<f64>, b: &DMatrix<f64>, period_s: f64) -> (DMatrix<f64>, DMatrix<f64>) {
    let (n, m) = b.shape();
    let mut augmented = DMatrix::zeros(n + m, n + m);
    augmented.view_mut((0, 0), (n, n)).copy_from(&(a * period_s));
    augmented.view_mut((0, n), (n, m)).copy_from(&(b * period_s));
    let image = augmented.exp();
    (
        image.view((0, 0), (n, n)).into_owned(),
        image.view((0, n), (n, m)).into_owned(),
    )
}

/// Random numbers of one seed.
pub struct Draw(ChaCha8Rng);

impl Draw {
    /// Numbers of this seed.
    pub fn new(seed: u64) -> Self {
        Self(ChaCha8Rng::seed_from_u64(seed))
    }

    /// Uniform within ± `bound`.
    pub fn bounded(&mut self, bound: f64) -> f64 {
        self.0.random_range(-bound..=bound)
    }

    /// Normal with this standard deviation (Box and Muller).
    pub fn normal(&mut self, deviation: f64) -> f64 {
        let radius = (-2.0 * (1.0 - self.0.random::<f64>()).ln()).sqrt();
        deviation * radius * (std::f64::consts::TAU * self.0.random::<f64>()).cos()
    }

    /// True with this probability.
    pub fn chance(&mut self, probability: f64) -> bool {
        self.0.random::<f64>() < probability
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_held_input_charges_a_first_order_lag_exactly() {
        let (a, b) = zero_order_hold(
            &DMatrix::from_element(1, 1, -2.0),
            &DMatrix::from_element(1, 1, 4.0),
            0.1,
        );
        assert!((a[0] - (-0.2_f64).exp()).abs() < 1e-15);
        assert!((b[0] - 2.0 * (1.0 - (-0.2_f64).exp())).abs() < 1e-15);
    }

    #[test]
    fn normal_numbers_have_their_deviation() {
        let mut draw = Draw::new(1);
        let square: f64 = (0..20_000).map(|_| draw.normal(2.0).powi(2)).sum::<f64>() / 20_000.0;
        assert!((square - 4.0).abs() < 0.2, "{square}");
    }
}
