//! The bank of few states against the formulas of the sheet, written down with dense matrices, for every order.

use super::{
    design::{Form, ImmDesign, Mixing, Mode, ModeTransition, Prior, Sensor},
    interval::Interval,
    joseph::JosephSteps,
    mixing::Mixer,
    plant::{LinearPlant, Plant},
    sensor::SensorModel,
    small_bank::{SmallBank, small_bank},
    state::ModeState,
};
use crate::matrix::Matrix;
use nalgebra::{DMatrix, DVector};
use rand::{RngExt as _, SeedableRng as _};
use rand_chacha::ChaCha8Rng;

const ORDERS: std::ops::RangeInclusive<usize> = 1..=8;
const MODES: usize = 3;

fn matrix(draw: &mut ChaCha8Rng, rows: usize, columns: usize) -> DMatrix<f64> {
    DMatrix::from_fn(rows, columns, |_, _| draw.random_range(-1.0..1.0))
}

fn covariance(draw: &mut ChaCha8Rng, n: usize, spread: f64) -> DMatrix<f64> {
    let factor = matrix(draw, n, n) * spread;
    let product = &factor * factor.transpose() + DMatrix::identity(n, n) * 0.01;
    (&product + product.transpose()) / 2.0
}

fn sensor(draw: &mut ChaCha8Rng, rows: usize, states: usize, n: usize) -> (SensorModel, Sensor) {
    let sensor = Sensor {
        name: String::new(),
        // Some entries are zero, and with one state at least one row may be.
        measurement_matrix: matrix(draw, rows, states).map(|entry| if entry > 0.5 { 0.0 } else { entry }),
        noise_covariance: covariance(draw, rows, 0.3),
        arrival_probability: 1.0,
        initial_held_value: None,
    };
    (SensorModel::new(&sensor, n), sensor)
}

fn states(draw: &mut ChaCha8Rng, n: usize, spread: f64) -> Vec<ModeState> {
    let mut state = || ModeState {
        mean: (0..n).map(|_| draw.random_range(-2.0..2.0)).collect(),
        spread: Matrix::zeros(n, n),
    };
    let mut states: Vec<ModeState> = (0..MODES).map(|_| state()).collect();
    for state in &mut states {
        state.spread = Matrix::from(&covariance(draw, n, spread));
    }
    states
}

/// Puts moments into a bank: mixing with the weights of certainty takes them over.
fn load(bank: &mut dyn SmallBank, states: &[ModeState], slots: usize) {
    let mut mixer = mixer(states[0].mean.len(), slots, Mixing::All);
    let log_lambda = Matrix::from(&DMatrix::from_fn(MODES, MODES, |i, j| {
        if i == j { 0.0 } else { f64::NEG_INFINITY }
    }));
    mixer.weigh(&[(1.0_f64 / 3.0).ln(); MODES], &log_lambda, &mut [0.0; MODES]);
    bank.mix(states, &mixer);
}

fn mixer(n: usize, slots: usize, mixing: Mixing) -> Mixer {
    let nx = n - slots;
    let direction =
        |m: usize| DMatrix::from_fn(2, slots, |c, j| f64::from(u8::from(m > 0 && c == (m + j) % 2)));
    let modes = (0..MODES).map(|m| Mode {
        name: m.to_string(),
        direction: direction(m),
        random_walk_psd: vec![0.0; slots],
    });
    Mixer::new(&ImmDesign {
        plant: Plant::Constant(LinearPlant {
            a: DMatrix::zeros(nx, nx),
            b: DMatrix::zeros(nx, 0),
            f: DMatrix::zeros(nx, 2),
            noise: DMatrix::zeros(nx, nx),
        }),
        sensors: Vec::new(),
        modes: modes.collect(),
        prior: Prior {
            state: vec![0.0; nx],
            state_covariance: DMatrix::identity(nx, nx),
            amplitude: vec![0.25; slots],
            amplitude_covariance: DMatrix::from_fn(slots, slots, |i, j| if i == j { 4.0 } else { 0.5 }),
            mode_probability: vec![1.0 / 3.0; MODES],
        },
        transition: ModeTransition::PerStep(DMatrix::identity(MODES, MODES)),
        form: Form::Sequential,
        mixing,
    })
}

fn close(found: &DMatrix<f64>, expected: &DMatrix<f64>, tolerance: f64) {
    let error = (found - expected).amax();
    assert!(
        error <= tolerance * expected.amax().max(1e-3),
        "{error:e}: {found}{expected}"
    );
}

fn vector(values: &[f64]) -> DMatrix<f64> {
    DMatrix::from_column_slice(values.len(), 1, values)
}

