//! Algebraic Riccati equations of filtering, by structure-preserving doubling (method sheet 3.2 of `hinf_filter`).
//!
//! Process noise and measurement noise have the joint covariance \[Q, S; S', R\], R positive definite.
//!
//! | time | equation | Ω | gain |
//! |---|---|---|---|
//! | discrete | Π = A Π A' + Q - (A Π C' + S) Ω⁻¹ (A Π C' + S)' | R + C Π C' | (A Π C' + S) Ω⁻¹ |
//! | continuous | A Π + Π A' + Q - (Π C' + S) R⁻¹ (Π C' + S)' = 0 | R | (Π C' + S) R⁻¹ |

use crate::spectrum::spectral_radius;
use nalgebra::DMatrix;
use thiserror::Error;

/// Doubling squares the closed loop in every round; 14 rounds are the most that was seen.
const ROUNDS: usize = 60;
/// Relative change of the solution that ends the doubling.
const CONVERGED: f64 = 1e-15;
/// Largest relative residual of an accepted solution.
const RESIDUAL: f64 = 1e-8;
/// A doubling with a larger residual is replaced by the filter's recursion.
const ACCURATE: f64 = 1e-11;
/// Steps of that recursion: before Newton's method takes over, and altogether.
const WARM_UP: usize = 20;
const RECURSIONS: usize = 60;
/// R counts as singular above this condition number of its correlation matrix.
const CONDITION: f64 = 1e12;

/// The stabilising solution.
#[derive(Clone, Debug, PartialEq)]
pub struct RiccatiSolution {
    /// Π, n x n, positive semidefinite.
    pub pi: DMatrix<f64>,
    /// Ω, q x q.
    pub omega: DMatrix<f64>,
    /// The gain, n x q.
    pub gain: DMatrix<f64>,
    /// Residual of the equation relative to its largest term.
    pub residual: f64,
}

/// Why there is no solution.
#[derive(Clone, Debug, PartialEq, Error)]
pub enum RiccatiError {
    /// R is not positive definite.
    #[error("the covariance of the measurement noise is singular (condition {condition:e})")]
    SingularNoise {
        /// Its condition number.
        condition: f64,
    },
    /// The doubling met a singular or infinite matrix, or did not settle.
    #[error("the doubling iteration broke down")]
    NoConvergence,
    /// The result does not satisfy the equation.
    #[error("the residual of the Riccati equation is {residual:e}")]
    LargeResidual {
        /// Residual relative to the largest term.
        residual: f64,
    },
    /// The gain does not stabilise the filter.
    #[error("the filter has a pole with {measure}")]
    NotStabilising {
        /// Modulus or real part of the worst pole.
        measure: String,
    },
}

/// Covariances Q (n x n), S (n x q), R (q x q).
#[derive(Clone, Copy, Debug)]
pub struct Covariances<'a> {
    /// Q, of the process noise.
    pub q: &'a DMatrix<f64>,
    /// S, between both.
    pub s: &'a DMatrix<f64>,
    /// R, of the measurement noise.
    pub r: &'a DMatrix<f64>,
}

/// Solves the discrete-time filter equation for the pair (A, C).
///
/// # Errors
/// [`RiccatiError`]: singular R, no convergence, or a gain whose A - LC is not stable by 1e-9.
pub fn dare(
    a: &DMatrix<f64>,
    c: &DMatrix<f64>,
    noise: Covariances<'_>,
) -> Result<RiccatiSolution, RiccatiError> {
    let inverse = inverse_of_noise(noise.r)?;
    let reduced = a - noise.s * &inverse * c;
    let start = Doubling {
        a: reduced.transpose(),
        g: c.transpose() * &inverse * c,
        h: noise.q - noise.s * &inverse * noise.s.transpose(),
    };
    let doubled = start.solve().and_then(|pi| dare_at(a, c, noise, pi));
    let solution = match doubled {
        Ok(solution) if solution.residual <= ACCURATE => solution,
        // Strongly unstable plants cost the doubling its digits; the recursion of the filter does not lose them.
        _ => improved(a, c, noise)?,
    };
    let (residual, gain) = (solution.residual, &solution.gain);
    if !(residual <= RESIDUAL) {
        return Err(RiccatiError::LargeResidual { residual });
    }
    let radius = spectral_radius(&(a - gain * c)).unwrap_or(f64::INFINITY);
    if !(radius < 1.0 - 1e-9) {
        return Err(RiccatiError::NotStabilising {
            measure: format!("modulus {radius}"),
        });
    }
    Ok(solution)
}

