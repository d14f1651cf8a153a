//! The reference runs: every statistic of an independent implementation.

use crate::common::{
    ALL, assert_near, diagnoser, file, longitudinal, only, quarter_car, scalar, square, step, steps_only,
    switched_quarter_car, without_calibration,
};
use crate::support::{integers, numbers, rows};
use residual_diagnosis::chi_square::{
    ChiSquareDiagnoser, Schedule, StabilityGuard, Statistic, StatisticKind, StepModel,
    chi_square_upper_quantile,
};
use serde_json::Value;

/// Relative tolerance of the sheet, and of the unstable run.
const RELATIVE: f64 = 1e-7;
const UNSTABLE: f64 = 1e-6;
const ABSOLUTE: f64 = 1e-9;

fn scalar_run(name: &str, a: f64, relative: f64) {
    let file = file(name);
    let mut options = steps_only(without_calibration(scalar(a)), 60);
    options.statistics.enabled = ALL.to_vec();
    options.statistics.window_steps = vec![10];
    options.statistics.stability_guard = StabilityGuard::Warn;
    let threshold = chi_square_upper_quantile(5e-3, 1);
    let measurement = numbers(&file["measurement_no_fault"]);
    for (scenario, expected) in file["scenarios"].as_object().unwrap() {
        let mut diagnoser = diagnoser(&options);
        let mut first = [None; 4];
        let mut count = [0; 4];
        let names = [
            "residual_chi_square",
            "state_chi_square_plain",
            "state_chi_square_window_10",
            "state_chi_square_two_propagator",
        ];
        for (i, z) in measurement.iter().enumerate() {
            let k = i as f64 + 1.0;
            let fault = match scenario.as_str() {
                "soft" if k >= 50.0 => 0.02 * (k - 50.0),
                "hard" if k >= 50.0 => 1.0,
                _ => 0.0,
            };
            step(&mut diagnoser, &[z + fault], &[]);
            let outcome = diagnoser.outcome();
            let window = outcome.windows().next().unwrap().1;
            let statistics = [outcome.residual, outcome.plain, window, outcome.pair];
            for (j, (statistic, name)) in statistics.into_iter().zip(names).enumerate() {
                let expected = expected[name][i].as_f64().unwrap();
                assert_eq!(statistic.degrees, 1);
                assert_near(
                    || format!("{scenario} {name} {k}"),
                    statistic.value,
                    expected,
                    relative,
                    ABSOLUTE,
                );
                if statistic.value > threshold {
                    first[j].get_or_insert(i as u64 + 1);
                    count[j] += 1;
                }
            }
            let ratio = outcome.likelihood_ratio().unwrap();
            for (name, found) in [("cusum", outcome.cusum[0].abs()), ("glr", ratio.value)] {
                // The run without fault has none of them.
                let Some(expected) = expected.get(name).map(|list| list[i].as_f64().unwrap()) else {
                    continue;
                };
                assert_near(
                    || format!("{scenario} {name} {k}"),
                    found,
                    expected,
                    relative,
                    ABSOLUTE,
                );
            }
            let covariances = &file["covariances"];
            let expected = |name: &str| covariances[name][i].as_f64().unwrap();
            let (_, window_factor) = outcome.window_difference(10).unwrap();
            let (_, plain_factor) = diagnoser.difference(StatisticKind::StatePlain).unwrap();
            let (_, _, s) = outcome.innovations().next().unwrap();
            for (name, found) in [
                ("filter_covariance", square(diagnoser.covariance_factor())[0]),
                ("innovation_covariance", s),
                ("plain_difference_covariance", square(plain_factor)[0]),
                ("window_10_difference_covariance", square(window_factor)[0]),
            ] {
                assert_near(|| format!("{name} {k}"), found, expected(name), relative, 0.0);
            }
        }
        for (j, name) in names.into_iter().enumerate() {
            assert_eq!(
                first[j],
                expected["first_alarm"][name].as_u64(),
                "{scenario} {name}"
            );
            assert_eq!(
                Some(count[j]),
                expected["alarm_count"][name].as_u64(),
                "{scenario} {name}"
            );
        }
        let best = diagnoser.outcome().likelihood_ratio().unwrap();
        let Some(last) = expected.get("glr_final") else {
            continue;
        };
        assert_eq!(
            measurement.len() as u64 - best.age,
            last["onset"].as_u64().unwrap()
        );
        for (found, name) in [
            (best.size, "size"),
            (best.standard_deviation, "size_standard_deviation"),
        ] {
            assert_near(
                || name.to_owned(),
                found,
                last[name].as_f64().unwrap(),
                relative,
                ABSOLUTE,
            );
        }
        let estimate = expected["final_state_estimate"].as_f64().unwrap();
        assert_near(
            || "estimate".to_owned(),
            diagnoser.estimate()[0],
            estimate,
            relative,
            ABSOLUTE,
        );
    }
}

#[test]
fn the_stable_scalar_run_agrees() {
    scalar_run("scalar_stable.json", 0.8, RELATIVE);
}

