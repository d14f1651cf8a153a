//! Identification from simulated plants whose bounds are known.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use residual_diagnosis::model::{LinearModel, ModelOptions};
use residual_synthesis::identify::{
    Identification, IdentifyError, IdentifyOptions, NoiseSearch, RunData, StepOutcome, identify_bounds,
};

/// Exactly these noise scales, no margin, least rounding.
fn exactly(noise_scales: &[f64]) -> IdentifyOptions {
    IdentifyOptions {
        noise_scales: noise_scales.to_vec(),
        search: NoiseSearch::Common,
        margin: 0.0,
        significant_digits: 7,
        window: 5,
        ..IdentifyOptions::default()
    }
}

fn identify(
    options: &ModelOptions,
    training: &[RunData],
    validation: &[RunData],
    how: &IdentifyOptions,
) -> Result<Identification, IdentifyError> {
    let model = LinearModel::new(options, 0.1).unwrap();
    identify_bounds(&model, training, validation, how, &mut |_| ())
}

/// x⁺ = x + u + d, y = x.
fn integrator(noise: f64) -> ModelOptions {
    ModelOptions {
        a: vec![vec![1.0]],
        b: vec![vec![1.0]],
        c: vec![vec![1.0]],
        d: vec![vec![1.0]],
        disturbance_bound: vec![1.0],
        measurement_noise_bound: vec![noise],
        ..ModelOptions::default()
    }
}

/// y = slope * k for k = 0..=transitions, without commands.
fn ramp(name: &str, slope: f64, transitions: usize) -> RunData {
    RunData {
        name: name.to_owned(),
        commands: vec![vec![0.0]; transitions + 1],
        measurements: (0..=transitions).map(|k| vec![slope * k as f64]).collect(),
    }
}

/// Three states, two of them measured; the disturbance 0 acts on two states.
fn plant() -> ModelOptions {
    ModelOptions {
        a: vec![vec![0.9, 0.1, 0.0], vec![0.0, 0.8, 0.2], vec![0.0, -0.1, 0.95]],
        b: vec![vec![0.0, 0.5], vec![1.0, 0.0], vec![0.0, 0.3]],
        c: vec![vec![1.0, 0.0, 0.0], vec![0.0, 0.0, 1.0]],
        d: vec![vec![1.0, 0.0], vec![0.5, 0.0], vec![0.0, 1.0]],
        disturbance_bound: vec![0.05, 0.02],
        measurement_noise_bound: vec![0.02, 0.03],
        ..ModelOptions::default()
    }
}

/// A simulated run; disturbances and noise are drawn by `draw` from [-1, 1] and scaled by the bounds.
fn simulate(options: &ModelOptions, seed: u64, samples: usize, draw: fn(&mut ChaCha8Rng) -> f64) -> RunData {
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    let product = |matrix: &[Vec<f64>], vector: &[f64]| -> Vec<f64> {
        matrix
            .iter()
            .map(|row| row.iter().zip(vector).map(|(a, b)| a * b).sum())
            .collect()
    };
    let mut run = RunData {
        name: format!("seed {seed}"),
        ..RunData::default()
    };
    let mut x: Vec<f64> = options.a.iter().map(|_| random.random_range(-1.0..1.0)).collect();
    for _ in 0..samples {
        let u: Vec<f64> = options.b[0]
            .iter()
            .map(|_| random.random_range(-1.0..1.0))
            .collect();
        let d: Vec<f64> = options
            .disturbance_bound
            .iter()
            .map(|w| w * draw(&mut random))
            .collect();
        let noise = options
            .measurement_noise_bound
            .iter()
            .map(|v| v * draw(&mut random));
        run.measurements.push(
            product(&options.c, &x)
                .iter()
                .zip(noise)
                .map(|(y, v)| y + v)
                .collect(),
        );
        let parts = [
            product(&options.a, &x),
            product(&options.b, &u),
            product(&options.d, &d),
        ];
        x = (0..x.len())
            .map(|i| parts.iter().map(|part| part[i]).sum())
            .collect();
        run.commands.push(u);
    }
    run
}

