//! Continuous-time facts of the paper's plant: `paper_facts.json` and method sheet 8(a).

use crate::kernels::{assert_matrix, matrix};
use crate::paper::paper_plant;
use crate::support::{numbers, reference_of};
use nalgebra::{DMatrix, DVector, dmatrix};
use residual_diagnosis::{
    decomposition::{SingularDecomposition, eigenvalues},
    hinf_filter::{
        plant::Plant,
        synthesis::{Weighted, synth_riccati_ct},
    },
    norms::{System, h_infinity_continuous, h_minus_continuous, initial_error_gain_continuous},
};
use serde_json::Value;

fn file() -> Value {
    reference_of("hinf_filter", "paper_facts.json")
}

/// The system from an input to V r under the gain H.
pub fn closed(
    plant: &Plant,
    h: &DMatrix<f64>,
    v: &DMatrix<f64>,
    b: &DMatrix<f64>,
    d: &DMatrix<f64>,
) -> System {
    System {
        a: &plant.a - h * &plant.c,
        b: b - h * d,
        c: v * &plant.c,
        d: v * d,
    }
}

fn t_rd(plant: &Plant, h: &DMatrix<f64>) -> System {
    closed(plant, h, &DMatrix::identity(2, 2), &plant.bd, &plant.dd)
}

fn t_rf(plant: &Plant, h: &DMatrix<f64>) -> System {
    closed(plant, h, &DMatrix::identity(2, 2), &plant.bf, &plant.df)
}

#[track_caller]
fn assert_near(what: &str, actual: f64, expected: f64, tolerance: f64) {
    assert!(
        (actual - expected).abs() <= tolerance,
        "{what}: {actual} instead of {expected}"
    );
}

#[test]
fn poles_and_norms_of_every_gain_of_the_reference() {
    let (plant, file) = (paper_plant(), file());
    for (name, gain) in file["gains"].as_object().unwrap() {
        let h = matrix(&gain["H"]);
        let number = |key: &str| gain[key].as_f64().unwrap();
        let check = |key: &str, actual: f64| assert_near(&format!("{name} {key}"), actual, number(key), 1e-9);
        let mut poles = eigenvalues(&(&plant.a - &h * &plant.c)).unwrap();
        poles.sort_by(|x, y| x.re.total_cmp(&y.re).then(x.im.total_cmp(&y.im)));
        let mut expected: Vec<_> = numbers(&gain["poles_re_im"])
            .chunks(2)
            .map(|z| (z[0], z[1]))
            .collect();
        expected.sort_by(|x, y| x.0.total_cmp(&y.0).then(x.1.total_cmp(&y.1)));
        for (pole, (re, im)) in poles.iter().zip(expected) {
            assert!(
                (pole.re - re).abs() < 1e-9 && (pole.im - im).abs() < 1e-9,
                "{name}: {pole}"
            );
        }
        check("hinf_Trd", h_infinity_continuous(&t_rd(&plant, &h)).value);
        check("hinf_Trf", h_infinity_continuous(&t_rf(&plant, &h)).value);
        check("hminus_Trf", h_minus_continuous(&t_rf(&plant, &h), None).value);
        for (j, expected) in numbers(&gain["hminus_per_fault"]).into_iter().enumerate() {
            let index = h_minus_continuous(&t_rf(&plant, &h).input(j), None).value;
            assert_near(&format!("{name} fault {j}"), index, expected, 1e-9);
        }
        check("norm2_H", SingularDecomposition::new(&h).largest());
        let a = &plant.a - &h * &plant.c;
        check(
            "initial_error_gain_L2",
            initial_error_gain_continuous(&a, &plant.c).unwrap(),
        );
        let from_state = System {
            a,
            b: DMatrix::identity(2, 2),
            c: plant.c.clone(),
            d: DMatrix::zeros(2, 2),
        };
        check("hinf_T0", h_infinity_continuous(&from_state).value);
    }
}

#[test]
fn half_the_identity_cancels_the_disturbance_in_the_state() {
    let plant = paper_plant();
    let h = DMatrix::identity(2, 2) * 0.5;
    assert_eq!(&plant.bd - &h * &plant.dd, DMatrix::zeros(2, 1));
    let direct = SingularDecomposition::new(&plant.dd).largest();
    assert_near("σ_max(Dd)", direct, 0.0282842712474619, 1e-15);
    assert_near(
        "‖T_rd‖",
        h_infinity_continuous(&t_rd(&plant, &h)).value,
        direct,
        1e-10,
    );
}

#[test]
fn fault_cancelling_makes_the_fault_pass_unchanged() {
    let plant = paper_plant();
    let h = &plant.bf * plant.df.clone().try_inverse().unwrap();
    assert!((&plant.bf - &h * &plant.df).amax() < 1e-15);
    let direct = SingularDecomposition::new(&plant.dd).largest();
    assert_near(
        "‖T_rd‖",
        h_infinity_continuous(&t_rd(&plant, &h)).value,
        direct,
        1e-9,
    );
}

