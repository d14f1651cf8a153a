//! The plant in continuous time, and its sampled form.

use crate::discretise::matrix_exponential;
use nalgebra::{DMatrix, DVector};

/// Points of the Gauss-Legendre rule on \[-1, 1\] (positive half) and their weights.
const GAUSS: [(f64, f64); 4] = [
    (0.183_434_642_495_649_8, 0.362_683_783_378_362),
    (0.525_532_409_916_329, 0.313_706_645_877_887_3),
    (0.796_666_477_413_626_7, 0.222_381_034_453_374_47),
    (0.960_289_856_497_536_2, 0.101_228_536_290_376_26),
];

/// x' = A x + B u + Bd d + Bf f, y = C x + D u + Dd d + Df f (paper equation (1)).
#[derive(Clone, Debug, PartialEq)]
pub struct Plant {
    /// A, n x n, 1/s.
    pub a: DMatrix<f64>,
    /// B, n x p.
    pub b: DMatrix<f64>,
    /// C, q x n.
    pub c: DMatrix<f64>,
    /// D, q x p.
    pub d: DMatrix<f64>,
    /// Bd, n x m.
    pub bd: DMatrix<f64>,
    /// Dd, q x m.
    pub dd: DMatrix<f64>,
    /// Bf, n x l.
    pub bf: DMatrix<f64>,
    /// Df, q x l.
    pub df: DMatrix<f64>,
}

/// Exact images of a plant under a zero-order hold of Ts seconds; C, D, Dd and Df stay.
#[derive(Clone, Debug, PartialEq)]
pub struct SampledPlant {
    /// Ts, s.
    pub sample_time_s: f64,
    /// Ad, n x n.
    pub ad: DMatrix<f64>,
    /// Bud, n x p.
    pub bud: DMatrix<f64>,
    /// Bdd, n x m.
    pub bdd: DMatrix<f64>,
    /// Bfd, n x l.
    pub bfd: DMatrix<f64>,
}

impl Plant {
    /// Numbers of states, commands, outputs, disturbances and faults: n, p, q, m, l.
    pub fn dimensions(&self) -> (usize, usize, usize, usize, usize) {
        (
            self.a.nrows(),
            self.b.ncols(),
            self.c.nrows(),
            self.bd.ncols(),
            self.bf.ncols(),
        )
    }

    /// The sampled plant: one exponential of \[A, B Bd Bf; 0, 0\] Ts.
    pub fn sample(&self, sample_time_s: f64) -> SampledPlant {
        let (_, p, _, m, l) = self.dimensions();
        let inputs = beside(&[&self.b, &self.bd, &self.bf]);
        let (ad, held) = zoh(&self.a, &inputs, sample_time_s);
        SampledPlant {
            sample_time_s,
            ad,
            bud: held.columns(0, p).into_owned(),
            bdd: held.columns(p, m).into_owned(),
            bfd: held.columns(p + m, l).into_owned(),
        }
    }

    /// ∫₀^Ts e^{Aτ} dτ H: the discrete gain of a continuous one.
    pub fn averaged_gain(&self, gain: &DMatrix<f64>, sample_time_s: f64) -> DMatrix<f64> {
        zoh(&self.a, gain, sample_time_s).1
    }
}

/// Exact zero-order-hold images (e^{A Ts}, ∫₀^Ts e^{Aτ} dτ B) over `sample_time_s` seconds.
pub fn zoh(a: &DMatrix<f64>, b: &DMatrix<f64>, sample_time_s: f64) -> (DMatrix<f64>, DMatrix<f64>) {
    let (n, m) = (a.nrows(), b.ncols());
    let mut augmented = DMatrix::zeros(n + m, n + m);
    augmented.view_mut((0, 0), (n, n)).copy_from(a);
    augmented.view_mut((0, n), (n, m)).copy_from(b);
    let exponential = matrix_exponential(&(augmented * sample_time_s));
    (
        exponential.view((0, 0), (n, n)).into_owned(),
        exponential.view((0, n), (n, m)).into_owned(),
    )
}

/// w̃ = ∫₀^Ts |e^{A(Ts-τ)} B| τ dτ · `slew`: what an input that changes by at most `slew` per second adds to the state
/// within a period, beyond its value at the beginning (method sheet 3.7).
pub fn slew_bound(
    a: &DMatrix<f64>,
    b: &DMatrix<f64>,
    slew: &DVector<f64>,
    sample_time_s: f64,
) -> DVector<f64> {
    let mut integral = DMatrix::zeros(b.nrows(), b.ncols());
    for (point, weight) in GAUSS {
        for place in [-point, point] {
            let time = sample_time_s * (1.0 + place) / 2.0;
            let response = matrix_exponential(&(a * (sample_time_s - time))) * b;
            integral += response.abs() * (weight * time * sample_time_s / 2.0);
        }
    }
    integral * slew
}

/// Matrices of one height side by side.
pub(super) fn beside(matrices: &[&DMatrix<f64>]) -> DMatrix<f64> {
    let rows = matrices.first().map_or(0, |matrix| matrix.nrows());
    let columns = matrices.iter().map(|matrix| matrix.ncols()).sum();
    let mut out = DMatrix::zeros(rows, columns);
    let mut next = 0;
    for matrix in matrices {
        out.columns_mut(next, matrix.ncols()).copy_from(matrix);
        next += matrix.ncols();
    }
    out
}

/// Matrices of one width on top of each other.
pub(super) fn stacked(matrices: &[&DMatrix<f64>]) -> DMatrix<f64> {
    let transposed: Vec<_> = matrices.iter().map(|matrix| matrix.transpose()).collect();
    beside(&transposed.iter().collect::<Vec<_>>()).transpose()
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::{dmatrix, dvector};

    #[test]
    fn the_slew_bound_of_an_integrator_is_half_the_square_of_the_period() {
        let bound = slew_bound(&dmatrix![0.0], &dmatrix![-3.0], &dvector![2.0], 0.5);
        assert!((bound[0] - 3.0 * 2.0 * 0.125).abs() < 1e-15);
    }

    #[test]
    fn the_slew_bound_of_a_lag_is_its_integral() {
        let (a, t) = (-4.0_f64, 0.1);
        let exact = (t - (1.0 - (a * t).exp()) / -a) / -a;
        let bound = slew_bound(&dmatrix![a], &dmatrix![1.0], &dvector![1.0], t);
        assert!((bound[0] - exact).abs() < 1e-15);
    }
}
