//! The set of one filter: ⟨p, H⟩ ⊕ span(U) (method sheet 2 and 4.1).

use crate::matrix::{Matrix, all_finite, row_sums};
use serde::{Deserialize, Serialize};

/// What one filter knows of the state. Everything that changes from step to step is here.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub(crate) struct SetState {
    /// p, length nx.
    pub centre: Vec<f64>,
    /// H, nx x r.
    pub generators: Matrix,
    /// R(H), kept up to date by [`SetState::update_radius`].
    pub radius: Vec<f64>,
    /// U, nx x nU: directions in which the set is unbounded; no column unless samples were lost.
    pub unbounded: Matrix,
    /// P of the Kalman-type baseline, nx x nx; zero in the other forms.
    pub covariance: Matrix,
    /// Whether the set is lost; then nothing is tested until a reset.
    pub void: bool,
}

impl SetState {
    /// A void set with room for `columns` generators of `nx` states.
    pub fn new(nx: usize, columns: usize) -> Self {
        Self {
            centre: vec![0.0; nx],
            generators: Matrix::with_capacity(nx, columns),
            radius: vec![0.0; nx],
            unbounded: Matrix::with_capacity(nx, nx),
            covariance: Matrix::zeros(nx, nx),
            void: true,
        }
    }

    /// Whether this set has the room of another.
    pub fn fits(&self, other: &Self) -> bool {
        self.centre.len() == other.centre.len()
            && self.radius.len() == other.radius.len()
            && self.generators.rows() == other.generators.rows()
            && self.generators.has_room_of(&other.generators)
            && self.unbounded.rows() == other.unbounded.rows()
            && self.unbounded.has_room_of(&other.unbounded)
            && self.covariance.shape() == other.covariance.shape()
            && self.covariance.has_room_of(&other.covariance)
    }

    /// Takes the box with this centre and radius.
    pub fn set_box(&mut self, centre: &[f64], radius: &[f64]) {
        let nx = self.centre.len();
        self.centre.copy_from_slice(centre);
        self.generators.reshape(nx, 0);
        self.generators.append_diagonal(radius);
        self.unbounded.reshape(nx, 0);
        self.void = false;
        self.update_radius();
    }

    /// Takes the set of another filter.
    pub fn copy_from(&mut self, other: &Self) {
        self.centre.copy_from_slice(&other.centre);
        self.generators.copy_from(&other.generators);
        self.radius.copy_from_slice(&other.radius);
        self.unbounded.copy_from(&other.unbounded);
        self.void = other.void;
    }

    /// Recomputes R(H); a set with a non-finite centre or radius becomes void.
    pub fn update_radius(&mut self) {
        row_sums(&self.generators, &mut self.radius);
        if !(all_finite(&self.centre) && all_finite(&self.radius)) {
            self.set_void();
        }
    }

    /// Loses the set.
    pub fn set_void(&mut self) {
        let nx = self.centre.len();
        self.centre.fill(0.0);
        self.generators.reshape(nx, 0);
        self.radius.fill(0.0);
        self.unbounded.reshape(nx, 0);
        self.void = true;
    }

    /// Whether the set is usable and bounded.
    pub fn is_bounded(&self) -> bool {
        !self.void && self.unbounded.columns() == 0
    }

    /// Radius of coordinate `i`, infinite where the set is unbounded.
    pub fn extent(&self, i: usize) -> f64 {
        let free = self.void || self.unbounded.row(i).iter().any(|value| *value != 0.0);
        if free { f64::INFINITY } else { self.radius[i] }
    }
}