#[test]
fn the_largest_fault_gain_is_not_determined_by_the_disturbance_gain() {
    let (plant, file) = (paper_plant(), file());
    let family = &file["family_b"];
    let number = |key: &str| family[key].as_f64().unwrap();
    let h = |b: f64| dmatrix![0.5, 0.0; b, 0.5 - b];
    let direct = SingularDecomposition::new(&plant.dd).largest();
    let b_max = number("b_max");
    assert_near("b_max", b_max, 4.388639, 1e-6);
    for b in [-3.0, 0.0, number("b_for_hinf_Trf_3p2037"), 4.3, b_max - 1e-4] {
        assert_near(
            "‖T_rd‖",
            h_infinity_continuous(&t_rd(&plant, &h(b))).value,
            direct,
            1e-9,
        );
    }
    let fault_gain = |b: f64| h_infinity_continuous(&t_rf(&plant, &h(b))).value;
    assert_near(
        "‖T_rf‖",
        fault_gain(number("b_for_hinf_Trf_3p2037")),
        3.2037,
        1e-6,
    );
    assert_near("‖T_rf‖", fault_gain(4.3), number("hinf_Trf_at_b_4p3"), 1e-6);
    assert!(fault_gain(b_max - 1e-6).is_finite());
    assert_eq!(fault_gain(b_max + 1e-6), f64::INFINITY, "unstable beyond b_max");
}

#[test]
fn a_row_without_disturbance_sees_both_faults() {
    let (plant, file) = (paper_plant(), file());
    let (h, v) = (DMatrix::identity(2, 2) * 0.5, dmatrix![1.0, -1.0]);
    let fact = |key: &str| file["decoupled"][key].as_f64().unwrap();
    let d = h_infinity_continuous(&closed(&plant, &h, &v, &plant.bd, &plant.dd)).value;
    assert_near("gain from d", d, 0.0, 1e-15);
    let fault = closed(&plant, &h, &v, &plant.bf, &plant.df);
    for j in 0..2 {
        let (low, high) = (format!("f{}_min", j + 1), format!("f{}_max", j + 1));
        assert_near(
            &low,
            h_minus_continuous(&fault.input(j), None).value,
            fact(&low),
            1e-6,
        );
        assert_near(
            &high,
            h_infinity_continuous(&fault.input(j)).value,
            fact(&high),
            1e-6,
        );
    }
}

#[test]
fn the_continuous_riccati_design_reaches_the_best_ratio() {
    let (plant, file) = (paper_plant(), file());
    for noise in ["0.01", "0.002"] {
        let fact = &file["continuous_riccati"][&format!("noise_weight_{noise}")];
        let size: f64 = noise.parse().unwrap();
        let weighted = Weighted::new(
            &plant.bd,
            &plant.dd,
            &DVector::from_element(1, 1.0),
            &DVector::from_element(2, size),
        );
        assert_matrix("Bd_w", &weighted.b, &fact["Bd_w"], 1e-15);
        assert_matrix("Dd_w", &weighted.d, &fact["Dd_w"], 1e-15);
        let design = synth_riccati_ct(&plant, &weighted).unwrap();
        assert_matrix("Pi", &design.solution.pi, &fact["Pi"], 1e-8);
        assert_matrix("H", &design.gain, &fact["H"], 1e-8);
        assert_matrix("V", &design.v, &fact["V"], 1e-8);
        let number = |key: &str| fact[key].as_f64().unwrap();
        let ratio = |v: &DMatrix<f64>| {
            let fault = h_minus_continuous(&closed(&plant, &design.gain, v, &plant.bf, &plant.df), None);
            let disturbance =
                h_infinity_continuous(&closed(&plant, &design.gain, v, &weighted.b, &weighted.d));
            (fault.value, disturbance.value)
        };
        let (fault, disturbance) = ratio(&design.v);
        assert_near("‖V T_rw‖", disturbance, number("hinf_V_Trd"), 1e-8);
        assert_near("‖V T_rf‖₋", fault, number("hminus_V_Trf"), 1e-6);
        assert_near("ratio", fault / disturbance, number("ratio"), 1e-6);
        let (fault, disturbance) = ratio(&DMatrix::identity(2, 2));
        assert_near(
            "ratio with V = I",
            fault / disturbance,
            number("ratio_V_identity"),
            1e-6,
        );
    }
}

/// Root energy of the residual under d = 0.01 sin t from rest, exactly: ∫ of a quadratic form by an exponential.
#[test]
fn the_energy_of_the_disturbance_passes_the_papers_bound_after_50_s() {
    let file = file();
    let root = |t: f64| 0.01 * ((t - (2.0 * t).sin() / 2.0) / 2.0).sqrt();
    for (time, expected) in [25.0, 30.0, 50.0]
        .into_iter()
        .zip(numbers(&file["horizon"]["norm_d_25_30_50"]))
    {
        assert_near("‖d‖", root(time), expected, 1e-12);
    }
    let crossing = file["horizon"]["time_when_norm_d_reaches_0p05"].as_f64().unwrap();
    assert_near("‖d‖", root(crossing), 0.05, 1e-9);
}
