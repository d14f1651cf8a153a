//! Exact facts of method sheet 8(a) that need the inner quantities of the filters.

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

const DESIGN: &str = include_str!("../../tests/reference/unknown_input_filter/vtol_design.json");
const BATTERY: &str = include_str!("../../tests/reference/unknown_input_filter/battery_bank.json");
const VARIANTS: &str = include_str!("../../tests/reference/unknown_input_filter/vtol_variants.json");
const UNIT: &str = include_str!("../../tests/reference/unknown_input_filter/unit_cases.json");

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

#[test]
fn fact_1_the_observer_matrices_decouple_the_fault() {
    let design = parse(DESIGN);
    let plant = Plant::new(&model(DESIGN, 1.0, true), 50, false);
    let s = dense(&design["model"]["S"]);
    let c = plant.c.to_dense();
    let expected = [
        [0.004328863367, -0.062649775601, 0.011048778470, -0.050436774089],
        [0.005346583117, -0.004664865133, -0.040072672442, -0.044229815631],
    ];
    for (i, expected) in expected.iter().enumerate() {
        let observer = UnknownInputObserver::new(&plant, mode(i), Some(&s));
        let (t, n) = (observer.t.to_dense(), observer.n.to_dense());
        assert!((&t * plant.b.to_dense().column(i)).amax() < 1e-15);
        assert!((&t + &n * &c - DMatrix::identity(4, 4)).amax() < 1e-15);
        assert_eq!(t.rank(1e-9), 3);
        assert_near(
            (&c * &t * plant.b.to_dense().column(1 - i)).as_slice(),
            expected,
            1e-11,
        );
        assert!((t - dense(&design["modes"][i]["T"])).amax() < 1e-12);
        assert!((n - dense(&design["modes"][i]["N"])).amax() < 1e-12);
        assert!((observer.decoupling.gain.to_dense() - dense(&design["modes"][i]["L0"])).amax() < 1e-12);
        let projector = UnknownInputObserver::new(&plant, mode(i), None)
            .decoupling
            .test_rows;
        assert!((projector.to_dense() - dense(&design["modes"][i]["projector"])).amax() < 1e-12);
    }
    let observer = UnknownInputObserver::new(&plant, mode(0), Some(&s));
    let diagonal: Vec<f64> = (c * observer.n.to_dense()).diagonal().iter().copied().collect();
    assert_near(
        &diagonal,
        &[0.014583411155, 0.093862976484, 0.650758638255, 0.279812377961],
        1e-11,
    );
}

#[test]
fn fact_2_the_papers_residual_is_the_projected_innovation() {
    let plant = Plant::new(&model(DESIGN, 1.0, true), 50, false);
    let s = dense(&parse(DESIGN)["model"]["S"]);
    for i in 0..2 {
        let filter = PaperFilter::new(&plant, mode(i), Some(&s), TestRule::Printed, 50);
        let rows = UnknownInputObserver::new(&plant, mode(i), Some(&s))
            .decoupling
            .test_rows
            .to_dense();
        let mut rig = Rig::new(&plant, mode(i), Form::Paper, 50, &[1.0; 4]);
        for k in 0..30 {
            let y: Vec<f64> = (0..4).map(|j| (1.7 * k as f64 + j as f64).sin()).collect();
            rig.command.receive(&plant, &[(0.3 * k as f64).cos(), 0.5]);
            let predicted = plant.a0.to_dense() * DVector::from_column_slice(&rig.state.centre)
                + plant.b.to_dense() * DVector::from_column_slice(&rig.command.centre);
            let expected = &rows * (DVector::from_column_slice(&y) - plant.c.to_dense() * predicted);
            rig.paper_step(&plant, &filter, &y);
            let found: Vec<f64> = rig.outcome.outputs.iter().map(|row| row.residual).collect();
            assert_near(&found, expected.as_slice(), 1e-13);
        }
    }
}

