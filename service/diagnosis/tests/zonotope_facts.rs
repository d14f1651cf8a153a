//! Order reduction of zonotopes (method sheet 4.3, fact 5) and the reference `unit_cases`.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

mod support;

use residual_diagnosis::{
    matrix::{Matrix, absolute_sum, row_sums},
    zonotope::{Reducer, Reduction},
};
use support::*;

fn matrix(rows: &[Vec<f64>]) -> Matrix {
    let mut out = Matrix::zeros(rows.len(), rows[0].len());
    for (i, row) in rows.iter().enumerate() {
        out.row_mut(i).copy_from_slice(row);
    }
    out
}

/// The columns in a fixed order.
fn columns(matrix: &Matrix) -> Vec<Vec<f64>> {
    let mut out: Vec<Vec<f64>> = (0..matrix.columns())
        .map(|c| (0..matrix.rows()).map(|i| matrix[(i, c)]).collect())
        .collect();
    out.sort_by(|a, b| a.partial_cmp(b).unwrap());
    out
}

#[test]
fn the_reference_reductions_agree() {
    let unit = reference("unit_cases.json");
    let full = matrix(&rows(&unit["reduction"]["H"]));
    let cases = unit["reduction"]["cases"].as_array().unwrap();
    assert_eq!(cases.len(), 8);
    for case in cases {
        let kind: Reduction = serde_json::from_value(case["kind"].clone()).unwrap();
        let order = case["generator_order"].as_u64().unwrap() as usize;
        let mut reduced = full.clone();
        let boxed = Reducer::new(kind, 3, 9).reduce(&mut reduced, order);
        assert_eq!(boxed, order < 9);
        let expected = columns(&matrix(&rows(&case["reduced"])));
        for (found, expected) in columns(&reduced).iter().zip(&expected) {
            assert_close(&format!("{kind:?} {order}"), found, expected, 1e-12);
        }
    }
}

#[test]
fn no_support_shrinks_and_the_interval_hull_stays() {
    for trial in 0..200_usize {
        let (n, count) = (2 + trial % 4, 8 + trial % 17);
        let mut full = Matrix::zeros(n, count);
        for i in 0..n {
            for c in 0..count {
                full[(i, c)] =
                    ((trial * 97 + i * 31 + c * 7) as f64).sin() * 10.0_f64.powi((c % 5) as i32 - 2);
            }
        }
        for kind in [Reduction::GirardScaled, Reduction::Euclidean] {
            let mut reduced = full.clone();
            Reducer::new(kind, n, count).reduce(&mut reduced, n + 2);
            assert_eq!(reduced.columns(), n + 2);
            let mut radii = [vec![0.0; n], vec![0.0; n]];
            row_sums(&full, &mut radii[0]);
            row_sums(&reduced, &mut radii[1]);
            assert_close("hull", &radii[1], &radii[0], 1e-12);
            for direction in 0..50_usize {
                let weights: Vec<f64> = (0..n).map(|i| ((direction * 13 + i * 5) as f64).cos()).collect();
                let support = |matrix: &Matrix| {
                    let image: Vec<f64> = (0..matrix.columns())
                        .map(|c| (0..n).map(|i| weights[i] * matrix[(i, c)]).sum())
                        .collect();
                    absolute_sum(&image)
                };
                assert!(support(&reduced) >= support(&full) * (1.0 - 1e-12));
            }
        }
    }
}
