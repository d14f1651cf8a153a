//! The smallest trace of a positive semidefinite matrix under equalities.

use nalgebra::DMatrix;
use residual_synthesis::semidefinite::{SemidefiniteProgram, symmetric_blocks};

#[test]
fn the_nuclear_norm_is_half_the_smallest_trace_of_a_completion() {
    // ‖M‖_* = min (tr P + tr Q) / 2 with [P, M; M', Q] ⪰ 0; singular values 6, 3, 1 in rotated coordinates.
    let rotation = |order: usize, angle: f64| {
        let mut matrix = DMatrix::<f64>::identity(order, order);
        for i in 0..order - 1 {
            let mut step = DMatrix::identity(order, order);
            step[(i, i)] = angle.cos();
            step[(i, i + 1)] = -angle.sin();
            step[(i + 1, i)] = angle.sin();
            step[(i + 1, i + 1)] = angle.cos();
            matrix *= step;
        }
        matrix
    };
    let core = DMatrix::from_fn(4, 3, |i, j| if i == j { [6.0, 3.0, 1.0][i] } else { 0.0 });
    let given = &(rotation(4, 0.7) * core * rotation(3, -1.1));
    let mut problem = SemidefiniteProgram::new();
    let (p, q, m) = (problem.symmetric(4), problem.symmetric(3), problem.full(4, 3));
    problem.minimise_trace(p);
    problem.minimise_trace(q);
    problem.require("completion", move |at| {
        symmetric_blocks(&[vec![at.matrix(p), at.matrix(m)], vec![at.matrix(q)]])
    });
    problem.equal("given part", move |at| at.matrix(m) - given);
    let solution = problem.solve().unwrap();
    assert!((solution.run.objective / 2.0 - 10.0).abs() < 1e-7);
    assert!((solution.value(m) - given).amax() < 1e-8);
    assert!(solution.margin("given part").unwrap() > -1e-8);
}