#[test]
fn the_unstable_scalar_run_agrees() {
    scalar_run("scalar_unstable.json", 1.1, UNSTABLE);
}

#[test]
fn the_marginal_scalar_run_agrees() {
    scalar_run("scalar_marginal.json", -1.0, RELATIVE);
}

/// A run of several states: compares everything the file has.
struct VectorRun {
    file: Value,
    first_alarm: Vec<(String, Option<u64>)>,
}

impl VectorRun {
    fn new(file: Value) -> Self {
        Self {
            file,
            first_alarm: Vec::new(),
        }
    }

    fn compare(&mut self, i: usize, diagnoser: &ChiSquareDiagnoser) {
        let outcome = diagnoser.outcome();
        let near = |name: &str, found: f64, expected: f64| {
            assert_near(
                || format!("{name} at {}", i + 1),
                found,
                expected,
                RELATIVE,
                ABSOLUTE,
            );
        };
        let windows = outcome
            .windows()
            .map(|(steps, window)| (format!("window_{steps}"), window));
        let mut statistics: Vec<(String, Statistic)> = windows.collect();
        statistics.push(("two_propagator".to_owned(), outcome.pair));
        statistics.push(("plain".to_owned(), outcome.plain));
        let mut named: Vec<_> = statistics
            .into_iter()
            .map(|(name, value)| {
                (
                    format!("state_chi_square_{name}"),
                    format!("state_dof_{name}"),
                    value,
                )
            })
            .collect();
        named.push((
            "residual_chi_square".to_owned(),
            "residual_dof".to_owned(),
            outcome.residual,
        ));
        let expected = &self.file["expected"];
        for (value_name, degrees_name, statistic) in named {
            assert_eq!(
                statistic.degrees as u64,
                expected[&degrees_name][i].as_u64().unwrap(),
                "{degrees_name} {i}"
            );
            near(
                &value_name,
                statistic.value,
                expected[&value_name][i].as_f64().unwrap(),
            );
            if statistic.degrees > 0
                && statistic.value > self.file["threshold_by_dof"][statistic.degrees].as_f64().unwrap()
                && !self.first_alarm.iter().any(|(name, _)| *name == value_name)
            {
                self.first_alarm.push((value_name, Some(i as u64 + 1)));
            }
        }
        for (row, expected) in numbers(&expected["cusum"][i]).into_iter().enumerate() {
            near("cusum", outcome.cusum[row].abs(), expected);
        }
        let best = outcome.likelihood_ratio();
        near(
            "glr",
            best.map_or(0.0, |best| best.value),
            expected["glr"][i].as_f64().unwrap(),
        );
        let onset = best.map(|best| i as u64 + 1 - best.age);
        assert_eq!(
            best.map(|best| best.mode as u64),
            expected["glr_best_mode"][i].as_u64(),
            "mode at {i}"
        );
        assert_eq!(onset, expected["glr_best_onset"][i].as_u64(), "onset at {i}");
        for (row, innovation, variance) in outcome.innovations() {
            near(
                "innovation",
                innovation,
                expected["innovation"][i][row].as_f64().unwrap(),
            );
            if let Some(expected) = expected["innovation_variance"].get(i) {
                near("innovation variance", variance, expected[row].as_f64().unwrap());
            }
        }
        if i.is_multiple_of(5) {
            let (difference, _) = outcome.window_difference(9).unwrap();
            for (found, expected) in difference
                .iter()
                .zip(numbers(&expected["difference_window_9"][i / 5]))
            {
                near("difference", *found, expected);
            }
            near(
                "size",
                best.map_or(0.0, |best| best.size),
                expected["glr_best_size"][i / 5].as_f64().unwrap_or(0.0),
            );
        }
        if i.is_multiple_of(10) {
            let covariance = square(diagnoser.covariance_factor());
            for (j, expected) in numbers(&expected["filter_covariance_diagonal"][i / 10])
                .into_iter()
                .enumerate()
            {
                near("P", covariance[(j, j)], expected);
            }
        }
        if let Some(expected) = expected["state_estimate"].get(i) {
            for (found, expected) in diagnoser.estimate().iter().zip(numbers(expected)) {
                near("estimate", *found, expected);
            }
        }
    }

