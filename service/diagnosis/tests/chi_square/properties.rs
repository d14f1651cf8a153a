//! Properties of method sheet 8(b).

use crate::common::{
    ALL, assert_near, diagnoser, longitudinal, quarter_car, scalar, square, step, without_calibration,
};
use crate::plant::{Draw, Plant, random_matrices, random_options};
use nalgebra::{DMatrix, DVector};
use residual_diagnosis::{
    chi_square::{
        ChiSquareDiagnoser, ChiSquareOptions, Schedule, StabilityGuard, Statistic, StatisticKind, StepModel,
    },
    diagnoser::{Diagnoser, StepRecord, Verdict},
};

/// A Kalman filter in covariance form (Joseph), by definition.
#[derive(Clone)]
struct Definition {
    x: DVector<f64>,
    p: DMatrix<f64>,
}

impl Definition {
    fn predict(&mut self, model: &StepModel, previous_input: &DVector<f64>) {
        let (phi, g) = (model.transition.to_dense(), model.noise_factor.to_dense());
        self.x = &phi * &self.x + model.input.to_dense() * previous_input;
        self.p = &phi * &self.p * phi.transpose() + &g * g.transpose();
    }

    fn correct(&mut self, model: &StepModel, input: &DVector<f64>, z: &[f64]) {
        let rows: Vec<usize> = (0..z.len()).filter(|i| z[*i].is_finite()).collect();
        if rows.is_empty() {
            return;
        }
        let h = model.measurement.to_dense().select_rows(&rows);
        let d = model.feedthrough.to_dense().select_rows(&rows);
        let r = model
            .measurement_noise
            .to_dense()
            .select_rows(&rows)
            .select_columns(&rows);
        let z = DVector::from_iterator(rows.len(), rows.iter().map(|i| z[*i]));
        let s = &h * &self.p * h.transpose() + &r;
        let gain = &self.p * h.transpose() * s.try_inverse().unwrap();
        self.x += &gain * (z - &h * &self.x - d * input);
        let joseph = DMatrix::identity(self.x.len(), self.x.len()) - &gain * h;
        self.p = &joseph * &self.p * joseph.transpose() + &gain * r * gain.transpose();
    }
}

/// β and T of a diagnoser against x_s - x̂ and P_s - P.
fn assert_difference(
    what: &str,
    (difference, factor): (&[f64], &residual_diagnosis::matrix::Matrix),
    propagator: &Definition,
    filter: &Definition,
) {
    let covariance = square(factor);
    for i in 0..difference.len() {
        let scale =
            |i: usize| propagator.p[(i, i)].sqrt() + propagator.x[i].abs() + filter.x[i].abs() + 1e-12;
        let expected = propagator.x[i] - filter.x[i];
        assert_near(
            || format!("{what} β_{i}"),
            difference[i],
            expected,
            0.0,
            1e-9 * scale(i),
        );
        for j in 0..difference.len() {
            let expected = propagator.p[(i, j)] - filter.p[(i, j)];
            let scale = (propagator.p[(i, i)] * propagator.p[(j, j)]).sqrt() + 1e-12;
            assert_near(
                || format!("{what} T_{i}{j}"),
                covariance[(i, j)],
                expected,
                0.0,
                1e-9 * scale,
            );
        }
    }
}

/// Steps over which a random system is compared: ten reset intervals of the pair.
const STEPS: usize = 30;
const RESET: usize = 3;

