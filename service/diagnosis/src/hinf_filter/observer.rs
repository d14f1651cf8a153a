//! The observer: from samples to the residual r = y - C x̂ - D u (method sheet 4.1).

use super::{
    plant::{Plant, SampledPlant},
    realisation::{FirstOrderFilter, ZeroOrderFilter},
};
use crate::matrix::{Matrix, dot};
use nalgebra::DMatrix;
use serde::{Deserialize, Serialize};

/// How a sample corrects the prediction.
#[derive(Clone, Debug)]
pub(super) enum Correction {
    /// x̂⁺ = Ad x̂ + Bud u + L r.
    Residual { l: Matrix },
    /// x̂⁺ = Φ x̂ + Gu u + Gy y.
    Held { phi: Matrix, gu: Matrix, gy: Matrix },
    /// x̂⁺ = Φ x̂ + Gu u + G0 y + G1 y⁺.
    Interpolated {
        phi: Matrix,
        gu: Matrix,
        g0: Matrix,
        g1: Matrix,
    },
}

impl Correction {
    pub fn residual(gain: &DMatrix<f64>) -> Self {
        Self::Residual {
            l: Matrix::from(gain),
        }
    }

    pub fn held(filter: &ZeroOrderFilter) -> Self {
        Self::Held {
            phi: Matrix::from(&filter.phi),
            gu: Matrix::from(&filter.gu),
            gy: Matrix::from(&filter.gy),
        }
    }

    pub fn interpolated(filter: &FirstOrderFilter) -> Self {
        Self::Interpolated {
            phi: Matrix::from(&filter.phi),
            gu: Matrix::from(&filter.gu),
            g0: Matrix::from(&filter.g0),
            g1: Matrix::from(&filter.g1),
        }
    }
}

/// Constant matrices of the observer.
#[derive(Clone, Debug)]
pub(super) struct Observer {
    pub ad: Matrix,
    pub bud: Matrix,
    pub c: Matrix,
    pub d: Matrix,
    pub correction: Correction,
    next: Vec<f64>,
}

/// What it remembers.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(super) struct ObserverState {
    /// x̂, prediction for the present instant.
    pub x: Vec<f64>,
    /// Φ x̂ + Gu u + G0 y of the interpolating form, without the part of the next sample.
    pub interpolated: Vec<f64>,
    /// Whether the last sample was received, so that `interpolated` is of use.
    pub has_interpolated: bool,
}

impl ObserverState {
    pub fn new(n: usize) -> Self {
        Self {
            x: vec![0.0; n],
            interpolated: vec![0.0; n],
            has_interpolated: false,
        }
    }

    pub fn start(&mut self, x: &[f64]) {
        self.x.copy_from_slice(x);
        self.interpolated.fill(0.0);
        self.has_interpolated = false;
    }

    pub fn fits(&self, other: &Self) -> bool {
        self.x.len() == other.x.len() && self.interpolated.len() == other.interpolated.len()
    }
}

/// `out` = Σ of matrix times vector.
fn sum_of_products(out: &mut [f64], terms: &[(&Matrix, &[f64])]) {
    for (i, value) in out.iter_mut().enumerate() {
        *value = terms.iter().map(|(matrix, x)| dot(matrix.row(i), x)).sum();
    }
}

impl Observer {
    pub fn new(plant: &Plant, sampled: &SampledPlant, correction: Correction) -> Self {
        Self {
            ad: Matrix::from(&sampled.ad),
            bud: Matrix::from(&sampled.bud),
            c: Matrix::from(&plant.c),
            d: Matrix::from(&plant.d),
            correction,
            next: vec![0.0; plant.a.nrows()],
        }
    }

    /// Takes the sample of this instant into x̂ where the form uses it at once.
    pub fn begin(&self, state: &mut ObserverState, y: Option<&[f64]>) {
        if let (Correction::Interpolated { g1, .. }, Some(y), true) =
            (&self.correction, y, state.has_interpolated)
        {
            for (i, x) in state.x.iter_mut().enumerate() {
                *x = state.interpolated[i] + dot(g1.row(i), y);
            }
        }
    }

    /// r = y - C x̂ - D u.
    pub fn residual(&self, state: &ObserverState, y: &[f64], u: &[f64], r: &mut [f64]) {
        for (i, r) in r.iter_mut().enumerate() {
            *r = y[i] - dot(self.c.row(i), &state.x) - dot(self.d.row(i), u);
        }
    }

    /// x̂ for the next instant; `sample` is (y, r) if the sample was received.
    pub fn advance(&mut self, state: &mut ObserverState, sample: Option<(&[f64], &[f64])>, u: &[f64]) {
        let (open, next) = ([(&self.ad, &state.x[..]), (&self.bud, u)], &mut self.next);
        match (&self.correction, sample) {
            (Correction::Residual { l }, Some((_, r))) => {
                sum_of_products(next, &[open[0], open[1], (l, r)]);
            }
            (Correction::Held { phi, gu, gy }, Some((y, _))) => {
                sum_of_products(next, &[(phi, &state.x), (gu, u), (gy, y)]);
            }
            (Correction::Interpolated { phi, gu, g0, .. }, Some((y, _))) => {
                sum_of_products(&mut state.interpolated, &[(phi, &state.x), (gu, u), (g0, y)]);
                sum_of_products(next, &open);
            }
            (_, None) => sum_of_products(next, &open),
        }
        state.has_interpolated = sample.is_some();
        state.x.copy_from_slice(next);
    }
}
