//! Properties of the kernels on random systems (method sheet 8(b)).

use crate::kernels::matrix;
use crate::paper::paper_plant;
use crate::paper_facts::closed;
use crate::support::reference_of;
use nalgebra::{DMatrix, DVector};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use residual_diagnosis::{
    decomposition::{SingularDecomposition, eigenvalues},
    lyapunov,
    norms::{
        System, WindowConstants, h_infinity_continuous, h_infinity_discrete, h_minus_continuous,
        initial_error_gain_continuous,
    },
    riccati::{Covariances, care, dare},
    spectrum::spectral_radius,
};

fn random_matrix(generator: &mut ChaCha8Rng, rows: usize, columns: usize) -> DMatrix<f64> {
    DMatrix::from_fn(rows, columns, |_, _| generator.random_range(-1.0..=1.0))
}

#[test]
fn doubling_solves_both_equations_on_200_random_plants() {
    let mut generator = ChaCha8Rng::seed_from_u64(1);
    for round in 0..200 {
        let (n, q) = (2 + round % 11, 2 + round % 4);
        // Spectral radius 0.6 to 1.2: a third of them is unstable.
        let a = random_matrix(&mut generator, n, n);
        let a = &a * (generator.random_range(0.6..1.2) / spectral_radius(&a).unwrap().max(1e-3));
        let c = random_matrix(&mut generator, q, n);
        let (b, d) = (
            random_matrix(&mut generator, n, n + q),
            random_matrix(&mut generator, q, n + q),
        );
        let (q, s, r) = (&b * b.transpose(), &b * d.transpose(), &d * d.transpose());
        let noise = Covariances { q: &q, s: &s, r: &r };
        let (discrete, continuous) = (dare(&a, &c, noise).unwrap(), care(&a, &c, noise).unwrap());
        // The residual once more, from the equations themselves.
        let pi = &discrete.pi;
        let cross = &a * pi * c.transpose() + &s;
        let omega = &r + &c * pi * c.transpose();
        let rest =
            &a * pi * a.transpose() + &q - &cross * omega.try_inverse().unwrap() * cross.transpose() - pi;
        assert!(
            rest.amax() <= 1e-8 * pi.amax().max(q.amax()),
            "{round}: {}",
            rest.amax()
        );
        let pi = &continuous.pi;
        let cross = pi * c.transpose() + &s;
        let loss = &cross * r.clone().try_inverse().unwrap() * cross.transpose();
        let rest = &a * pi + pi * a.transpose() + &q - &loss;
        assert!(
            rest.amax() <= 1e-8 * loss.amax().max(q.amax()),
            "{round}: {}",
            rest.amax()
        );
        for solution in [discrete, continuous] {
            assert!(solution.residual <= 1e-8, "{round}: {}", solution.residual);
            let smallest = solution.pi.symmetric_eigenvalues().min();
            assert!(
                smallest >= -1e-9 * solution.pi.amax(),
                "{round}: Π is not positive semidefinite"
            );
        }
    }
}

#[test]
fn lyapunov_equations_of_200_random_stable_matrices_leave_no_residual() {
    let mut generator = ChaCha8Rng::seed_from_u64(11);
    for round in 0..200 {
        let n = 2 + round % 11;
        let a = random_matrix(&mut generator, n, n);
        let factor = random_matrix(&mut generator, n, n);
        let q = &factor * factor.transpose();
        let schur = &a * (generator.random_range(0.3..0.999) / spectral_radius(&a).unwrap());
        let x = lyapunov::discrete(&schur, &q).unwrap();
        assert!(
            (&schur * &x * schur.transpose() + &q - &x).amax() <= 1e-10 * x.amax(),
            "{round}"
        );
        let worst = eigenvalues(&a)
            .unwrap()
            .iter()
            .map(|pole| pole.re)
            .fold(f64::MIN, f64::max);
        let hurwitz = a - DMatrix::identity(n, n) * (worst + generator.random_range(0.001..1.0));
        let x = lyapunov::continuous(&hurwitz, &q).unwrap();
        let flow = &hurwitz * &x;
        assert!(
            (&flow + flow.transpose() + &q).amax() <= 1e-9 * flow.amax().max(q.amax()),
            "{round}"
        );
        for x in [
            lyapunov::discrete(&(schur * 4.0), &q),
            lyapunov::continuous(&-hurwitz, &q),
        ] {
            assert!(x.is_none(), "{round}: no solution of an unstable matrix");
        }
    }
}

