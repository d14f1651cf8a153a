//! Mixed H₋/H∞ synthesis in continuous time: the observer and the post-filter V with the largest sensitivity to faults
//! for a bounded sensitivity to disturbances (method sheet 3.3).
//!
//! With Q = V'V, the residual r̃ = V r and θ > 0, maximise β² subject to
//!
//! - \[\[He Φ + C'QC, Ψ + C'Q Dd\], \[·, Dd'Q Dd - I\]\] ⪯ 0, which means ‖V T_rd‖∞ <= 1,
//! - \[\[-θ He Φ + C'QC, -θ (X Bf - W Df) + C'Q Df\], \[·, Df'Q Df - β² I\]\] ⪰ 0, which means ‖V T_rf‖₋ >= β.
//!
//! For fixed θ this is a semidefinite program; θ is found by a line search over its logarithm.

use super::{
    ErrorPlant, LmiError, Region, Time,
    certificate::{check_norm, check_poles, strict_lyapunov},
    plant::check_matrix,
    scaling::ScaledPlant,
    stages::{recovered, require_region},
    two_stage::CLAIM,
};
use crate::semidefinite::{SemidefiniteProgram, hermitian, symmetric_blocks};
use nalgebra::DMatrix;
use residual_diagnosis::{
    decomposition::{SingularDecomposition, SymmetricDecomposition},
    gains::SolverRun,
    hinf_filter::bounded_real,
    norms::{System, h_minus_continuous},
};

/// Decimal exponents of θ, in units in which disturbances and faults have size 1, among which the search begins.
const EXPONENTS: [i32; 13] = [-6, -5, -4, -3, -2, -1, 0, 1, 2, 3, 4, 5, 6];
/// The search ends when θ is known to this factor: log₁₀.
const SETTLED: f64 = 1e-3;
/// How far the recomputed ‖V T_rf‖₋ may lie below β.
const INDEX: f64 = 1e-5;
/// X is at least this multiple of the identity, in the units of the search.
const DEFINITE: f64 = 1e-6;
/// 2 - golden ratio.
const GOLDEN: f64 = 0.381_966_011_250_105_1;

/// A gain and a post-filter with their proof.
#[derive(Clone, Debug, PartialEq)]
pub struct MixedGain {
    /// H, n x q, 1/s, in original units and coordinates.
    pub gain: DMatrix<f64>,
    /// V = Q^{1/2}, q x q: ‖V T_rd‖∞ <= `bound`.
    pub v: DMatrix<f64>,
    /// β: ‖V T_rf‖₋, recomputed.
    pub index: f64,
    /// 1 + 1e-3.
    pub bound: f64,
    /// X ≻ 0 of the strict bounded-real inequality at the level `bound`, as [`super::LmiGain::lyapunov`], with VC for C
    /// in the last block and V Dd for Dd in the last column.
    pub lyapunov: DMatrix<f64>,
    /// θ, in the units of the search.
    pub theta: f64,
    /// The solver's words at that θ.
    pub runs: Vec<SolverRun>,
}

/// The program for one θ, solved.
struct Candidate {
    x: DMatrix<f64>,
    w: DMatrix<f64>,
    q: DMatrix<f64>,
    /// β².
    index: f64,
    /// log₁₀ θ.
    exponent: f64,
    run: SolverRun,
}

/// Plant and faults in units in which d and f have size 1.
struct Search<'a> {
    plant: ErrorPlant<'a>,
    bf: DMatrix<f64>,
    df: DMatrix<f64>,
    asked: &'a Region,
    region: Region,
}

/// The mixed gain; `bf` (n x l) and `df` (q x l) stand beside the plant.
///
/// # Errors
/// [`LmiError`]: a plant or region without a gain, a failure of the solver, or a gain that fails its verification.
pub fn mixed(
    plant: &ErrorPlant<'_>,
    bf: &DMatrix<f64>,
    df: &DMatrix<f64>,
    region: &Region,
) -> Result<MixedGain, LmiError> {
    let time = Time::Continuous;
    plant.check()?;
    check_matrix("Bf", bf, (plant.a.nrows(), bf.ncols()))?;
    check_matrix("Df", df, (plant.c.nrows(), bf.ncols()))?;
    region.check(time, plant)?;
    let scaled = ScaledPlant::new(time, plant, plant.disturbance_size()?);
    let size = |matrix: &DMatrix<f64>| SingularDecomposition::new(matrix).largest();
    let fault_size = match (size(df), size(&scaled.input(bf))) {
        (direct, _) if direct > 0.0 => direct,
        (_, state) if state > 0.0 => state,
        _ => 1.0,
    };
    region.within(|tightened| {
        let search = Search {
            plant: scaled.plant(),
            bf: scaled.input(bf) / fault_size,
            df: df / fault_size,
            asked: region,
            region: *tightened,
        };
        let best = search.best()?;
        verified(plant, &scaled, (bf, df, fault_size), region, &best)
    })
}