/// Ω, gain and residual that belong to a given Π in discrete time: how a solution is checked.
///
/// # Errors
/// [`RiccatiError::NoConvergence`] if Ω is singular.
pub fn dare_at(
    a: &DMatrix<f64>,
    c: &DMatrix<f64>,
    noise: Covariances<'_>,
    pi: DMatrix<f64>,
) -> Result<RiccatiSolution, RiccatiError> {
    let omega = noise.r + c * &pi * c.transpose();
    let cross = a * &pi * c.transpose() + noise.s;
    let inverse = omega.clone().try_inverse().ok_or(RiccatiError::NoConvergence)?;
    let gain = &cross * inverse;
    let propagated = a * &pi * a.transpose() + noise.q;
    let residual = relative(
        &(&propagated - &gain * cross.transpose() - &pi),
        &[&propagated, &pi],
    );
    Ok(RiccatiSolution {
        pi,
        omega,
        gain,
        residual,
    })
}

/// The solution by the filter's own recursion, Π⁺ = Ac Π Ac' + \[I, -L\] \[Q, S; S', R\] \[I, -L\]', until L stabilises,
/// then by Newton's method, which keeps the gain and solves for Π.
fn improved(
    a: &DMatrix<f64>,
    c: &DMatrix<f64>,
    noise: Covariances<'_>,
) -> Result<RiccatiSolution, RiccatiError> {
    let n = a.nrows();
    let size = noise.q.amax().max(noise.r.amax());
    let mut best = dare_at(a, c, noise, DMatrix::identity(n, n) * size)?;
    for round in 0..RECURSIONS {
        let gain = &best.gain;
        let closed = a - gain * c;
        let cross = noise.s * gain.transpose();
        let driven = noise.q - &cross - cross.transpose() + gain * noise.r * gain.transpose();
        let stationary = match round < WARM_UP {
            true => None,
            false => crate::lyapunov::discrete(&closed, &driven),
        };
        let next = stationary.unwrap_or_else(|| &closed * &best.pi * closed.transpose() + driven);
        best = dare_at(a, c, noise, (&next + next.transpose()) / 2.0)?;
        if round > WARM_UP && best.residual <= ACCURATE {
            break;
        }
    }
    Ok(best)
}

/// Solves the continuous-time filter equation for the pair (A, C).
///
/// # Errors
/// [`RiccatiError`]: singular R, no convergence, or a gain whose A - HC is not stable.
pub fn care(
    a: &DMatrix<f64>,
    c: &DMatrix<f64>,
    noise: Covariances<'_>,
) -> Result<RiccatiSolution, RiccatiError> {
    let inverse = inverse_of_noise(noise.r)?;
    let reduced = (a - noise.s * &inverse * c).transpose();
    let weight = noise.q - noise.s * &inverse * noise.s.transpose();
    let start =
        cayley(&reduced, &(c.transpose() * &inverse * c), &weight).ok_or(RiccatiError::NoConvergence)?;
    let solution = care_at(a, c, noise, start.solve()?)?;
    let (residual, gain) = (solution.residual, &solution.gain);
    if !(residual <= RESIDUAL) {
        return Err(RiccatiError::LargeResidual { residual });
    }
    let poles = crate::decomposition::eigenvalues(&(a - gain * c)).ok_or(RiccatiError::NoConvergence)?;
    let worst = poles.iter().map(|pole| pole.re).fold(f64::NEG_INFINITY, f64::max);
    if !(worst < 0.0) {
        return Err(RiccatiError::NotStabilising {
            measure: format!("real part {worst}"),
        });
    }
    Ok(solution)
}