fn compare_with_definition(seed: u64) {
    let mut draw = Draw::new(seed);
    let shape = [
        1 + draw.below(6),
        1 + draw.below(4),
        draw.below(3),
        1 + draw.below(4),
    ];
    let models: Vec<StepModel> = (0..STEPS)
        .map(|_| StepModel::new(&random_matrices(&mut draw, shape), "").unwrap())
        .collect();
    let nominal = random_matrices(&mut draw, shape);
    let mut options = random_options(&mut draw, nominal, Schedule::External);
    options.statistics.window_steps = vec![1, 4, 10];
    options.statistics.two_propagator_reset_steps = RESET;
    let mut diagnoser = diagnoser(&options);
    let factor = diagnoser.covariance_factor().to_dense();
    let mut filter = Definition {
        x: DVector::from_column_slice(diagnoser.estimate()),
        p: &factor * factor.transpose(),
    };
    // The propagators started after each instant, 0 included.
    let mut started = vec![filter.clone()];
    let mut previous = DVector::zeros(shape[2]);
    for (i, model) in models.iter().enumerate() {
        let k = i + 1;
        let input = draw.normals(shape[2]);
        let lost = [0.0, 0.3, 1.0][draw.below(3)];
        let z: Vec<f64> = (0..shape[1])
            .map(|_| {
                if draw.chance(lost) {
                    f64::NAN
                } else {
                    2.0 * draw.normal()
                }
            })
            .collect();
        diagnoser.set_model(model).unwrap();
        step(&mut diagnoser, &z, input.as_slice());
        filter.predict(model, &previous);
        started
            .iter_mut()
            .for_each(|propagator| propagator.predict(model, &previous));
        filter.correct(model, &input, &z);
        previous = input;
        for steps in [1, 4, 10] {
            let found = diagnoser.outcome().window_difference(steps).unwrap();
            assert_difference(
                &format!("{seed} window {steps} at {k}"),
                found,
                &started[k.saturating_sub(steps)],
                &filter,
            );
        }
        let plain = diagnoser.difference(StatisticKind::StatePlain).unwrap();
        assert_difference(&format!("{seed} plain at {k}"), plain, &started[0], &filter);
        let begin = RESET * k.div_ceil(RESET).saturating_sub(2);
        let pair = diagnoser.difference(StatisticKind::StateTwoPropagator).unwrap();
        assert_difference(&format!("{seed} pair at {k}"), pair, &started[begin], &filter);
        started.push(filter.clone());
    }
}

#[test]
fn differences_are_propagator_minus_filter_on_random_time_varying_systems() {
    (0..150).for_each(compare_with_definition);
}

#[test]
fn statistics_have_their_mean_and_tail_without_fault() {
    const RUNS: u64 = 5000;
    let probability = 0.05;
    let mut options = without_calibration(quarter_car());
    options.statistics.enabled = ALL[..4].to_vec();
    options.statistics.decision = vec![StatisticKind::Residual];
    options.statistics.window_steps = vec![3, 9];
    options.statistics.two_propagator_reset_steps = 4;
    options.model.initial_covariance = (0..4)
        .map(|i| (0..4).map(|j| if i == j { 1e-4 } else { 0.0 }).collect())
        .collect();
    options.threshold.false_alarm_probability = probability;
    let mut diagnoser = diagnoser(&options);
    let thresholds = diagnoser.design().thresholds.residual.clone();
    let instants = [1, 2, 3, 25];
    // Sum of λ, of λ², exceedances, degrees; by instant and statistic.
    let mut sums = [[[0.0_f64; 4]; 5]; 4];
    for run in 0..RUNS {
        let mut plant = Plant::new(&options, run);
        diagnoser.reset();
        for k in 1..=25 {
            let u = [(k as f64 * 0.7).sin() * 100.0];
            let previous = if k == 1 {
                [0.0]
            } else {
                [((k - 1) as f64 * 0.7).sin() * 100.0]
            };
            step(&mut diagnoser, &plant.next(&previous, &u), &u);
            let Some(place) = instants.iter().position(|instant| *instant == k) else {
                continue;
            };
            let outcome = diagnoser.outcome();
            let mut windows = outcome.windows().map(|(_, window)| window);
            let statistics = [
                outcome.residual,
                outcome.plain,
                outcome.pair,
                windows.next().unwrap(),
                windows.next().unwrap(),
            ];
            for (sums, Statistic { value, degrees }) in sums[place].iter_mut().zip(statistics) {
                sums[0] += value;
                sums[1] += value * value;
                sums[2] += f64::from(u8::from(value > thresholds[degrees]));
                sums[3] += degrees as f64;
            }
        }
    }
    let runs = RUNS as f64;
    for (k, statistics) in instants.iter().zip(sums) {
        for (i, [sum, squares, beyond, degrees]) in statistics.into_iter().enumerate() {
            let (mean, degrees) = (sum / runs, degrees / runs);
            let error = ((squares / runs - mean * mean) / runs).sqrt();
            assert_near(|| format!("mean of {i} at {k}"), mean, degrees, 0.0, 4.0 * error);
            let error = (probability * (1.0 - probability) / runs).sqrt();
            assert_near(
                || format!("tail of {i} at {k}"),
                beyond / runs,
                probability,
                0.0,
                4.0 * error,
            );
        }
    }
}

