//! Free entries.

use crate::simulation::{runs, simulate};
use nalgebra::{DMatrix, dmatrix};
use residual_diagnosis::discretise::matrix_exponential;
use residual_synthesis::identify::model::{
    IdentifiedModel, ModelIdentificationError, Plant, Structure, StructureOptions, identify_model,
};
use residual_synthesis::identify::{IdentifyError, RunData};

fn structure(text: &str, sample_time_s: f64, outputs: usize, commands: usize) -> Structure {
    let options: StructureOptions = toml::from_str(text).unwrap();
    Structure::new(&options, sample_time_s, outputs, commands).unwrap()
}

/// A car: yaw rate with lag a, heading that integrates the new yaw rate, speed with lag c.
fn car(a: f64, b: f64, c: f64, e: f64) -> Plant {
    Plant {
        a: dmatrix![a, 0.0, 0.0; 0.025 * a, 1.0, 0.0; 0.0, 0.0, c],
        b: dmatrix![b, 0.0; 0.025 * b, 0.0; 0.0, e],
        c: dmatrix![0.0, 1.0, 0.0; 0.0, 0.0, 1.0],
        feedthrough: DMatrix::zeros(2, 2),
        disturbance: dmatrix![1.0, 0.0; 0.025, 0.0; 0.0, 1.0],
    }
}

const CAR: &str = r#"
    A = [["a", 0, 0], ["0.025 * a", 1, 0], [0, 0, "free"]]
    B = [["b", 0], ["0.025 * b", 0], [0, { start = 0.05, lower = 0 }]]
    C = [[0, 1, 0], [0, 0, 1]]
    D = [[1, 0], [0.025, 0], [0, 1]]
    initial_state_radius = [2, 2, 2]
    parameters = { a = { lower = 0, upper = 1 }, b = {} }
"#;

/// Standard deviations of the disturbances and of the noise of the simulated car.
const CAR_NOISE: ([f64; 2], [f64; 2]) = ([0.02, 0.01], [0.004, 0.02]);

fn car_runs(seed: u64, count: u64, samples: usize) -> Vec<RunData> {
    let ([q0, q1], [r0, r1]) = CAR_NOISE;
    let truth = car(0.87, 0.13, 0.92, 0.08);
    runs(
        &truth,
        &dmatrix![q0, 0.0; 0.0, q1],
        &dmatrix![r0, 0.0; 0.0, r1],
        seed,
        count,
        samples,
    )
}

fn value(model: &IdentifiedModel, name: &str) -> (f64, f64) {
    let found = model
        .parameters
        .iter()
        .find(|parameter| parameter.name == name)
        .unwrap();
    (found.value, found.standard_error)
}

#[test]
fn confidence_intervals_of_a_car_contain_the_truth_as_often_as_they_should() {
    let truth = [("a", 0.87), ("b", 0.13), ("A[2][2]", 0.92), ("B[2][1]", 0.08)];
    let (mut within, mut all, mut squares) = (0, 0, 0.0);
    for seed in 0..10 {
        let found = identify_model(&structure(CAR, 0.025, 2, 2), &car_runs(seed, 4, 100), &[]).unwrap();
        let ([q0, q1], [r0, r1]) = CAR_NOISE;
        let noise = found
            .noise
            .iter()
            .zip([q0, q1, r0, r1])
            .map(|(found, truth)| (found.value - truth.ln()) / found.standard_error);
        let entries = truth.map(|(name, truth)| {
            let (value, error) = value(&found, name);
            (value - truth) / error
        });
        for z in entries.into_iter().chain(noise) {
            within += u32::from(z.abs() < 1.96);
            squares += z * z;
            all += 1;
        }
        assert!((found.training.normalised_square - 1.0).abs() < 0.02, "{found:?}");
        assert!(!found.is_overfitted());
    }
    // 80 intervals of 95 %: 76 on average, fewer than 69 once in 1,000 batches.
    assert!(all == 80 && within >= 69, "{within} of {all}");
    let mean_square = squares / f64::from(all);
    assert!((0.65..1.5).contains(&mean_square), "{mean_square}");
}

