//! `paper_sampled.json`: sampled forms, designs, constants, windowed runs, isolation bank and model bank.

use crate::kernels::{assert_matrix, matrix};
use crate::paper::{PaperPlant, RICCATI, TS, channel, given, paper_options, paper_plant, step, windowed};
use crate::support::{assert_close, numbers, reference_of, rows};
use nalgebra::{DMatrix, DVector};
use residual_diagnosis::{
    diagnoser::Diagnoser,
    hinf_filter::{
        HinfFilter,
        constants::{Driven, ErrorFilter, ErrorModel, GapEnvelope, ThresholdConstants, within_period},
        realisation::{filter_foh, filter_zoh},
        synthesis::{Weighted, matched_gain, synth_riccati_dt},
    },
    norms::{
        System, WindowConstants, h_infinity_discrete, h_minus_discrete, initial_error_gain_discrete, l1_norm,
    },
    spectrum::spectral_radius,
};
use serde_json::Value;

fn file() -> Value {
    reference_of("hinf_filter", "paper_sampled.json")
}

#[track_caller]
fn assert_number(what: &str, actual: f64, expected: &Value, tolerance: f64) {
    let expected = expected.as_f64().unwrap();
    let error = (actual - expected).abs();
    assert!(
        error <= tolerance * expected.abs().max(1e-6),
        "{what}: {actual} instead of {expected}"
    );
}

#[test]
fn sampled_matrices_agree_with_the_reference() {
    let (file, plant) = (file(), paper_plant());
    let sampled = plant.sample(TS);
    for (key, actual) in [
        ("Ad", &sampled.ad),
        ("Bud", &sampled.bud),
        ("Bdd", &sampled.bdd),
        ("Bfd", &sampled.bfd),
    ] {
        assert_matrix(key, actual, &file["zoh"][key], 1e-13);
    }
    let h = DMatrix::identity(2, 2) * 0.5;
    let (zoh, foh) = (filter_zoh(&plant, &h, TS), filter_foh(&plant, &h, TS));
    let expected = &file["filter_zoh_H_half_identity"];
    for (key, actual) in [("Phi", &zoh.phi), ("Gu", &zoh.gu), ("Gy", &zoh.gy)] {
        assert_matrix(key, actual, &expected[key], 1e-12);
    }
    let expected = &file["filter_foh_H_half_identity"];
    for (key, actual) in [
        ("Phi", &foh.phi),
        ("Gu", &foh.gu),
        ("G0", &foh.g0),
        ("G1", &foh.g1),
    ] {
        assert_matrix(key, actual, &expected[key], 1e-12);
    }
}

#[test]
fn only_the_discrete_observer_keeps_the_command_out_of_the_residual() {
    let file = file();
    let leak = |realisation: &str| {
        let tables = format!(
            "[disturbance]\n[synthesis]\ntype = \"given\"\nH = [[0.5, 0], [0, 0.5]]\n[filter]\nrealisation = \
             \"{realisation}\"\n[evaluation]\nthreshold = \"constant\"\nconstant_threshold = 0.1"
        );
        HinfFilter::new(&paper_options(&tables), TS).unwrap()
    };
    let expected = &file["leak_unit_step_sup_abs_r"];
    let zoh = leak("filter_zoh").report().command_leak.unwrap();
    assert!((zoh - expected["zoh"].as_f64().unwrap()).abs() < 1e-9, "{zoh}");
    let foh = leak("filter_foh").report().command_leak.unwrap();
    assert!((foh - expected["foh"].as_f64().unwrap()).abs() < 1e-11, "{foh}");
    // The same step response through the discrete observer.
    let (plant, mut filter) = (paper_plant(), leak("discrete_observer"));
    let sampled = plant.sample(TS);
    let mut x = DVector::zeros(2);
    for _ in 0..=1000 {
        let y = &plant.c * &x + &plant.d;
        step(&mut filter, y.as_slice(), &[1.0]);
        assert!(filter.residual().iter().all(|r| r.abs() <= 1e-13));
        x = &sampled.ad * x + &sampled.bud;
    }
}

