//! `design.json` and the facts of method sheet 8 (a).

use crate::fixtures::{
    bounded, dense, design, file, given, list, matrices, observer, other_plant, row_major, servo,
};
use crate::support::{assert_close, numbers, rows};
use nalgebra::{DMatrix, DVector};
use residual_diagnosis::reduced_order_observer::{
    certificate::Certificate,
    closed_form::{closed_form, riccati},
    decoupling::Decoupling,
    directions::test_directions,
    error::ConstructionError,
    floors::certain_sizes,
    observer_design::ObserverDesign,
    options::{Gains, Objective},
    plant::Plant,
};

fn servo_plant(noise: f64) -> Plant {
    Plant::new(&servo(noise).model).unwrap()
}

/// The printed gain K, projected.
fn paper_gains() -> (DMatrix<f64>, DMatrix<f64>) {
    let file = file("design.json");
    (dense(&file["K_projected"]), dense(&file["printed"]["M"]))
}

#[test]
fn fact_1_the_assumptions_hold_and_there_is_no_zero() {
    let plant = servo_plant(0.0);
    let decoupling = Decoupling::new(&plant, &plant.d).unwrap();
    assert!(decoupling.zeros.is_empty());
    let mut values = residual_diagnosis::decomposition::eigenvalues(&plant.a).unwrap();
    values.sort_by(|left, right| (left.re, left.im).partial_cmp(&(right.re, right.im)).unwrap());
    let expected = [
        (0.5521948, -0.1859318 - 5e-7),
        (0.5521948, 0.1859318 + 5e-7),
        (0.9656102, 0.0),
    ];
    for (found, expected) in values.iter().zip(expected) {
        assert!(
            (found.re - expected.0).abs() < 1e-6 && (found.im - expected.1).abs() < 1e-6,
            "{found}"
        );
    }
}

#[test]
fn fact_2_the_printed_p_and_l_solve_the_papers_inequality() {
    let (file, plant) = (file("design.json"), servo_plant(0.0));
    let (p, l) = (dense(&file["printed"]["P"]), dense(&file["printed"]["L"]));
    let mut eigenvalues = list(&p.clone().symmetric_eigenvalues());
    eigenvalues.sort_by(f64::total_cmp);
    assert_close(
        "eig P",
        &eigenvalues,
        &numbers(&file["printed_solution_check"]["eig_P"]),
        1e-8,
    );
    assert!((eigenvalues[0] / 1e4 - 1.858403).abs() < 1e-3);
    let closed = &plant.a + &l * &plant.c;
    let change = (closed.transpose() * &p * &closed - &p)
        .symmetric_eigenvalues()
        .max();
    assert!((change / 1e4 + 1.857608).abs() < 1e-3, "{change}");
    let radius = residual_diagnosis::spectrum::spectral_radius(&closed).unwrap();
    assert!((radius - 0.054045).abs() < 2e-6);
    assert!((p * &plant.d)[2].abs() < 1e-9);
}

#[test]
fn fact_3_and_4_gains_from_the_printed_p_and_l() {
    let (file, plant) = (file("design.json"), servo_plant(0.0));
    let (p, l) = (dense(&file["printed"]["P"]), dense(&file["printed"]["L"]));
    let k = DMatrix::from_row_slice(1, 2, &[p[(0, 2)] / p[(2, 2)], p[(1, 2)] / p[(2, 2)]]);
    let expected = &file["from_printed_P_L"];
    assert_close("K", &row_major(&k), &numbers(&expected["K"]), 1e-9);
    assert_close("K", &row_major(&k), &[8.341935, 4.670968], 1e-6);
    assert_close("K printed", &row_major(&k), &numbers(&file["printed"]["K"]), 1e-2);
    let [a11, a12, a21, _] = plant.blocks();
    let (p11, p12) = (
        p.view((0, 0), (2, 2)).into_owned(),
        p.view((0, 2), (2, 1)).into_owned(),
    );
    let (l1, l2) = (l.rows(0, 2).into_owned(), l.rows(2, 1).into_owned());
    let m = &a11 + l1 + p11.try_inverse().unwrap() * p12 * (a21 + l2);
    let n = &a11 - &a12 * &k - &m;
    assert_close("M", &row_major(&m), &numbers(&expected["M"]), 1e-6);
    assert_close("N", &row_major(&n), &numbers(&expected["N"]), 1e-6);
    let printed = &file["printed"];
    let rest = dense(&printed["M"]) + dense(&printed["N"]) + a12 * dense(&printed["K"]) - a11;
    assert!(rest.amax() < 7e-5);
}

