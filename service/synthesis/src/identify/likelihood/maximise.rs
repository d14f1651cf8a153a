//! The search: scoring steps, damped as Levenberg and Marquardt do, inside the ranges of the unknowns.

use super::Likelihood;
use super::derivatives::Derivatives;
use crate::identify::run_data::Piece;
use nalgebra::{Cholesky, DMatrix, DVector};
use residual_diagnosis::decomposition::SingularDecomposition;

/// Most iterations.
const ITERATIONS: usize = 100;
/// The search ends when a step would lower ℓ by less than this: a 200th of a standard error in every direction.
const DECREMENT: f64 = 1e-5;
/// A search that cannot lower ℓ any more, or ran out of iterations, has failed if a step should still lower it by this.
const STALLED_DECREMENT: f64 = 1e-3;
/// Lowering of ℓ, as a share of what the quadratic model foretells, below which the next step is damped more, and above
/// which less: the information of real noise, which is not Gaussian, may differ much from the curvature of ℓ.
const POOR_STEP: f64 = 0.25;
const GOOD_STEP: f64 = 0.75;
/// Eigenvalue of the information, scaled to a unit diagonal, below which a direction is not determined.
const UNDETERMINED: f64 = 1e-9;
/// Displacement of the central differences in standard errors, and its limits relative to the parameter: a parameter
/// without influence has no standard error.
const DISPLACEMENT: (f64, f64, f64) = (1e-3, 1e-6, 1e-2);
/// Parameters below this count as this large.
const SMALL: f64 = 1e-2;

/// Where the search ended.
#[derive(Clone, Debug)]
pub(in crate::identify) struct Maximum {
    pub theta: Vec<f64>,
    pub iterations: usize,
    /// Which unknowns ended at an end of their range.
    pub at_limit: Vec<bool>,
    /// Standard error of each unknown; 0 at an end of its range.
    pub standard_errors: Vec<f64>,
}

/// Why there is no maximum.
#[derive(Clone, Debug, PartialEq)]
pub(in crate::identify) enum MaximumError {
    /// The start makes no model, or its filter fails.
    Start,
    /// The search got stuck or ran out of iterations; by how much a step should still lower ℓ.
    NotConverged { iterations: usize, decrement: f64 },
    /// The unknowns that make up a direction without information.
    Undetermined { unknowns: Vec<usize> },
}

impl Likelihood<'_> {
    /// Maximises over the pieces from `start`.
    pub(in crate::identify) fn maximise(
        &self,
        pieces: &[&Piece],
        start: &[f64],
    ) -> Result<Maximum, MaximumError> {
        let mut theta = start.to_vec();
        let mut damping = 1e-3;
        let mut displacements: Vec<f64> = theta.iter().map(|value| 1e-5 * value.abs().max(SMALL)).collect();
        let mut decrement = f64::INFINITY;
        for iterations in 0..ITERATIONS {
            let found = self
                .derivatives(&theta, &displacements, pieces.iter().copied())
                .ok_or(MaximumError::Start)?;
            for (i, displacement) in displacements.iter_mut().enumerate() {
                let error = found.information[(i, i)].sqrt().recip();
                let (standard_errors, smallest, largest) = DISPLACEMENT;
                let size = theta[i].abs().max(SMALL);
                if !error.is_nan() {
                    *displacement = (standard_errors * error).clamp(smallest * size, largest * size);
                }
            }
            let at_limit = self.at_limit(&theta, &found.gradient);
            let free: Vec<usize> = (0..theta.len()).filter(|&i| !at_limit[i]).collect();
            decrement = scoring_step(&found, &free, 1e-9).map_or(0.0, |step| {
                -free
                    .iter()
                    .zip(step.iter())
                    .map(|(&i, step)| found.gradient[i] * step)
                    .sum::<f64>()
            });
            let lowered = if decrement > DECREMENT && iterations + 1 < ITERATIONS {
                self.lower(pieces, &mut theta, &found, &free, &mut damping)
            } else {
                false
            };
            if !lowered {
                if decrement > STALLED_DECREMENT {
                    check_determined(&found.information, &free)?;
                    return Err(MaximumError::NotConverged {
                        iterations,
                        decrement,
                    });
                }
                let standard_errors = standard_errors(&found.information, &free)?;
                return Ok(Maximum {
                    theta,
                    iterations,
                    at_limit,
                    standard_errors,
                });
            }
        }
        Err(MaximumError::NotConverged {
            iterations: ITERATIONS,
            decrement,
        })
    }

    /// Takes the first damped step that lowers ℓ; false if none does.
    fn lower(
        &self,
        pieces: &[&Piece],
        theta: &mut Vec<f64>,
        found: &Derivatives,
        free: &[usize],
        damping: &mut f64,
    ) -> bool {
        while *damping < 1e10 {
            if let Some(step) = scoring_step(found, free, *damping) {
                let mut trial = theta.clone();
                let mut shortened = false;
                for (&i, step) in free.iter().zip(step.iter()) {
                    let unknown = &self.unknowns[i];
                    shortened |= step.abs() > unknown.largest_step;
                    let step = step.clamp(-unknown.largest_step, unknown.largest_step);
                    trial[i] = (trial[i] + step).clamp(unknown.range.0, unknown.range.1);
                }
                let value = self.value(&trial, pieces.iter().copied());
                if value < found.value {
                    let taken = DVector::from_fn(theta.len(), |i, _| trial[i] - theta[i]);
                    let foretold =
                        -found.gradient.dot(&taken) - 0.5 * taken.dot(&(&found.information * &taken));
                    let share = (found.value - value) / foretold;
                    if shortened || share > GOOD_STEP {
                        *damping = (*damping * 0.1).max(1e-12);
                    } else if share < POOR_STEP || share.is_nan() {
                        *damping *= 2.0;
                    }
                    *theta = trial;
                    return true;
                }
            }
            *damping = (*damping * 10.0).max(1e-3);
        }
        *damping = 1e-3;
        false
    }

    /// Unknowns at an end of their range that ℓ wants outside.
    fn at_limit(&self, theta: &[f64], gradient: &DVector<f64>) -> Vec<bool> {
        let outside = |i: usize| {
            let (lower, upper) = self.unknowns[i].range;
            (theta[i] <= lower && gradient[i] >= 0.0) || (theta[i] >= upper && gradient[i] <= 0.0)
        };
        (0..theta.len()).map(outside).collect()
    }
}

