//! The matrices of the inequalities, as affine functions of the variables.

use super::{ErrorPlant, Time};
use crate::semidefinite::{hermitian, symmetric_blocks};
use nalgebra::DMatrix;

/// Φ = X A - W C.
fn phi(plant: &ErrorPlant<'_>, x: &DMatrix<f64>, w: &DMatrix<f64>) -> DMatrix<f64> {
    x * plant.a - w * plant.c
}

/// Bounded-real inequality of an error with X (A - LC) = Φ and X (Bd - L Dd) = Ψ, for the norm `level` / s and the
/// certificate X / s:
///
/// - continuous: \[\[He Φ, Ψ, s C'\], \[·, -level I, s Dd'\], \[·, ·, -level I\]\] ⪯ 0,
/// - discrete: \[\[X, Φ, Ψ, 0\], \[·, X, 0, s C'\], \[·, ·, level I, s Dd'\], \[·, ·, ·, level I\]\] ⪰ 0.
pub fn bounded_real(
    time: Time,
    x: &DMatrix<f64>,
    (phi, psi): (DMatrix<f64>, DMatrix<f64>),
    (c, dd): (&DMatrix<f64>, &DMatrix<f64>),
    s: f64,
    level: f64,
) -> DMatrix<f64> {
    let ((n, m), q) = (psi.shape(), c.nrows());
    let levels = |order: usize, level: f64| DMatrix::<f64>::identity(order, order) * level;
    let (c, dd) = (c.transpose() * s, dd.transpose() * s);
    match time {
        Time::Continuous => symmetric_blocks(&[
            vec![hermitian(&phi), psi, c],
            vec![levels(m, -level), dd],
            vec![levels(q, -level)],
        ]),
        Time::Discrete => symmetric_blocks(&[
            vec![x.clone(), phi, psi, DMatrix::zeros(n, q)],
            vec![x.clone(), DMatrix::zeros(n, m), c],
            vec![levels(m, level), dd],
            vec![levels(q, level)],
        ]),
    }
}

/// [`bounded_real`] with the variables X and W = X L.
pub fn bounded_real_of_gain(
    time: Time,
    plant: &ErrorPlant<'_>,
    x: &DMatrix<f64>,
    w: &DMatrix<f64>,
    s: f64,
    level: f64,
) -> DMatrix<f64> {
    let psi = x * plant.bd - w * plant.dd;
    bounded_real(time, x, (phi(plant, x, w), psi), (plant.c, plant.dd), s, level)
}

/// Re λ < -α: He Φ + 2αX ⪯ 0.
pub fn decay(plant: &ErrorPlant<'_>, x: &DMatrix<f64>, w: &DMatrix<f64>, alpha: f64) -> DMatrix<f64> {
    hermitian(&phi(plant, x, w)) + x * (2.0 * alpha)
}

/// |λ| < ρ: \[\[-ρX, Φ\], \[Φ', -ρX\]\] ⪯ 0, the same in both time domains.
pub fn radius(plant: &ErrorPlant<'_>, x: &DMatrix<f64>, w: &DMatrix<f64>, rho: f64) -> DMatrix<f64> {
    symmetric_blocks(&[vec![x * -rho, phi(plant, x, w)], vec![x * -rho]])
}

/// Variables of the paper's conditions (13), (14).
#[derive(Clone, Debug, PartialEq)]
pub struct PaperVariables {
    /// R, n x n, symmetric.
    pub r: DMatrix<f64>,
    /// X, n x n, symmetric.
    pub x: DMatrix<f64>,
    /// Z, n x q.
    pub z: DMatrix<f64>,
    /// Y, q x n.
    pub y: DMatrix<f64>,
    /// M, n x n.
    pub m: DMatrix<f64>,
    /// K, n x l.
    pub k: DMatrix<f64>,
    /// N, n x q.
    pub n: DMatrix<f64>,
    /// T, q x l.
    pub t: DMatrix<f64>,
}

/// The paper's condition (13), ⪯ 0, in block rows \[n, n, m, l, q\]; `levels` are those of the disturbance and fault
/// blocks (1 as printed, γ by Lemma 1) and of the residual (γ).
pub fn condition_13(
    plant: &ErrorPlant<'_>,
    (bf, df): (&DMatrix<f64>, &DMatrix<f64>),
    variables: &PaperVariables,
    (inputs, residual): (f64, f64),
) -> DMatrix<f64> {
    let (a, c) = (plant.a, plant.c.transpose());
    let PaperVariables {
        r,
        x,
        z,
        y,
        m,
        k,
        n,
        t,
    } = variables;
    let levels = |order: usize, level: f64| DMatrix::<f64>::identity(order, order) * -level;
    let (disturbances, faults, outputs) = (plant.bd.ncols(), bf.ncols(), plant.c.nrows());
    let ra_zc = r * a - z * plant.c;
    let xa_yc = a.tr_mul(x) - &c * y;
    symmetric_blocks(&[
        vec![
            hermitian(&ra_zc),
            &ra_zc + &xa_yc + m,
            r * plant.bd - z * plant.dd,
            r * bf - z * df,
            &c - n,
        ],
        vec![
            hermitian(&xa_yc),
            x * plant.bd - y.tr_mul(plant.dd),
            x * bf - y.tr_mul(df) + k,
            c,
        ],
        vec![
            levels(disturbances, inputs),
            DMatrix::zeros(disturbances, faults),
            plant.dd.transpose(),
        ],
        vec![levels(faults, inputs), df.transpose() - t.transpose()],
        vec![levels(outputs, residual)],
    ])
}
