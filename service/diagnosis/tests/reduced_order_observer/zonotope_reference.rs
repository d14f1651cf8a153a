//! `zonotope.json`: order reduction, the paper's recursion, membership.

use crate::fixtures::{dense, file, observer};
use crate::support::{assert_close, numbers, rows};
use nalgebra::{DMatrix, DVector};
use residual_diagnosis::{
    diagnoser::Diagnoser,
    matrix::Matrix,
    reduced_order_observer::{
        BaselineObserver,
        design::Design,
        directions::test_directions,
        options::{Gains, Mode, ModelOptions, ObserverM, ReducedOrderObserverOptions},
        plant::Plant,
    },
    zonotope::{Reducer, Reduction},
};

fn columns(matrix: &DMatrix<f64>) -> Vec<Vec<f64>> {
    let mut out: Vec<Vec<f64>> = matrix
        .column_iter()
        .map(|column| column.iter().copied().collect())
        .collect();
    out.sort_by(|left, right| left.partial_cmp(right).unwrap());
    out
}

#[test]
fn the_reduction_keeps_the_longest_columns_and_boxes_the_rest() {
    let reduction = &file("zonotope.json")["reduction"];
    let full = Matrix::from(&dense(&reduction["H"]));
    for (order, expected) in reduction["reduced"].as_object().unwrap() {
        let order: usize = order.parse().unwrap();
        let mut reduced = full.clone();
        Reducer::new(Reduction::Euclidean, 2, 7).reduce(&mut reduced, order);
        let expected = dense(expected);
        assert_eq!(reduced.shape(), expected.shape(), "order {order}");
        for (found, expected) in columns(&reduced.to_dense()).iter().zip(columns(&expected)) {
            assert_close(&format!("order {order}"), found, &expected, 1e-12);
        }
    }
}

/// The recursion with M = 0.8 rot(60°) is that of the paper's mode of a plant without hidden states.
fn recursion_options(mode: Mode, order: usize) -> ReducedOrderObserverOptions {
    let recursion = &file("zonotope.json")["recursion"];
    let m = rows(&recursion["M"]);
    let mut options = ReducedOrderObserverOptions {
        model: ModelOptions {
            a: m.clone(),
            b: vec![vec![1.0], vec![0.0]],
            c: vec![vec![1.0, 0.0], vec![0.0, 1.0]],
            d: rows(&recursion["D1"]),
            initial_state_lower: numbers(&recursion["initial_lower"]),
            initial_state_upper: numbers(&recursion["initial_upper"]),
            disturbance_lower: numbers(&recursion["disturbance_lower"]),
            disturbance_upper: numbers(&recursion["disturbance_upper"]),
            ..ModelOptions::default()
        },
        ..ReducedOrderObserverOptions::default()
    };
    options.bounds.mode = mode;
    options.bounds.generator_order = Some(order);
    options.bounds.rounding_tolerance = 1e-14;
    options.design.gains = Gains::Given;
    options.design.k = Some(vec![]);
    options.design.observer_m = ObserverM::Matrix(m);
    options
}

/// Centres and half widths of the bounds with samples that all miss but the first.
fn bounds(mode: Mode, order: usize, steps: usize) -> (Vec<f64>, Vec<f64>) {
    let mut diagnoser =
        BaselineObserver::new(&Design::new(&recursion_options(mode, order)).unwrap()).unwrap();
    let (mut centres, mut widths) = (Vec::new(), Vec::new());
    for _ in 0..steps {
        let y = diagnoser.observer_state().0.to_vec();
        let record = crate::fixtures::step(&mut diagnoser, &y, &[0.0]);
        for channel in &record.channels()[..2] {
            centres.push((channel.lower + channel.upper) / 2.0);
            widths.push((channel.upper - channel.lower) / 2.0);
        }
    }
    assert!(diagnoser.description().channels.len() == 3);
    (centres, widths)
}