#[test]
fn designs_and_their_constants_agree_with_the_reference() {
    let (file, plant) = (file(), paper_plant());
    let sampled = plant.sample(TS);
    for (name, expected) in file["designs"].as_object().unwrap() {
        let (l, v) = (matrix(&expected["L"]), matrix(&expected["V"]));
        let found = match name.as_str() {
            "matched" => matched_gain(&sampled.bdd, &plant.dd).unwrap(),
            "fault_cancelling" => &sampled.bfd * plant.df.clone().try_inverse().unwrap(),
            _ => l.clone(),
        };
        assert_matrix(name, &found, &expected["L"], 1e-8);
        let closed = &sampled.ad - &l * &plant.c;
        assert_number(
            "radius",
            spectral_radius(&closed).unwrap(),
            &expected["spectral_radius"],
            1e-9,
        );
        let filter = ErrorFilter {
            closed: &closed,
            gain: &l,
            c: &plant.c,
            v: &v,
        };
        let slew = within_period(&plant.a, &plant.bd, &DVector::from_element(1, 0.01), TS);
        let model = ErrorModel::nominal(filter, &sampled.bdd, &plant.dd, slew);
        let system = model.disturbance_system();
        assert_number(
            "‖V T_rd‖",
            h_infinity_discrete(&system).value,
            &expected["hinf_V_Trd"],
            1e-8,
        );
        let plain = System::new(&closed, &(&sampled.bdd - &l * &plant.dd), &plant.c, &plant.dd);
        assert_number(
            "‖T_rd‖",
            h_infinity_discrete(&plain).value,
            &expected["hinf_Trd"],
            1e-8,
        );
        let fault = System::new(
            &closed,
            &(&sampled.bfd - &l * &plant.df),
            &(&v * &plant.c),
            &(&v * &plant.df),
        );
        assert_number(
            "‖V T_rf‖₋",
            h_minus_discrete(&fault, None).value,
            &expected["hminus_V_Trf"],
            1e-8,
        );
        assert_matrix("l1", &l1_norm(&system).unwrap(), &expected["l1_V_Trd"], 1e-8);
        let gain = initial_error_gain_discrete(&closed, &(&v * &plant.c), TS).unwrap();
        assert_number("initial", gain, &expected["initial_error_gain"], 1e-8);
        let gap = GapEnvelope::new(filter, &v.clone().try_inverse().unwrap()).unwrap();
        assert_number("gap rate", gap.rate, &expected["gap_rate"], 1e-9);
        assert_matrix("gap envelope", &gap.envelope, &expected["gap_envelope_c"], 1e-8);
        for (samples, expected) in expected["window"].as_object().unwrap() {
            let samples: usize = samples.parse().unwrap();
            let memory = WindowConstants::new(&system.a, &system.b, &system.c, samples).unwrap();
            let kappa = numbers(&expected["kappa_first5"]);
            // The matched design has κ = 0 up to rounding.
            for (actual, expected) in memory.kappa.iter().zip(&kappa) {
                assert!(
                    (actual - expected).abs() <= 1e-8 * kappa[0].max(1e-8),
                    "{name}: {actual} {expected}"
                );
            }
            let amplitude = DVector::from_element(1, 0.01);
            let constants =
                ThresholdConstants::new(&model, Driven::Amplitude(&amplitude), Some(samples), 2, TS).unwrap();
            assert!((constants.memory - expected["mu"].as_f64().unwrap()).abs() < 1e-11);
            assert_close("J_d", &[constants.energy], &numbers(&expected["J_d"]), 1e-8);
            assert_close(
                "J_slew",
                &[constants.slew_energy],
                &numbers(&expected["J_slew"]),
                1e-8,
            );
            assert_close(
                "rho_d",
                constants.amplitude.as_slice(),
                &numbers(&expected["rho_d"]),
                1e-8,
            );
            assert_close(
                "rho_slew",
                constants.slew.as_slice(),
                &numbers(&expected["rho_slew"]),
                1e-8,
            );
        }
    }
}

