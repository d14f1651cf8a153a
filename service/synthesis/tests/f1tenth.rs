//! Identification from recordings of a real car, and the configuration that came of it.
//!
//! The recordings are no part of the project. Without them (`../shared/data` beside the workspace, or the folder
//! that RESIDUALD_RECORDINGS names) the tests that need them say so and pass.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

mod common;

use common::workspace;
use residual_diagnosis::model::{LinearModel, ModelOptions};
use residual_diagnosis::unknown_input_filter::options::UnknownInputFilterOptions;
use residual_synthesis::identify::{
    Identification, IdentifyOptions, NoiseSearch, RunData, StepOutcome, identify_bounds,
};
use serde::Deserialize;
use std::io::Write;
use std::path::PathBuf;

/// Wheelbase, m, and sampling time, s.
const WHEELBASE: f64 = 0.33;
const SAMPLE_TIME: f64 = 0.025;

#[derive(Deserialize)]
struct Row {
    run: String,
    t: f64,
    psi: f64,
    v: f64,
    steer_cmd: f64,
    v_cmd: f64,
}

fn rows() -> Option<Vec<Row>> {
    let folder = std::env::var_os("RESIDUALD_RECORDINGS")
        .map_or_else(|| workspace().join("../shared/data"), PathBuf::from);
    match csv::Reader::from_path(folder.join("f1tenth.csv")) {
        Ok(mut reader) => Some(reader.deserialize().map(Result::unwrap).collect()),
        Err(_) => {
            let note = "SKIPPED: no recording f1tenth.csv; set RESIDUALD_RECORDINGS to its folder\n";
            std::io::stderr().write_all(note.as_bytes()).unwrap();
            None
        }
    }
}

/// The odd and the even runs; from `onset` seconds on the wheels are off by `offset` rad, so that the command, as
/// recorded, differs from what the car does.
fn runs(rows: &[Row], offset: f64, onset: f64) -> [Vec<RunData>; 2] {
    let mut runs: Vec<RunData> = Vec::new();
    for row in rows {
        if runs.last().is_none_or(|run| run.name != row.run) {
            runs.push(RunData {
                name: row.run.clone(),
                ..RunData::default()
            });
        }
        let run = runs.last_mut().unwrap();
        let steering = row.steer_cmd + if row.t >= onset { offset } else { 0.0 };
        run.commands.push(vec![row.v * steering / WHEELBASE, row.v_cmd]);
        run.measurements.push(vec![row.psi, row.v]);
    }
    let (odd, even) = runs
        .into_iter()
        .partition(|run| run.name.parse::<usize>().unwrap() % 2 == 1);
    [odd, even]
}

fn configured() -> (ModelOptions, UnknownInputFilterOptions) {
    let text = std::fs::read_to_string(workspace().join("deploy/config/f1tenth.toml")).unwrap();
    let file: toml::Table = text.parse().unwrap();
    let diagnoser = file["diagnoser"][0].as_table().unwrap();
    let method = ["bank", "filter", "parity", "missing"]
        .into_iter()
        .filter_map(|key| Some((key.to_owned(), diagnoser.get(key)?.clone())))
        .collect::<toml::Table>();
    (
        diagnoser["model"].clone().try_into().unwrap(),
        method.try_into().unwrap(),
    )
}

fn model(options: &ModelOptions) -> LinearModel {
    LinearModel::new(options, SAMPLE_TIME).unwrap()
}

fn identify(model: &LinearModel, runs: &[Vec<RunData>; 2], options: &IdentifyOptions) -> Identification {
    identify_bounds(model, &runs[0], &runs[1], options, &mut |_| ()).unwrap()
}

#[test]
fn the_configuration_fits_the_method() {
    let (options, method) = configured();
    method.validate(&model(&options)).unwrap();
}

#[test]
fn the_heading_needs_the_disturbances_that_an_independent_solver_found() {
    let Some(rows) = rows() else { return };
    let (mut options, _) = configured();
    options.disturbance_bound[0] = 0.004;
    let scales = IdentifyOptions {
        noise_scales: vec![0.8, 1.0, 1.2],
        search: NoiseSearch::Common,
        ..IdentifyOptions::default()
    };
    // Speed has all the freedom it wants, so that only the heading can contradict.
    options.disturbance_bound[1] = 0.01;
    options.measurement_noise_bound[1] = 1.0;
    let found = identify(&model(&options), &runs(&rows, 0.0, 0.0), &scales);
    for (step, (bound, inconsistent)) in found.steps.iter().zip([(0.0080, 0), (0.0038, 0), (0.0022, 3)]) {
        let StepOutcome::Bounds(step) = &step.outcome else {
            panic!("{step:?}")
        };
        let difference = step.bounds.disturbance[0] - bound;
        assert!(difference.abs() <= 0.5e-4 + 1e-9, "{step:?}");
        assert_eq!(step.inconsistent_validation_runs, inconsistent);
    }
}

#[test]
fn the_configured_bounds_are_those_of_the_odd_runs() {
    let Some(rows) = rows() else { return };
    let (options, _) = configured();
    let start = ModelOptions {
        disturbance_bound: vec![0.004, 0.004],
        ..options.clone()
    };
    let scales = IdentifyOptions {
        noise_scales: vec![0.7, 1.0, 1.4],
        ..IdentifyOptions::default()
    };
    let found = identify(&model(&start), &runs(&rows, 0.0, 0.0), &scales);
    assert_eq!(
        found.best.bounds.disturbance.as_slice(),
        options.disturbance_bound,
        "{found}"
    );
    assert_eq!(
        found.best.bounds.measurement.as_slice(),
        options.measurement_noise_bound,
        "{found}"
    );
    assert_eq!(found.best.inconsistent_validation_runs, 0, "{found}");
    assert!(
        found.to_string().contains("disturbance_bound = [0.00376, 0]"),
        "{found}"
    );
}

#[test]
fn a_steering_offset_contradicts_the_configured_bounds() {
    let Some(rows) = rows() else { return };
    let (options, _) = configured();
    let as_configured = IdentifyOptions {
        noise_scales: vec![1.0],
        ..IdentifyOptions::default()
    };
    for (offset, expected) in [(-0.1, 20), (-0.05, 1), (0.0, 0), (0.05, 15), (0.1, 20)] {
        let [odd, _] = runs(&rows, 0.0, 0.0);
        let [_, even] = runs(&rows, offset, 1.5);
        let found = identify(&model(&options), &[odd, even], &as_configured);
        assert_eq!(found.best.inconsistent_validation_runs, expected, "{offset}");
    }
}