fn uniform(random: &mut ChaCha8Rng) -> f64 {
    random.random_range(-1.0..=1.0)
}

fn vertex(random: &mut ChaCha8Rng) -> f64 {
    if random.random_bool(0.5) { 1.0 } else { -1.0 }
}

#[test]
fn the_smallest_disturbance_and_the_factor_of_a_ramp_are_exact() {
    let (transitions, slope, noise) = (20, 0.3, 0.25);
    let runs = [ramp("training", slope, transitions)];
    let found = identify(&integrator(noise), &runs, &runs, &exactly(&[1.0])).unwrap();
    let length = transitions as f64;
    let expected = (slope * length - 2.0 * noise) / length;
    let disturbance = found.best.bounds.disturbance[0];
    assert!(
        (disturbance / expected - 1.0).abs() < 1e-6,
        "{disturbance} {expected}"
    );

    let steeper = [ramp("steeper", 2.0 * slope, transitions)];
    let factor = identify(&integrator(noise), &runs, &steeper, &exactly(&[1.0]))
        .unwrap()
        .best
        .validation_factors[0];
    let expected = 2.0 * slope * length / (disturbance * length + 2.0 * noise);
    assert!((factor / expected - 1.0).abs() < 1e-6, "{factor} {expected}");
}

#[test]
fn bounds_never_exceed_the_true_ones_and_explain_their_own_runs() {
    let options = plant();
    for (seed, draw) in [(1, uniform as fn(&mut ChaCha8Rng) -> f64), (2, vertex)] {
        let runs: Vec<_> = (0..4)
            .map(|i| simulate(&options, 10 * seed + i, 60, draw))
            .collect();
        let found = identify(&options, &runs, &runs, &exactly(&[1.0])).unwrap();
        // The sum of the scales is minimal, one scale alone need not be.
        let scales: f64 = (0..2)
            .map(|j| found.best.bounds.disturbance[j] / options.disturbance_bound[j])
            .sum();
        assert!(scales <= 4.0, "{found}");
        assert_eq!(
            found.best.bounds.measurement.as_slice(),
            options.measurement_noise_bound
        );
        assert_eq!(found.best.inconsistent_validation_runs, 0, "{found}");
        assert!(
            found
                .best
                .validation_factors
                .iter()
                .all(|&factor| factor <= 1.0 + 1e-7),
            "{found}"
        );
    }
}

#[test]
fn vertex_disturbances_in_little_noise_are_recovered() {
    let mut options = plant();
    options.c = vec![vec![1.0, 0.0, 0.0], vec![0.0, 1.0, 0.0], vec![0.0, 0.0, 1.0]];
    options.measurement_noise_bound = vec![1e-4; 3];
    let runs: Vec<_> = (0..3).map(|seed| simulate(&options, seed, 60, vertex)).collect();
    let fresh: Vec<_> = (10..14)
        .map(|seed| simulate(&options, seed, 60, vertex))
        .collect();
    // The configured bounds are guesses here: only their ratio to the result changes.
    let guess = ModelOptions {
        disturbance_bound: vec![1.0, 0.001],
        ..options.clone()
    };
    let how = IdentifyOptions {
        margin: 0.02,
        ..exactly(&[1.0])
    };
    let found = identify(&guess, &runs, &fresh, &how).unwrap();
    for (bound, truth) in found
        .best
        .bounds
        .disturbance
        .iter()
        .zip(&options.disturbance_bound)
    {
        assert!((0.99..=1.03).contains(&(bound / truth)), "{found}");
    }
    assert_eq!(found.best.left_out_failures, Some(0), "{found}");
    assert_eq!(found.best.inconsistent_validation_runs, 0, "{found}");
}