impl Search<'_> {
    /// The best θ: first among powers of ten, then between the neighbours of the best by golden sections.
    fn best(&self) -> Result<Candidate, LmiError> {
        let coarse = EXPONENTS.map(|exponent| self.solve(f64::from(exponent)));
        let best = coarse
            .into_iter()
            .reduce(better)
            .unwrap_or(Err(LmiError::NoDisturbance))?;
        let (mut low, mut high) = (best.exponent - 1.0, best.exponent + 1.0);
        let (mut left, mut right) = (low + GOLDEN * (high - low), high - GOLDEN * (high - low));
        let (mut at_left, mut at_right) = (self.solve(left), self.solve(right));
        while high - low > SETTLED {
            if value(&at_left) > value(&at_right) {
                high = right;
                (right, at_right) = (left, at_left);
                left = low + GOLDEN * (high - low);
                at_left = self.solve(left);
            } else {
                low = left;
                (left, at_left) = (right, at_right);
                right = high - GOLDEN * (high - low);
                at_right = self.solve(right);
            }
        }
        better(Ok(best), better(at_left, at_right))
    }

    /// The largest β² for θ = 10^`exponent`.
    fn solve(&self, exponent: f64) -> Result<Candidate, LmiError> {
        let theta = 10_f64.powf(exponent);
        let (plant, time) = (self.plant, Time::Continuous);
        let (n, q) = (plant.a.nrows(), plant.c.nrows());
        let (m, l) = (plant.bd.ncols(), self.bf.ncols());
        let mut problem = SemidefiniteProgram::named("mixed H₋/H∞: largest β² at the best θ");
        let (x, w, square) = (problem.symmetric(n), problem.full(n, q), problem.symmetric(q));
        let index = problem.scalar();
        problem.maximise(index);
        problem.require("X", move |at| at.matrix(x) - DMatrix::identity(n, n) * DEFINITE);
        problem.require("Q", move |at| at.matrix(square));
        problem.require("disturbance", move |at| {
            let (x, w, square) = (at.matrix(x), at.matrix(w), at.matrix(square));
            let (c, qdd) = (plant.c, &square * plant.dd);
            -symmetric_blocks(&[
                vec![
                    hermitian(&(&x * plant.a - &w * c)) + c.tr_mul(&(&square * c)),
                    &x * plant.bd - &w * plant.dd + c.tr_mul(&qdd),
                ],
                vec![plant.dd.tr_mul(&qdd) - DMatrix::identity(m, m)],
            ])
        });
        let (bf, df) = (&self.bf, &self.df);
        problem.require("fault", move |at| {
            let (x, w, square) = (at.matrix(x), at.matrix(w), at.matrix(square));
            let (c, qdf) = (plant.c, &square * df);
            symmetric_blocks(&[
                vec![
                    hermitian(&(&x * plant.a - &w * c)) * -theta + c.tr_mul(&(&square * c)),
                    (&x * bf - &w * df) * -theta + c.tr_mul(&qdf),
                ],
                vec![df.tr_mul(&qdf) - DMatrix::identity(l, l) * at.number(index)],
            ])
        });
        require_region(&mut problem, time, plant, self.region, (x, w));
        let solution = problem.solve().map_err(|source| LmiError::Solver {
            problem: "mixed H₋/H∞".to_owned(),
            region: self.asked.describe(time),
            source,
        })?;
        Ok(Candidate {
            x: solution.value(x),
            w: solution.value(w),
            q: solution.value(square),
            index: solution.number(index),
            exponent,
            run: solution.run,
        })
    }
}

/// β² of a candidate.
fn value(candidate: &Result<Candidate, LmiError>) -> f64 {
    candidate.as_ref().map_or(f64::NEG_INFINITY, |found| found.index)
}

/// The one with the larger β².
fn better(
    left: Result<Candidate, LmiError>,
    right: Result<Candidate, LmiError>,
) -> Result<Candidate, LmiError> {
    match value(&right) > value(&left) {
        true => right,
        false => left,
    }
}

/// The gain of a point in original units, with everything recomputed that is claimed of it.
fn verified(
    plant: &ErrorPlant<'_>,
    scaled: &ScaledPlant,
    (bf, df, fault_size): (&DMatrix<f64>, &DMatrix<f64>, f64),
    region: &Region,
    best: &Candidate,
) -> Result<MixedGain, LmiError> {
    let (time, bound) = (Time::Continuous, 1.0 + CLAIM);
    let gain = scaled.gain(&recovered(&best.x, &best.w)?);
    let v = root(&best.q) / scaled.delta;
    let filtered = |system: System| System {
        c: &v * system.c,
        d: &v * system.d,
        ..system
    };
    let closed = filtered(plant.closed(&gain));
    check_poles(time, &closed, region)?;
    check_norm(time, &closed, bound)?;
    // X of a level-1 inequality with the square of the output: scale d by δ, state by T.
    let start = scaled.lyapunov(&best.x) / (scaled.delta * scaled.delta);
    let lyapunov = strict_lyapunov(time, &closed, bound, &start).ok_or_else(|| LmiError::Recovery {
        condition: "bounded-real inequality".to_owned(),
        margin: -bounded_real::margin(&closed, time, &start, bound),
    })?;
    let faults = ErrorPlant {
        bd: bf,
        dd: df,
        ..*plant
    };
    let faults = filtered(faults.closed(&gain));
    let index = h_minus_continuous(&faults, None).value;
    let claimed = best.index.max(0.0).sqrt() * fault_size / scaled.delta;
    if !(index >= claimed * (1.0 - INDEX)) {
        return Err(LmiError::Recovery {
            condition: format!("‖V T_rf‖₋ >= {claimed}"),
            margin: claimed - index,
        });
    }
    Ok(MixedGain {
        gain,
        v,
        index,
        bound,
        lyapunov,
        theta: 10_f64.powf(best.exponent),
        runs: vec![best.run.clone()],
    })
}

/// Q^{1/2}; negative eigenvalues within the solver's errors count as 0.
fn root(q: &DMatrix<f64>) -> DMatrix<f64> {
    let decomposition = SymmetricDecomposition::new(q);
    let roots = decomposition.eigenvalues.map(|value| value.max(0.0).sqrt());
    &decomposition.vectors * DMatrix::from_diagonal(&roots) * decomposition.vectors.transpose()
}