/// Statistics of a run, for comparisons: every chi-square statistic, then ℓ and the sums.
fn statistics(diagnoser: &ChiSquareDiagnoser) -> (Vec<Statistic>, f64, Vec<f64>) {
    let outcome = diagnoser.outcome();
    let mut list = vec![outcome.residual, outcome.plain, outcome.pair];
    list.extend(outcome.windows().map(|(_, window)| window));
    (
        list,
        outcome.likelihood_ratio().map_or(0.0, |best| best.value),
        outcome.cusum.clone(),
    )
}

fn assert_same_statistics(what: &str, one: &ChiSquareDiagnoser, other: &ChiSquareDiagnoser) {
    let ((one, one_ratio, _), (other, other_ratio, _)) = (statistics(one), statistics(other));
    for (i, (one, other)) in one.iter().zip(&other).enumerate() {
        assert_eq!(one.degrees, other.degrees, "{what}: degrees of {i}");
        assert_near(|| format!("{what}: {i}"), other.value, one.value, 1e-8, 1e-8);
    }
    assert_near(|| format!("{what}: glr"), other_ratio, one_ratio, 1e-8, 1e-8);
}

/// A random constant model that the stability guard accepts: on others the plain test loses digits by its nature.
fn random_constant(draw: &mut Draw, shape: [usize; 4]) -> ChiSquareOptions {
    loop {
        let matrices = random_matrices(draw, shape);
        let mut options = random_options(draw, matrices, Schedule::Constant);
        options.glr.window_steps = 15;
        options.statistics.stability_guard = StabilityGuard::Refuse;
        if ChiSquareDiagnoser::new(&options).is_ok() {
            return options;
        }
    }
}

#[test]
fn units_of_the_states_and_the_order_of_the_sensors_change_nothing() {
    for seed in 0..20 {
        let mut draw = Draw::new(1000 + seed);
        let [n, m] = [2 + draw.below(4), 2 + draw.below(3)];
        let options = random_constant(&mut draw, [n, m, 1, 2]);
        let mut other = options.clone();
        let model = &mut other.model;
        let units: Vec<f64> = (0..n).map(|i| [1e-6, 1.0, 1e6][i % 3]).collect();
        let order: Vec<usize> = (0..m).rev().collect();
        for i in 0..n {
            for j in 0..n {
                model.transition[i][j] *= units[i] / units[j];
                model.initial_covariance[i][j] *= units[i] * units[j];
            }
            model.input[i].iter_mut().for_each(|value| *value *= units[i]);
            model.process_noise_input[i]
                .iter_mut()
                .for_each(|value| *value *= units[i]);
            model.measurement.iter_mut().for_each(|row| row[i] /= units[i]);
            model.initial_state.as_mut().unwrap()[i] *= units[i];
        }
        let permuted = |rows: &[Vec<f64>]| order.iter().map(|i| rows[*i].clone()).collect::<Vec<_>>();
        model.measurement = permuted(&model.measurement);
        model.feedthrough = permuted(&model.feedthrough);
        model.measurement_noise_covariance = permuted(&model.measurement_noise_covariance)
            .iter()
            .map(|row| order.iter().map(|i| row[*i]).collect())
            .collect();
        let (mut one, mut two) = (diagnoser(&options), diagnoser(&other));
        for k in 0..30 {
            let u = [draw.normal()];
            let z: Vec<f64> = (0..m)
                .map(|_| {
                    if draw.chance(0.1) {
                        f64::NAN
                    } else {
                        2.0 * draw.normal()
                    }
                })
                .collect();
            let records = [
                step(&mut one, &z, &u),
                step(&mut two, &order.iter().map(|i| z[*i]).collect::<Vec<_>>(), &u),
            ];
            assert_same_statistics(&format!("{seed} {k}"), &one, &two);
            let (_, _, one_sums) = statistics(&one);
            let (_, _, two_sums) = statistics(&two);
            for (place, sensor) in order.iter().enumerate() {
                assert_near(
                    || format!("{seed} {k} cusum"),
                    two_sums[place],
                    one_sums[*sensor],
                    1e-8,
                    1e-8,
                );
            }
            assert_eq!(records[0].verdict, records[1].verdict);
        }
    }
}

