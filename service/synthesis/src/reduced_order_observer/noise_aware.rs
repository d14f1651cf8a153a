//! The noise-aware H2 inequality with slack variables (method sheet 3.4); M = 0.
//!
//! With x̃2 = z̃2 + K v and ξ = \[x̃2; v\]: ξ⁺ = \[\[F, -(A21 + K A11)\], \[0, 0\]\] ξ + \[K; I\] v⁺ and
//! e_y⁺ = \[A12, -A11\] ξ + (D1 η + v⁺). The trace of Z bounds the squared H2 norm from v to \[A12, -A11\] ξ.
//!
//! | symbol | shape | meaning |
//! |---|---|---|
//! | Vn | p x p | diag(vbar) / max(vbar) |
//! | Q, Z | ν x ν, p x p | Lyapunov matrix of ξ, ν = nz + p; bound of the output's covariance |
//! | G = \[\[G11, G12\], \[0, G22\]\] | ν x ν | slack |
//! | Y | nz x (p - q) | G11 times the free part of K |
//! | S_K = G11 K0 + Y V_s' | nz x p | G11 K |
//! | S_F = G11 Ab + Y c | nz x nz | G11 F |
//! | Qr | nz x nz | Lyapunov matrix of F for the bound ρ |

use crate::semidefinite::{SemidefiniteProgram, hermitian, symmetric_blocks};
use nalgebra::DMatrix;
use residual_diagnosis::{
    gains::SolverRun,
    reduced_order_observer::{
        decoupling::Decoupling,
        plant::{Plant, beside},
    },
};

/// Lower bound of Qr.
const SMALLEST: f64 = 1e-6;

/// The solver's last point.
#[derive(Clone, Debug, PartialEq)]
pub struct NoiseAwareSolution {
    /// tr Z.
    pub trace: f64,
    /// K, in the coordinates x' = T_c x.
    pub k: DMatrix<f64>,
    /// What the solver said.
    pub run: SolverRun,
}

/// Solves the inequality; with `radius` also for |eig F| <= ρ.
///
/// # Errors
/// The reason in words: no noise, the solver's reason, or a slack that cannot be inverted.
pub fn solve(
    plant: &Plant,
    decoupling: &Decoupling,
    radius: Option<f64>,
) -> Result<NoiseAwareSolution, String> {
    let (p, nz, free) = (plant.outputs(), plant.hidden(), decoupling.free.ncols());
    let largest = plant.noise_bound.max();
    if !(largest > 0.0) {
        return Err("it needs a `model.measurement_noise_bound` above zero".to_owned());
    }
    let noise = DMatrix::from_diagonal(&plant.noise_bound) / largest;
    let [a11, a12, a21, _] = plant.blocks();
    let seen = beside(&a12, &-&a11);
    let weight = seen.tr_mul(&seen);
    let order = nz + p;

    let s_k = |g11: &DMatrix<f64>, y: &DMatrix<f64>| g11 * &decoupling.k0 + y * decoupling.free.transpose();
    let s_f = |g11: &DMatrix<f64>, y: &DMatrix<f64>| g11 * &decoupling.a_bar + y * &decoupling.c;
    let rest = |g11: &DMatrix<f64>, g12: &DMatrix<f64>, g22: &DMatrix<f64>, q: &DMatrix<f64>| {
        let mut g = DMatrix::zeros(order, order);
        g.view_mut((0, 0), (nz, nz)).copy_from(g11);
        g.view_mut((0, nz), (nz, p)).copy_from(g12);
        g.view_mut((nz, nz), (p, p)).copy_from(g22);
        hermitian(&g) - q
    };
    let (s_k, s_f, rest) = (&s_k, &s_f, &rest);
    let (a11, a21, weight, noise) = (&a11, &a21, &weight, &noise);

    let mut problem = SemidefiniteProgram::named("noise-aware H2 inequality for a reduced-order observer");
    let (q, z) = (problem.symmetric(order), problem.symmetric(p));
    let (g11, g12, g22) = (problem.full(nz, nz), problem.full(nz, p), problem.full(p, p));
    let y = problem.full(nz, free);
    problem.minimise_trace(z);

    problem.require("decay of the errors", move |at| {
        let (g11, y, q) = (at.matrix(g11), at.matrix(y), at.matrix(q));
        let mut ga = DMatrix::zeros(order, order);
        ga.view_mut((0, 0), (nz, nz)).copy_from(&s_f(&g11, &y));
        ga.view_mut((0, nz), (nz, p))
            .copy_from(&-(&g11 * a21 + s_k(&g11, &y) * a11));
        let rest = rest(&g11, &at.matrix(g12), &at.matrix(g22), &q);
        symmetric_blocks(&[vec![q - weight, ga.transpose()], vec![rest]])
    });
    problem.require("effect of the noise", move |at| {
        let (g11, g12, g22, y) = (at.matrix(g11), at.matrix(g12), at.matrix(g22), at.matrix(y));
        let mut gb = DMatrix::zeros(order, p);
        gb.rows_mut(0, nz).copy_from(&((s_k(&g11, &y) + &g12) * noise));
        gb.rows_mut(nz, p).copy_from(&(&g22 * noise));
        let rest = rest(&g11, &g12, &g22, &at.matrix(q));
        symmetric_blocks(&[vec![at.matrix(z), gb.transpose()], vec![rest]])
    });
    if let Some(radius) = radius {
        let qr = problem.symmetric(nz);
        problem.require("eigenvalues of F", move |at| {
            let (g11, qr) = (at.matrix(g11), at.matrix(qr));
            let f = s_f(&g11, &at.matrix(y));
            symmetric_blocks(&[
                vec![&qr * radius.powi(2), f.transpose()],
                vec![hermitian(&g11) - qr],
            ])
        });
        problem.require("Qr", move |at| {
            at.matrix(qr) - DMatrix::identity(nz, nz) * SMALLEST
        });
    }
    let solution = problem.solve().map_err(|error| error.to_string())?;
    let gain = solution
        .value(g11)
        .lu()
        .solve(&solution.value(y))
        .ok_or("the slack G11 is singular")?;
    Ok(NoiseAwareSolution {
        trace: solution.number(z),
        k: &decoupling.k0 + gain * decoupling.free.transpose(),
        run: solution.run,
    })
}