    fn finish(&self, diagnoser: &ChiSquareDiagnoser) {
        let expected = &self.file["expected"];
        for (name, first) in expected["first_alarm"].as_object().unwrap() {
            let found = self.first_alarm.iter().find(|(other, _)| other == name);
            assert_eq!(found.and_then(|(_, k)| *k), first.as_u64(), "{name}");
        }
        let matrices = [
            ("filter_covariance_final", square(diagnoser.covariance_factor())),
            (
                "difference_covariance_window_9_final",
                square(diagnoser.outcome().window_difference(9).unwrap().1),
            ),
        ];
        for (name, found) in matrices {
            let expected = rows(&expected[name]);
            for (i, row) in expected.iter().enumerate() {
                for (j, value) in row.iter().enumerate() {
                    let scale = (expected[i][i] * expected[j][j]).sqrt();
                    assert_near(
                        || format!("{name} {i} {j}"),
                        found[(i, j)],
                        *value,
                        RELATIVE,
                        RELATIVE * scale,
                    );
                }
            }
        }
        for (found, expected) in diagnoser
            .estimate()
            .iter()
            .zip(numbers(&expected["state_estimate_final"]))
        {
            assert_near(
                || "final estimate".to_owned(),
                *found,
                expected,
                RELATIVE,
                ABSOLUTE,
            );
        }
        let best = diagnoser.outcome().likelihood_ratio().unwrap();
        let deviation = expected["glr_size_standard_deviation_final"].as_f64().unwrap();
        assert_near(
            || "deviation".to_owned(),
            best.standard_deviation,
            deviation,
            RELATIVE,
            ABSOLUTE,
        );
        // The best of both modes of each sensor.
        let by_mode = numbers(&expected["glr_by_mode_final"]);
        for sensor in 0..2 {
            let found = diagnoser.outcome().likelihood_ratio_of(sensor).unwrap().value;
            let expected = by_mode[sensor].max(by_mode[sensor + 2]);
            assert_near(|| format!("sensor {sensor}"), found, expected, RELATIVE, ABSOLUTE);
        }
    }
}

#[test]
fn the_longitudinal_run_with_outages_agrees() {
    let mut run = VectorRun::new(file("longitudinal_dropout.json"));
    let mut diagnoser = diagnoser(&longitudinal());
    let inputs = numbers(&run.file["known_input"]);
    for (i, z) in rows(&run.file["measurement"]).into_iter().enumerate() {
        step(&mut diagnoser, &z, &[inputs[i + 1]]);
        run.compare(i, &diagnoser);
    }
    run.finish(&diagnoser);
}

#[test]
fn the_switched_quarter_car_agrees_when_a_command_selects_the_model() {
    let mut run = VectorRun::new(file("quarter_car_switched.json"));
    let mut diagnoser = diagnoser(&switched_quarter_car());
    let inputs = numbers(&run.file["known_input"]);
    let schedule = integers(&run.file["model_schedule"]);
    for (i, z) in rows(&run.file["measurement"]).into_iter().enumerate() {
        step(&mut diagnoser, &z, &[inputs[i + 1], schedule[i] as f64]);
        run.compare(i, &diagnoser);
    }
    run.finish(&diagnoser);
}

#[test]
fn the_switched_quarter_car_agrees_when_matrices_are_given_at_every_instant() {
    let mut run = VectorRun::new(file("quarter_car_switched.json"));
    let mut options = quarter_car();
    options.model.schedule = Schedule::External;
    let mut diagnoser = diagnoser(&options);
    let models: Vec<StepModel> = switched_quarter_car()
        .models
        .iter()
        .map(|matrices| StepModel::new(matrices, "models").unwrap())
        .collect();
    let inputs = numbers(&run.file["known_input"]);
    let schedule = integers(&run.file["model_schedule"]);
    for (i, z) in rows(&run.file["measurement"]).into_iter().enumerate() {
        diagnoser.set_model(&models[schedule[i]]).unwrap();
        step(&mut diagnoser, &z, &[inputs[i + 1]]);
        run.compare(i, &diagnoser);
    }
    run.finish(&diagnoser);
}

#[test]
fn position_and_bias_in_extreme_units_keep_their_rank() {
    // Position in 1e-4 m, bias in 1e6 m/s²: T has a diagonal from 5e8 to 9e-15.
    let file = file("longitudinal_dropout.json");
    let units = [1e-4, 1.0, 1e6];
    let mut scaled = only(longitudinal(), StatisticKind::StateWindow);
    let mut plain = scaled.clone();
    let model = &mut scaled.model;
    for i in 0..3 {
        for j in 0..3 {
            model.transition[i][j] *= units[j] / units[i];
            model.initial_covariance[i][j] /= units[i] * units[j];
        }
        model.input[i].iter_mut().for_each(|value| *value /= units[i]);
        model.process_noise_input[i]
            .iter_mut()
            .for_each(|value| *value /= units[i]);
        model.measurement.iter_mut().for_each(|row| row[i] *= units[i]);
    }
    plain.statistics.window_steps = vec![9];
    scaled.statistics.window_steps = vec![9];
    let (mut scaled, mut plain) = (diagnoser(&scaled), diagnoser(&plain));
    let inputs = numbers(&file["known_input"]);
    for (i, z) in rows(&file["measurement"]).into_iter().enumerate() {
        step(&mut scaled, &z, &[inputs[i + 1]]);
        step(&mut plain, &z, &[inputs[i + 1]]);
        let of = |diagnoser: &ChiSquareDiagnoser| diagnoser.outcome().windows().next().unwrap().1;
        assert_eq!(of(&scaled).degrees, of(&plain).degrees);
        assert_near(
            || format!("{i}"),
            of(&scaled).value,
            of(&plain).value,
            1e-8,
            1e-10,
        );
    }
}