#[test]
fn every_order_mixes_to_the_bits_of_the_general_form() {
    let mut draw = ChaCha8Rng::seed_from_u64(1);
    for (n, slots) in ORDERS.flat_map(|n| (0..n.min(3)).map(move |slots| (n, slots))) {
        for mixing in [Mixing::SharedChannel, Mixing::All] {
            let from = states(&mut draw, n, 1.0);
            let mut mixer = mixer(n, slots, mixing);
            let log_lambda = Matrix::from(&matrix(&mut draw, MODES, MODES).map(|entry| entry.abs().ln()));
            let log_mu = [-0.1, -2.0, f64::NEG_INFINITY];
            mixer.weigh(&log_mu, &log_lambda, &mut [0.0; MODES]);
            let (mut expected, mut found) = (from.clone(), from.clone());
            mixer.mix_moments(&from, &mut expected);
            let mut bank = small_bank(n, MODES, 1).unwrap();
            bank.mix(&from, &mixer);
            bank.store(&mut found);
            assert_eq!(found, expected, "n = {n}, {slots} slots");
        }
    }
}

#[test]
fn every_order_and_the_general_form_predict_as_the_formula_says() {
    let mut draw = ChaCha8Rng::seed_from_u64(2);
    for (n, slots) in (1..=12_usize).flat_map(|n| (0..n.min(3)).map(move |slots| (n, slots))) {
        let nx = n - slots;
        let interval = Interval {
            phi: Matrix::from(&matrix(&mut draw, nx, nx)),
            gain: Matrix::from(&matrix(&mut draw, nx, 3)),
            omega: Matrix::from(&covariance(&mut draw, nx, 0.5)),
        };
        let direction = matrix(&mut draw, 2, slots);
        let from = states(&mut draw, n, 1.0);
        let mut phi = DMatrix::identity(n, n);
        phi.view_mut((0, 0), (nx, nx)).copy_from(&interval.phi.to_dense());
        let xi = interval.gain.to_dense().columns(1, 2) * &direction;
        phi.view_mut((0, nx), (nx, slots)).copy_from(&xi);
        let (mut omega, mut shift) = (DMatrix::zeros(n, n), DMatrix::zeros(n, 1));
        omega
            .view_mut((0, 0), (nx, nx))
            .copy_from(&interval.omega.to_dense());
        shift
            .view_mut((0, 0), (nx, 1))
            .copy_from(&interval.gain.to_dense().column(0));
        let direction = Matrix::from(&direction);
        let mut found = from.clone();
        if let Some(mut bank) = small_bank(n, MODES, 1) {
            load(bank.as_mut(), &from, slots);
            // What another interval leaves behind must not matter.
            bank.prepare(&Interval::empty(n, 1));
            bank.prepare(&interval);
            (0..MODES).for_each(|m| bank.predict(m, &interval, &direction));
            bank.store(&mut found);
        } else {
            assert!(n > 8);
        }
        let mut general = from.clone();
        let mut steps = JosephSteps::new(MODES, n, 1);
        for (m, state) in general.iter_mut().enumerate() {
            steps.predict(&interval, &direction, state);
            let expected = &phi * from[m].spread.to_dense() * phi.transpose() + &omega;
            let mean = &phi * vector(&from[m].mean) + &shift;
            for result in [&*state, &found[m]].into_iter().take(if n > 8 { 1 } else { 2 }) {
                close(&result.spread.to_dense(), &expected, 1e-14);
                close(&vector(&result.mean), &mean, 1e-14);
            }
        }
    }
}

/// (I - KH) P (I - KH)' + K R K', x̂ + K e and log N(e; 0, S), as the sheet has them.
fn joseph(state: &ModeState, sensor: &Sensor, z: &[f64]) -> (DMatrix<f64>, DMatrix<f64>, f64) {
    let (n, d) = (state.mean.len(), z.len());
    let h = sensor.measurement_matrix.clone().resize_horizontally(n, 0.0);
    let p = state.spread.to_dense();
    let s = &h * &p * h.transpose() + &sensor.noise_covariance;
    let inverse = s.clone().try_inverse().unwrap();
    let gain = &p * h.transpose() * &inverse;
    let e = DVector::from_column_slice(z) - &h * DVector::from_column_slice(&state.mean);
    let left = DMatrix::identity(n, n) - &gain * &h;
    let covariance = &left * p * left.transpose() + &gain * &sensor.noise_covariance * gain.transpose();
    let quadratic = (e.transpose() * inverse * &e)[(0, 0)];
    let log = -0.5 * (d as f64 * std::f64::consts::TAU.ln() + quadratic + s.determinant().ln());
    (
        covariance,
        vector(&state.mean) + vector((&gain * &e).as_slice()),
        log,
    )
}