#[test]
fn fact_4_the_gains_are_stationary_and_no_perturbation_is_better() {
    let unit = parse(UNIT);
    let case = &unit["coupled_gain"];
    let model = model(DESIGN, 1.0, true);
    let plant = Plant::new(&model, 50, false);
    let (c, v) = (plant.c.to_dense(), DMatrix::from_diagonal(model.v()));
    let generators = Matrix::from(&dense(&case["G"]));
    let g = generators.to_dense();
    let mut work = Workspace::new(&plant, 50, 1, Reduction::GirardScaled);
    work.prediction.generators.copy_from(&generators);
    let spread = Matrix::from(&(&c * &g));
    work.prediction.spread.copy_from(&spread);

    assert!(optimal_gain(&plant.noise, &mut work));
    let lambda = work.gain.to_dense();
    let r = &c * &g * g.transpose() * c.transpose() + &v * &v;
    assert!((&lambda * r - &g * g.transpose() * c.transpose()).amax() < 1e-12 * g.norm_squared());
    assert!((&lambda - dense(&unit["gain_equation_35"]["Lambda"])).amax() < 1e-11);

    let filter = coupled(&plant, mode(0), false, 50);
    work.choice.prepare(&filter.decoupling, &spread, &plant.noise);
    let candidates = super::gain::Candidates {
        strip: None,
        fixed: None,
        sweeps: 0,
    };
    work.choice.choose(
        &filter.decoupling,
        &generators,
        &spread,
        candidates,
        &mut work.gain,
    );
    let gain = work.gain.to_dense();
    assert!((&gain - dense(&case["L"])).amax() < 1e-11);
    let weight = DMatrix::from_diagonal(&DVector::from_vec(vec![3.0, 0.1, 1.0, 20.0]));
    let size = |gain: &DMatrix<f64>, weight: &DMatrix<f64>| {
        let left = weight * (&g - gain * &c * &g);
        (left.norm_squared() + (weight * gain * &v).norm_squared()).sqrt()
    };
    let identity = DMatrix::identity(4, 4);
    assert!((size(&gain, &identity) - case["frobenius_norm"].as_f64().unwrap()).abs() < 1e-12);
    let basis = filter.decoupling.null_basis.to_dense();
    for trial in 0..200 {
        let scale = 10.0_f64.powi(-(trial % 6));
        let change = DMatrix::from_fn(4, 3, |i, j| {
            scale * ((trial * 31 + i as i32 * 7 + j as i32) as f64).sin()
        });
        let other = &gain + change * &basis;
        for weight in [&identity, &weight] {
            assert!(size(&other, weight) >= size(&gain, weight));
        }
    }
}

#[test]
fn fact_6_the_corrected_set_contains_the_intersection_for_any_gain() {
    let unit = parse(UNIT);
    let case = &unit["correction_31_32"];
    let model = model(DESIGN, 1.0, true);
    let plant = Plant::new(&model, 50, false);
    let (h, c) = (dense(&case["H"]), plant.c.to_dense());
    let p = DVector::from_vec(vector(&case["p"]));
    let mut work = Workspace::new(&plant, 50, 1, Reduction::GirardScaled);
    work.prediction.generators.copy_from(&Matrix::from(&h));
    work.prediction.spread.copy_from(&Matrix::from(&(&c * &h)));
    let mut corrected = Matrix::with_capacity(4, 20);
    for trial in 0..100_i32 {
        let sample = |i: usize, scale: f64| scale * ((trial * 13 + i as i32) as f64 * 1.37).sin();
        let z = DVector::from_fn(7, |i, _| sample(i, 1.0));
        let noise = DVector::from_fn(4, |i, _| sample(i + 7, 1.0));
        let x = &p + &h * &z;
        let y = &c * &x + noise.component_mul(model.v());
        let gain = DMatrix::from_fn(4, 4, |i, j| sample(20 + 4 * i + j, 2.0));
        work.prediction.correct(
            &Matrix::from(&gain),
            &plant.noise,
            &mut work.scratch,
            &mut corrected,
        );
        let centre = &p + &gain * (y - &c * &p);
        let coordinates =
            DVector::from_iterator(11, z.iter().copied().chain(noise.iter().map(|value| -value)));
        assert!((centre + corrected.to_dense() * coordinates - x).amax() < 1e-12);
    }
    assert!(optimal_gain(&plant.noise, &mut work));
    work.prediction
        .correct(&work.gain, &plant.noise, &mut work.scratch, &mut corrected);
    assert!((corrected.to_dense() - dense(&case["generators"])).amax() < 1e-12);
    let centre = &p + work.gain.to_dense() * (DVector::from_vec(vector(&case["y"])) - &c * &p);
    assert_near(centre.as_slice(), &vector(&case["centre"]), 1e-11);
}