#[test]
fn a_strongly_unstable_plant_with_one_output_is_still_solved() {
    // The doubling alone leaves a relative residual of 1e-3 here.
    let mut generator = ChaCha8Rng::seed_from_u64(5);
    let mut solved = 0;
    for _ in 0..100 {
        let (a, c) = (
            random_matrix(&mut generator, 4, 4) * 2.0,
            random_matrix(&mut generator, 1, 4),
        );
        let (b, d) = (
            random_matrix(&mut generator, 4, 5),
            random_matrix(&mut generator, 1, 5),
        );
        let (q, s, r) = (&b * b.transpose(), &b * d.transpose(), &d * d.transpose());
        // Whatever is accepted satisfies the equation; what is too ill-conditioned is refused.
        if let Ok(solution) = dare(&a, &c, Covariances { q: &q, s: &s, r: &r }) {
            assert!(solution.residual <= 1e-8);
            solved += 1;
        }
    }
    assert!(solved >= 90, "{solved}");
}

#[test]
fn every_stabilising_gain_obeys_the_limits_of_the_direct_terms() {
    let plant = paper_plant();
    let mut generator = ChaCha8Rng::seed_from_u64(2);
    let direct = SingularDecomposition::new(&plant.df);
    let mut seen = 0;
    while seen < 300 {
        let h = random_matrix(&mut generator, 2, 2) * 6.0;
        let stable = eigenvalues(&(&plant.a - &h * &plant.c))
            .unwrap()
            .iter()
            .all(|pole| pole.re < 0.0);
        if !stable {
            continue;
        }
        seen += 1;
        let identity = DMatrix::identity(2, 2);
        let fault = closed(&plant, &h, &identity, &plant.bf, &plant.df);
        let (largest, smallest) = (h_infinity_continuous(&fault), h_minus_continuous(&fault, None));
        assert!(largest.confirmed && smallest.confirmed);
        assert!(largest.value >= direct.largest() * (1.0 - 1e-9), "{h}");
        assert!(smallest.value <= direct.smallest() * (1.0 + 1e-9), "{h}");
        let disturbance = h_infinity_continuous(&closed(&plant, &h, &identity, &plant.bd, &plant.dd));
        let limit = SingularDecomposition::new(&plant.dd).largest();
        assert!(
            disturbance.value >= limit * (1.0 - 1e-9),
            "inf ‖T_rd‖ is σ_max(Dd): {h}"
        );
    }
}

#[test]
fn level_sets_agree_with_a_dense_grid_on_random_systems() {
    let mut generator = ChaCha8Rng::seed_from_u64(3);
    // Every combination of the dimensions once.
    for round in 0..66 {
        let (n, m) = (2 + round % 11, 1 + round % 3);
        let q = m + round % 2;
        let a = random_matrix(&mut generator, n, n) * 3.0;
        let worst = eigenvalues(&a)
            .unwrap()
            .iter()
            .map(|pole| pole.re)
            .fold(f64::MIN, f64::max);
        let system = System {
            a: a - DMatrix::identity(n, n) * (worst + 0.05),
            b: random_matrix(&mut generator, n, m),
            c: random_matrix(&mut generator, q, n),
            d: random_matrix(&mut generator, q, m),
        };
        let (mut low, mut high) = (f64::INFINITY, 0.0_f64);
        for i in 0..4000 {
            let omega = 1e-3 * 1e6_f64.powf(f64::from(i) / 3999.0);
            let response = system.response(nalgebra::Complex::new(0.0, omega)).unwrap();
            let values = SingularDecomposition::new(&response);
            low = low.min(values.smallest());
            high = high.max(values.largest());
        }
        let (largest, smallest) = (h_infinity_continuous(&system), h_minus_continuous(&system, None));
        assert!(largest.confirmed && smallest.confirmed, "{round}");
        assert!(
            high <= largest.upper && largest.upper - largest.lower <= 3e-10 * largest.value,
            "{round}"
        );
        assert!(smallest.lower <= low && smallest.upper - smallest.lower <= 3e-9 * smallest.value.max(1e-3));
        let (largest, smallest) = (largest.value, smallest.value);
        assert!(
            largest >= high * (1.0 - 1e-8) && largest <= high * 1.01,
            "{round}: {largest} {high}"
        );
        assert!(
            smallest <= low * (1.0 + 1e-8) && smallest >= low * 0.98 - 1e-4,
            "{round}: {smallest} {low}"
        );
    }
}

