//! A system, its frequency response and the bilinear map between the unit circle and the imaginary axis.

use crate::decomposition::SingularDecomposition;
use nalgebra::{Complex, DMatrix};

/// x' = A x + B w (or x⁺), z = C x + D w.
#[derive(Clone, Debug, PartialEq)]
pub struct System {
    /// A, n x n.
    pub a: DMatrix<f64>,
    /// B, n x m.
    pub b: DMatrix<f64>,
    /// C, q x n.
    pub c: DMatrix<f64>,
    /// D, q x m.
    pub d: DMatrix<f64>,
}

impl System {
    /// A system of copies of its matrices, whose shapes must agree.
    pub fn new(a: &DMatrix<f64>, b: &DMatrix<f64>, c: &DMatrix<f64>, d: &DMatrix<f64>) -> Self {
        Self {
            a: a.clone(),
            b: b.clone(),
            c: c.clone(),
            d: d.clone(),
        }
    }

    /// The column of the transfer matrix that belongs to input `j`.
    pub fn input(&self, j: usize) -> Self {
        Self {
            a: self.a.clone(),
            b: self.b.columns(j, 1).into_owned(),
            c: self.c.clone(),
            d: self.d.columns(j, 1).into_owned(),
        }
    }

    /// V G for a constant V.
    pub fn filtered(&self, v: &DMatrix<f64>) -> Self {
        Self {
            a: self.a.clone(),
            b: self.b.clone(),
            c: v * &self.c,
            d: v * &self.d,
        }
    }

    /// G(s) = C (sI - A)⁻¹ B + D at a complex s in the real embedding \[Re, -Im; Im, Re\], which has every singular
    /// value twice; `None` at a pole.
    pub fn response(&self, s: Complex<f64>) -> Option<DMatrix<f64>> {
        let (n, m, q) = (self.a.nrows(), self.b.ncols(), self.c.nrows());
        let mut pencil = DMatrix::zeros(2 * n, 2 * n);
        for block in [0, n] {
            for i in 0..n {
                for j in 0..n {
                    pencil[(block + i, block + j)] = -self.a[(i, j)];
                }
                pencil[(block + i, block + i)] += s.re;
            }
        }
        for i in 0..n {
            pencil[(i, n + i)] = -s.im;
            pencil[(n + i, i)] = s.im;
        }
        let mut input = DMatrix::zeros(2 * n, m);
        input.view_mut((0, 0), (n, m)).copy_from(&self.b);
        let state = pencil.lu().solve(&input)?;
        let real = &self.c * state.rows(0, n) + &self.d;
        let imaginary = &self.c * state.rows(n, n);
        let finite = real.iter().chain(imaginary.iter()).all(|value| value.is_finite());
        finite.then(|| {
            DMatrix::from_fn(2 * q, 2 * m, |i, j| match (i < q, j < m) {
                (true, true) => real[(i, j)],
                (false, false) => real[(i - q, j - m)],
                (true, false) => -imaginary[(i, j - m)],
                (false, true) => imaginary[(i - q, j)],
            })
        })
    }

    /// Smallest and largest singular value of G(s); `None` at a pole.
    pub(crate) fn gains_at(&self, s: Complex<f64>) -> Option<(f64, f64)> {
        let values = SingularDecomposition::new(&self.response(s)?);
        Some((values.smallest(), values.largest()))
    }

    /// Smallest and largest singular value of G(jω), ω in rad/s; those of D at infinity.
    pub(super) fn gains(&self, omega: f64) -> Option<(f64, f64)> {
        if omega.is_infinite() {
            let values = SingularDecomposition::new(&self.d);
            return Some((values.smallest(), values.largest()));
        }
        self.gains_at(Complex::new(0.0, omega))
    }

    /// The continuous-time system with the same gains: s = (z - 1)/(z + 1); `None` if -1 is an eigenvalue of A.
    pub(super) fn bilinear(&self) -> Option<Self> {
        let n = self.a.nrows();
        let identity = DMatrix::<f64>::identity(n, n);
        let inverse = (&self.a + &identity).try_inverse()?;
        let root = std::f64::consts::SQRT_2;
        Some(Self {
            a: &inverse * (&self.a - identity),
            b: &inverse * &self.b * root,
            c: &self.c * &inverse * root,
            d: &self.d - &self.c * &inverse * &self.b,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::dmatrix;

    #[test]
    fn the_response_of_a_first_order_lag_is_known() {
        let one = dmatrix![1.0];
        let lag = System::new(&dmatrix![-2.0], &one, &one, &dmatrix![0.5]);
        let gain = lag.gains(1.5).unwrap();
        let expected = (Complex::new(0.5, 0.0) + Complex::new(2.0, 1.5).inv()).norm();
        assert!((gain.0 - expected).abs() < 1e-15 && (gain.1 - expected).abs() < 1e-15);
        assert_eq!(lag.gains(f64::INFINITY), Some((0.5, 0.5)));
    }

    #[test]
    fn the_bilinear_map_keeps_the_gain_at_corresponding_frequencies() {
        let discrete = System::new(
            &dmatrix![0.7, 0.2; -0.1, 0.5],
            &dmatrix![1.0; 0.3],
            &dmatrix![0.4, -1.0],
            &dmatrix![0.1],
        );
        let continuous = discrete.bilinear().unwrap();
        let angle = 0.8_f64;
        let at_circle = discrete.response(Complex::from_polar(1.0, angle)).unwrap();
        let expected = SingularDecomposition::new(&at_circle).largest();
        assert!((continuous.gains((angle / 2.0).tan()).unwrap().1 - expected).abs() < 1e-13);
    }
}