#[test]
fn every_order_and_the_general_form_update_as_josephs_formula_says() {
    let mut draw = ChaCha8Rng::seed_from_u64(3);
    for (n, d) in (1..=12_usize).flat_map(|n| (1..=6).map(move |d| (n, d))) {
        let slots = usize::from(n > 1);
        let from = states(&mut draw, n, 1.0);
        let (model, sensor) = sensor(&mut draw, d, n - slots, n);
        let z: Vec<f64> = (0..d).map(|_| draw.random_range(-3.0..3.0)).collect();
        let (mut found, mut general) = (from.clone(), from.clone());
        let mut steps = JosephSteps::new(MODES, n, 6);
        let mut bank = small_bank(n, MODES, 6);
        let mut logs = [None; MODES];
        if let Some(bank) = &mut bank {
            load(bank.as_mut(), &from, slots);
            assert!((0..MODES).all(|m| bank.innovate(m, &model, &z)));
            for (m, log) in logs.iter_mut().enumerate() {
                *log = Some(bank.update(m, &model));
            }
            bank.store(&mut found);
        }
        for (m, state) in general.iter_mut().enumerate() {
            let (covariance, mean, log) = joseph(&from[m], &sensor, &z);
            assert!(steps.innovate(m, state, &model, &z));
            let general_log = steps.update(m, state, &model);
            let results = [(&*state, Some(general_log)), (&found[m], logs[m])];
            for (result, found) in results.into_iter().filter_map(|(state, log)| Some((state, log?))) {
                close(&result.spread.to_dense(), &covariance, 1e-10);
                close(&vector(&result.mean), &mean, 1e-10);
                assert!((found - log).abs() < 1e-8 * log.abs().max(1.0), "{found} {log}");
                assert_eq!(result.spread, result.spread.transpose());
            }
        }
    }
}

/// P = σ² I, H = \[1 0 …\], R = 1: the exact posterior variance is σ²/(σ² + 1), and Joseph's form finds it.
#[test]
fn hardly_any_knowledge_before_leaves_a_sound_covariance() {
    for spread in [1e4, 1e8, 1e12, 1e15] {
        let n = 4;
        let mut state = states(&mut ChaCha8Rng::seed_from_u64(4), n, 1.0).remove(0);
        state.spread = Matrix::from(&DMatrix::from_fn(n, n, |i, j| {
            if i == j { spread } else { spread * (1.0 - 1e-3) }
        }));
        let sensor = Sensor {
            name: String::new(),
            measurement_matrix: DMatrix::from_row_slice(1, n, &[1.0, 0.0, 0.0, 0.0]),
            noise_covariance: DMatrix::identity(1, 1),
            arrival_probability: 1.0,
            initial_held_value: None,
        };
        let model = SensorModel::new(&sensor, n);
        let from = vec![state; MODES];
        let mut bank = small_bank(n, MODES, 1).unwrap();
        load(bank.as_mut(), &from, 1);
        let (mut found, mut general) = (from.clone(), from.clone());
        let mut steps = JosephSteps::new(MODES, n, 1);
        for (m, state) in general.iter_mut().enumerate() {
            assert!(bank.innovate(m, &model, &[1.0]) && steps.innovate(m, state, &model, &[1.0]));
            bank.update(m, &model);
            steps.update(m, state, &model);
        }
        bank.store(&mut found);
        let exact = spread / (spread + 1.0);
        for state in found.iter().chain(&general) {
            // 1 - K is known to rounding only: what is left of σ² is σ² ε² beside K² R.
            let (plain, ..) = joseph(&from[0], &sensor, &[1.0]);
            let allowed = 2.0 * (plain[(0, 0)] - exact).abs() + 1e-12;
            assert!(
                (state.spread[(0, 0)] - exact).abs() <= allowed,
                "{spread:e} {}",
                state.spread[(0, 0)]
            );
            assert!((0..n).all(|i| state.spread[(i, i)] >= 0.0));
        }
    }
}

#[test]
fn a_sample_without_a_factor_is_refused_by_every_order() {
    for n in ORDERS {
        let mut draw = ChaCha8Rng::seed_from_u64(5);
        let (model, _) = sensor(&mut draw, 2, n, n);
        let mut from = states(&mut draw, n, 1.0);
        let mut bank = small_bank(n, MODES, 2).unwrap();
        load(bank.as_mut(), &from, 0);
        assert!(bank.innovate(0, &model, &[0.0, 0.0]));
        assert!(!bank.innovate(0, &model, &[0.0, f64::NAN]));
        from[1].spread = Matrix::from(&(DMatrix::identity(n, n) * -1e6));
        load(bank.as_mut(), &from, 0);
        let seen = (0..n).any(|j| (0..2).any(|i| model.h[(i, j)] != 0.0));
        assert!(bank.innovate(0, &model, &[0.0, 0.0]));
        assert_eq!(bank.innovate(1, &model, &[0.0, 0.0]), !seen);
    }
}
