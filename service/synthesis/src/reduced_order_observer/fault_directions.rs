//! Test directions that tell single faults best, by linear programs (method sheet 3.8, rule 4).
//!
//! For an actuator j and an instant k after the onset of its fault: max w'g_j(k) subject to -τ <= H'w <= τ, 1'τ <= 1,
//! where H holds the generators of the steady set of the residual. The half width of the direction w is 1'|H'w|, so that
//! w attains the smallest fault that any direction can guarantee at k. Where g_j(k) leaves the range of H, its part
//! outside is a direction that neither disturbance nor noise reaches.
//!
//! Any direction is sound: what it guarantees follows from its half width, which is computed apart.

use crate::linear_program::LinearProgram;
use nalgebra::{DMatrix, DVector};
use residual_diagnosis::{
    decomposition::SingularDecomposition,
    matrix::Matrix,
    reduced_order_observer::{floors::step_response, observer::Observer, plant::Plant, reach::Reach},
    zonotope::{Reducer, Reduction},
};

/// Instants after the onset.
const INSTANTS: [usize; 6] = [1, 2, 3, 5, 10, 200];
/// Columns of H that are kept.
const COLUMNS: usize = 60;
/// Below this share of the largest singular value H does not reach a direction.
const RANK: f64 = 1e-9;

/// Directions, and how many could not be found.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct FaultDirections {
    /// Unit vectors of length p.
    pub directions: Vec<DVector<f64>>,
    /// Linear programs that were solved.
    pub solved: usize,
    /// Linear programs without a usable solution.
    pub failed: usize,
}

/// The directions of all actuators and instants.
pub fn fault_directions(plant: &Plant, observer: &Observer, reach: &Reach) -> FaultDirections {
    let h = steady_generators(plant, reach);
    let range = SingularDecomposition::new(&h.transpose());
    let outside = range.null_space(RANK * range.largest());
    let mut found = FaultDirections::default();
    for actuator in 0..plant.actuators() {
        let response = step_response(observer, actuator);
        let largest = response.iter().map(|g| g.norm()).fold(0.0, f64::max);
        for g in INSTANTS.iter().filter_map(|k| response.get(*k)) {
            if !(g.norm() > RANK * largest) {
                continue;
            }
            let g = g.normalize();
            let free = &outside * outside.tr_mul(&g);
            if free.norm() > RANK.sqrt() {
                found.directions.push(free.normalize());
                continue;
            }
            match best_direction(&h, &g) {
                Some(direction) => {
                    found.solved += 1;
                    found.directions.push(direction);
                }
                None => found.failed += 1,
            }
        }
    }
    found
}

/// H = \[V, top(X_0), top(X_1), ...\], reduced and scaled to largest entry 1.
fn steady_generators(plant: &Plant, reach: &Reach) -> DMatrix<f64> {
    let p = plant.outputs();
    let count = p + reach.generators.iter().map(DMatrix::ncols).sum::<usize>();
    let mut all = Matrix::with_capacity(p, count);
    all.append_diagonal(plant.noise_bound.as_slice());
    for generators in &reach.generators {
        all.append(&Matrix::from(&generators.rows(0, p).into_owned()));
    }
    Reducer::new(Reduction::Euclidean, p, count).reduce(&mut all, COLUMNS.max(p));
    let h = all.to_dense();
    let scale = h.amax();
    if scale > 0.0 { h / scale } else { h }
}

/// The unit vector along the w of the linear program for one g; `None` if the solver has none.
fn best_direction(h: &DMatrix<f64>, g: &DVector<f64>) -> Option<DVector<f64>> {
    let p = g.len();
    let mut program = LinearProgram::default();
    let w = program.add_variables(p);
    let tau = program.add_variables(h.ncols());
    for (i, value) in g.iter().enumerate() {
        program.add_cost(w + i, -value);
    }
    for (j, column) in h.column_iter().enumerate() {
        for sign in [1.0, -1.0] {
            let terms = column.iter().enumerate().map(|(i, value)| (w + i, sign * value));
            program.at_most(terms.chain([(tau + j, -1.0)]), 0.0);
        }
    }
    program.at_most((0..h.ncols()).map(|j| (tau + j, 1.0)), 1.0);
    let solution = program.solve().ok()?;
    let direction = DVector::from_column_slice(solution.values.get(w..w + p)?);
    let length = direction.norm();
    (length.is_finite() && length > 0.0 && direction.dot(g) > 0.0).then(|| direction / length)
}