#[test]
fn a_rotation_of_the_measurement_changes_no_chi_square_statistic() {
    for seed in 0..20 {
        let mut draw = Draw::new(2000 + seed);
        let mut options = random_constant(&mut draw, [3, 2, 1, 2]);
        options.statistics.enabled.truncate(4);
        options.statistics.decision = vec![StatisticKind::Residual];
        let mut other = options.clone();
        let (sine, cosine) = (seed as f64 + 0.5).sin_cos();
        let rotation = DMatrix::from_row_slice(2, 2, &[cosine, -sine, sine, cosine]);
        let dense = |rows: &[Vec<f64>]| residual_diagnosis::tables::matrix("", rows).unwrap();
        let list = |matrix: DMatrix<f64>| {
            matrix
                .row_iter()
                .map(|row| row.iter().copied().collect())
                .collect::<Vec<Vec<f64>>>()
        };
        let model = &mut other.model;
        model.measurement = list(&rotation * dense(&model.measurement));
        model.feedthrough = list(&rotation * dense(&model.feedthrough));
        model.measurement_noise_covariance =
            list(&rotation * dense(&model.measurement_noise_covariance) * rotation.transpose());
        let (mut one, mut two) = (diagnoser(&options), diagnoser(&other));
        for k in 0..30 {
            let (u, z) = ([draw.normal()], draw.normals(2));
            step(&mut one, z.as_slice(), &u);
            step(&mut two, (&rotation * &z).as_slice(), &u);
            assert_same_statistics(&format!("{seed} {k}"), &one, &two);
        }
    }
}

#[test]
fn an_input_to_plant_and_model_changes_nothing() {
    for seed in 0..20 {
        let mut draw = Draw::new(3000 + seed);
        let options = random_constant(&mut draw, [3, 2, 2, 2]);
        let (mut one, mut two) = (diagnoser(&options), diagnoser(&options));
        let (mut quiet, mut driven) = (Plant::new(&options, seed), Plant::new(&options, seed));
        let mut previous = [0.0; 2];
        for k in 0..30 {
            let u = [3.0 * draw.normal(), 3.0 * draw.normal()];
            step(&mut one, &quiet.next(&[0.0; 2], &[0.0; 2]), &[0.0; 2]);
            step(&mut two, &driven.next(&previous, &u), &u);
            previous = u;
            assert_same_statistics(&format!("{seed} {k}"), &one, &two);
        }
    }
}

#[test]
fn a_value_that_is_not_finite_is_a_missing_one() {
    let options = longitudinal();
    let records = |bad: f64| {
        let mut diagnoser = diagnoser(&options);
        let z = |k: usize| {
            [
                if k.is_multiple_of(3) { bad } else { 0.1 * k as f64 },
                if k.is_multiple_of(7) { bad } else { 1.0 },
            ]
        };
        (0..60)
            .map(|k| step(&mut diagnoser, &z(k), &[0.1]))
            .collect::<Vec<StepRecord>>()
    };
    let expected = records(f64::NAN);
    for bad in [f64::INFINITY, f64::NEG_INFINITY] {
        for (one, other) in expected.iter().zip(records(bad)) {
            assert!(one.same_bits(&other), "{one:?}\n{other:?}");
        }
    }
}

