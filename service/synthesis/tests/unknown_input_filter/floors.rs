//! Floors against the reference values and against their own definition.

use crate::reference_files::{aircraft, mode, plant, reference};
use nalgebra::DVector;
use residual_diagnosis::model::LinearModel;
use residual_diagnosis::unknown_input_filter::modes::FaultMode;
use residual_synthesis::bounds::NoiseBounds;
use residual_synthesis::unknown_input_filter::floors::{FloorError, FloorQuestion, solve};
use serde_json::Value;

fn check_floors(file: &Value, model: &LinearModel) -> usize {
    let floors = file["lp_floors"].as_array().unwrap();
    for entry in floors {
        let number = |key: &str| entry[key].as_u64().unwrap() as usize;
        let question = FloorQuestion {
            mode: mode(&entry["mode"]),
            actuator: number("fault"),
            length: number("L"),
            pre_samples: number("window") - number("L"),
        };
        let nominal = DVector::from_element(model.state_count(), entry["nominal_state"].as_f64().unwrap());
        let solution = solve(model, &NoiseBounds::from(model), &nominal, question).unwrap();
        let expected = entry["floor"].as_f64();
        let found = solution.map(|solution| solution.floor());
        match (found, expected) {
            (Some(found), Some(expected)) => {
                assert!((found / expected - 1.0).abs() < 1e-6, "{entry}: {found}");
            }
            (found, expected) => assert_eq!(found, expected, "{entry}"),
        }
    }
    floors.len()
}

#[test]
fn every_reference_floor_of_the_aircraft_is_met() {
    assert!(check_floors(&reference("vtol_design.json"), &aircraft()) >= 20);
}

#[test]
fn every_reference_floor_of_the_battery_is_met() {
    let mut file = reference("battery_bank.json");
    let model = plant(&file["model"]);
    let nominal_state = file["nominal_state"].clone();
    for entry in file["lp_floors"].as_array_mut().unwrap() {
        entry["nominal_state"] = nominal_state.clone();
    }
    assert!(check_floors(&file, &model) >= 8);
}

#[test]
fn faults_that_cannot_be_told_apart_have_no_floor() {
    let file = reference("vtol_design.json");
    let mut separable = 0;
    let mut inseparable = 0;
    for case in file["assumption_cases"]
        .as_array()
        .unwrap()
        .iter()
        .filter(|case| case["lp"].is_array())
    {
        let model = plant(case);
        for entry in case["lp"].as_array().unwrap() {
            let length = entry["L"].as_u64().unwrap() as usize;
            let question = FloorQuestion {
                mode: mode(&entry["mode"]),
                actuator: 1 - entry["mode"][0].as_u64().unwrap() as usize,
                length,
                pre_samples: entry["window"].as_u64().unwrap() as usize - length,
            };
            let nominal = DVector::zeros(model.state_count());
            let solution = solve(&model, &NoiseBounds::from(&model), &nominal, question).unwrap();
            let objective = entry["objective"].as_f64().unwrap();
            if objective == 0.0 {
                assert_eq!(solution, None, "{entry}");
                inseparable += 1;
            } else {
                assert!((solution.unwrap().gain / objective - 1.0).abs() < 1e-6, "{entry}");
                separable += 1;
            }
        }
    }
    assert!(separable >= 10 && inseparable >= 5, "{separable} {inseparable}");
}

#[test]
fn a_question_that_does_not_fit_the_model_is_refused() {
    let model = aircraft();
    let bounds = NoiseBounds::from(&model);
    let nominal = DVector::zeros(4);
    let question = FloorQuestion {
        mode: FaultMode::FAULT_FREE,
        actuator: 0,
        length: 1,
        pre_samples: 0,
    };
    let refusal = |question| solve(&model, &bounds, &nominal, question).unwrap_err();
    assert_eq!(
        refusal(FloorQuestion {
            actuator: 2,
            ..question
        }),
        FloorError::UnknownActuator {
            actuator: 2,
            count: 2
        }
    );
    let own = FaultMode::from_actuators(&[0]).unwrap();
    assert_eq!(
        refusal(FloorQuestion {
            mode: own,
            ..question
        }),
        FloorError::FaultInMode {
            actuator: 0,
            mode: own
        }
    );
    assert_eq!(
        refusal(FloorQuestion {
            length: 0,
            ..question
        }),
        FloorError::EmptyWindow
    );
    let error = solve(&model, &bounds, &DVector::zeros(3), question).unwrap_err();
    assert!(matches!(error, FloorError::InvalidVector { expected: 4, .. }));
    let silent = NoiseBounds {
        disturbance: DVector::zeros(4),
        measurement: DVector::zeros(4),
    };
    let error = solve(&model, &silent, &nominal, question).unwrap_err();
    assert_eq!(error, FloorError::Unlimited { actuator: 0 });
}