#[test]
fn the_printed_factor_of_the_initial_error_is_too_small() {
    // ‖T0‖∞ ‖e0‖ does not bound the initial response: x' = -3x has √λ_max(Wo) = 0.408 > ‖T0‖∞ = 0.333.
    let (a, one) = (
        DMatrix::from_element(1, 1, -3.0),
        DMatrix::from_element(1, 1, 1.0),
    );
    let gain = initial_error_gain_continuous(&a, &one).unwrap();
    assert!((gain - 1.0 / 6.0_f64.sqrt()).abs() < 1e-14);
    let printed = h_infinity_continuous(&System {
        a,
        b: one.clone(),
        c: one,
        d: DMatrix::zeros(1, 1),
    });
    assert!((printed.value - 1.0 / 3.0).abs() < 1e-12 && gain > printed.value);
}

/// Root energy of the last window for the worst input whose windows all have energy root 1, relative to γ + μ.
fn reached(system: &System, window: usize, earlier: usize) -> f64 {
    let (q, m) = system.d.shape();
    let mut impulse = vec![system.d.clone()];
    let mut carried = system.b.clone();
    for _ in 1..window * (earlier + 1) {
        impulse.push(&system.c * &carried);
        carried = &system.a * carried;
    }
    // Response of window 0 to window -j.
    let blocks: Vec<DMatrix<f64>> = (0..=earlier)
        .map(|j| {
            let mut block = DMatrix::zeros(q * window, m * window);
            for row in 0..window {
                for column in 0..window {
                    if let Some(delay) = (row + j * window).checked_sub(column) {
                        block
                            .view_mut((q * row, m * column), (q, m))
                            .copy_from(&impulse[delay]);
                    }
                }
            }
            block
        })
        .collect();
    let mut output = DVector::from_element(q * window, 1.0);
    let mut norm = 0.0;
    for _ in 0..200 {
        let parts = blocks.iter().map(|block| {
            let input = block.tr_mul(&output);
            let size = input.norm();
            if size > 0.0 {
                block * (input / size)
            } else {
                DVector::zeros(q * window)
            }
        });
        output = parts.fold(DVector::zeros(q * window), |sum, part| sum + part);
        norm = output.norm();
        output /= norm;
    }
    let memory = WindowConstants::new(&system.a, &system.b, &system.c, window)
        .unwrap()
        .memory;
    norm / (h_infinity_discrete(system).value + memory)
}

#[test]
fn the_worst_input_with_bounded_windows_comes_close_to_its_bound() {
    let plant = paper_plant();
    let sampled = plant.sample(0.01);
    let file = reference_of("hinf_filter", "paper_facts.json");
    for name in [
        "half_identity",
        "open_loop",
        "fault_cancelling",
        "literal_R_inv_Z_lemma1",
        "literal_R_inv_Z_printed",
    ] {
        let h = matrix(&file["gains"][name]["H"]);
        let l = plant.averaged_gain(&h, 0.01);
        let system = System {
            a: &sampled.ad - &l * &plant.c,
            b: &sampled.bdd - &l * &plant.dd,
            c: plant.c.clone(),
            d: plant.dd.clone(),
        };
        let reached = reached(&system, 100, 3);
        assert!((0.90..=1.0 + 1e-9).contains(&reached), "{name}: {reached}");
    }
}
