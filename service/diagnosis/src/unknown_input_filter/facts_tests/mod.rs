//! Exact facts of method sheet 8(a) that need the inner quantities of the filters.

mod gains;
mod thresholds;
mod time_invariant;

use super::{
    filter::{CoupledFilter, CoupledOptions},
    fixed_gain::{FixedGain, Nominal},
    fixed_step::FixedFilter,
    modes::FaultMode,
    options::{Form, TestRule},
    outcome::Outcome,
    paper::{PaperFilter, UnknownInputObserver, optimal_gain},
    plant::{Command, Measured, Plant},
    state::SetState,
    workspace::Workspace,
};
use crate::{
    matrix::{Matrix, row_sums},
    model::{LinearModel, ModelOptions},
    zonotope::Reduction,
};
use nalgebra::{DMatrix, DVector};
use serde_json::Value;

const DESIGN: &str = include_str!("../../../tests/reference/unknown_input_filter/vtol_design.json");
const BATTERY: &str = include_str!("../../../tests/reference/unknown_input_filter/battery_bank.json");
const VARIANTS: &str = include_str!("../../../tests/reference/unknown_input_filter/vtol_variants.json");
const UNIT: &str = include_str!("../../../tests/reference/unknown_input_filter/unit_cases.json");

fn parse(text: &str) -> Value {
    serde_json::from_str(text).unwrap()
}

fn vector(value: &Value) -> Vec<f64> {
    serde_json::from_value(value.clone()).unwrap()
}

fn rows(value: &Value) -> Vec<Vec<f64>> {
    serde_json::from_value(value.clone()).unwrap()
}

fn dense(value: &Value) -> DMatrix<f64> {
    let rows = rows(value);
    DMatrix::from_fn(rows.len(), rows[0].len(), |i, j| rows[i][j])
}

/// The model of a reference file, with or without its uncertainty.
fn model(text: &str, radius: f64, uncertain: bool) -> LinearModel {
    let model = &parse(text)["model"];
    let nx = rows(&model["A0"]).len();
    let options = ModelOptions {
        a: rows(&model["A0"]),
        b: rows(&model["B"]),
        c: rows(&model["C"]),
        d: rows(&model["D"]),
        a_uncertainty: if uncertain {
            rows(&model["A_plus"])
        } else {
            Vec::new()
        },
        disturbance_bound: vector(&model["disturbance_bound"]),
        measurement_noise_bound: vector(&model["noise_bound"]),
        initial_state_radius: Some(vec![radius; nx]),
        ..ModelOptions::default()
    };
    LinearModel::new(&options, 0.01).unwrap()
}

fn mode(actuator: usize) -> FaultMode {
    FaultMode::from_actuators(&[actuator]).unwrap()
}

fn coupled(plant: &Plant, mode: FaultMode, row_wise: bool, order: usize) -> CoupledFilter {
    let options = CoupledOptions {
        shaping: None,
        fault_bound: None,
        row_wise,
        sweeps: 0,
        order,
    };
    CoupledFilter::new(plant, mode, &options)
}

/// One filter with all that its step needs.
struct Rig {
    state: SetState,
    work: Workspace,
    outcome: Outcome,
    command: Command,
    measured: Measured,
}

impl Rig {
    fn new(plant: &Plant, mode: FaultMode, form: Form, order: usize, radius: &[f64]) -> Self {
        let mut state = SetState::new(plant.nx(), plant.column_capacity(order, mode.len()));
        state.set_box(&vec![0.0; plant.nx()], radius);
        let reduction = if form == Form::Paper {
            Reduction::Euclidean
        } else {
            Reduction::GirardScaled
        };
        let mut command = Command::new(plant);
        command.receive(plant, &vec![0.0; plant.nu()]);
        Self {
            state,
            work: Workspace::new(plant, order, mode.len(), reduction),
            outcome: Outcome::new(plant, mode, form),
            command,
            measured: Measured::new(plant),
        }
    }

    fn coupled_step(&mut self, plant: &Plant, filter: &CoupledFilter, y: &[f64]) {
        self.measured.receive(plant, y);
        let Self {
            state,
            work,
            outcome,
            command,
            measured,
        } = self;
        filter.step(plant, command, measured, state, work, outcome);
    }

    fn paper_step(&mut self, plant: &Plant, filter: &PaperFilter, y: &[f64]) {
        self.measured.receive(plant, y);
        let Self {
            state,
            work,
            outcome,
            command,
            measured,
        } = self;
        filter.step(plant, command, measured, state, work, outcome);
    }
}

fn assert_near(found: &[f64], expected: &[f64], tolerance: f64) {
    assert_eq!(found.len(), expected.len());
    for (a, b) in found.iter().zip(expected) {
        assert!((a - b).abs() <= tolerance, "{found:?} instead of {expected:?}");
    }
}