#[test]
fn the_discrete_riccati_design_agrees_with_the_reference() {
    let (file, plant) = (file(), paper_plant());
    let expected = &file["designs"]["riccati"];
    let sampled = plant.sample(TS);
    let noise = |size: f64| {
        Weighted::new(
            &sampled.bdd,
            &plant.dd,
            &DVector::from_element(1, 1.0),
            &DVector::from_element(2, size),
        )
    };
    let weighted = noise(0.002);
    assert_matrix("Bd_w", &weighted.b, &expected["Bd_w"], 1e-12);
    let design = synth_riccati_dt(&sampled.ad, &plant.c, &weighted, &sampled.bdd).unwrap();
    assert_matrix("Pi", &design.solution.pi, &expected["Pi"], 1e-8);
    assert_matrix("Omega", &design.solution.omega, &expected["Omega"], 1e-8);
    assert_matrix("L", &design.gain, &expected["L"], 1e-8);
    assert_matrix("V", &design.v, &expected["V"], 1e-8);
    assert_number(
        "optimum",
        design.optimum,
        &expected["gamma_lower_bound_weighted"],
        1e-9,
    );
    // Ratios of method sheet 6, item 2.
    for (size, with_v, without) in [(0.01, 11.6018, 8.8413), (0.002, 12.7722, 9.3556)] {
        let weighted = noise(size);
        let design = synth_riccati_dt(&sampled.ad, &plant.c, &weighted, &sampled.bdd).unwrap();
        let system = |v: &DMatrix<f64>, b: &DMatrix<f64>, d: &DMatrix<f64>| System {
            a: &sampled.ad - &design.gain * &plant.c,
            b: b - &design.gain * d,
            c: v * &plant.c,
            d: v * d,
        };
        for (v, ratio) in [(&design.v, with_v), (&DMatrix::identity(2, 2), without)] {
            let fault = h_minus_discrete(&system(v, &sampled.bfd, &plant.df), None).value;
            let disturbance = h_infinity_discrete(&system(v, &weighted.b, &weighted.d)).value;
            assert!(
                (fault / disturbance - ratio).abs() < 5.1e-5,
                "{} {ratio}",
                fault / disturbance
            );
        }
        let co_inner = h_infinity_discrete(&system(&design.v, &weighted.b, &weighted.d)).value;
        assert!((co_inner - 1.0).abs() < 1e-8);
    }
}

/// First instants with energy and peak alarm of filters with this prefix, over 3000 samples; calls `row` on each.
fn first_alarms(
    filter: &mut HinfFilter,
    prefix: &str,
    case: &str,
    mut row: impl FnMut(usize, &[f64], &[f64], f64, f64),
) -> [Option<usize>; 2] {
    let mut plant = PaperPlant::new(case);
    let mut first = [None; 2];
    for k in 0..3000 {
        let record = step(filter, &plant.next(), &[1.0]);
        let energy = channel(filter, &record, &format!("{prefix}energy"));
        let peak = ["r1", "r2"].map(|row| channel(filter, &record, &format!("{prefix}{row}")));
        row(
            k,
            &peak.map(|channel| channel.residual),
            &peak.map(|channel| channel.upper),
            energy.residual,
            energy.upper,
        );
        let alarms = [energy.ratio > 1.0, peak.iter().any(|channel| channel.ratio > 1.0)];
        for (first, alarm) in first.iter_mut().zip(alarms) {
            *first = first.or(alarm.then_some(k));
        }
    }
    first
}

fn expected_alarms(value: &Value) -> [Option<usize>; 2] {
    ["first_energy_alarm_k", "first_peak_alarm_k"].map(|key| value[key].as_u64().map(|k| k as usize))
}

/// Rows of a run, column by column to 1e-8 of the column's largest value.
fn assert_rows(what: &str, actual: &[Vec<f64>], expected: &Value) {
    let expected = rows(expected);
    assert_eq!(actual.len(), expected.len(), "{what}");
    for column in 0..expected[0].len() {
        let of = |rows: &[Vec<f64>]| rows.iter().map(|row| row[column]).collect::<Vec<_>>();
        assert_close(
            &format!("{what}, column {column}"),
            &of(actual),
            &of(&expected),
            1e-8,
        );
    }
}

