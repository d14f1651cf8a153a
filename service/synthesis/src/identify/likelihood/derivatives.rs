//! Gradient of ℓ and information matrix, with central differences of e_k and S_k: the filters of all displaced
//! parameters run side by side.

use super::Likelihood;
use super::filter::Filter;
use crate::identify::run_data::Piece;
use nalgebra::{DMatrix, DVector};

/// ℓ, its gradient g and the information M at one θ.
#[derive(Clone, Debug)]
pub(in crate::identify) struct Derivatives {
    pub value: f64,
    pub gradient: DVector<f64>,
    pub information: DMatrix<f64>,
}

/// The covariance's part at one instant: S⁻¹ ∂_i S for every i, ½ tr of these, and ½ tr of their products.
struct CovariancePart {
    relative: Vec<DMatrix<f64>>,
    half_trace: DVector<f64>,
    information: DMatrix<f64>,
}

impl Likelihood<'_> {
    /// The derivatives at θ with these displacements; `None` where a displaced θ makes no model or a filter fails.
    pub(in crate::identify) fn derivatives<'p>(
        &self,
        theta: &[f64],
        displacements: &[f64],
        pieces: impl Iterator<Item = &'p Piece>,
    ) -> Option<Derivatives> {
        let count = theta.len();
        let displaced = |i: usize, sign: f64| {
            let mut theta = theta.to_vec();
            theta[i] += sign * displacements[i];
            self.filter(&theta)
        };
        let mut base = self.filter(theta)?;
        let mut above: Vec<Filter> = (0..count).map(|i| displaced(i, 1.0)).collect::<Option<_>>()?;
        let mut below: Vec<Filter> = (0..count).map(|i| displaced(i, -1.0)).collect::<Option<_>>()?;
        let mut found = Derivatives {
            value: 0.0,
            gradient: DVector::zeros(count),
            information: DMatrix::zeros(count, count),
        };
        for piece in pieces {
            let mut cached: Option<CovariancePart> = None;
            base.restart();
            above
                .iter_mut()
                .chain(&mut below)
                .for_each(|filter| filter.restart());
            for k in 0..piece.transitions() {
                let centre = base.step(piece, k)?;
                let rows = centre.e.len();
                let mut errors = DMatrix::zeros(rows, count);
                let mut slopes = Vec::with_capacity(count);
                for i in 0..count {
                    let (up, down) = (above[i].step(piece, k)?, below[i].step(piece, k)?);
                    let width = 2.0 * displacements[i];
                    errors.set_column(i, &((up.e - down.e) / width));
                    if cached.is_none() {
                        slopes.push((up.covariance - down.covariance) / width);
                    }
                }
                let weighted = centre.factor.solve(&centre.e);
                let part = cached
                    .take()
                    .unwrap_or_else(|| covariance_part(&slopes, |slope| centre.factor.solve(slope)));
                found.value += centre.cost();
                found.gradient += errors.tr_mul(&weighted) + &part.half_trace;
                for (i, relative) in part.relative.iter().enumerate() {
                    found.gradient[i] -= 0.5 * centre.e.dot(&(relative * &weighted));
                }
                found.information += errors.tr_mul(&centre.factor.solve(&errors)) + &part.information;
                let all_steady = base.is_steady() && above.iter().chain(&below).all(Filter::is_steady);
                let same_rows = k + 1 < piece.transitions()
                    && (0..piece.measurements.nrows()).all(|i| {
                        let received = |k: usize| piece.measurements[(i, k)].is_finite();
                        received(k) == received(k + 1)
                    });
                cached = (all_steady && same_rows).then_some(part);
            }
        }
        let finite = found.gradient.iter().chain(&found.information);
        (found.value.is_finite() && finite.into_iter().all(|value| value.is_finite())).then_some(found)
    }
}

fn covariance_part(slopes: &[DMatrix<f64>], solve: impl Fn(&DMatrix<f64>) -> DMatrix<f64>) -> CovariancePart {
    let relative: Vec<DMatrix<f64>> = slopes.iter().map(solve).collect();
    let count = relative.len();
    CovariancePart {
        half_trace: DVector::from_fn(count, |i, _| 0.5 * relative[i].trace()),
        // tr(X Y) = Σ X_ab Y_ba
        information: DMatrix::from_fn(count, count, |i, j| {
            0.5 * relative[i].dot(&relative[j].transpose())
        }),
        relative,
    }
}
