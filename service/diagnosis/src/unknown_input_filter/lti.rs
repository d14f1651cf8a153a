//! Thresholds of time-invariant plants without uncertainty, and the memoryless form (method sheet 3.5).
//!
//! With A⁺ = 0 and a fixed gain L the half width of a test row w depends on the number of steps alone:
//! h_w(k) = |w|v + |w C D|w + Σ_{i=0}^{k-2} R(w C A0 Φ^i Γ) + R(w C A0 Φ^{k-1} H_0), with Φ = (I - LC) A0 and
//! Γ = \[(I - LC) D diag(w), L V\]. The set behind it is never reduced, so that no filter with this gain is tighter.
//! When L is a left inverse of C, Φ = 0 and the filter needs one measurement back, even with uncertainty.
//!
//! | symbol | shape | argument |
//! |---|---|---|
//! | L | nx x ny | `gain` |
//! | W | nw x ny | `rows` |
//! | H_0 | nx x nx, diagonal | `initial_radius` |

use crate::model::LinearModel;
use nalgebra::{DMatrix, DVector};

/// Terms of the sums below this share of them are left to the bound of the rest.
const NEGLIGIBLE: f64 = 1e-14;
/// Largest power of Φ that is looked at for a contraction.
const MAX_POWER: usize = 1_000_000;

/// Exact half widths of the rows of W at the steps 1, 2, ..., `steps` after a start in the box of
/// `initial_radius`: entry (k - 1, row). The uncertainty A⁺ of the model is left aside.
pub fn half_widths(
    model: &LinearModel,
    gain: &DMatrix<f64>,
    rows: &DMatrix<f64>,
    initial_radius: &DVector<f64>,
    steps: usize,
) -> DMatrix<f64> {
    let parts = Parts::new(model, gain, rows);
    let mut out = DMatrix::zeros(steps, rows.nrows());
    let mut directions = parts.first.clone();
    let mut sum = parts.constant.clone();
    for k in 0..steps {
        let start = directions.abs() * initial_radius;
        out.row_mut(k).copy_from(&(&sum + start).transpose());
        sum += row_sums(&(&directions * &parts.generators));
        directions *= &parts.transition;
    }
    out
}

/// An upper bound of the half widths after any number of steps without regard to the start, exact to 1e-14;
/// `None` if no power of Φ is a contraction.
pub fn steady_half_widths(
    model: &LinearModel,
    gain: &DMatrix<f64>,
    rows: &DMatrix<f64>,
) -> Option<DVector<f64>> {
    let parts = Parts::new(model, gain, rows);
    let (mut directions, mut sum) = (parts.first.clone(), parts.constant.clone());
    let mut power = parts.generators.clone();
    let mut contraction = parts.transition.clone();
    let mut block = 1;
    while infinity_norm(&contraction) >= 1.0 {
        contraction *= &parts.transition;
        block += 1;
        if block > MAX_POWER || !contraction.iter().all(|value| value.is_finite()) {
            return None;
        }
    }
    for _ in 0..MAX_POWER {
        let term = row_sums(&(&directions * &parts.generators));
        if term.iter().zip(&sum).all(|(term, sum)| *term <= NEGLIGIBLE * sum) {
            break;
        }
        sum += term;
        directions *= &parts.transition;
        power = &parts.transition * power;
    }
    let mut rest = 0.0;
    for _ in 0..block {
        rest += infinity_norm(&power);
        power = &parts.transition * power;
    }
    rest /= 1.0 - infinity_norm(&contraction);
    Some(sum + row_sums(&parts.first) * rest)
}

/// The quantities that both sums share.
struct Parts {
    /// W C A0.
    first: DMatrix<f64>,
    /// Φ.
    transition: DMatrix<f64>,
    /// Γ.
    generators: DMatrix<f64>,
    /// |W|v + |W C D|w.
    constant: DVector<f64>,
}

impl Parts {
    fn new(model: &LinearModel, gain: &DMatrix<f64>, rows: &DMatrix<f64>) -> Self {
        let nx = model.state_count();
        let correction = DMatrix::identity(nx, nx) - gain * model.c();
        let disturbance = &correction * model.d() * DMatrix::from_diagonal(model.w());
        let noise = gain * DMatrix::from_diagonal(model.v());
        let mut generators = DMatrix::zeros(nx, disturbance.ncols() + noise.ncols());
        generators
            .columns_mut(0, disturbance.ncols())
            .copy_from(&disturbance);
        generators
            .columns_mut(disturbance.ncols(), noise.ncols())
            .copy_from(&noise);
        Self {
            first: rows * model.c() * model.a0(),
            transition: correction * model.a0(),
            generators,
            constant: rows.abs() * model.v() + (rows * model.c() * model.d()).abs() * model.w(),
        }
    }
}

/// The filter with L = C⁺ and Φ = 0: residual and half width from two measurements and the command between them.
#[derive(Clone, Debug)]
pub struct MemorylessFilter {
    model: LinearModel,
    strip: DMatrix<f64>,
    rows: DMatrix<f64>,
    constant: DVector<f64>,
}

impl MemorylessFilter {
    /// For the test rows W; `None` if one measurement does not determine the state.
    pub fn new(model: &LinearModel, rows: DMatrix<f64>) -> Option<Self> {
        let strip = model.strip_gain()?;
        let noise = &strip * DMatrix::from_diagonal(model.v());
        let constant = row_sums(&(&rows * model.c() * model.a0() * noise))
            + (&rows * model.c() * model.d()).abs() * model.w()
            + rows.abs() * model.v();
        Some(Self {
            model: model.clone(),
            strip,
            rows,
            constant,
        })
    }

    /// r = W(y - C(A0p + Bu)) and h, with p = C⁺ `previous`; `command` was held between the two measurements.
    pub fn test(
        &self,
        previous: &DVector<f64>,
        command: &DVector<f64>,
        y: &DVector<f64>,
    ) -> (DVector<f64>, DVector<f64>) {
        let model = &self.model;
        let state = &self.strip * previous;
        let predicted = model.c() * (model.a0() * &state + model.b() * command);
        let size = state.abs() + self.strip.abs() * model.v();
        let uncertainty = (&self.rows * model.c()).abs() * (model.a_plus() * size);
        (&self.rows * (y - predicted), &self.constant + uncertainty)
    }
}

fn row_sums(matrix: &DMatrix<f64>) -> DVector<f64> {
    DVector::from_iterator(
        matrix.nrows(),
        matrix
            .row_iter()
            .map(|row| row.iter().map(|value| value.abs()).sum()),
    )
}

/// Largest row sum of absolute values.
fn infinity_norm(matrix: &DMatrix<f64>) -> f64 {
    row_sums(matrix).max()
}