fn windowed_runs(design: &str, synthesis: &str) {
    let file = file();
    for (case, expected) in file["windowed_runs"]["runs"][design].as_object().unwrap() {
        let mut filter = HinfFilter::new(&paper_options(&windowed(synthesis)), TS).unwrap();
        let wanted: Vec<usize> = rows(&expected["rows"])
            .iter()
            .map(|row| row[0] as usize)
            .collect();
        let mut found = Vec::new();
        let first = first_alarms(&mut filter, "", case, |k, r, rho, j, threshold| {
            if wanted.contains(&k) {
                found.push(vec![k as f64, j, threshold, r[0], r[1], rho[0], rho[1]]);
            }
        });
        assert_eq!(first, expected_alarms(expected), "{design} {case}");
        assert_rows(&format!("{design} {case}"), &found, &expected["rows"]);
    }
}

#[test]
fn windowed_runs_of_the_matched_design_agree_with_the_reference() {
    windowed_runs("matched", "type = \"matched\"");
}

#[test]
fn windowed_runs_of_the_riccati_design_agree_with_the_reference() {
    windowed_runs("riccati", RICCATI);
    let design = &file()["designs"]["riccati"];
    let given = format!(
        "type = \"given\"\n{}{}",
        given("L", &design["L"]),
        given("V", &design["V"])
    );
    windowed_runs("riccati", &given);
}

#[test]
fn the_isolation_bank_names_the_fault_in_every_case() {
    let file = file();
    let bank = &file["isolation_bank"];
    let tables = format!(
        "{}[isolation]\nblind_sets = [[\"f1\"], [\"f2\"]]\nfault_bound = [0.3, 0.3]\nfault_slew = [0.05, 0.05]\n",
        windowed(RICCATI)
    );
    for case in ["none", "1", "1b", "2", "3"] {
        for name in ["blind_to_f1", "blind_to_f2"] {
            let mut filter = HinfFilter::new(&paper_options(&tables), TS).unwrap();
            let mut largest = 0.0_f64;
            let first = first_alarms(&mut filter, &format!("{name}_"), case, |_, _, _, j, threshold| {
                largest = largest.max(j / threshold);
            });
            let expected = &bank["filters"][name]["alarms"][case];
            assert_eq!(first, expected_alarms(expected), "{name} {case}");
            assert_number("max J/Jth", largest, &expected["max_J_over_Jth"], 1e-7);
        }
    }
    let filter = HinfFilter::new(&paper_options(&tables), TS).unwrap();
    for (leak, name) in filter
        .report()
        .blind_leaks
        .iter()
        .zip(["blind_to_f1", "blind_to_f2"])
    {
        assert_number("leak", *leak, &bank["filters"][name]["hinf_blind"], 1e-8);
    }
}

/// y of the plant factor·A under the paper's sine, step and faults, from rest.
struct OffPlant {
    exponential: DMatrix<f64>,
    plant: residual_diagnosis::hinf_filter::plant::Plant,
    x: DVector<f64>,
    faults: PaperPlant,
}

impl OffPlant {
    fn new(factor: f64, case: &str) -> Self {
        let mut plant = paper_plant();
        plant.a *= factor;
        // State x, u, d, its quadrature, f1, f2 and their rates.
        let mut generator = DMatrix::zeros(9, 9);
        generator.view_mut((0, 0), (2, 2)).copy_from(&plant.a);
        generator.view_mut((0, 2), (2, 1)).copy_from(&plant.b);
        generator.view_mut((0, 3), (2, 1)).copy_from(&plant.bd);
        generator[(3, 4)] = 1.0;
        generator[(4, 3)] = -1.0;
        generator.view_mut((0, 5), (2, 2)).copy_from(&plant.bf);
        generator[(5, 7)] = 1.0;
        generator[(6, 8)] = 1.0;
        Self {
            exponential: residual_diagnosis::discretise::matrix_exponential(&(generator * TS)),
            plant,
            x: DVector::zeros(2),
            faults: PaperPlant::new(case),
        }
    }