#[test]
fn fact_5_all_decoupling_gains() {
    let (file, plant) = (file("design.json"), servo_plant(0.0));
    let decoupling = Decoupling::new(&plant, &plant.d).unwrap();
    let expected = &file["decoupled_pair"];
    assert_close("K0", &row_major(&decoupling.k0), &numbers(&expected["K0"]), 1e-12);
    assert!((decoupling.a_bar[(0, 0)] - 0.526).abs() < 1e-12);
    let projector = &decoupling.free * decoupling.free.transpose();
    assert_close("Π", &row_major(&projector), &numbers(&expected["Pi"]), 1e-12);
    let c_bar = &decoupling.free * &decoupling.c;
    assert_close("Π A12", &row_major(&c_bar), &numbers(&expected["C_bar"]), 1e-12);
    for pole in [0.0, 0.3, -0.5, 0.9] {
        let k = closed_form(&decoupling, &[pole]).unwrap();
        let t = k[0];
        assert!(
            (k[1] - (0.5 + 0.5 * t)).abs() < 1e-12 && (0.515 - 0.055 * t - pole).abs() < 1e-12,
            "{k}"
        );
    }
    let deadbeat = closed_form(&decoupling, &[0.0]).unwrap();
    assert_close(
        "deadbeat",
        &row_major(&deadbeat),
        &[103.0 / 11.0, 57.0 / 11.0],
        1e-12,
    );
    let k = decoupling.project(&dense(&file["printed"]["K"]));
    assert_close("projected", &row_major(&k), &numbers(&file["K_projected"]), 1e-12);
    let (observer, _) = observer(&plant, k, dense(&file["printed"]["M"]));
    let expected = &file["observer_with_K_projected"];
    assert_close("F", observer.f.as_slice(), &numbers(&expected["F"]), 1e-12);
    assert_close("J", &row_major(&observer.j), &numbers(&expected["J"]), 1e-12);
    assert_close("N", &row_major(&observer.n), &numbers(&expected["N"]), 1e-12);
    assert_close(
        "E_z",
        observer.input.rows(2, 1).into_owned().as_slice(),
        &numbers(&expected["K_B1_plus_B2"]),
        1e-12,
    );
}

#[test]
fn a_gain_that_misses_by_1e_5_leaves_an_error_that_the_projection_removes() {
    let (file, plant) = (file("design.json"), servo_plant(0.0));
    let decoupling = Decoupling::new(&plant, &plant.d).unwrap();
    let k = dense(&file["printed"]["K"]);
    assert!(((&k * &decoupling.u1 + &decoupling.u2)[0] + 1e-5).abs() < 1e-12);
    assert!(!decoupling.is_decoupled(&k) && decoupling.is_decoupled(&decoupling.project(&k)));
}

#[test]
fn fact_7_the_steady_half_widths_without_noise() {
    let plant = servo_plant(0.0);
    let (k, m) = paper_gains();
    let (_, reach) = observer(&plant, k.clone(), m);
    let hull = |reach: &residual_diagnosis::reduced_order_observer::reach::Reach| {
        let table = reach.test_half_widths(&DMatrix::identity(2, 2));
        table.row(table.nrows() - 1).iter().copied().collect::<Vec<_>>()
    };
    assert_close("M_s", &hull(&reach), &[0.1000007816, 0.2000301755], 1e-9);
    let expected = numbers(&file("design.json")["half_width_steady_noise_free"]);
    assert_close("M_s", &hull(&reach), &expected, 1e-9);
    let (_, reach) = observer(&plant, k, DMatrix::zeros(2, 2));
    assert_close("M = 0", &hull(&reach), &[0.1, 0.2], 1e-9);
}

#[test]
fn the_tables_are_as_long_as_the_errors_decay() {
    let length = |noise: f64, k: DMatrix<f64>, m: DMatrix<f64>| {
        let plant = servo_plant(noise);
        observer(&plant, k, m).1.length()
    };
    let (k, m) = paper_gains();
    assert_eq!(length(0.001, k, m), 11);
    let plant = servo_plant(0.0);
    let slow = closed_form(&Decoupling::new(&plant, &plant.d).unwrap(), &[0.8]).unwrap();
    let found = [0.01, 0.05].map(|noise| length(noise, slow.clone(), DMatrix::zeros(2, 2)));
    assert!(found[0] < 135 && 135 < found[1], "{found:?}");
}

