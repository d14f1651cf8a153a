//! The paper's linear matrix inequality with its equality (method sheet 3.3, paper equations (2) and (4)).
//!
//! In the configured coordinates, with W = P L and an orthonormal basis N_c of null(C):
//! min κ subject to P - I ⪰ 0, κI - P ⪰ 0, \[\[a²P, (PA + WC)'\], \[PA + WC, P\]\] ⪰ 0, D'P N_c = 0.
//!
//! | symbol | shape | meaning |
//! |---|---|---|
//! | a | | decay rate: \|eig(A + L C)\| <= a |
//! | κ | | bound of the condition number of P |
//! | P, L | n x n, n x p | Lyapunov matrix and gain of the full-order observer |
//! | K = P22⁻¹P12' | nz x p | gain of the reduced-order one, in the coordinates x' = T_c x |
//! | M = A11 + L1 + P11⁻¹P12 (A21 + L2) | p x p | gain of the output's observer, there too; not unique |

use crate::semidefinite::{SemidefiniteProgram, symmetric_blocks};
use nalgebra::DMatrix;
use residual_diagnosis::{
    decomposition::{SingularDecomposition, SymmetricDecomposition},
    gains::SolverRun,
    reduced_order_observer::plant::Plant,
};

/// λ_min(P) may fall short of 1 by this.
const SMALLEST: f64 = 1e-6;
/// D'P N_c may reach this share of P.
const EQUALITY: f64 = 1e-6;
/// Largest condition number of P.
const CONDITION: f64 = 1e9;

/// An accepted solution.
#[derive(Clone, Debug, PartialEq)]
pub struct PaperSolution {
    /// κ at the optimum.
    pub kappa: f64,
    /// P, in the configured coordinates.
    pub p: DMatrix<f64>,
    /// L, in the configured coordinates.
    pub l: DMatrix<f64>,
    /// K, in the coordinates x' = T_c x; not yet projected on K D1 + D2 = 0.
    pub k: DMatrix<f64>,
    /// M, there too; Schur unless the decay rate is nearly 1.
    pub m: DMatrix<f64>,
    /// What the solver said.
    pub run: SolverRun,
}

/// Solves the inequality for the decay rate `a` and accepts or rejects the solution (method sheet 3.6, 1).
///
/// # Errors
/// The reason in words: the solver's, or the condition that its last point violates.
pub fn solve(plant: &Plant, decay_rate: f64) -> Result<PaperSolution, String> {
    let (n, outputs, q) = (plant.states(), plant.outputs(), plant.disturbances());
    let (t, inverse) = (&plant.transformation, &plant.inverse);
    let (a, c, d) = (inverse * &plant.a * t, &plant.c, inverse * &plant.d);
    let null = SingularDecomposition::new(c);
    let null = null.null_space(1e-9 * null.largest());
    let identity = DMatrix::<f64>::identity(n, n);
    let (a, d, null, identity) = (&a, &d, &null, &identity);

    let mut problem = SemidefiniteProgram::named("paper's inequality for a reduced-order observer");
    let (p, w, kappa) = (problem.symmetric(n), problem.full(n, outputs), problem.scalar());
    problem.minimise(kappa);
    problem.require("P - I", move |at| at.matrix(p) - identity);
    problem.require("κI - P", move |at| identity * at.number(kappa) - at.matrix(p));
    problem.require("decay", move |at| {
        let closed = at.matrix(p) * a + at.matrix(w) * c;
        symmetric_blocks(&[
            vec![at.matrix(p) * decay_rate.powi(2), closed.transpose()],
            vec![at.matrix(p)],
        ])
    });
    if q > 0 && null.ncols() > 0 {
        problem.equal("D'P N_c", move |at| d.tr_mul(&at.matrix(p)) * null);
    }
    let solution = problem.solve().map_err(|error| error.to_string())?;
    let (p, w) = (solution.value(p), solution.value(w));

    let values = SymmetricDecomposition::new(&p).eigenvalues;
    let (smallest, largest) = (values.min(), values.max());
    if !(smallest >= 1.0 - SMALLEST) {
        return Err(format!(
            "P - I is not positive semidefinite, λ_min(P) = {smallest:e}"
        ));
    }
    if !(largest <= CONDITION * smallest) {
        return Err(format!(
            "P is nearly singular, its condition number is {:e}",
            largest / smallest
        ));
    }
    let l = p.clone().cholesky().ok_or("P has no Cholesky factor")?.solve(&w);
    let closed = a + &l * c;
    let change = -SymmetricDecomposition::new(&(&p - closed.transpose() * &p * &closed)).smallest();
    if !(change < 0.0) {
        return Err(format!(
            "(A + L C)'P(A + L C) - P is not negative definite, it reaches {change:e}"
        ));
    }
    let coupling = (d.tr_mul(&p) * null).amax();
    if !(coupling <= EQUALITY * p.amax()) {
        return Err(format!("D'P N_c does not vanish, it reaches {coupling:e}"));
    }
    let (k, m) = recovered(plant, &p, &l).ok_or("a diagonal block of P is singular")?;
    Ok(PaperSolution {
        kappa: solution.number(kappa),
        p,
        l,
        k,
        m,
        run: solution.run,
    })
}

/// K and M of P and L, in the coordinates x' = T_c x: P ← T_c⁻ᵀ P T_c⁻¹, L ← T_c L.
fn recovered(plant: &Plant, p: &DMatrix<f64>, l: &DMatrix<f64>) -> Option<(DMatrix<f64>, DMatrix<f64>)> {
    let (outputs, nz) = (plant.outputs(), plant.hidden());
    let p = plant.inverse.tr_mul(p) * &plant.inverse;
    let l = &plant.transformation * l;
    let [a11, _, a21, _] = plant.blocks();
    let p12 = p.view((0, outputs), (outputs, nz)).into_owned();
    let p11 = p.view((0, 0), (outputs, outputs)).into_owned().cholesky()?;
    let p22 = p.view((outputs, outputs), (nz, nz)).into_owned().cholesky()?;
    let k = p22.solve(&p12.transpose());
    let m = a11 + l.rows(0, outputs) + p11.solve(&(p12 * (a21 + l.rows(outputs, nz))));
    Some((k, m))
}