    fn next(&mut self, k: usize) -> Vec<f64> {
        let t = k as f64 * TS;
        let fault = self.faults.faults();
        let z = DVector::from_column_slice(&[
            self.x[0],
            self.x[1],
            1.0,
            0.01 * t.sin(),
            0.01 * t.cos(),
            fault[0],
            fault[1],
            fault[2],
            fault[3],
        ]);
        let f = DVector::from_column_slice(&fault[..2]);
        let y =
            &self.plant.c * &self.x + &self.plant.d + &self.plant.dd * (0.01 * t.sin()) + &self.plant.df * f;
        self.x = (&self.exponential * z).rows(0, 2).into_owned();
        self.faults.next();
        y.as_slice().to_vec()
    }
}

#[test]
fn the_model_bank_keeps_its_guarantee_where_the_single_model_alarms() {
    let file = file();
    let bank = &file["model_bank"];
    let plant = paper_plant();
    let listed: Vec<String> = [1.01, 0.99]
        .iter()
        .map(|factor| {
            let a: Vec<Vec<f64>> = (0..2)
                .map(|i| (0..2).map(|j| factor * plant.a[(i, j)]).collect())
                .collect();
            format!("{{ A = {a:?} }}")
        })
        .collect();
    let reference = reference_of("hinf_filter", "paper_facts.json");
    let options = |more: &str| {
        let model = crate::paper::model_table(&reference["plant"], more);
        toml::from_str(&format!("{model}{}", windowed(RICCATI))).unwrap()
    };
    let with_bank = options(&format!("listed_models = [{}]", listed.join(", ")));
    let without: residual_diagnosis::hinf_filter::options::HinfFilterOptions = options("");
    for (factor, cases) in bank["true_A_factor"].as_object().unwrap() {
        for (case, expected) in cases.as_object().unwrap() {
            let mut filter = HinfFilter::new(&with_bank, TS).unwrap();
            let mut single = HinfFilter::new(&without, TS).unwrap();
            let mut truth = OffPlant::new(factor.parse().unwrap(), case);
            let (mut first, mut first_single) = ([None; 2], None);
            let mut found = Vec::new();
            let listed_rows = expected.get("rows").map_or(Vec::new(), rows);
            for k in 0..3000 {
                let y = truth.next(k);
                let record = step(&mut filter, &y, &[1.0]);
                let channels = ["energy", "r1", "r2"].map(|name| channel(&filter, &record, name));
                let alarms = [
                    channels[0].ratio > 1.0,
                    channels[1].ratio.max(channels[2].ratio) > 1.0,
                ];
                for (first, alarm) in first.iter_mut().zip(alarms) {
                    *first = first.or(alarm.then_some(k));
                }
                if listed_rows.iter().any(|row| row[0] as usize == k) {
                    let [j, r1, r2] = channels;
                    found.push(vec![
                        k as f64,
                        j.residual,
                        j.upper,
                        r1.residual,
                        r2.residual,
                        r1.upper,
                        r2.upper,
                    ]);
                }
                if first_single.is_none() {
                    // The reference compares with the bound of a full window, J_d + J_s, from the start on.
                    let record = step(&mut single, &y, &[1.0]);
                    let constants = single.report().constants.as_ref().unwrap();
                    let energy = channel(&single, &record, "energy");
                    let alarm = energy.residual > constants.energy + constants.slew_energy;
                    assert!(
                        !alarm || energy.ratio > 1.0,
                        "the present threshold is never above it"
                    );
                    first_single = alarm.then_some(k);
                }
            }
            assert_eq!(first, expected_alarms(expected), "{factor} {case}");
            let single = expected["first_energy_alarm_k_without_model_bank"].as_u64();
            assert_eq!(first_single, single.map(|k| k as usize), "{factor} {case}");
            if !listed_rows.is_empty() {
                for column in 0..7 {
                    let of = |rows: &[Vec<f64>]| rows.iter().map(|row| row[column]).collect::<Vec<_>>();
                    assert_close(&format!("column {column}"), &of(&found), &of(&listed_rows), 1e-8);
                }
            }
        }
    }
}

#[test]
fn description_counts_the_signals() {
    let filter = HinfFilter::new(&paper_options(&windowed(RICCATI)), TS).unwrap();
    let description = filter.description();
    assert_eq!((description.measurement_count, description.command_count), (2, 1));
    assert_eq!(description.faults, ["f1", "f2"]);
}