#[test]
fn an_unstable_plant_is_identified_from_a_long_run() {
    let mut options = integrator(0.01);
    options.a = vec![vec![1.1]];
    let mut run = simulate(
        &ModelOptions {
            disturbance_bound: vec![0.02],
            ..options.clone()
        },
        5,
        1,
        uniform,
    );
    let mut random = ChaCha8Rng::seed_from_u64(6);
    let mut x = 0.0;
    (run.commands, run.measurements) = (Vec::new(), Vec::new());
    for _ in 0..1500 {
        let y: f64 = x + 0.01 * uniform(&mut random);
        run.measurements.push(vec![y]);
        run.commands.push(vec![-0.6 * y]);
        x = 1.1 * x - 0.6 * y + 0.02 * vertex(&mut random);
    }
    let found = identify(&options, &[run.clone()], &[run], &exactly(&[1.0])).unwrap();
    let bound = found.best.bounds.disturbance[0];
    assert!(bound <= 0.02 * (1.0 + 1e-6) && bound > 0.005, "{found}");
    assert_eq!(found.best.inconsistent_validation_runs, 0, "{found}");
}

#[test]
fn missing_measurements_never_enlarge_the_bound() {
    let options = plant();
    let whole = simulate(&options, 3, 60, vertex);
    let mut sparse = whole.clone();
    let mut random = ChaCha8Rng::seed_from_u64(4);
    for value in sparse.measurements.iter_mut().flatten() {
        if random.random_bool(0.3) {
            *value = f64::NAN;
        }
    }
    let sum = |run: RunData| -> f64 {
        let found = identify(&options, &[run], &[], &exactly(&[1.0])).unwrap();
        assert_eq!(found.best.left_out_failures, None);
        found
            .best
            .bounds
            .disturbance
            .iter()
            .zip(&options.disturbance_bound)
            .map(|(bound, w)| bound / w)
            .sum()
    };
    let (whole, sparse) = (sum(whole), sum(sparse));
    assert!(sparse <= whole * (1.0 + 1e-7) && sparse > 0.0, "{sparse} {whole}");
}

#[test]
fn a_missing_command_makes_two_runs_of_one() {
    let options = plant();
    let whole = simulate(&options, 7, 60, uniform);
    let part = |range: std::ops::Range<usize>| RunData {
        name: "part".to_owned(),
        commands: whole.commands[range.clone()].to_vec(),
        measurements: whole.measurements[range].to_vec(),
    };
    let parts = [part(0..25), part(25..60)];
    let mut interrupted = whole.clone();
    interrupted.commands[24][1] = f64::NAN;
    let found = identify(&options, &[interrupted], &[], &exactly(&[1.0])).unwrap();
    let separate = identify(&options, &parts, &[], &exactly(&[1.0])).unwrap();
    assert_eq!(found.best.bounds, separate.best.bounds);
}

#[test]
fn a_run_unlike_all_others_is_a_left_out_failure() {
    let runs = [ramp("a", 0.3, 20), ramp("b", 0.3, 20), ramp("c", 0.6, 20)];
    let how = IdentifyOptions {
        margin: 0.05,
        ..exactly(&[1.0])
    };
    let found = identify(&integrator(0.1), &runs, &[], &how).unwrap();
    assert_eq!(found.best.left_out_failures, Some(1));
    assert_eq!(found.best.deciding_runs, [Some(2)]);
    assert_eq!(
        identify(&integrator(0.1), &runs[..2], &[], &how)
            .unwrap()
            .best
            .left_out_failures,
        Some(0)
    );
}