/// dx/dt of a servo: position, speed, current.
fn servo_matrices(friction: f64, torque: f64, gain: f64) -> (DMatrix<f64>, DMatrix<f64>) {
    (
        dmatrix![0.0, 1.0, 0.0; 0.0, -friction, torque; 0.0, -1.0, -12.0],
        dmatrix![0.0; 0.0; gain],
    )
}

#[test]
fn a_continuous_servo_is_found_with_exact_discretisation() {
    let (period, truth) = (0.05, (2.0, 6.0, 10.0));
    let (a, b) = servo_matrices(truth.0, truth.1, truth.2);
    let mut augmented = DMatrix::zeros(5, 5);
    augmented.view_mut((0, 0), (3, 3)).copy_from(&a);
    augmented.view_mut((0, 3), (3, 1)).copy_from(&b);
    augmented[(1, 4)] = 1.0;
    let exponential = matrix_exponential(&(augmented * period));
    let plant = Plant {
        a: exponential.view((0, 0), (3, 3)).into_owned(),
        b: exponential.view((0, 3), (3, 1)).into_owned(),
        c: dmatrix![1.0, 0.0, 0.0],
        feedthrough: DMatrix::zeros(1, 1),
        disturbance: exponential.view((0, 4), (3, 1)).into_owned(),
    };
    let training = runs(&plant, &dmatrix![0.5], &dmatrix![0.01], 7, 5, 200);
    // Torque and gain only show as a product in the position, and the current's decay is known.
    let text = r#"
        time = "continuous"
        A = [[0, 1, 0], [0, "-friction", 6], [0, -1, -12]]
        B = [[0], [0], [{ start = 1 }]]
        C = [[1, 0, 0]]
        D = [[0], [1], [0]]
        initial_state_radius = [2, 2, 2]
        parameters = { friction = { start = 1, lower = 0 } }
    "#;
    let found = identify_model(&structure(text, period, 1, 1), &training, &training[..1]).unwrap();
    for (name, truth) in [("friction", truth.0), ("B[2][0]", truth.2)] {
        let (value, error) = value(&found, name);
        assert!(
            (value - truth).abs() < 3.0 * error && error < 0.1 * truth,
            "{name} {value} {error}"
        );
    }
    let (friction, gain) = (value(&found, "friction").0, value(&found, "B[2][0]").0);
    let (a, b) = servo_matrices(friction, 6.0, gain);
    assert!((&found.matrices.a - a).amax() < 1e-6 && (&found.matrices.b - b).amax() < 1e-6);
    assert!((&found.plant.a - &plant.a).amax() < 0.02, "{}", found.plant.a);
    assert!(found.validation.unwrap().elements > 150);
}

#[test]
fn without_noise_in_the_states_the_entries_are_found_to_the_noise_of_the_measurement() {
    let truth = Plant {
        a: dmatrix![0.9, 0.2; -0.3, 0.7],
        b: dmatrix![0.0; 1.0],
        c: dmatrix![1.0, 0.0],
        feedthrough: dmatrix![0.5],
        disturbance: DMatrix::zeros(2, 0),
    };
    let training = runs(&truth, &DMatrix::zeros(0, 0), &dmatrix![1e-4], 3, 4, 150);
    let text = r#"
        A = [[{ start = 0.7 }, 0.2], ["free", 0.7]]
        B = [[0], [{ start = 0.5 }]]
        C = [[1, 0]]
        feedthrough = [["free"]]
        initial_state_radius = [5, 5]
    "#;
    let found = identify_model(&structure(text, 0.1, 1, 1), &training, &[]).unwrap();
    assert!((&found.plant.a - &truth.a).amax() < 1e-3, "{}", found.plant.a);
    assert!(
        (&found.plant.b - &truth.b).amax() < 1e-3
            && (&found.plant.feedthrough - &truth.feedthrough).amax() < 1e-3
    );
    assert!((found.measurement_noise_covariance[(0, 0)].sqrt() / 1e-4 - 1.0).abs() < 0.1);
}

