//! `vehicle_bank.json`: general C, isolation bank, three scenarios.

use crate::fixtures::{channel, dense, design, file, given, matrices, row_major, step};
use crate::support::{assert_close, numbers, rows};
use residual_diagnosis::{
    diagnoser::{Diagnoser, Verdict},
    reduced_order_observer::{ReducedOrderObserver, design::Design, options::ReducedOrderObserverOptions},
};
use serde_json::Value;

fn options(file: &Value) -> ReducedOrderObserverOptions {
    let mut options = ReducedOrderObserverOptions {
        model: matrices(&file["plant"]),
        ..ReducedOrderObserverOptions::default()
    };
    let bound = file["disturbance_abs"].as_f64().unwrap();
    let model = &mut options.model;
    model.initial_state_lower = numbers(&file["state_lower"]);
    model.initial_state_upper = numbers(&file["state_upper"]);
    model.disturbance_lower = vec![-bound];
    model.disturbance_upper = vec![bound];
    model.measurement_noise_bound = numbers(&file["noise_bound"]);
    let main = &file["main"];
    let mut options = given(options, &rows(&main["K"]), &rows(&main["M"]));
    options.bounds.rounding_tolerance = 1e-12;
    options.missing.max_width_ratio = 1e6;
    options.isolation.poles = numbers(&file["members"][0]["eig_F"]);
    options.isolation.fault_estimate = false;
    options
}

/// The design with the reference's test rows of the main observer.
fn vehicle(file: &Value) -> Design {
    let mut design = design(&options(file));
    design.main = design.main.with_tests(dense(&file["main"]["test_directions"]));
    design
}

#[test]
fn the_design_agrees() {
    let file = file("vehicle_bank.json");
    let design = vehicle(&file);
    let canonical = row_major(&design.plant.transformation);
    assert_close("T_c", &canonical, &numbers(&file["canonical_T"]), 1e-12);
    let main = &file["main"];
    let steady = design.main.steady();
    assert_close(
        "main",
        steady.as_slice(),
        &numbers(&main["threshold_steady"]),
        1e-8,
    );
    assert_eq!(design.isolation.members.len(), 2);
    for (i, (found, expected)) in design
        .isolation
        .members
        .iter()
        .zip(file["members"].as_array().unwrap())
        .enumerate()
    {
        assert_eq!(found.actuator, Some(i));
        assert_close("K", &row_major(&found.observer.k), &numbers(&expected["K"]), 1e-8);
        let mut poles: Vec<f64> = found
            .eigenvalues()
            .unwrap()
            .iter()
            .map(|value| value.re)
            .collect();
        poles.sort_by(f64::total_cmp);
        assert_close("eig F", &poles, &numbers(&expected["eig_F"]), 1e-8);
        let row = numbers(&expected["test_directions"]);
        let inner: f64 = found.tests.iter().zip(&row).map(|(a, b)| a * b).sum();
        assert!((inner.abs() - 1.0).abs() < 1e-12);
        let steady = found.steady();
        assert_close(
            "steady",
            steady.as_slice(),
            &numbers(&expected["threshold_steady"]),
            1e-8,
        );
        let other = 1 - i;
        let floors = found.set_floors();
        let expected = expected["fault_floor"][other].as_f64().unwrap();
        assert!((floors[other] / expected - 1.0).abs() < 1e-8, "{floors}");
        assert!(floors[i] > 1e6 * floors[other], "{floors}");
    }
}

#[test]
fn all_three_scenarios_agree_sample_by_sample() {
    let file = file("vehicle_bank.json");
    let design = vehicle(&file);
    let u = rows(&file["u"]);
    let main_rows = design.main.tests.nrows();
    for name in ["none", "steering_fault", "brake_fault"] {
        let scenario = &file["scenarios"][name];
        let y = rows(&scenario["y"]);
        let mut diagnoser = ReducedOrderObserver::new(&design).unwrap();
        let mut found: Vec<Vec<f64>> = vec![Vec::new(); 6];
        let (mut isolated_at, mut candidates) = (None, Vec::new());
        for k in 0..y.len() {
            let record = step(&mut diagnoser, &y[k], &u[k]);
            for channel in &record.channels()[..main_rows] {
                found[0].push(channel.residual);
                found[1].push(channel.upper);
            }
            let main = &record.channels()[..main_rows];
            found[2].push(f64::from(u8::from(
                main.iter().any(|channel| channel.ratio > 1.0),
            )));
            for i in 0..2 {
                let channel = channel(&diagnoser, &record, &format!("member_{i}_0"));
                found[3].push(channel.residual.abs());
                found[4].push(channel.upper);
                found[5].push(f64::from(u8::from(channel.ratio > 1.0)));
            }
            let left = (0..2).filter(|i| diagnoser.exonerated() & 1 << i == 0);
            candidates.push(left.map(|i| i as f64).collect::<Vec<_>>());
            if record.verdict() == Verdict::Isolated && isolated_at.is_none() {
                isolated_at = Some((k as u64, u64::from(record.certainly_faulty.trailing_zeros())));
            }
        }
        let flat = |key: &str| numbers(&scenario[key]);
        assert_close("main residual", &found[0], &flat("main_residual"), 1e-8);
        assert_close(
            "main threshold",
            &found[1],
            &numbers(&file["main_threshold"]),
            1e-8,
        );
        assert_close("main alarm", &found[2], &flat("main_alarm"), 0.0);
        let magnitudes: Vec<f64> = flat("member_residual").iter().map(|r| r.abs()).collect();
        assert_close("member residual", &found[3], &magnitudes, 1e-8);
        assert_close(
            "member threshold",
            &found[4],
            &numbers(&file["member_threshold"]),
            1e-8,
        );
        assert_close("member alarm", &found[5], &flat("member_alarm"), 0.0);
        for (k, expected) in scenario["candidates"].as_array().unwrap().iter().enumerate() {
            assert_eq!(candidates[k], numbers(expected), "{name} at {k}");
        }
        assert_eq!(
            isolated_at.map(|found| found.0),
            scenario["isolation_sample"].as_u64(),
            "{name}"
        );
        assert_eq!(
            isolated_at.map(|found| found.1),
            scenario["isolated"].as_u64(),
            "{name}"
        );
    }
}

#[test]
fn one_actuator_is_one_fault_of_the_description() {
    let file = file("vehicle_bank.json");
    let diagnoser = ReducedOrderObserver::new(&vehicle(&file)).unwrap();
    assert_eq!(diagnoser.description().faults, ["actuator_0", "actuator_1"]);
}
