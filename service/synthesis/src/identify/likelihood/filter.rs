//! The Kalman predictor: innovations and their covariances of one parameter vector.
//!
//! e_k = y_k - C x_k - D u_k, S_k = C P_k C' + R, K_k = P_k C' S_k⁻¹, x_{k+1} = A (x_k + K_k e_k) + B u_k,
//! P_{k+1} = A (P_k - K_k S_k K_k') A' + G Q G'. Rows of y_k that were not received are left out of C, D and R.

use crate::identify::run_data::Piece;
use nalgebra::{Cholesky, DMatrix, DVector, Dyn};

/// Change of P in one step, relative to its diagonal, from which on it counts as constant.
const STEADY: f64 = 1e-13;

/// A discrete-time linear model.
#[derive(Clone, Debug, PartialEq)]
pub struct Plant {
    /// State matrix, nx x nx.
    pub a: DMatrix<f64>,
    /// Input matrix, nx x nu.
    pub b: DMatrix<f64>,
    /// Output matrix, ny x nx.
    pub c: DMatrix<f64>,
    /// What a command adds to the output of its own instant, ny x nu.
    pub feedthrough: DMatrix<f64>,
    /// Disturbance matrix G, nx x nd.
    pub disturbance: DMatrix<f64>,
}

impl Plant {
    pub(in crate::identify) fn is_finite(&self) -> bool {
        [&self.a, &self.b, &self.c, &self.feedthrough, &self.disturbance]
            .iter()
            .all(|matrix| matrix.iter().all(|entry| entry.is_finite()))
    }
}

/// What depends on P_k and the received rows only.
#[derive(Clone, Debug)]
struct Gain {
    received: Vec<usize>,
    covariance: DMatrix<f64>,
    factor: Cholesky<f64, Dyn>,
    log_determinant: f64,
    k: DMatrix<f64>,
}

/// e_k and S_k of the received rows.
pub(in crate::identify) struct Innovation<'f> {
    pub received: &'f [usize],
    pub e: DVector<f64>,
    pub covariance: &'f DMatrix<f64>,
    pub factor: &'f Cholesky<f64, Dyn>,
    log_determinant: f64,
}

impl Innovation<'_> {
    /// e' S⁻¹ e.
    pub(in crate::identify) fn square(&self) -> f64 {
        self.e.dot(&self.factor.solve(&self.e))
    }

    /// This instant's part of ℓ.
    pub(in crate::identify) fn cost(&self) -> f64 {
        let constant = self.e.len() as f64 * std::f64::consts::TAU.ln();
        0.5 * (self.square() + self.log_determinant + constant)
    }
}

/// The filter of one parameter vector.
pub(in crate::identify) struct Filter {
    plant: Plant,
    process: DMatrix<f64>,
    r: DMatrix<f64>,
    initial: (DVector<f64>, DMatrix<f64>),
    x: DVector<f64>,
    p: DMatrix<f64>,
    /// The last gain, and whether P stays what it is as long as the same rows are received.
    gain: Option<Gain>,
    steady: bool,
}

impl Filter {
    pub(in crate::identify) fn new(
        plant: Plant,
        q: &DMatrix<f64>,
        r: DMatrix<f64>,
        initial: (DVector<f64>, DMatrix<f64>),
    ) -> Self {
        let process = &plant.disturbance * q * plant.disturbance.transpose();
        Self {
            x: initial.0.clone(),
            p: initial.1.clone(),
            plant,
            process,
            r,
            initial,
            gain: None,
            steady: false,
        }
    }

    /// Back to the initial state.
    pub(in crate::identify) fn restart(&mut self) {
        self.x.copy_from(&self.initial.0);
        self.p.copy_from(&self.initial.1);
        (self.gain, self.steady) = (None, false);
    }

    /// Whether S_k is the one of the instant before.
    pub(in crate::identify) fn is_steady(&self) -> bool {
        self.steady
    }

    /// Takes y_k and u_k, goes on to k + 1; `None` if S_k is not positive definite or something overflows.
    pub(in crate::identify) fn step(&mut self, piece: &Piece, k: usize) -> Option<Innovation<'_>> {
        let (y, u) = (piece.measurements.column(k), piece.commands.column(k));
        let missing = |received: &[usize]| {
            let count = y.iter().filter(|value| value.is_finite()).count();
            count != received.len() || received.iter().any(|&i| !y[i].is_finite())
        };
        if self.gain.as_ref().is_none_or(|gain| missing(&gain.received)) {
            self.steady = false;
        }
        if !self.steady {
            let received = (0..y.len()).filter(|&i| y[i].is_finite()).collect();
            self.gain = Some(self.gain_for(received)?);
        }
        let gain = self.gain.as_ref()?;
        let predicted = &self.plant.c * &self.x + &self.plant.feedthrough * u;
        let rows = gain.received.iter().map(|&i| y[i] - predicted[i]);
        let e = DVector::from_iterator(gain.received.len(), rows);
        let corrected = &self.x + &gain.k * &e;
        self.x = &self.plant.a * corrected + &self.plant.b * u;
        if !self.steady {
            let updated = &self.p - &gain.k * &gain.covariance * gain.k.transpose();
            let next = &self.plant.a * updated * self.plant.a.transpose() + &self.process;
            let next = (&next + next.transpose()) * 0.5;
            let change = |i: usize, j: usize| (next[(i, j)] - self.p[(i, j)]).abs();
            let scale = |i: usize, j: usize| (next[(i, i)] * next[(j, j)]).sqrt();
            let n = next.nrows();
            self.steady = (0..n).all(|i| (0..n).all(|j| change(i, j) <= STEADY * scale(i, j)));
            self.p = next;
        }
        let finite = self.x.iter().chain(&self.p).all(|value| value.is_finite());
        finite.then_some(Innovation {
            received: &gain.received,
            e,
            covariance: &gain.covariance,
            factor: &gain.factor,
            log_determinant: gain.log_determinant,
        })
    }

    fn gain_for(&self, received: Vec<usize>) -> Option<Gain> {
        let c = self.plant.c.select_rows(&received);
        let r = DMatrix::from_fn(received.len(), received.len(), |i, j| {
            self.r[(received[i], received[j])]
        });
        let pc = &self.p * c.transpose();
        let covariance = &c * &pc + r;
        let covariance = (&covariance + covariance.transpose()) * 0.5;
        let factor = Cholesky::new(covariance.clone())?;
        let log_determinant = 2.0
            * factor
                .l_dirty()
                .diagonal()
                .iter()
                .map(|entry| entry.ln())
                .sum::<f64>();
        let k = factor.solve(&pc.transpose()).transpose();
        Some(Gain {
            received,
            covariance,
            factor,
            log_determinant,
            k,
        })
    }
}