#[test]
fn fact_11_adjoint_noise_reaches_the_bound_of_every_row() {
    let model = model(DESIGN, 1.0, false);
    let plant = Plant::new(&model, 400, false);
    let (a, c) = (model.a0(), model.c());
    let instants = 25;
    for i in 0..2 {
        let filter = coupled(&plant, mode(i), false, 400);
        // Widths and gains do not depend on data when A⁺ = 0: record the gains on zero data.
        let mut rig = Rig::new(&plant, mode(i), Form::Coupled, 400, &[1.0; 4]);
        let gains: Vec<DMatrix<f64>> = (0..instants)
            .map(|_| {
                rig.coupled_step(&plant, &filter, &[0.0; 4]);
                rig.work.gain.to_dense()
            })
            .collect();
        for row in 0..4 {
            let w = filter.decoupling.test_rows.to_dense().row(row).into_owned();
            let sign = |q: &nalgebra::RowDVector<f64>| q.map(f64::signum).transpose();
            let mut noise = vec![DVector::zeros(4); instants + 1];
            let mut disturbance = vec![DVector::zeros(4); instants];
            noise[instants] = sign(&w);
            let mut q = &w * c;
            disturbance[instants - 1] = sign(&q);
            q *= a;
            for k in (0..instants - 1).rev() {
                let gain = &gains[k];
                noise[k + 1] = sign(&(-(&q * gain)));
                q -= &q * gain * c;
                disturbance[k] = sign(&q);
                q *= a;
            }
            let mut x = sign(&q);
            let mut rig = Rig::new(&plant, mode(i), Form::Coupled, 400, &[1.0; 4]);
            for k in 0..instants {
                x = a * x + model.d() * disturbance[k].component_mul(model.w());
                let y = c * &x + noise[k + 1].component_mul(model.v());
                rig.coupled_step(&plant, &filter, y.as_slice());
            }
            let test = rig.outcome.outputs[row];
            assert!((test.residual / test.half_width - 1.0).abs() < 1e-9, "{test:?}");
        }
    }
}

#[test]
fn fact_14_the_set_after_the_first_step_is_the_strip() {
    for uncertain in [true, false] {
        let plant = Plant::new(&model(DESIGN, 1.0, uncertain), 30, false);
        for i in 0..2 {
            let filter = coupled(&plant, mode(i), true, 30);
            let mut rig = Rig::new(&plant, mode(i), Form::Coupled, 30, &[1.0; 4]);
            rig.coupled_step(&plant, &filter, &[0.0; 4]);
            assert_near(&rig.state.radius, &[0.01, 0.01, 0.01, 0.03], 1e-8);
        }
    }
}

#[test]
fn floors_grow_with_the_state_as_listed() {
    let design = parse(DESIGN);
    let plant = Plant::new(&model(DESIGN, 1.0, true), 50, false);
    let s = dense(&design["model"]["S"]);
    for case in design["inert_threshold"].as_array().unwrap() {
        let magnitude = case["state_magnitude"].as_f64().unwrap();
        for fault in 0..2 {
            let other = mode(1 - fault);
            let paper = PaperFilter::new(&plant, other, Some(&s), TestRule::Printed, 50);
            let filter = coupled(&plant, other, true, 50);
            let mut rigs =
                [Form::Paper, Form::Coupled].map(|form| Rig::new(&plant, other, form, 50, &[1.0; 4]));
            for _ in 0..300 {
                for rig in &mut rigs {
                    rig.state.centre.fill(magnitude);
                }
                rigs[0].paper_step(&plant, &paper, &[0.0; 4]);
                rigs[1].coupled_step(&plant, &filter, &[0.0; 4]);
            }
            let [paper, row_wise] = rigs.each_ref().map(|rig| rig.outcome.floors[fault]);
            let relative = |found: f64, field: &str| found / case[field][fault].as_f64().unwrap() - 1.0;
            assert!(relative(row_wise, "floor_row_wise").abs() < 1e-9);
            // The reduced sets of the paper's form do not settle but cycle, by less than one per cent.
            assert!(relative(paper, "floor_paper").abs() < 1e-2);
        }
    }
}

