//! The trajectories that explain one piece of a recording, found by linear programming and checked afterwards.
//!
//! Variables: states x_0 .. x_K, disturbances δ_k in units of the configured bound w (so D d = D diag(w) δ),
//! and the scales that are minimised. Elements with w = 0 stay at zero; A⁺ counts as zero.

use super::run_data::Piece;
use crate::conic::SolverError;
use crate::linear_program::{LinearProgram, Solution};
use nalgebra::{DMatrix, DVector};
use residual_diagnosis::model::LinearModel;

/// Largest residual of an equality, relative to the largest term of its row, that a checked trajectory may have.
const EQUALITY_TOLERANCE: f64 = 1e-9;

/// Disturbances that are nowhere larger than this, in units of w, are the solver's way to say zero.
const NEGLIGIBLE: f64 = 1e-9;

/// What is minimised, and with what the other quantities are limited.
pub(super) enum Goal<'a> {
    /// The sum of the scales s_j of the disturbances, at this noise bound (length ny).
    SmallestDisturbances(&'a DVector<f64>),
    /// The common factor t of |δ| <= t and of this noise bound.
    CommonFactor(&'a DVector<f64>),
    /// The factor t of this noise bound, the disturbances being unlimited.
    NoiseFactor(&'a DVector<f64>),
}

/// How much a trajectory needs; as checked, not as the solver reported.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Need {
    /// Largest |δ_j| of each disturbance, length nd; 0 for those with w = 0.
    pub disturbances: DVector<f64>,
    /// Largest |y - C x| of each output relative to the given noise bound, length ny.
    pub noise: DVector<f64>,
}

/// Why there is no trajectory.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum TrajectoryError {
    /// The solver did not get there.
    Solver(SolverError),
    /// The solver's trajectory misses the model.
    Unverified { residual: f64, status: String },
}

/// The model's matrices in the units of the programs.
pub(super) struct Plant<'a> {
    model: &'a LinearModel,
    /// Positions of the disturbances with a bound above zero.
    active: Vec<usize>,
    /// D diag(unit) of those, nx x number of them.
    d: DMatrix<f64>,
    /// Its pseudo-inverse.
    d_inverse: DMatrix<f64>,
}

impl<'a> Plant<'a> {
    /// Measures disturbance j in `unit[j]`.
    pub(super) fn new(model: &'a LinearModel, unit: &DVector<f64>) -> Self {
        let active: Vec<usize> = (0..unit.len()).filter(|&j| unit[j] > 0.0).collect();
        let d = DMatrix::from_fn(model.state_count(), active.len(), |i, a| {
            model.d()[(i, active[a])] * unit[active[a]]
        });
        let d_inverse = pseudo_inverse(&d);
        Self {
            model,
            active,
            d,
            d_inverse,
        }
    }

    /// The trajectory that reaches the goal.
    pub(super) fn explain(&self, piece: &Piece, goal: &Goal<'_>) -> Result<Need, TrajectoryError> {
        let transitions = piece.transitions();
        let (nx, nd) = (self.d.nrows(), self.d.ncols());
        let mut program = LinearProgram::default();
        let x = program.add_variables(nx * (transitions + 1));
        let d = program.add_variables(nd * transitions);
        let bound = self.limit(&mut program, piece, goal, x, d);
        for k in 0..transitions {
            let driven = self.model.b() * piece.commands.column(k);
            for i in 0..nx {
                let next = [(x + (k + 1) * nx + i, 1.0)];
                let state = (0..nx).map(|j| (x + k * nx + j, -self.model.a0()[(i, j)]));
                let disturbance = (0..nd).map(|j| (d + k * nd + j, -self.d[(i, j)]));
                program.equal(next.into_iter().chain(state).chain(disturbance), driven[i]);
            }
        }
        let solution = program.solve().map_err(TrajectoryError::Solver)?;
        let states = DMatrix::from_column_slice(nx, transitions + 1, &solution.values[x..d]);
        let disturbances =
            DMatrix::from_column_slice(nd, transitions, &solution.values[d..d + nd * transitions]);
        self.check(piece, bound, &states, disturbances, &solution)
    }

