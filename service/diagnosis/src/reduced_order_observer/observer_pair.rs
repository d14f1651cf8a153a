//! The two observers in operation (method sheet 4, step 6).

use super::{inputs::Inputs, observer::Observer};
use crate::matrix::{Matrix, dot};

/// ẑ1 ← A1 ẑ1 + A12 ẑ2 + B1 u + N S e, ẑ2 ← F ẑ2 + J y_v + E_z u, where y_v is y, or ẑ1 where y is missing.
#[derive(Clone, Debug)]
pub(super) struct ObserverPair {
    pub a1: Matrix,
    a12: Matrix,
    pub n: Matrix,
    f: Matrix,
    pub j: Matrix,
    /// \[B1; E_z\].
    pub input: Matrix,
}

/// Buffers of one step.
#[derive(Clone, Debug)]
pub(super) struct PairRoom {
    error: Vec<f64>,
    known: Vec<f64>,
    z1: Vec<f64>,
    z2: Vec<f64>,
}

impl PairRoom {
    pub fn new(states: usize, outputs: usize) -> Self {
        Self {
            error: vec![0.0; outputs],
            known: vec![0.0; outputs],
            z1: vec![0.0; outputs],
            z2: vec![0.0; states - outputs],
        }
    }
}

impl ObserverPair {
    pub fn new(observer: &Observer) -> Self {
        Self {
            a1: Matrix::from(&observer.a1),
            a12: Matrix::from(&observer.a12),
            n: Matrix::from(&observer.n),
            f: Matrix::from(&observer.f),
            j: Matrix::from(&observer.j),
            input: Matrix::from(&observer.input),
        }
    }

    /// To the next instant.
    pub fn advance(&self, z1: &mut [f64], z2: &mut [f64], inputs: &Inputs, room: &mut PairRoom) {
        let samples = inputs.y.iter().zip(&inputs.valid).zip(z1.iter());
        for ((error, known), ((y, valid), z1)) in room.error.iter_mut().zip(&mut room.known).zip(samples) {
            *error = if *valid { y - z1 } else { 0.0 };
            *known = if *valid { *y } else { *z1 };
        }
        for (i, next) in room.z1.iter_mut().enumerate() {
            let model = dot(self.a1.row(i), z1) + dot(self.a12.row(i), z2);
            *next = model + dot(self.input.row(i), &inputs.u) + dot(self.n.row(i), &room.error);
        }
        let p = z1.len();
        for (i, next) in room.z2.iter_mut().enumerate() {
            let model = dot(self.f.row(i), z2) + dot(self.j.row(i), &room.known);
            *next = model + dot(self.input.row(p + i), &inputs.u);
        }
        z1.copy_from_slice(&room.z1);
        z2.copy_from_slice(&room.z2);
    }
}
