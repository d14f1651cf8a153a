//! The mixed H₋/H∞ synthesis reaches the closed-form optimum of the Riccati design (method sheet 3.3).

use crate::{
    files::reference_of,
    plants::{Plant, matrix, norm},
};
use residual_diagnosis::{decomposition::eigenvalues, norms::System, norms::h_minus_continuous};
use residual_synthesis::hinf_filter::lmi::{Region, Time, mixed};

#[test]
fn the_ratio_of_the_riccati_design_is_reached() {
    let file = &reference_of("hinf_filter", "paper_facts.json")["continuous_riccati"];
    for key in ["noise_weight_0.01", "noise_weight_0.002"] {
        let mut plant = Plant::paper();
        (plant.bd, plant.dd) = (matrix(&file[key]["Bd_w"]), matrix(&file[key]["Dd_w"]));
        let found = mixed(&plant.error(), &plant.bf, &plant.df, &Region::default()).unwrap();
        let filtered = |system: System| System {
            c: &found.v * system.c,
            d: &found.v * system.d,
            ..system
        };
        let disturbance = norm(Time::Continuous, &filtered(plant.disturbance(&found.gain)));
        let fault = h_minus_continuous(&filtered(plant.fault(&found.gain)), None).value;
        let expected = file[key]["ratio"].as_f64().unwrap();
        let ratio = fault / disturbance;
        assert!((ratio / expected - 1.0).abs() < 1e-5, "{key}: {ratio} {expected}");
        assert!((fault - found.index).abs() < 1e-9 * fault && disturbance <= found.bound);
    }
}

#[test]
fn a_region_costs_sensitivity_and_is_kept() {
    let file = &reference_of("hinf_filter", "paper_facts.json")["continuous_riccati"]["noise_weight_0.01"];
    let mut plant = Plant::paper();
    (plant.bd, plant.dd) = (matrix(&file["Bd_w"]), matrix(&file["Dd_w"]));
    let region = Region {
        decay: Some(6.0),
        radius: Some(30.0),
    };
    let found = mixed(&plant.error(), &plant.bf, &plant.df, &region).unwrap();
    let optimum = file["ratio"].as_f64().unwrap();
    assert!(
        found.index < optimum && found.index > 0.5 * optimum,
        "{}",
        found.index
    );
    for pole in eigenvalues(&plant.disturbance(&found.gain).a).unwrap() {
        assert!(pole.re < -6.0 && pole.norm() < 30.0, "{pole}");
    }
}