#[test]
fn fact_8_the_interval_recursion_is_wider_in_the_steady_state() {
    let file = file("design.json");
    let m = dense(&file["printed"]["M"]).abs();
    let d1 = DVector::from_vec(vec![0.1, 0.2]);
    let steady = (DMatrix::identity(2, 2) - m).try_inverse().unwrap() * d1;
    assert_close(
        "TIOM",
        &list(&steady),
        &numbers(&file["tiom_half_width_steady"]),
        1e-9,
    );
    let narrow = numbers(&file["half_width_steady_noise_free"]);
    assert!((narrow[0] / steady[0] - 0.9046310).abs() < 1e-6);
    assert!((narrow[1] / steady[1] - 0.9885940).abs() < 1e-6);
}

#[test]
fn fact_13_the_blind_direction_sees_the_actuator_but_not_the_disturbance() {
    let plant = servo_plant(0.0);
    let decoupling = Decoupling::new(&plant, &plant.d).unwrap();
    let (observer, reach) = observer(&plant, decoupling.k0.clone(), DMatrix::zeros(2, 2));
    let tests = test_directions(&plant, &reach, true, &[], 32);
    let w = DVector::from_vec(vec![2.0, 1.0]);
    let blind = tests
        .row_iter()
        .position(|row| (row.transpose().dot(&w).abs() - w.norm()).abs() < 1e-12);
    assert!(w.dot(&plant.d.rows(0, 2).column(0)).abs() < 1e-12);
    assert!((w.dot(&observer.input.rows(0, 2).column(0)) - 1.2).abs() < 1e-12);
    let table = reach.test_half_widths(&tests);
    assert!(table.column(blind.unwrap()).amax() < 1e-12);
}

#[test]
fn fact_15_half_widths_and_floors_of_the_design_table() {
    let file = file("design.json");
    let entries = file["design_table"].as_array().unwrap();
    assert_eq!(entries.len(), 18);
    for entry in entries {
        let noise = entry["noise_bound"].as_f64().unwrap();
        let name = format!("{} with noise {noise}", entry["design"]);
        let plant = servo_plant(noise);
        let (observer, reach) = observer(&plant, dense(&entry["K"]), dense(&entry["M"]));
        let tests = test_directions(&plant, &reach, true, &[], 32);
        let found = ObserverDesign::new(observer, reach, tests, None);
        assert_close(
            &name,
            &list(&found.hull()),
            &numbers(&entry["half_width_steady"]),
            1e-8,
        );
        let hull = entry["fault_floor_hull"].as_f64().unwrap();
        assert!(
            (found.hull_floors()[0] / hull - 1.0).abs() < 1e-8,
            "{name}: {}",
            found.hull_floors()
        );
        let set = found.set_floors()[0];
        match entry["fault_floor_set"].as_f64() {
            Some(expected) => assert!(
                (set - expected).abs() < 1e-5,
                "{name}: {set} instead of {expected}"
            ),
            // Without noise the blind direction sees no disturbance, with M = 0 ever, else at the first sample.
            None => assert!(
                set < if entry["design"] == "paper" { 1e-4 } else { 1e-9 },
                "{name}: {set}"
            ),
        }
    }
}

#[test]
fn fact_16_the_fault_estimator() {
    let expected = &file("design.json")["fault_decoupled_observer"];
    for (noise, radius) in [(0.0, 0.0), (0.01, 0.0396495), (0.05, 0.1982475)] {
        let design = design(&servo(noise));
        let [estimator] = design.isolation.estimators.as_slice() else {
            panic!("{:?}", design.warnings)
        };
        assert_close(
            "K",
            &row_major(&estimator.observer.k),
            &numbers(&expected["K"]),
            1e-9,
        );
        assert_close(
            "F",
            estimator.observer.f.as_slice(),
            &numbers(&expected["F"]),
            1e-9,
        );
        assert_close("φ", estimator.tests.as_slice(), &numbers(&expected["phi"]), 1e-9);
        assert!(
            (estimator.steady()[0] - radius).abs() < 1e-6,
            "{}",
            estimator.steady()
        );
    }
}

