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

/// The reduction as it is written in the method: columns sorted by score, ties by the lower index.
fn plainly_reduced(full: &Matrix, kind: Reduction, order: usize) -> Vec<Vec<f64>> {
    let (n, count) = full.shape();
    let scale: Vec<f64> = (0..n)
        .map(|i| match (kind, absolute_sum(full.row(i))) {
            (Reduction::GirardScaled, radius) if radius > 0.0 => 1.0 / radius,
            _ => 0.0,
        })
        .collect();
    let score = |c: usize| {
        let (mut sum, mut largest) = (0.0, 0.0);
        for (i, scale) in scale.iter().enumerate() {
            match kind {
                Reduction::Euclidean => sum += full[(i, c)] * full[(i, c)],
                Reduction::GirardScaled => {
                    let size = full[(i, c)].abs() * scale;
                    sum += size;
                    largest = if size > largest { size } else { largest };
                }
            }
        }
        sum - largest
    };
    let mut ranking: Vec<usize> = (0..count).collect();
    ranking.sort_by(|a, b| score(*b).total_cmp(&score(*a)).then(a.cmp(b)));
    let (kept, boxed) = ranking.split_at_mut(order - n);
    kept.sort_unstable();
    boxed.sort_unstable();
    (0..n)
        .map(|i| {
            let mut row: Vec<f64> = kept.iter().map(|&c| full[(i, c)]).collect();
            row.resize(order, 0.0);
            row[order - n + i] = boxed.iter().map(|&c| full[(i, c)].abs()).sum();
            row
        })
        .collect()
}

#[test]
fn a_reduction_has_the_bits_of_the_sorted_one() {
    for n in 1..7 {
        for count in (n + 1..70).chain([127, 128, 129, 193]) {
            let mut full = Matrix::zeros(n, count);
            for i in 0..n {
                for c in 0..count {
                    // Repeated columns and columns along an axis have equal scores.
                    let place = if c % 5 == 4 { c - 4 } else { c };
                    let along_axis = c % 7 == 3 && i != c % n;
                    full[(i, c)] = match (along_axis, (i * 31 + place) % 29) {
                        (true, _) | (_, 11) => 0.0,
                        _ => ((count * 97 + i * 31 + place * 7) as f64).sin(),
                    };
                }
            }
            for kind in [Reduction::GirardScaled, Reduction::Euclidean] {
                let order = n.max(count * (1 + count % 4) / 5);
                let mut reduced = full.clone();
                Reducer::new(kind, n, count).reduce(&mut reduced, order);
                for (i, expected) in plainly_reduced(&full, kind, order).iter().enumerate() {
                    let bits = |row: &[f64]| row.iter().map(|value| value.to_bits()).collect::<Vec<_>>();
                    assert_eq!(
                        bits(reduced.row(i)),
                        bits(expected),
                        "{kind:?} {n} x {count} to {order}"
                    );
                }
            }
        }
    }
}
