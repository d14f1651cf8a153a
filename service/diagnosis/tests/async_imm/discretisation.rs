//! `discretisation.json` and the closed facts of method sheet 8(a).

use crate::fixture::{file, flat, plant};
use crate::support::{assert_close, numbers};
use nalgebra::DMatrix;
use residual_diagnosis::async_imm::{
    dyadic::DyadicTable,
    exact::discretise,
    inputs::InputHistory,
    interval::Interval,
    plant::{LinearPlant, Plant, PlantRates},
    propagator::Propagator,
};
use residual_diagnosis::matrix::Matrix;
use serde_json::Value;
use std::sync::Arc;

fn entries(matrix: &Matrix) -> Vec<f64> {
    flat(&matrix.to_dense())
}

fn columns(matrix: &Matrix, first: usize, count: usize) -> Vec<f64> {
    flat(&matrix.to_dense().columns(first, count).into_owned())
}

fn paper() -> LinearPlant {
    plant(&file("discretisation.json")["plants"]["paper"])
}

fn assert_interval(what: &str, case: &Value, interval: &Interval, tolerance: f64) {
    let channels = interval.gain.columns() - 1;
    assert_close(what, &entries(&interval.phi), &numbers(&case["Phi"]), tolerance);
    let input = columns(&interval.gain, 0, 1);
    assert_close(what, &input, &numbers(&case["input_term"]), tolerance);
    assert_close(
        what,
        &columns(&interval.gain, 1, channels),
        &numbers(&case["Xi"]),
        tolerance,
    );
    assert_close(
        what,
        &entries(&interval.omega),
        &numbers(&case["Omega"]),
        tolerance,
    );
}

#[test]
fn the_table_gives_the_reference_intervals_of_smooth_and_stiff_plants() {
    let file = file("discretisation.json");
    for case in file["time_invariant"].as_array().unwrap() {
        let name = case["plant"].as_str().unwrap();
        let data = &file["plants"][name];
        let mut propagator = Propagator::of_plant(&Plant::Constant(plant(data)), false);
        let commands = InputHistory::new(&numbers(&data["input"]), 0);
        let length = case["interval_us"].as_i64().unwrap();
        propagator.go(17, 17 + length, &commands);
        assert_interval(&format!("{name} {length}"), case, propagator.interval(), 1e-11);
    }
}

#[test]
fn an_amplitude_with_random_walk_gives_the_reference_intervals_of_the_filter_state() {
    let file = file("discretisation.json");
    for case in file["augmented_with_random_walk"].as_array().unwrap() {
        let data = &file["plants"][case["plant"].as_str().unwrap()];
        let channel = if case["mode"].as_str().unwrap().ends_with('2') {
            1
        } else {
            0
        };
        let channels = plant(data).f.ncols();
        let direction = DMatrix::from_fn(channels, 1, |i, _| {
            f64::from(u8::from(i == channel || channels == 1))
        });
        let density = numbers(&case["amplitude_random_walk_psd"]);
        let mut propagator = Propagator::of_mode(&Plant::Constant(plant(data)), &direction, &density, false);
        let commands = InputHistory::new(&numbers(&data["input"]), 0);
        propagator.go(0, case["interval_us"].as_i64().unwrap(), &commands);
        let interval = propagator.interval();
        assert_close(
            "Phi_bar",
            &entries(&interval.phi),
            &numbers(&case["Phi_bar"]),
            1e-12,
        );
        assert_close(
            "u_bar",
            &columns(&interval.gain, 0, 1),
            &numbers(&case["u_bar"]),
            1e-12,
        );
        assert_close(
            "Omega_bar",
            &entries(&interval.omega),
            &numbers(&case["Omega_bar"]),
            1e-11,
        );
    }
}

#[test]
fn the_papers_plant_has_the_printed_digits() {
    let interval = discretise(&paper(), 0.3);
    let gain = interval.gain.to_dense();
    let near =
        |value: f64, expected: f64, tolerance: f64| assert!((value - expected).abs() <= tolerance, "{value}");
    near(interval.phi[(0, 1)], 0.299820032397223, 1e-12);
    near(interval.phi[(0, 3)], -0.00899730032397905, 1e-12);
    near(gain[(0, 2)], -0.0449865016198953, 1e-12);
    near(gain[(2, 2)], -0.000899838013885268, 1e-12);
    let omega = discretise(&paper(), 0.5).omega;
    near(omega[(1, 1)], 0.005, 1e-13);
    near(omega[(0, 0)], 0.000416458382929613, 1e-13);
    near(omega[(0, 3)].abs(), 4.16458382929613e-5, 1e-13);
}

#[test]
fn intervals_form_a_semigroup() {
    let [short, middle, long] = [0.2, 0.5, 0.7].map(|h| discretise(&paper(), h));
    let (phi, omega) = (middle.phi.to_dense(), short.omega.to_dense());
    let composed = &phi * omega * phi.transpose() + middle.omega.to_dense();
    assert!((composed - long.omega.to_dense()).amax() < 1e-13);
}

#[test]
fn the_table_agrees_with_the_direct_form_to_rounding() {
    let stiff = plant(&file("discretisation.json")["plants"]["stiff"]);
    for (plant, tolerance) in [(paper(), 5e-15), (stiff, 1e-12)] {
        let mut table = DyadicTable::new(&plant);
        for microseconds in [1, 2, 3, 999, 65_537, 300_000, 777_777, 1_000_000] {
            let direct = discretise(&plant, microseconds as f64 * 1e-6);
            let composed = table.over(microseconds);
            for (one, other) in [
                (&composed.phi, &direct.phi),
                (&composed.gain, &direct.gain),
                (&composed.omega, &direct.omega),
            ] {
                assert_close(
                    &format!("{microseconds} µs"),
                    &entries(one),
                    &entries(other),
                    tolerance,
                );
            }
        }
    }
}