#[test]
fn fact_17_the_riccati_rule() {
    let plant = Plant::new(&other_plant("six_state", 1e-3).model).unwrap();
    let decoupling = Decoupling::new(&plant, &plant.d).unwrap();
    for (degree, radius, widths) in [(0.8, 0.4408, 4.58971), (0.4, 0.1801, 4.58936)] {
        let y = riccati(&decoupling, degree).unwrap();
        let k = decoupling.project(&(&decoupling.k0 + y * decoupling.free.transpose()));
        let (observer, reach) = observer(&plant, k, DMatrix::zeros(3, 3));
        let found = residual_diagnosis::spectrum::spectral_radius(&observer.f).unwrap();
        assert!((found - radius).abs() < 1e-4, "{found}");
        let table = reach.test_half_widths(&DMatrix::identity(3, 3));
        let sum = table.row(table.nrows() - 1).sum();
        assert!((sum - widths).abs() < 1e-4, "{sum}");
    }
}

#[test]
fn the_assumptions_are_judged_as_the_reference_judges_them() {
    for case in file("design.json")["assumption_cases"].as_array().unwrap() {
        let mut model = matrices(case_with_input(case).as_ref());
        model = bounded(model, 1.0, 1.0, 0.0);
        let plant = Plant::new(&model).unwrap();
        let found = Decoupling::new(&plant, &plant.d);
        assert_eq!(
            found.is_ok(),
            case["feasible"].as_bool().unwrap(),
            "{}: {found:?}",
            case["name"]
        );
        match (found, case["invariant_zeros"].as_array()) {
            (Ok(found), Some(zeros)) => {
                assert_eq!(found.zeros.len(), zeros.len(), "{}", case["name"]);
                for (found, zero) in found.zeros.iter().zip(zeros) {
                    assert!((found.re - zero[0].as_f64().unwrap()).abs() < 1e-9);
                }
            }
            (Err(ConstructionError::UnstableInvariantZero { re, .. }), Some(zeros)) => {
                assert!((re - zeros[0][0].as_f64().unwrap()).abs() < 1e-9);
            }
            (Err(error), zeros) => {
                assert!(matches!(error, ConstructionError::DisturbanceNotMatched { .. }) && zeros.is_none());
            }
            (Ok(_), None) => panic!("{}", case["name"]),
        }
    }
}

/// The cases state no input; any will do.
fn case_with_input(case: &serde_json::Value) -> Box<serde_json::Value> {
    let mut case = case.clone();
    let states = rows(&case["A"]).len();
    case["B"] = serde_json::json!(vec![vec![1.0]; states]);
    Box::new(case)
}

#[test]
fn the_certificate_of_the_deadbeat_observer_agrees() {
    let file = file("design.json");
    let plant = servo_plant(0.0);
    let (observer, _) = observer(&plant, dense(&file["deadbeat_K"]), DMatrix::zeros(2, 2));
    let (delta, certificate) = Certificate::find(&plant, &observer).unwrap();
    let expected = &file["certificate_deadbeat"];
    assert_eq!(delta, expected["delta"].as_f64().unwrap());
    assert_close("P", &row_major(&certificate.p), &numbers(&expected["P"]), 1e-8);
    assert_close("L", &row_major(&certificate.l), &numbers(&expected["L"]), 1e-8);
    assert!(
        (certificate.decrease + 8.6e-4).abs() < 1e-5,
        "{}",
        certificate.decrease
    );
    let coupling = (plant.d.transpose() * &certificate.p)[2];
    assert!(coupling.abs() < 1e-12 * certificate.p.amax());
}

#[test]
fn the_closed_form_of_the_vehicle_agrees() {
    let file = file("design.json");
    let vehicle = &file["other_plants"][0];
    let expected = &vehicle["closed_form"];
    let mut options = other_plant("vehicle_lateral", 1e-3);
    options.design.gains = Gains::ClosedForm;
    options.design.poles = Some(numbers(&expected["poles"]));
    let found = design(&options).main;
    assert_close(
        "width",
        &list(&found.hull()),
        &numbers(&expected["half_width_steady"]),
        1e-8,
    );
    assert_close(
        "hull",
        &list(&found.hull_floors()),
        &numbers(&expected["fault_floor_hull"]),
        1e-8,
    );
    assert_close(
        "set",
        &list(&found.set_floors()),
        &numbers(&expected["fault_floor_set"]),
        1e-5,
    );
    options.model.measurement_noise_bound = vec![0.0; 2];
    let widths = numbers(&expected["half_width_steady_noise_free"]);
    assert_close("noise-free", &list(&design(&options).main.hull()), &widths, 1e-8);
}