#[test]
fn missing_measurements_cost_information_only() {
    let complete = car_runs(3, 4, 150);
    let mut gappy = complete.clone();
    for (i, row) in gappy.iter_mut().flat_map(|run| &mut run.measurements).enumerate() {
        if i % 3 == 1 {
            row[0] = f64::NAN;
        }
        if i % 7 == 2 {
            row[1] = f64::NAN;
        }
    }
    let structure = structure(CAR, 0.025, 2, 2);
    let [complete, gappy] = [complete, gappy].map(|runs| identify_model(&structure, &runs, &[]).unwrap());
    for (name, truth) in [("a", 0.87), ("b", 0.13), ("A[2][2]", 0.92), ("B[2][1]", 0.08)] {
        let (value, error) = value(&gappy, name);
        assert!((value - truth).abs() < 3.0 * error, "{name} {value} {error}");
        assert!(error > value_error(&complete, name) && error < 2.0 * value_error(&complete, name));
    }
}

fn value_error(model: &IdentifiedModel, name: &str) -> f64 {
    value(model, name).1
}

#[test]
fn entries_that_only_show_as_a_product_are_named() {
    let text = r#"
        A = [["free", "free"], [0, 0.5]]
        B = [[0], ["free"]]
        C = [[1, 0]]
        D = [[1], [0]]
        initial_state_radius = [2, 0.001]
    "#;
    let truth = Plant {
        a: dmatrix![0.8, 0.4; 0.0, 0.5],
        b: dmatrix![0.0; 0.3],
        c: dmatrix![1.0, 0.0],
        feedthrough: DMatrix::zeros(1, 1),
        disturbance: dmatrix![1.0; 0.0],
    };
    let text = text
        .replacen("\"free\"", "{ start = 0.5 }", 1)
        .replace("\"free\"", "{ start = 0.3 }");
    let mut training = runs(&truth, &dmatrix![0.05], &dmatrix![0.05], 4, 4, 150);
    // The hidden state begins at 0, so that nothing but the product enters.
    for run in &mut training {
        run.commands.drain(..1);
        run.measurements.drain(..1);
    }
    let mut structure = structure(&text, 0.1, 1, 1);
    structure = structure.with_initial_state(nalgebra::dvector![0.0, 0.0], dmatrix![4.0, 0.0; 0.0, 0.0]);
    match identify_model(&structure, &training, &[]) {
        Err(ModelIdentificationError::Undetermined { names }) => {
            assert_eq!(names, ["A[0][1]", "B[1][0]"]);
        }
        other => panic!("{other:?}"),
    }
}

#[test]
fn cross_validation_detects_too_many_free_entries() {
    let truth = Plant {
        a: dmatrix![0.8],
        b: DMatrix::from_fn(1, 12, |_, j| if j == 0 { 0.3 } else { 0.0 }),
        c: dmatrix![1.0],
        feedthrough: DMatrix::zeros(1, 12),
        disturbance: dmatrix![1.0],
    };
    let training = runs(&truth, &dmatrix![0.5], &dmatrix![0.05], 5, 10, 17);
    let with = |free: usize| {
        let entries: Vec<&str> = (0..12).map(|j| if j < free { "\"free\"" } else { "0" }).collect();
        let text = format!(
            "A = [[\"free\"]]\nB = [[{}]]\nC = [[1]]\nD = [[1]]\ninitial_state_radius = [2]\n\
             measurement_noise_covariance = [[0.0025]]",
            entries.join(", ")
        );
        identify_model(&structure(&text, 0.1, 1, 12), &training, &[])
    };
    let (modest, greedy) = (with(1).unwrap(), with(12).unwrap());
    assert!(!modest.is_overfitted(), "{}", modest.cross_validation_ratio());
    assert!(greedy.is_overfitted(), "{}", greedy.cross_validation_ratio());
    assert!(greedy.training.rms[0] < modest.training.rms[0]);
    assert!(greedy.cross_validation.rms[0] > modest.cross_validation.rms[0]);
}

