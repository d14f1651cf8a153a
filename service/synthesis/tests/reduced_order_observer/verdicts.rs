//! The rank and zero test of method sheet 3.1 against the verdict of the paper's inequality, on random systems of which
//! half admit no observer.

use nalgebra::DMatrix;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use residual_diagnosis::reduced_order_observer::{
    decoupling::Decoupling,
    options::{ModelOptions, ReducedOrderObserverOptions},
    plant::Plant,
};
use residual_synthesis::reduced_order_observer::{find_gains, paper_inequality};

/// A system with q = p whose zeros are the eigenvalues of F, of modulus `slowest` at most and once; with `hidden` a
/// disturbance that the next output does not show instead.
fn system(seed: u64, slowest: f64, hidden: bool) -> ModelOptions {
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    let p = random.random_range(1..=2_usize);
    let nz = random.random_range(1..=3_usize);
    let n = p + nz;
    let mut matrix = |rows: usize, columns: usize| {
        DMatrix::from_fn(rows, columns, |_, _| random.random_range(-1.0..1.0_f64))
    };
    let mut f = matrix(nz, nz).lower_triangle() * 0.5;
    f.fill_diagonal(0.3);
    f[(0, 0)] = slowest;
    let (a11, a12, a21, k) = (matrix(p, p), matrix(p, nz), matrix(nz, p), matrix(nz, p));
    let mut d1 = matrix(p, p) * 0.3 + DMatrix::identity(p, p);
    if hidden {
        d1.column_mut(0).fill(0.0);
    }
    let mut a = DMatrix::zeros(n, n);
    a.view_mut((0, 0), (p, p)).copy_from(&a11);
    a.view_mut((0, p), (p, nz)).copy_from(&a12);
    a.view_mut((p, 0), (nz, p)).copy_from(&a21);
    a.view_mut((p, p), (nz, nz)).copy_from(&(f - &k * &a12));
    let mut d = DMatrix::zeros(n, p);
    d.rows_mut(0, p).copy_from(&d1);
    d.rows_mut(p, nz).copy_from(&-(k * &d1));
    if hidden {
        d[(n - 1, 0)] = 1.0;
    }
    let t = DMatrix::identity(n, n) + matrix(n, n) * 0.2;
    let inverse = t.clone().try_inverse().unwrap();
    let rows = |matrix: DMatrix<f64>| -> Vec<Vec<f64>> {
        matrix
            .row_iter()
            .map(|row| row.iter().copied().collect())
            .collect()
    };
    ModelOptions {
        a: rows(&inverse * a * &t),
        b: vec![vec![1.0]; n],
        c: rows(t.rows(0, p).into_owned()),
        d: rows(inverse * d),
        initial_state_lower: vec![-1.0; n],
        initial_state_upper: vec![1.0; n],
        disturbance_lower: vec![-1.0; p],
        disturbance_upper: vec![1.0; p],
        measurement_noise_bound: vec![0.01; p],
        ..ModelOptions::default()
    }
}

#[test]
fn the_rank_test_and_the_inequality_agree_on_all_of_48_random_systems() {
    for seed in 0..48 {
        let (feasible, slowest) = (seed % 2 == 0, 0.4 + 0.016 * seed as f64);
        // Infeasible ones by a slow zero or by a hidden disturbance.
        let hidden = seed % 4 == 1;
        let slowest = match (feasible, hidden) {
            (true, _) => slowest.min(0.8),
            (false, true) => 0.5,
            (false, false) => 1.03 + slowest / 2.0,
        };
        let model = system(seed, slowest, hidden);
        let plant = Plant::new(&model).unwrap();
        let by_rank = Decoupling::new(&plant, &plant.d);
        let by_inequality = paper_inequality::solve(&plant, 0.95);
        assert_eq!(by_rank.is_ok(), feasible, "{seed}: {by_rank:?}");
        assert_eq!(
            by_inequality.is_ok(),
            feasible,
            "{seed}: {:?}",
            by_inequality.err()
        );
        let options = ReducedOrderObserverOptions {
            model,
            ..ReducedOrderObserverOptions::default()
        };
        let found = find_gains(&options, 0.1, &mut |_| ());
        match found {
            Ok(found) => {
                assert!(feasible, "{seed}: {}", found.gains.main.source);
            }
            Err(refusal) => assert!(!feasible && refusal.key == "model.D", "{seed}: {refusal}"),
        }
    }
}