#[test]
fn a_stiff_plant_over_a_day_stays_finite_and_reaches_its_stationary_covariance() {
    let stiff = plant(&file("discretisation.json")["plants"]["stiff"]);
    let omega = discretise(&stiff, 86_400.0).omega.to_dense();
    let residual = &stiff.a * &omega + &omega * stiff.a.transpose() + &stiff.noise;
    assert!(residual.amax() < 1e-11, "{residual}");
}

/// The plant of the time-varying cases: a vehicle that accelerates.
fn vehicle(time: f64, _command: &[f64], rates: &mut PlantRates) {
    let v = 10.0 + 0.5 * time;
    let (m, iz, lf, lr, cf, cr) = (1500.0, 2500.0, 1.2, 1.4, 80_000.0, 90_000.0);
    let a = [
        [-(cf + cr) / (m * v), (lr * cr - lf * cf) / (m * v) - v],
        [
            (lr * cr - lf * cf) / (iz * v),
            -(lf * lf * cf + lr * lr * cr) / (iz * v),
        ],
    ];
    let b = [cf / m, lf * cf / iz];
    let f = [[cf / m, 0.0], [lf * cf / iz, 1000.0 / iz]];
    let q = [0.02 * (1.0 + 0.1 * time), 0.002 * (1.0 + 0.1 * time)];
    for i in 0..2 {
        rates.a.row_mut(i).copy_from_slice(&a[i]);
        rates.f.row_mut(i).copy_from_slice(&f[i]);
        rates.input[i] = b[i] * 0.02 * (0.8 * time).sin();
        rates.noise[(i, i)] = q[i];
    }
}

#[test]
fn a_plant_that_is_a_function_of_time_gives_the_reference_intervals() {
    let plant = Plant::Function {
        states: 2,
        inputs: 1,
        channels: 2,
        function: Arc::new(vehicle),
    };
    let mut propagator = Propagator::of_plant(&plant, false);
    let commands = InputHistory::new(&[0.0], 0);
    for case in file("discretisation.json")["time_varying"]["cases"]
        .as_array()
        .unwrap()
    {
        let (from, to) = (case["from_us"].as_i64().unwrap(), case["to_us"].as_i64().unwrap());
        propagator.go(from, to, &commands);
        assert_interval(&format!("{from}"), case, propagator.interval(), 2.4e-9);
    }
}

#[test]
fn a_random_walk_in_a_function_of_time_equals_the_constant_plant() {
    let constant = paper();
    let copy = constant.clone();
    let function = move |_: f64, command: &[f64], rates: &mut PlantRates| {
        for i in 0..4 {
            for j in 0..4 {
                rates.a[(i, j)] = copy.a[(i, j)];
                rates.noise[(i, j)] = copy.noise[(i, j)];
            }
            for j in 0..2 {
                rates.f[(i, j)] = copy.f[(i, j)];
            }
            rates.input[i] = (0..2).map(|j| copy.b[(i, j)] * command[j]).sum();
        }
    };
    let varying = Plant::Function {
        states: 4,
        inputs: 2,
        channels: 2,
        function: Arc::new(function),
    };
    let direction = DMatrix::from_row_slice(2, 1, &[0.0, 1.0]);
    let commands = InputHistory::with_changes(&[0.5, 0.5], &[(300_000_000, vec![-1.0, 2.0])]);
    let [one, other] = [Plant::Constant(constant), varying].map(|plant| {
        let mut propagator = Propagator::of_mode(&plant, &direction, &[0.3], false);
        propagator.go(100_000, 900_000, &commands);
        propagator.interval().clone()
    });
    assert_close("Phi", &entries(&other.phi), &entries(&one.phi), 1e-10);
    assert_close("input", &entries(&other.gain), &entries(&one.gain), 1e-10);
    assert_close("Omega", &entries(&other.omega), &entries(&one.omega), 1e-10);
}

#[test]
fn a_schedule_of_plants_is_split_at_its_changes() {
    let (first, mut second) = (paper(), paper());
    second.a *= 3.0;
    second.noise *= 2.0;
    let schedule = Plant::Schedule(vec![(0, first.clone()), (400_000_000, second.clone())]);
    let commands = InputHistory::new(&[0.5, 0.5], 0);
    let interval = |plant: &Plant, begin: i64, end: i64| {
        let mut propagator = Propagator::of_plant(plant, false);
        propagator.go(begin, end, &commands);
        propagator.interval().clone()
    };
    let whole = interval(&schedule, -50_000, 900_000);
    let before = interval(&Plant::Constant(first), -50_000, 400_000);
    let after = interval(&Plant::Constant(second), 400_000, 900_000);
    let (phi, omega) = (after.phi.to_dense(), before.omega.to_dense());
    let expected = &phi * omega * phi.transpose() + after.omega.to_dense();
    assert_close("Omega", &entries(&whole.omega), &flat(&expected), 1e-14);
    let gain = &phi * before.gain.to_dense() + after.gain.to_dense();
    assert_close("gain", &entries(&whole.gain), &flat(&gain), 1e-14);
    assert_close(
        "Phi",
        &entries(&whole.phi),
        &flat(&(&phi * before.phi.to_dense())),
        1e-14,
    );
}