#[test]
fn auto_takes_the_slow_pole_for_the_floor_and_never_a_worse_width_than_k0() {
    let mut options = servo(0.01);
    let found = design(&options);
    assert!(
        (found.main.observer.f[0] - 0.9).abs() < 1e-9,
        "{}",
        found.gains.main.source
    );
    assert!((found.main.set_floors()[0] - 0.035125).abs() < 1e-5);
    // One actuator: nothing to isolate, the estimator runs.
    assert_eq!(
        (found.isolation.members.len(), found.isolation.estimators.len()),
        (0, 1)
    );
    assert!(found.warnings.is_empty(), "{:?}", found.warnings);
    options.design.objective = Objective::Width;
    let found = design(&options);
    assert!(
        (found.main.hull().sum() - 0.34267).abs() < 1e-4,
        "{}",
        found.main.hull().sum()
    );
    // The K0 of the method sheet's table is the narrowest of the closed forms.
    assert!(
        (found.main.observer.f[0] - 0.526).abs() < 1e-9,
        "{}",
        found.gains.main.source
    );
}

#[test]
fn slow_poles_lower_the_floors_of_the_vehicle() {
    let mut options = other_plant("vehicle_lateral", 1e-3);
    options.design.gains = Gains::ClosedForm;
    options.design.poles = Some(vec![0.9, 0.8]);
    let floors = design(&options).main.set_floors();
    assert!(
        (floors[0] - 0.0016).abs() < 5e-5 && (floors[1] - 0.109).abs() < 5e-4,
        "{floors}"
    );
}

#[test]
fn the_set_test_needs_one_sample_where_the_outputs_need_six() {
    let mut options = servo(0.05);
    options.design.gains = Gains::ClosedForm;
    options.design.poles = Some(vec![0.8]);
    let main = design(&options).main;
    let delay = |rows: usize| {
        let tests = main.tests.rows(0, rows).into_owned();
        let steady = main.steady().rows(0, rows).into_owned();
        let sizes = certain_sizes(&main.observer, &tests, &steady, 0);
        sizes.iter().position(|size| 0.5 > *size)
    };
    assert_eq!((delay(2), delay(main.tests.nrows())), (Some(6), Some(1)));
}

#[test]
fn the_vehicles_steering_estimator_is_refused_by_its_radius_and_the_brakes_has_034_knm() {
    let mut options = other_plant("vehicle_lateral", 1e-3);
    options.isolation.poles = vec![0.4, 0.5];
    let all = design(&options).isolation;
    let radius = |i: usize| all.estimators[i].steady()[0];
    assert!((radius(0) / 110.0 - 1.0).abs() < 0.05, "{}", radius(0));
    assert!((radius(1) - 0.340).abs() < 5e-4, "{}", radius(1));
    options.isolation.fault_estimate_radius_max = Some(vec![1.0, 1.0]);
    let some = design(&options);
    assert_eq!(some.isolation.estimators.len(), 1);
    assert_eq!(some.isolation.estimators[0].actuator, Some(1));
    assert!(
        some.warnings[0].contains("fault_estimate_radius_max"),
        "{:?}",
        some.warnings
    );
}

#[test]
fn the_estimators_of_the_six_state_plant_are_as_narrow_as_the_method_sheet_says() {
    let mut options = other_plant("six_state", 1e-3);
    options.isolation.poles = vec![0.3, 0.4, 0.5];
    let found = design(&options).isolation.estimators;
    let radii: Vec<f64> = found.iter().map(|estimator| estimator.steady()[0]).collect();
    assert_close("radius", &radii, &[0.00146, 0.0245], 1e-3);
}

#[test]
fn given_gains_are_projected_and_kept() {
    let file = file("design.json");
    let options = given(
        servo(0.0),
        &rows(&file["printed"]["K"]),
        &rows(&file["printed"]["M"]),
    );
    let found = design(&options).main.observer;
    assert_close("K", &row_major(&found.k), &numbers(&file["K_projected"]), 1e-12);
}