#[test]
fn an_outage_leaves_no_residual_and_freezes_the_plain_statistic() {
    let mut options = longitudinal();
    options.model.initial_covariance = vec![vec![1.0, 0.0, 0.0], vec![0.0, 1.0, 0.0], vec![0.0, 0.0, 0.1]];
    let mut diagnoser = diagnoser(&options);
    for k in 0..20 {
        step(&mut diagnoser, &[f64::from(k) * 0.3, 1.0], &[0.5]);
    }
    let before = diagnoser.outcome().plain;
    for _ in 0..10 {
        let record = step(&mut diagnoser, &[f64::NAN, f64::NAN], &[0.5]);
        assert_eq!(record.verdict(), Verdict::NotEvaluated);
        assert_eq!(diagnoser.outcome().residual.degrees, 0);
        assert_eq!(diagnoser.outcome().plain.degrees, before.degrees);
        assert_near(
            || "λ".into(),
            diagnoser.outcome().plain.value,
            before.value,
            1e-8,
            0.0,
        );
    }
}

#[test]
fn a_noise_free_fault_is_identified_exactly() {
    for (sensor, mode, ramp, size) in [
        (0, 0, false, 3.0),
        (1, 1, false, -0.4),
        (0, 2, true, 0.2),
        (1, 3, true, 0.01),
    ] {
        let mut options = longitudinal();
        options.glr.window_steps = 120;
        options.model.initial_covariance = vec![vec![0.0; 3]; 3];
        let mut diagnoser = diagnoser(&options);
        let onset = 41;
        for k in 1..=100_i32 {
            let amplitude = match k - onset {
                age if age < 0 => 0.0,
                age if ramp => size * f64::from(age + 1),
                _ => size,
            };
            let mut z = [0.0; 2];
            z[sensor] = amplitude;
            step(&mut diagnoser, &z, &[0.0]);
        }
        let best = diagnoser.outcome().likelihood_ratio().unwrap();
        assert_eq!((best.mode, best.age), (mode, 59));
        assert_near(|| "size".into(), best.size, size, 1e-8, 0.0);
    }
}

#[test]
fn a_noise_free_process_fault_is_identified_exactly() {
    use residual_diagnosis::chi_square::Signature;
    let mut options = longitudinal();
    // A fault of the accelerometer enters like the input, negative.
    options.glr.signatures = vec![
        Signature::SensorStep,
        Signature::ProcessStep,
        Signature::ProcessRamp,
    ];
    options.glr.process_fault_input = vec![vec![0.005], vec![0.1], vec![0.0]];
    let mut diagnoser = diagnoser(&options);
    let (mut position, mut speed) = (0.0, 0.0);
    for k in 1..=60 {
        let acceleration = if k >= 31 { 0.7 } else { 0.0 };
        position += 0.1 * speed + 0.005 * acceleration;
        speed += 0.1 * acceleration;
        step(&mut diagnoser, &[position, speed], &[0.0]);
    }
    let best = diagnoser.outcome().likelihood_ratio().unwrap();
    assert_eq!((best.mode, best.age, diagnoser.modes().len()), (2, 29, 4));
    assert_near(|| "size".into(), best.size, 0.7, 1e-8, 0.0);
    assert_eq!(diagnoser.description().faults[2], "process_fault_0");
}

#[test]
fn an_outage_of_a_hundred_thousand_instants_is_survived() {
    let mut options = scalar(0.8);
    options = without_calibration(options);
    options.glr.window_steps = 10;
    let mut diagnoser = diagnoser(&options);
    for _ in 0..100_000 {
        assert_eq!(
            step(&mut diagnoser, &[f64::NAN], &[]).verdict(),
            Verdict::NotEvaluated
        );
    }
    assert_eq!(step(&mut diagnoser, &[0.0], &[]).verdict(), Verdict::Nominal);
}

#[test]
fn an_unstable_model_that_overflows_loses_the_guarantee_and_starts_anew() {
    let mut options = without_calibration(scalar(1.1));
    options.statistics.enabled = ALL.to_vec();
    options.statistics.stability_guard = StabilityGuard::Warn;
    options.glr.window_steps = 10;
    let mut diagnoser = diagnoser(&options);
    let mut lost = 0;
    for k in 0..20_000 {
        let record = step(&mut diagnoser, &[if k < 100 { 0.0 } else { f64::NAN }], &[]);
        lost += usize::from(record.verdict() == Verdict::GuaranteeLost);
    }
    assert!((1..5).contains(&lost), "{lost}");
    assert_eq!(step(&mut diagnoser, &[0.0], &[]).verdict(), Verdict::Nominal);
}