#[test]
fn outputs_get_noise_scales_of_their_own() {
    // Two independent integrators; the noise of the first is guessed twenty times too large.
    let mut options = plant();
    options.a = vec![vec![1.0, 0.0], vec![0.0, 1.0]];
    (options.b, options.c, options.d) = (options.a.clone(), options.a.clone(), options.a.clone());
    options.disturbance_bound = vec![0.02, 0.02];
    options.measurement_noise_bound = vec![0.02, 0.08];
    let runs: Vec<_> = (0..3).map(|seed| simulate(&options, seed, 50, vertex)).collect();
    options.measurement_noise_bound = vec![0.4, 0.08];
    let how = exactly(&[0.05, 1.0]);
    let common = identify(&options, &runs, &[], &how).unwrap();
    let per_output = IdentifyOptions {
        search: NoiseSearch::PerOutput,
        ..how.clone()
    };
    let own = identify(&options, &runs, &[], &per_output).unwrap();
    assert_eq!(own.steps[own.chosen].noise_scales, [0.05, 1.0], "{own}");
    assert_eq!(own.best.bounds.measurement.as_slice(), [0.02, 0.08], "{own}");
    assert!(own.best.mean_floor < common.best.mean_floor, "{common}{own}");
}

#[test]
fn a_noise_bound_that_swallows_the_disturbance_is_only_chosen_when_no_failure_is_tolerated() {
    let runs = [ramp("a", 0.3, 20), ramp("b", 0.3, 20), ramp("c", 0.6, 20)];
    let chosen = |tolerated_left_out_failures| {
        let how = IdentifyOptions {
            tolerated_left_out_failures,
            ..exactly(&[1.0, 100.0])
        };
        let found = identify(&integrator(0.1), &runs, &[], &how).unwrap();
        (found.chosen, found.best.left_out_failures, found.best.mean_floor)
    };
    let (strict, tolerant) = (chosen(0), chosen(1));
    assert_eq!(
        (strict.0, strict.1, tolerant.0, tolerant.1),
        (1, Some(0), 0, Some(1))
    );
    assert!(tolerant.2 < strict.2);
}

#[test]
fn noise_scales_that_explain_nothing_are_listed_but_never_chosen() {
    let mut options = integrator(0.1);
    options.disturbance_bound = vec![0.0];
    let runs = [ramp("steep", 0.05, 20)];
    // Without disturbance the noise has to bridge half of the rise of 1.
    let found = identify(&options, &runs, &[], &exactly(&[1.0, 4.0, 6.0, 8.0])).unwrap();
    assert_eq!(found.steps[found.chosen].noise_scales, [6.0]);
    let StepOutcome::Infeasible { run, factor } = &found.steps[1].outcome else {
        panic!("{found}")
    };
    assert!(run == "steep" && (factor - 1.25).abs() < 1e-6, "{factor}");
    assert!(
        found.to_string().contains("none: run steep needs noise x 1.250"),
        "{found}"
    );

    let error = identify(&options, &runs, &[], &exactly(&[1.0, 4.0])).unwrap_err();
    assert!(
        matches!(error, IdentifyError::Infeasible { factor, .. } if (factor - 1.25).abs() < 1e-6),
        "{error}"
    );
}

#[test]
fn progress_counts_every_run_of_every_step() {
    let model = LinearModel::new(&integrator(0.1), 0.1).unwrap();
    let (training, validation) = ([ramp("a", 0.3, 9), ramp("b", 0.2, 9)], [ramp("c", 0.1, 9)]);
    let mut calls = Vec::new();
    let mut note = |progress: residual_synthesis::identify::Progress| {
        assert_eq!(progress.runs, 3);
        calls.push((progress.finished_steps, progress.runs_done));
    };
    identify_bounds(&model, &training, &validation, &exactly(&[1.0, 2.0]), &mut note).unwrap();
    assert_eq!(calls, [(0, 1), (0, 2), (0, 3), (1, 1), (1, 2), (1, 3)]);
}

