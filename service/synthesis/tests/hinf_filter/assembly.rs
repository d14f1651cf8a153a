//! The matrices of all inequalities against the reference (`kernels.json`).

use crate::{
    files::reference_of,
    plants::{Plant, matrix},
};
use nalgebra::DMatrix;
use residual_diagnosis::hinf_filter::plant::zoh;
use residual_synthesis::hinf_filter::lmi::{
    ErrorPlant, Time,
    inequalities::{PaperVariables, bounded_real_of_gain, condition_13, decay, radius},
};
use serde_json::Value;

fn assert_matrix(what: &str, actual: &DMatrix<f64>, expected: &Value) {
    let expected = matrix(expected);
    assert_eq!(actual.shape(), expected.shape(), "{what}");
    for (value, wanted) in actual.iter().zip(expected.iter()) {
        let allowed = 1e-8 * wanted.abs() + 1e-15 * expected.amax();
        assert!((value - wanted).abs() <= allowed, "{what}: {value} {wanted}");
    }
}

#[test]
fn every_inequality_has_the_entries_of_the_reference() {
    let file = &reference_of("hinf_filter", "kernels.json")["lmi_assembly"];
    let plant = Plant::paper();
    let number = |key: &str| file[key].as_f64().unwrap();
    let variable = |key: &str| matrix(&file["variables"][key]);
    let variables = PaperVariables {
        r: variable("R"),
        x: variable("X"),
        z: variable("Z"),
        y: variable("Y"),
        m: variable("M"),
        k: variable("K"),
        n: variable("N"),
        t: variable("T"),
    };
    let gamma = number("gamma");
    let faults = (&plant.bf, &plant.df);
    let printed = condition_13(&plant.error(), faults, &variables, (1.0, gamma));
    assert_matrix("(13) as printed", &printed, &file["lmi13_printed"]);
    let lemma = condition_13(&plant.error(), faults, &variables, (gamma, gamma));
    assert_matrix("(13) by Lemma 1", &lemma, &file["lmi13_lemma1"]);

    let (delta, s) = (number("delta"), number("s"));
    let (bd, dd) = (&plant.bd / delta, &plant.dd / delta);
    let scaled = ErrorPlant {
        a: &plant.a,
        bd: &bd,
        c: &plant.c,
        dd: &dd,
    };
    let (x, w) = (&variables.x, &variables.y.transpose());
    let bounded = bounded_real_of_gain(Time::Continuous, &scaled, x, w, s, gamma * s);
    assert_matrix("continuous bounded real", &bounded, &file["brl_ct"]);
    let region = decay(&scaled, x, w, number("alpha"));
    assert_matrix("decay", &region, &file["region_alpha"]);
    let region = radius(&scaled, x, w, number("rho"));
    assert_matrix("radius", &region, &file["region_rho"]);

    let (ad, bdd) = zoh(&plant.a, &bd, number("Ts"));
    let sampled = ErrorPlant {
        a: &ad,
        bd: &bdd,
        ..scaled
    };
    let bounded = bounded_real_of_gain(Time::Discrete, &sampled, x, &variables.z, s, gamma * s);
    assert_matrix("discrete bounded real", &bounded, &file["brl_dt"]);
}