    /// Adds the scales, their cost and all inequalities; returns the noise bound.
    fn limit<'g>(
        &self,
        program: &mut LinearProgram,
        piece: &Piece,
        goal: &Goal<'g>,
        x: usize,
        d: usize,
    ) -> &'g DVector<f64> {
        let nd = self.d.ncols();
        let (bound, disturbance_scale, noise_scale) = match *goal {
            Goal::SmallestDisturbances(bound) => {
                let first = program.add_variables(nd);
                (bound, (0..nd).map(|j| Some(first + j)).collect(), None)
            }
            Goal::CommonFactor(bound) => {
                let factor = program.add_variables(1);
                (bound, vec![Some(factor); nd], Some(factor))
            }
            Goal::NoiseFactor(bound) => (bound, vec![None; nd], Some(program.add_variables(1))),
        };
        let mut scales: Vec<usize> = disturbance_scale
            .iter()
            .copied()
            .chain([noise_scale])
            .flatten()
            .collect();
        scales.dedup();
        for scale in scales {
            program.add_cost(scale, 1.0);
            program.at_most([(scale, -1.0)], 0.0);
        }
        for k in 0..piece.transitions() {
            for (j, scale) in disturbance_scale.iter().enumerate() {
                for (sign, scale) in [1.0, -1.0]
                    .into_iter()
                    .flat_map(|sign| scale.map(|scale| (sign, scale)))
                {
                    program.at_most([(d + k * nd + j, sign), (scale, -1.0)], 0.0);
                }
            }
        }
        let c = self.model.c();
        for (k, sample) in piece.measurements.column_iter().enumerate() {
            for (i, &y) in sample.iter().enumerate().filter(|(_, y)| y.is_finite()) {
                for sign in [1.0, -1.0] {
                    let output =
                        (0..c.ncols()).map(|j| (x + k * c.ncols() + j, -sign * c[(i, j)] / bound[i]));
                    let (scale, fixed) = noise_scale.map_or((None, 1.0), |scale| (Some((scale, -1.0)), 0.0));
                    program.at_most(output.chain(scale), fixed - sign * y / bound[i]);
                }
            }
        }
        bound
    }

    /// Moves what the equalities miss into the disturbances as far as D allows, and measures what is needed.
    fn check(
        &self,
        piece: &Piece,
        bound: &DVector<f64>,
        states: &DMatrix<f64>,
        mut disturbances: DMatrix<f64>,
        solution: &Solution,
    ) -> Result<Need, TrajectoryError> {
        let (a, b) = (self.model.a0(), self.model.b());
        let (nx, transitions) = (states.nrows(), piece.transitions());
        let next = states.columns(1, transitions);
        let present = states.columns(0, transitions);
        let known = next - a * present - b * &piece.commands;
        let missed = &known - &self.d * &disturbances;
        disturbances += &self.d_inverse * missed;
        for mut row in disturbances.row_iter_mut().filter(|row| row.amax() <= NEGLIGIBLE) {
            row.fill(0.0);
        }
        let residual = known - &self.d * &disturbances;
        let terms = next.abs()
            + a.abs() * present.abs()
            + b.abs() * piece.commands.abs()
            + self.d.abs() * disturbances.abs();
        let worst = (0..nx)
            .map(|i| relative(residual.row(i).amax(), terms.row(i).amax()))
            .fold(0.0, f64::max);
        let noise = (&piece.measurements - self.model.c() * states).map(|value| match value.is_nan() {
            true => 0.0,
            false => value.abs(),
        });
        let finite = states.iter().chain(&disturbances).all(|value| value.is_finite());
        if !finite || worst > EQUALITY_TOLERANCE {
            return Err(TrajectoryError::Unverified {
                residual: worst,
                status: solution.run.status.clone(),
            });
        }
        let mut needed = DVector::zeros(self.model.disturbance_count());
        for (row, &j) in self.active.iter().enumerate() {
            needed[j] = disturbances.row(row).amax();
        }
        let noise = DVector::from_fn(bound.len(), |i, _| noise.row(i).amax() / bound[i]);
        Ok(Need {
            disturbances: needed,
            noise,
        })
    }
}

fn relative(residual: f64, terms: f64) -> f64 {
    if residual == 0.0 { 0.0 } else { residual / terms }
}

/// The pseudo-inverse; zero where the singular-value decomposition fails, which leaves residuals as they are.
fn pseudo_inverse(matrix: &DMatrix<f64>) -> DMatrix<f64> {
    let zero = DMatrix::zeros(matrix.ncols(), matrix.nrows());
    if matrix.is_empty() {
        return zero;
    }
    let tolerance = 1e-9 * matrix.norm();
    matrix.clone().pseudo_inverse(tolerance).unwrap_or(zero)
}