/// Ω = R, gain and residual that belong to a given Π in continuous time: how a solution is checked.
///
/// # Errors
/// [`RiccatiError::SingularNoise`] if R is singular.
pub fn care_at(
    a: &DMatrix<f64>,
    c: &DMatrix<f64>,
    noise: Covariances<'_>,
    pi: DMatrix<f64>,
) -> Result<RiccatiSolution, RiccatiError> {
    let cross = &pi * c.transpose() + noise.s;
    let gain = &cross * inverse_of_noise(noise.r)?;
    let (flow, loss) = (a * &pi, &gain * cross.transpose());
    let residual = relative(
        &(&flow + flow.transpose() + noise.q - &loss),
        &[&flow, noise.q, &loss],
    );
    Ok(RiccatiSolution {
        omega: noise.r.clone(),
        pi,
        gain,
        residual,
    })
}

/// One iterate of the doubling: A⁺ = A W A, G⁺ = G + A W G A', H⁺ = H + A' H W A with W = (I + G H)⁻¹; H grows to Π.
struct Doubling {
    a: DMatrix<f64>,
    g: DMatrix<f64>,
    h: DMatrix<f64>,
}

impl Doubling {
    fn solve(self) -> Result<DMatrix<f64>, RiccatiError> {
        let Self { mut a, mut g, mut h } = self;
        let n = a.nrows();
        for _ in 0..ROUNDS {
            let w = (DMatrix::identity(n, n) + &g * &h)
                .try_inverse()
                .ok_or(RiccatiError::NoConvergence)?;
            let change = a.transpose() * &h * &w * &a;
            g += &a * &w * &g * a.transpose();
            a = &a * w * &a;
            h += &change;
            g = (&g + g.transpose()) / 2.0;
            h = (&h + h.transpose()) / 2.0;
            if !h.amax().is_finite() {
                break;
            }
            if change.amax() <= CONVERGED * h.amax() {
                return Ok(h);
            }
        }
        Err(RiccatiError::NoConvergence)
    }
}

/// The discrete doubling problem with the solution of the continuous equation; the shift is kept away from every
/// eigenvalue of Ab by the factor 1.5.
fn cayley(ab: &DMatrix<f64>, g: &DMatrix<f64>, qb: &DMatrix<f64>) -> Option<Doubling> {
    let n = ab.nrows();
    let identity = DMatrix::<f64>::identity(n, n);
    let largest = crate::decomposition::SingularDecomposition::new(ab).largest();
    let shift = 1.5 * largest.max(1e-3);
    let inverse = (ab - &identity * shift).try_inverse()?;
    let w = ((ab - &identity * shift).transpose() + qb * &inverse * g).try_inverse()?;
    Some(Doubling {
        a: identity + w.transpose() * (2.0 * shift),
        g: &inverse * g * &w * (2.0 * shift),
        h: &w * qb * &inverse * (2.0 * shift),
    })
}

fn inverse_of_noise(r: &DMatrix<f64>) -> Result<DMatrix<f64>, RiccatiError> {
    // Scaled to a unit diagonal, so that the units of the outputs do not matter.
    let scale = r.diagonal().map(|variance| variance.max(0.0).sqrt());
    let scaled = DMatrix::from_fn(r.nrows(), r.ncols(), |i, j| r[(i, j)] / (scale[i] * scale[j]));
    if scaled.iter().any(|entry| !entry.is_finite()) {
        return Err(RiccatiError::SingularNoise {
            condition: f64::INFINITY,
        });
    }
    let values = crate::decomposition::SingularDecomposition::new(&scaled);
    let condition = values.largest() / values.smallest();
    match scaled.try_inverse() {
        Some(inverse) if condition <= CONDITION => Ok(DMatrix::from_fn(r.nrows(), r.ncols(), |i, j| {
            inverse[(i, j)] / (scale[i] * scale[j])
        })),
        _ => Err(RiccatiError::SingularNoise { condition }),
    }
}

/// ‖residual‖ relative to the largest of the terms.
fn relative(residual: &DMatrix<f64>, terms: &[&DMatrix<f64>]) -> f64 {
    let scale = terms.iter().map(|term| term.amax()).fold(0.0, f64::max);
    if scale > 0.0 {
        residual.amax() / scale
    } else {
        residual.amax()
    }
}