#[test]
fn the_papers_recursion_agrees_for_every_order_and_the_interval_recursion_equals_the_smallest() {
    let recursion = &file("zonotope.json")["recursion"];
    let steps = recursion["center"].as_array().unwrap().len();
    for (order, expected) in recursion["half_width_by_order"].as_object().unwrap() {
        let (centres, widths) = bounds(Mode::Paper, order.parse().unwrap(), steps);
        assert_close("centre", &centres, &numbers(&recursion["center"]), 1e-9);
        // With order 10 two columns of one length 0.8^12 stand at the cut of k = 13: rounding decides there.
        let count = if order == "10" { 2 * 14 } else { widths.len() };
        assert_close(
            &format!("order {order}"),
            &widths[..count],
            &numbers(expected)[..count],
            1e-9,
        );
    }
    let (centres, widths) = bounds(Mode::Tiom, 2, steps);
    assert_close("centre", &centres, &numbers(&recursion["center"]), 1e-9);
    assert_close("interval", &widths, &numbers(&recursion["tiom_half_width"]), 1e-9);
}

#[test]
fn with_order_p_the_zonotope_diverges_although_m_is_schur_and_larger_orders_stay_near_the_exact_width() {
    let (_, boxed) = bounds(Mode::Paper, 2, 201);
    assert!(boxed[400] / boxed[0] > 1e8, "{}", boxed[400]);
    let (_, exact) = bounds(Mode::Paper, 400, 201);
    for (order, most) in [(5, 1.08), (20, 0.05), (40, 0.001)] {
        let (_, widths) = bounds(Mode::Paper, order, 201);
        let excess = widths[400] / exact[400] - 1.0;
        assert!(excess >= -1e-12 && excess < most, "{order}: {excess}");
    }
}

/// A plant without hidden states whose residual reaches the zonotope of H after one sample and no other.
fn plant_of(h: &DMatrix<f64>) -> Plant {
    let (p, count) = h.shape();
    let zero = vec![vec![0.0; p]; p];
    let unit = (0..p).map(|i| (0..p).map(|j| f64::from(u8::from(i == j))).collect());
    Plant::new(&ModelOptions {
        a: zero,
        b: vec![vec![1.0]; p],
        c: unit.collect(),
        d: h.row_iter().map(|row| row.iter().copied().collect()).collect(),
        initial_state_lower: vec![0.0; p],
        initial_state_upper: vec![0.0; p],
        disturbance_lower: vec![-1.0; count],
        disturbance_upper: vec![1.0; count],
        ..ModelOptions::default()
    })
    .unwrap()
}

#[test]
fn the_test_rows_decide_membership_as_the_linear_program_does() {
    for name in ["membership_2d", "membership_3d"] {
        let case = &file("zonotope.json")[name];
        let h = dense(&case["H"]);
        let (plant, p) = (plant_of(&h), h.nrows());
        let (_, reach) = observer(&plant, DMatrix::zeros(0, p), DMatrix::zeros(p, p));
        let tests = test_directions(&plant, &reach, true, &[], 1000);
        // Every facet of the reference is tested, with its support as threshold.
        let thresholds = reach.test_half_widths(&tests);
        let thresholds = thresholds.row(thresholds.nrows() - 1).transpose();
        let normals = dense(&case["facet_normals"]);
        for (normal, support) in normals.row_iter().zip(numbers(&case["support"])) {
            let row = tests
                .row_iter()
                .position(|row| row.dot(&normal).abs() > 1.0 - 1e-12);
            assert!((thresholds[row.unwrap()] - support).abs() < 1e-12 * support.max(1.0));
        }
        let gauges = numbers(&case["gauge"]);
        for (point, gauge) in rows(&case["points"]).into_iter().zip(gauges) {
            let image = &tests * DVector::from_vec(point);
            let found = image.component_div(&thresholds).amax();
            assert!((found - gauge).abs() < 1e-9, "{found} instead of {gauge}");
        }
    }
}