#[test]
fn recordings_that_tell_too_little_are_refused_by_name() {
    let structure = structure(CAR, 0.025, 2, 2);
    let good = car_runs(1, 3, 60);
    let refused = |runs: &[RunData]| identify_model(&structure, runs, &[]).unwrap_err();
    let changed = |change: &dyn Fn(&mut RunData)| {
        let mut runs = good.clone();
        runs.iter_mut().for_each(change);
        refused(&runs).to_string()
    };
    assert_eq!(
        refused(&[]),
        ModelIdentificationError::Data(IdentifyError::NoTrainingRuns)
    );
    let only = refused(&good[..1]).to_string();
    assert!(only.contains("run 1000 is the only training run"), "{only}");
    let short = changed(&|run| {
        run.commands.truncate(10);
        run.measurements.truncate(10);
    });
    assert!(
        short.contains("hold 60 measured values for 8 unknowns") && short.contains("80 are needed"),
        "{short}"
    );
    let stuck = changed(&|run| run.commands.iter_mut().for_each(|u| u[1] = 0.5));
    assert!(
        stuck.contains("command 1 has the same value") && stuck.contains("(0.5)"),
        "{stuck}"
    );
    let flat = changed(&|run| run.measurements.iter_mut().for_each(|y| y[0] = 0.0));
    assert!(flat.contains("measurement 0 has the same value"), "{flat}");
    let silent = changed(&|run| run.measurements.iter_mut().for_each(|y| y[1] = f64::NAN));
    assert!(silent.contains("measurement 1 has no value"), "{silent}");
    let uncommanded = changed(&|run| run.commands.iter_mut().for_each(|u| u[0] = f64::NAN));
    assert!(
        uncommanded.contains("has no transition between two instants"),
        "{uncommanded}"
    );
    let infinite = changed(&|run| run.measurements[5][0] = f64::INFINITY);
    assert!(
        infinite.contains("instant 5: element 0 of the measurements is infinite"),
        "{infinite}"
    );
    let narrow = changed(&|run| run.commands[2].truncate(1));
    assert!(
        narrow.contains("instant 2: 1 commands, but the model has 2"),
        "{narrow}"
    );
}

#[test]
fn noise_that_the_disturbance_explains_sinks_to_its_limit_and_stays_positive() {
    // The disturbance of a step acts on two steps, the opposite of what measurement noise would look like.
    let truth = Plant {
        a: dmatrix![0.8, 0.5; 0.0, 0.0],
        b: dmatrix![1.0; 0.0],
        c: dmatrix![1.0, 0.0],
        feedthrough: dmatrix![0.0],
        disturbance: dmatrix![1.0; 1.0],
    };
    let training: Vec<RunData> = (0..3)
        .map(|seed| simulate(&truth, &dmatrix![0.3], &dmatrix![0.0], seed, 200))
        .collect();
    let text = "A = [[\"free\"]]\nB = [[\"free\"]]\nC = [[1]]\nD = [[1]]\ninitial_state_radius = [2]";
    let found = identify_model(&structure(text, 0.1, 1, 1), &training, &[]).unwrap();
    assert!(found.noise[1].at_limit && !found.noise[0].at_limit, "{found:?}");
    let (q, r) = (
        found.disturbance_covariance[(0, 0)],
        found.measurement_noise_covariance[(0, 0)],
    );
    assert!(r > 0.0 && r < 1e-4 * q, "{found:?}");
}
