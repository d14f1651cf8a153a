//! Gains without a solver for matrix inequalities: the Riccati co-inner-outer design and its matched special case
//! (method sheet 3.2).

use super::{
    certificate::{Gain, Time},
    plant::{Plant, SampledPlant, beside},
};
use crate::decomposition::SingularDecomposition;
use crate::norms::{System, h_infinity_continuous, h_infinity_discrete};
use crate::riccati::{Covariances, RiccatiError, RiccatiSolution, care, care_at, dare, dare_at};
use nalgebra::{DMatrix, DVector};

/// Relative size of the process noise that is added once if the first attempt does not stabilise.
const REGULARISATION: f64 = 1e-3;
/// Bdd (I - Dd⁺Dd) counts as zero below this part of Bdd.
const MATCHED: f64 = 1e-9;

/// Weighted disturbance matrices of a design: \[B diag(w_d), 0\] and \[Dd diag(w_d), diag(w_n)\].
#[derive(Clone, Debug, PartialEq)]
pub struct Weighted {
    /// Bw, n x (m + q).
    pub b: DMatrix<f64>,
    /// Dw, q x (m + q).
    pub d: DMatrix<f64>,
}

impl Weighted {
    /// Weights the disturbances by `disturbance` (m) and adds measurement noise of amplitude `noise` (q).
    pub fn new(b: &DMatrix<f64>, d: &DMatrix<f64>, disturbance: &DVector<f64>, noise: &DVector<f64>) -> Self {
        let weight = DMatrix::from_diagonal(disturbance);
        Self {
            b: beside(&[&(b * &weight), &DMatrix::zeros(b.nrows(), noise.len())]),
            d: beside(&[&(d * weight), &DMatrix::from_diagonal(noise)]),
        }
    }

    /// Appends further columns.
    pub fn with_columns(&self, b: &DMatrix<f64>, d: &DMatrix<f64>) -> Self {
        Self {
            b: beside(&[&self.b, b]),
            d: beside(&[&self.d, d]),
        }
    }
}

/// Q = Bw Bw', S = Bw Dw', R = Dw Dw'.
struct Products {
    q: DMatrix<f64>,
    s: DMatrix<f64>,
    r: DMatrix<f64>,
}

impl Weighted {
    fn products(&self) -> Products {
        Products {
            q: &self.b * self.b.transpose(),
            s: &self.b * self.d.transpose(),
            r: &self.d * self.d.transpose(),
        }
    }
}

impl Products {
    fn covariances(&self) -> Covariances<'_> {
        Covariances {
            q: &self.q,
            s: &self.s,
            r: &self.r,
        }
    }

    /// With a little process noise, relative to what enters by `disturbance`.
    fn regularised(&self, disturbance: &DMatrix<f64>) -> Self {
        let n = self.q.nrows();
        let size = REGULARISATION * SingularDecomposition::new(disturbance).largest();
        Self {
            q: &self.q + DMatrix::identity(n, n) * (size * size),
            s: self.s.clone(),
            r: self.r.clone(),
        }
    }
}

/// A gain with the post-filter r̃ = V r.
#[derive(Clone, Debug, PartialEq)]
pub struct RiccatiDesign {
    /// L (discrete) or H (continuous, 1/s), n x q.
    pub gain: DMatrix<f64>,
    /// V, q x q, symmetric.
    pub v: DMatrix<f64>,
    /// √λ_max(Ω): the smallest ‖T_rw‖∞ that any gain reaches.
    pub optimum: f64,
    /// The solution of the equation.
    pub solution: RiccatiSolution,
}

/// The discrete design: V T_rw is co-inner, and no other (L, V) has a larger ‖V T_rf‖₋/‖V T_rw‖∞.
///
/// # Errors
/// [`RiccatiError`]; a gain that does not stabilise is tried once more with a little process noise.
pub fn synth_riccati_dt(
    ad: &DMatrix<f64>,
    c: &DMatrix<f64>,
    weighted: &Weighted,
    bdd: &DMatrix<f64>,
) -> Result<RiccatiDesign, RiccatiError> {
    design(ad, c, weighted, bdd, dare)
}

/// The continuous design.
///
/// # Errors
/// [`RiccatiError`]; a gain that does not stabilise is tried once more with a little process noise.
pub fn synth_riccati_ct(plant: &Plant, weighted: &Weighted) -> Result<RiccatiDesign, RiccatiError> {
    design(&plant.a, &plant.c, weighted, &plant.bd, care)
}