#[test]
fn the_report_can_be_copied_into_a_configuration() {
    let found = identify(
        &integrator(0.1),
        &[ramp("a", 0.3, 20)],
        &[ramp("b", 0.9, 20)],
        &IdentifyOptions::default(),
    )
    .unwrap();
    let text = found.to_string();
    let lines: Vec<_> = text.lines().filter(|line| line.contains("_bound = ")).collect();
    let table: toml::Table = lines.join("\n").parse().unwrap();
    assert_eq!(
        table["disturbance_bound"][0].as_float(),
        Some(found.best.bounds.disturbance[0])
    );
    assert_eq!(
        table["measurement_noise_bound"][0].as_float(),
        Some(found.best.bounds.measurement[0])
    );
    assert!(text.contains("Validation run b exceeds the bounds"), "{text}");
}

#[test]
fn bad_input_is_refused_with_what_to_do() {
    let good = ramp("good", 0.3, 5);
    let refusal = |run: RunData| identify(&integrator(0.1), &[run], &[], &exactly(&[1.0])).unwrap_err();
    let cases = [
        (
            RunData {
                commands: vec![vec![0.0]; 5],
                ..good.clone()
            },
            "align both",
        ),
        (
            RunData {
                measurements: vec![vec![0.0, 1.0]; 6],
                ..good.clone()
            },
            "2 measurements, but the model has 1",
        ),
        (
            RunData {
                commands: vec![vec![]; 6],
                ..good.clone()
            },
            "0 commands, but the model has 1",
        ),
        (
            RunData {
                measurements: vec![vec![f64::INFINITY]; 6],
                ..good.clone()
            },
            "write NaN",
        ),
        (
            RunData {
                measurements: vec![vec![f64::NAN]; 6],
                ..good.clone()
            },
            "no transition",
        ),
        (
            RunData {
                commands: vec![vec![f64::NAN]; 6],
                ..good.clone()
            },
            "no transition",
        ),
        (
            RunData {
                commands: vec![],
                measurements: vec![],
                ..good.clone()
            },
            "no transition",
        ),
    ];
    for (run, expected) in cases {
        let message = refusal(run).to_string();
        assert!(
            message.contains("run good") && message.contains(expected),
            "{message}"
        );
    }
    let error = identify(&integrator(0.1), &[], &[], &exactly(&[1.0])).unwrap_err();
    assert_eq!(error, IdentifyError::NoTrainingRuns);
    let error = identify(
        &integrator(0.0),
        std::slice::from_ref(&good),
        &[],
        &exactly(&[1.0]),
    )
    .unwrap_err();
    assert_eq!(error, IdentifyError::NoNoiseBound { output: 0 });
    let options = [
        IdentifyOptions {
            noise_scales: vec![],
            ..exactly(&[1.0])
        },
        exactly(&[1.0, 0.0]),
        IdentifyOptions {
            margin: -0.1,
            ..exactly(&[1.0])
        },
        IdentifyOptions {
            significant_digits: 0,
            ..exactly(&[1.0])
        },
        IdentifyOptions {
            window: 0,
            ..exactly(&[1.0])
        },
    ];
    for (how, name) in options.iter().zip([
        "noise_scales",
        "noise_scales",
        "margin",
        "significant_digits",
        "window",
    ]) {
        let error = identify(&integrator(0.1), std::slice::from_ref(&good), &[], how).unwrap_err();
        assert!(
            matches!(error, IdentifyError::InvalidOption { option, .. } if option == name),
            "{error}"
        );
    }
    let long = IdentifyOptions {
        window: 6,
        ..exactly(&[1.0])
    };
    let error = identify(&integrator(0.1), std::slice::from_ref(&good), &[], &long).unwrap_err();
    assert_eq!(
        error,
        IdentifyError::WindowTooLong {
            window: 6,
            longest: 5
        }
    );
    let mut invisible = integrator(0.1);
    invisible.b = vec![vec![0.0]];
    let error = identify(&invisible, &[good], &[], &exactly(&[1.0])).unwrap_err();
    assert_eq!(error, IdentifyError::NothingDetectable { window: 5 });
}
