//! `servo_noise_missing.json`: noise, lost samples, set test, state interval, fault estimate.

use crate::fixtures::{channel, design, file, given, matrices, step};
use crate::support::{assert_close, numbers, rows};
use residual_diagnosis::{
    diagnoser::flags,
    reduced_order_observer::{ReducedOrderObserver, design::Design, options::ReducedOrderObserverOptions},
};
use serde_json::Value;

fn options(file: &Value) -> ReducedOrderObserverOptions {
    let mut options = ReducedOrderObserverOptions {
        model: matrices(&file["plant"]),
        ..ReducedOrderObserverOptions::default()
    };
    let model = &mut options.model;
    model.initial_state_lower = numbers(&file["state_lower"]);
    model.initial_state_upper = numbers(&file["state_upper"]);
    model.disturbance_lower = numbers(&file["disturbance_lower"]);
    model.disturbance_upper = numbers(&file["disturbance_upper"]);
    model.measurement_noise_bound = numbers(&file["noise_bound"]);
    let mut options = given(options, &rows(&file["K"]), &rows(&file["M"]));
    options.bounds.generator_order = Some(file["generator_order"].as_u64().unwrap() as usize);
    options.bounds.rounding_tolerance = 1e-12;
    options.isolation.fault_bound = Some(vec![file["fault_observer"]["fault_bound"].as_f64().unwrap()]);
    options
}

/// The own test row that is the reference's row up to its sign, with that sign.
fn place(design: &Design, reference: &[f64]) -> (usize, f64) {
    let rows = design.main.tests.row_iter().enumerate();
    rows.map(|(i, row)| (i, row.iter().zip(reference).map(|(a, b)| a * b).sum::<f64>()))
        .find(|(_, inner)| inner.abs() > 1.0 - 1e-12)
        .unwrap_or_else(|| panic!("no row {reference:?} in {}", design.main.tests))
}

#[test]
fn every_number_and_every_alarm_of_the_run_agrees() {
    let file = file("servo_noise_missing.json");
    let design = design(&options(&file));
    let reference_rows = rows(&file["test_directions"]);
    assert_eq!(design.main.tests.nrows(), reference_rows.len());
    let places: Vec<_> = reference_rows.iter().map(|row| place(&design, row)).collect();
    let mut diagnoser = ReducedOrderObserver::new(&design).unwrap();
    let (y, u) = (rows(&file["y"]), numbers(&file["u"]));
    let expected = &file["expected"];
    let mut found: Vec<Vec<f64>> = vec![Vec::new(); 9];
    let mut hull_alarms = Vec::new();
    for (k, (y, u)) in y.iter().zip(u).enumerate() {
        let (z1, z2) = diagnoser.observer_state();
        if k > 0 {
            found[0].extend(z1);
            found[1].extend(z2);
        }
        let record = step(&mut diagnoser, y, &[u]);
        let mut alarm = false;
        for (row, (position, sign)) in places.iter().enumerate() {
            // The channel of r stands between the two groups of rows only in its place in a record.
            let channel = record.channels()[*position];
            found[2].push(f64::from(u8::from(channel.is_evaluated())));
            let tested = rows(&expected["tested"])[k][row] == 1.0;
            let ends = if *sign > 0.0 {
                (channel.lower, channel.upper)
            } else {
                (-channel.upper, -channel.lower)
            };
            let ends = if tested || k == 0 {
                ends
            } else {
                (f64::NAN, f64::NAN)
            };
            found[3].push(sign.signum() * channel.residual);
            found[4].push(ends.0);
            found[5].push(ends.1);
            alarm |= channel.ratio > 1.0;
        }
        found[6].push(f64::from(u8::from(alarm)));
        let interval = diagnoser.state_interval();
        let none = (&[f64::NAN; 3][..], &[f64::NAN; 3][..]);
        let (centre, radius) = interval.unwrap_or(none);
        if k <= 60 {
            found[7].extend(centre);
            found[8].extend(radius);
        }
        let hull = ["output_0", "output_1"].map(|name| channel(&diagnoser, &record, name).ratio);
        if hull.iter().any(|ratio| *ratio > 1.0) {
            hull_alarms.push(k as f64);
        }
        if alarm {
            assert_ne!(record.flags & flags::ALARM_NOW, 0);
        }
    }
    assert_close("ẑ1", &found[0], &numbers(&expected["z1_hat"])[2..], 1e-8);
    assert_close("ẑ2", &found[1], &numbers(&expected["z2_hat"])[1..], 1e-8);
    assert_close("tested", &found[2], &numbers(&expected["tested"]), 0.0);
    assert_close("residual", &found[3], &numbers(&expected["residual"]), 1e-8);
    let where_tested = |key: &str| {
        let all = numbers(&expected[key]).into_iter().zip(&found[2]).enumerate();
        let known = |(i, (value, tested)): (usize, (f64, &f64))| {
            if *tested == 1.0 || i < 6 { value } else { f64::NAN }
        };
        all.map(known).collect::<Vec<_>>()
    };
    assert_close("lower", &found[4], &where_tested("lower"), 1e-8);
    assert_close("upper", &found[5], &where_tested("upper"), 1e-8);
    assert_close("alarm", &found[6], &numbers(&expected["alarm"]), 0.0);
    // `null` stands for three numbers here.
    let triples = |key: &str| -> Vec<f64> {
        let entries = expected[key].as_array().unwrap()[..=60].iter();
        entries
            .flat_map(|entry| {
                if entry.is_null() {
                    vec![f64::NAN; 3]
                } else {
                    numbers(entry)
                }
            })
            .collect()
    };
    assert_close("x̂", &found[7], &triples("x_hat"), 1e-8);
    assert_close("radius", &found[8], &triples("x_radius"), 1e-8);
    assert_close(
        "hull alarms",
        &hull_alarms,
        &numbers(&expected["hull_alarm_samples"]),
        0.0,
    );
}

#[test]
fn the_fault_estimate_agrees_and_contains_the_fault_of_one_sample_ago() {
    let file = file("servo_noise_missing.json");
    let design = design(&options(&file));
    let [estimator] = design.isolation.estimators.as_slice() else {
        panic!("{:?}", design.warnings)
    };
    let observer = &file["fault_observer"];
    assert_close(
        "K",
        estimator.observer.k.as_slice(),
        &numbers(&observer["K"]),
        1e-12,
    );
    assert_close("φ", estimator.tests.as_slice(), &numbers(&observer["phi"]), 1e-12);
    let mut diagnoser = ReducedOrderObserver::new(&design).unwrap();
    let (y, u, f) = (rows(&file["y"]), numbers(&file["u"]), numbers(&file["f"]));
    let (mut estimates, mut radii) = (Vec::new(), Vec::new());
    for k in 0..y.len() {
        let record = step(&mut diagnoser, &y[k], &[u[k]]);
        let channel = channel(&diagnoser, &record, "fault_estimate_0");
        if channel.is_evaluated() {
            estimates.push(channel.residual);
            radii.push((channel.upper - channel.lower) / 2.0);
            assert!(channel.lower <= f[k - 1] && f[k - 1] <= channel.upper, "{k}");
        } else {
            estimates.push(f64::NAN);
            radii.push(f64::NAN);
        }
    }
    let expected = &file["expected"];
    assert_close(
        "estimate",
        &estimates,
        &numbers(&expected["fault_estimate"]),
        1e-8,
    );
    assert_close(
        "radius",
        &radii,
        &numbers(&expected["fault_estimate_radius"]),
        1e-8,
    );
}