#[test]
fn fact_16_the_table_is_the_unreduced_set_of_the_fixed_gain() {
    let case = &parse(VARIANTS)["lti_table"];
    let model = model(BATTERY, 3.0, false);
    let plant = Plant::new(&model, 4000, false);
    let gain = Matrix::from(&dense(&case["fixed_gain"]));
    let filter = coupled(&plant, mode(1), false, 4000);
    let rows = filter.decoupling.test_rows.to_dense();
    let table = super::lti::half_widths(&model, &gain.to_dense(), &rows, &DVector::repeat(5, 3.0), 1000);
    let steady = super::lti::steady_half_widths(&model, &gain.to_dense(), &rows).unwrap();
    for (k, expected) in vector(&case["k"])
        .iter()
        .zip(case["half_width"].as_array().unwrap())
    {
        let found: Vec<f64> = table.row(*k as usize - 1).iter().copied().collect();
        assert_near(&found, &vector(expected), 1e-9);
    }
    for row in [0, 1, 3] {
        let excess = steady[row] / table[(999, row)] - 1.0;
        assert!((-1e-14..1e-9).contains(&excess), "{excess}");
    }
    // The filter itself, without reduction, gives the same half widths.
    let nominal = Nominal {
        radius: vec![3.0; 5],
        state: vec![0.0; 5],
        order: 30,
        reduction: Reduction::GirardScaled,
    };
    let fixed = FixedGain::check(&plant, &coupled(&plant, mode(1), false, 30), &gain, &nominal).unwrap();
    let filter = FixedFilter::new(&plant, filter, &fixed);
    let mut rig = Rig::new(&plant, mode(1), Form::Coupled, 4000, &[3.0; 5]);
    for k in 0..200 {
        rig.measured.receive(&plant, &[0.0; 4]);
        let Rig {
            state,
            work,
            outcome,
            command,
            measured,
        } = &mut rig;
        filter.step(&plant, command, measured, state, work, outcome);
        for (row, test) in rig
            .outcome
            .outputs
            .iter()
            .enumerate()
            .filter(|(_, test)| test.evaluated)
        {
            assert!((test.half_width - table[(k, row)]).abs() < 1e-12);
        }
    }
}

#[test]
fn fact_16_the_memoryless_form_is_the_filter_from_the_second_step_on() {
    let model = model(DESIGN, 1.0, true);
    let plant = Plant::new(&model, 30, false);
    let filter = coupled(&plant, mode(0), true, 30);
    let rows = filter.decoupling.test_rows.to_dense();
    let memoryless = super::lti::MemorylessFilter::new(&model, rows).unwrap();
    let mut rig = Rig::new(&plant, mode(0), Form::Coupled, 30, &[1.0; 4]);
    let mut previous = DVector::zeros(4);
    for k in 0..50 {
        let y = DVector::from_fn(4, |j, _| 0.2 * (0.1 * k as f64 + j as f64).sin());
        let u = [0.1 * (k as f64).cos(), 0.05];
        rig.command.receive(&plant, &u);
        rig.coupled_step(&plant, &filter, y.as_slice());
        if k > 0 {
            let (residual, half_width) = memoryless.test(&previous, &DVector::from_row_slice(&u), &y);
            let found: (Vec<f64>, Vec<f64>) = rig
                .outcome
                .outputs
                .iter()
                .map(|row| (row.residual, row.half_width))
                .unzip();
            assert_near(&found.0, residual.as_slice(), 1e-12);
            assert_near(&found.1, half_width.as_slice(), 1e-12);
        }
        previous = y;
    }
    let mut radius = vec![0.0; 4];
    row_sums(&rig.state.generators, &mut radius);
    assert_near(&radius, &[0.01, 0.01, 0.01, 0.03], 1e-12);
}

#[test]
fn the_alarm_rule_is_that_of_the_reference() {
    let cases = parse(UNIT)["alarm"]["cases"].as_array().unwrap().clone();
    assert_eq!(cases.len(), 6);
    for case in cases {
        let [lower, upper] = ["lo", "up"].map(|bound| case[bound].as_f64().unwrap());
        let row = super::outcome::TestRow {
            residual: -(lower + upper) / 2.0,
            half_width: (upper - lower) / 2.0,
            evaluated: true,
        };
        assert_eq!(row.alarm(), case["alarm"].as_bool().unwrap(), "{case}");
    }
    let undefined = super::outcome::TestRow {
        residual: f64::NAN,
        half_width: 1.0,
        evaluated: true,
    };
    assert!(undefined.alarm());
}