/// δ = -(M + λ diag M)⁻¹ g over the free unknowns.
fn scoring_step(found: &Derivatives, free: &[usize], damping: f64) -> Option<DVector<f64>> {
    let mut matrix = found.information.select_rows(free).select_columns(free);
    for i in 0..free.len() {
        // Without any information a unit keeps the step finite; its gradient is zero as well.
        let diagonal = matrix[(i, i)];
        matrix[(i, i)] = if diagonal > 0.0 {
            diagonal * (1.0 + damping)
        } else {
            1.0
        };
    }
    let step = Cholesky::new(matrix)?.solve(&found.gradient.select_rows(free));
    step.iter().all(|value| value.is_finite()).then(|| -step)
}

/// M over the free unknowns with a unit diagonal, and the roots of its diagonal.
fn scaled(information: &DMatrix<f64>, free: &[usize]) -> (DMatrix<f64>, Vec<f64>) {
    let matrix = information.select_rows(free).select_columns(free);
    let roots: Vec<f64> = matrix
        .diagonal()
        .iter()
        .map(|entry| entry.max(0.0).sqrt())
        .collect();
    let scaled = DMatrix::from_fn(free.len(), free.len(), |i, j| {
        let product = roots[i] * roots[j];
        if product > 0.0 {
            matrix[(i, j)] / product
        } else {
            0.0
        }
    });
    (scaled, roots)
}

/// Refuses a direction without information, naming the unknowns in it.
fn check_determined(information: &DMatrix<f64>, free: &[usize]) -> Result<(), MaximumError> {
    let (scaled, _) = scaled(information, free);
    let decomposition = SingularDecomposition::new(&scaled);
    let weakest = (0..free.len()).min_by(|&a, &b| decomposition.sigma[a].total_cmp(&decomposition.sigma[b]));
    match weakest.filter(|&weakest| decomposition.sigma[weakest] < UNDETERMINED) {
        None => Ok(()),
        Some(weakest) => {
            let direction = decomposition.v.column(weakest);
            let part = |i: &usize| direction[*i].abs() > 0.05;
            Err(MaximumError::Undetermined {
                unknowns: (0..free.len()).filter(part).map(|i| free[i]).collect(),
            })
        }
    }
}

/// Roots of the diagonal of M⁻¹.
fn standard_errors(information: &DMatrix<f64>, free: &[usize]) -> Result<Vec<f64>, MaximumError> {
    check_determined(information, free)?;
    let (scaled, roots) = scaled(information, free);
    let mut errors = vec![0.0; information.nrows()];
    let inverse = Cholesky::new(scaled).map(|factor| factor.inverse());
    let inverse = inverse.ok_or(MaximumError::Undetermined {
        unknowns: free.to_vec(),
    })?;
    for (position, &i) in free.iter().enumerate() {
        errors[i] = inverse[(position, position)].sqrt() / roots[position];
    }
    Ok(errors)
}
