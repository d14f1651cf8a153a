//! The two observers and their error system (method sheet 2).
//!
//! z = T x', z1 = y - v, z2 = K x1 + x2:
//! ẑ1⁺ = A1 ẑ1 + A12 ẑ2 + B1 u + N (y - ẑ1), ẑ2⁺ = F ẑ2 + J y + E_z u.
//! Without a fault the errors follow z̃⁺ = A_e z̃ + D_e η - \[N; J\] v, and y - ẑ1 = z̃1 + v.

use super::plant::{Plant, beside, stack};
use nalgebra::DMatrix;

/// Which columns of the plant an observer keeps out of z2.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Decoupled {
    /// All disturbances.
    pub disturbances: bool,
    /// The fault of this actuator.
    pub actuator: Option<usize>,
}

/// The matrices of one pair of observers.
#[derive(Clone, Debug, PartialEq)]
pub struct Observer {
    /// K, nz x p.
    pub k: DMatrix<f64>,
    /// M, p x p.
    pub m: DMatrix<f64>,
    /// F = A22 + K A12, nz x nz.
    pub f: DMatrix<f64>,
    /// J = A21 - A22 K + K (A11 - A12 K), nz x p.
    pub j: DMatrix<f64>,
    /// A1 = A11 - A12 K, p x p.
    pub a1: DMatrix<f64>,
    /// A12, p x nz.
    pub a12: DMatrix<f64>,
    /// N = A1 - M, p x p.
    pub n: DMatrix<f64>,
    /// \[B1; E_z\], n x m: the response of z to u and f.
    pub input: DMatrix<f64>,
    /// A_e = \[\[M, A12\], \[0, F\]\], n x n.
    pub a_e: DMatrix<f64>,
    /// D_e = \[D1; D2 + K D1\], n x q.
    pub d_e: DMatrix<f64>,
    /// What does not reach z2.
    pub decoupled: Decoupled,
}

impl Observer {
    /// The observers with gains K and M. What is decoupled becomes exactly zero in the lower block.
    pub fn new(plant: &Plant, k: DMatrix<f64>, m: DMatrix<f64>, decoupled: Decoupled) -> Self {
        let (p, nz) = (plant.outputs(), plant.hidden());
        let [a11, a12, a21, a22] = plant.blocks();
        let a1 = &a11 - &a12 * &k;
        let f = &a22 + &k * &a12;
        let lower = |columns: &DMatrix<f64>| {
            let (upper, lower) = (columns.rows(0, p).into_owned(), columns.rows(p, nz).into_owned());
            stack(&upper, &(lower + &k * &upper))
        };
        let mut input = lower(&plant.b);
        if let Some(actuator) = decoupled.actuator {
            input.view_mut((p, actuator), (nz, 1)).fill(0.0);
        }
        let mut d_e = lower(&plant.d);
        if decoupled.disturbances {
            d_e.rows_mut(p, nz).fill(0.0);
        }
        Self {
            j: a21 - &a22 * &k + &k * &a1,
            n: &a1 - &m,
            a_e: stack(&beside(&m, &a12), &beside(&DMatrix::zeros(nz, p), &f)),
            k,
            m,
            f,
            a1,
            a12,
            input,
            d_e,
            decoupled,
        }
    }

    /// \[N; J\], n x p: how the noise enters the errors, with a minus.
    pub fn noise_input(&self) -> DMatrix<f64> {
        stack(&self.n, &self.j)
    }
}