type Equation = fn(&DMatrix<f64>, &DMatrix<f64>, Covariances<'_>) -> Result<RiccatiSolution, RiccatiError>;

fn design(
    a: &DMatrix<f64>,
    c: &DMatrix<f64>,
    weighted: &Weighted,
    disturbance: &DMatrix<f64>,
    equation: Equation,
) -> Result<RiccatiDesign, RiccatiError> {
    let products = weighted.products();
    let solution = equation(a, c, products.covariances()).or_else(|error| {
        if matches!(error, RiccatiError::SingularNoise { .. }) {
            return Err(error);
        }
        equation(a, c, products.regularised(disturbance).covariances())
    })?;
    let (v, largest) = inverse_root(&solution.omega);
    Ok(RiccatiDesign {
        gain: solution.gain.clone(),
        v,
        optimum: largest.sqrt(),
        solution,
    })
}

/// Ω^{-1/2} and λ_max(Ω) of a positive definite Ω.
fn inverse_root(omega: &DMatrix<f64>) -> (DMatrix<f64>, f64) {
    let decomposition = SingularDecomposition::new(omega);
    let scaled =
        &decomposition.v * DMatrix::from_diagonal(&decomposition.sigma.map(|value| value.powf(-0.5)));
    let root = scaled * decomposition.v.transpose();
    ((&root + root.transpose()) / 2.0, decomposition.largest())
}

/// How well a gain agrees with a Π that is said to belong to it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct RiccatiCheck {
    /// Relative residual of the equation at Π, with or without the process noise of a second attempt.
    pub residual: f64,
    /// Deviation of the gain and of V from those of Π, V = Ω^{-1/2}, relative; infinite if V has another shape.
    pub deviation: f64,
    /// ‖T_rw‖∞.
    pub norm: f64,
    /// √λ_max(Ω): no gain has a smaller ‖T_rw‖∞; none if Π is that of a second attempt with more noise.
    pub optimum: Option<f64>,
}

/// Puts Π (n x n) into the equation of the gain's time domain: no equation is solved.
pub(super) fn check_riccati(
    plant: &Plant,
    sampled: &SampledPlant,
    gain: &Gain,
    weighted: &Weighted,
    pi: &DMatrix<f64>,
) -> Result<RiccatiCheck, RiccatiError> {
    let (a, input) = match gain.time {
        Time::Continuous => (&plant.a, &plant.bd),
        Time::Discrete => (&sampled.ad, &sampled.bdd),
    };
    let at = |products: &Products| match gain.time {
        Time::Continuous => care_at(a, &plant.c, products.covariances(), pi.clone()),
        Time::Discrete => dare_at(a, &plant.c, products.covariances(), pi.clone()),
    };
    let products = weighted.products();
    let (plain, regularised) = (at(&products)?, at(&products.regularised(input))?);
    let second_attempt = regularised.residual < plain.residual;
    let solution = if second_attempt { regularised } else { plain };
    let of_gain = (&gain.matrix - &solution.gain).amax() / solution.gain.amax().max(f64::MIN_POSITIVE);
    let (root, largest) = inverse_root(&solution.omega);
    let of_filter = match gain.v.shape() == root.shape() {
        true => (&gain.v - &root).amax() / root.amax(),
        false => f64::INFINITY,
    };
    let system = System::new(
        &(a - &gain.matrix * &plant.c),
        &(&weighted.b - &gain.matrix * &weighted.d),
        &plant.c,
        &weighted.d,
    );
    let norm = match gain.time {
        Time::Continuous => h_infinity_continuous(&system),
        Time::Discrete => h_infinity_discrete(&system),
    };
    Ok(RiccatiCheck {
        residual: solution.residual,
        deviation: of_gain.max(of_filter),
        norm: norm.value,
        optimum: (!second_attempt).then(|| largest.sqrt()),
    })
}

/// How far a gain is from T_rd ≡ Dd: the largest entry of B - L Dd relative to that of B.
pub(super) fn matched_rest(plant: &Plant, sampled: &SampledPlant, gain: &Gain) -> f64 {
    let input = match gain.time {
        Time::Continuous => &plant.bd,
        Time::Discrete => &sampled.bdd,
    };
    let rest = (input - &gain.matrix * &plant.dd).amax();
    if rest == 0.0 { 0.0 } else { rest / input.amax() }
}

/// The matched special case L = B Dd⁺, for which T_rd ≡ Dd: with B = Bdd the discrete gain, with B = Bd the
/// continuous one. `None` unless B (I - Dd⁺Dd) = 0.
pub fn matched_gain(b: &DMatrix<f64>, dd: &DMatrix<f64>) -> Option<DMatrix<f64>> {
    let inverse = pseudo_inverse(dd);
    let rest = b - b * &inverse * dd;
    (rest.amax() <= MATCHED * b.amax()).then(|| b * inverse)
}

/// The Moore-Penrose inverse.
pub fn pseudo_inverse(matrix: &DMatrix<f64>) -> DMatrix<f64> {
    let decomposition = SingularDecomposition::new(matrix);
    let limit = 1e-12 * decomposition.largest();
    let inverted = decomposition
        .sigma
        .map(|sigma| if sigma > limit { 1.0 / sigma } else { 0.0 });
    decomposition.v * DMatrix::from_diagonal(&inverted) * decomposition.u.transpose()
}
