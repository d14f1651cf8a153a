//! `vehicle_single_track.json`: lost samples, isolation, and a plant that is unstable.

use crate::kernels::{assert_matrix, matrix};
use crate::paper::{channel, given, model_table, plant, step};
use crate::support::{assert_close, integers, numbers, reference_of, rows};
use nalgebra::DVector;
use residual_diagnosis::{
    diagnoser::{Diagnoser, StepRecord},
    hinf_filter::{
        HinfFilter,
        constants::{ErrorFilter, ErrorModel},
        error::HinfFilterError,
        gap::GapEnvelope,
        options::HinfFilterOptions,
    },
    method::MethodOptions,
    norms::l1_norm,
};
use serde_json::Value;

fn file() -> Value {
    reference_of("hinf_filter", "vehicle_single_track.json")
}

fn options(vehicle: &Value, synthesis: &str, isolation: &str, require_stable: bool) -> HinfFilterOptions {
    let model = model_table(&vehicle["plant"], &format!("require_stable = {require_stable}"));
    let tables = format!(
        "[disturbance]\namplitude = {}\n[synthesis]\n{synthesis}\n[filter]\ninitial = \"given\"\ninitial_error_bound = \
         {}\n{isolation}",
        vehicle["disturbance_amplitude"], vehicle["initial_error_bound"]
    );
    toml::from_str(&format!("{model}{tables}")).unwrap()
}

/// Hands every record of the recorded run to `take`.
fn run(vehicle: &Value, filter: &mut HinfFilter, mut take: impl FnMut(usize, &HinfFilter, &StepRecord)) {
    let (u, y) = (numbers(&vehicle["inputs"]["u"]), rows(&vehicle["inputs"]["y"]));
    let missing = integers(&vehicle["inputs"]["missing_samples"]);
    for k in 0..u.len() {
        // One element is enough to lose the sample.
        let mut sample = y[k].clone();
        if missing.contains(&k) {
            sample[k % 2] = f64::NAN;
        }
        let record = step(filter, &sample, &u[k..=k]);
        take(k, filter, &record);
    }
}

fn alarms(filter: &HinfFilter, record: &StepRecord, prefix: &str) -> [bool; 2] {
    let ratio = |name: &str| channel(filter, record, &format!("{prefix}{name}")).ratio;
    [ratio("energy") > 1.0, ratio("r1") > 1.0 || ratio("r2") > 1.0]
}

fn check_run(name: &str) {
    let file = file();
    let vehicle = &file[name];
    let (design, expected) = (&vehicle["design"], &vehicle["expected"]);
    let given = format!(
        "type = \"given\"\n{}{}",
        given("L", &design["L"]),
        given("V", &design["V"])
    );
    let ts = vehicle["Ts"].as_f64().unwrap();
    let mut filter = HinfFilter::new(&options(vehicle, &given, "", false), ts).unwrap();
    let terms = &vehicle["threshold_terms"];
    let constants = filter.report().constants.clone().unwrap();
    assert_close(
        "rho_d",
        constants.amplitude.as_slice(),
        &numbers(&terms["rho_d"]),
        1e-8,
    );
    assert_close("gamma", &[constants.gamma], &numbers(&terms["gamma"]), 1e-8);
    assert_close("mu", &[constants.memory], &numbers(&terms["mu"]), 1e-8);
    assert_close("J_d", &[constants.energy], &numbers(&terms["J_d"]), 1e-8);
    let plant = plant(&vehicle["plant"]);
    let sampled = plant.sample(ts);
    let (gain, v) = (matrix(&design["L"]), matrix(&design["V"]));
    let closed = &sampled.ad - &gain * &plant.c;
    let error = ErrorFilter {
        closed: &closed,
        gain: &gain,
        c: &plant.c,
        v: &v,
    };
    let model = ErrorModel::nominal(error, &sampled.bdd, &plant.dd, DVector::zeros(2));
    let l1 = l1_norm(&model.disturbance_system()).unwrap();
    assert_matrix("l1", &l1, &terms["l1"], 1e-8);
    let gap = GapEnvelope::new(error, &v.clone().try_inverse().unwrap()).unwrap();
    assert_close("gap rate", &[gap.rate], &numbers(&terms["gap_rate"]), 1e-8);
    assert_matrix("gap envelope", &gap.envelope, &terms["gap_envelope_c"], 1e-8);
    let wanted = rows(&expected["rows"]);
    let (mut found, mut energy, mut peak) = (Vec::new(), Vec::new(), Vec::new());
    run(vehicle, &mut filter, |k, filter, record| {
        let alarm = alarms(filter, record, "");
        energy.extend(alarm[0].then_some(k));
        peak.extend(alarm[1].then_some(k));
        if wanted.iter().any(|row| row[0] as usize == k) {
            let j = channel(filter, record, "energy");
            let (r, rho, x) = (filter.residual(), filter.bound(), filter.state_estimate());
            let flag = |alarm: bool| f64::from(u8::from(alarm));
            found.push(vec![
                k as f64,
                j.residual,
                j.upper,
                r[0],
                r[1],
                rho[0],
                rho[1],
                flag(alarm[0]),
                flag(alarm[1]),
                x[0],
                x[1],
            ]);
        }
    });
    for column in 0..wanted[0].len() {
        let of = |rows: &[Vec<f64>]| rows.iter().map(|row| row[column]).collect::<Vec<_>>();
        assert_close(
            &format!("{name}, column {column}"),
            &of(&found),
            &of(&wanted),
            1e-8,
        );
    }
    assert_eq!(energy, integers(&expected["energy_alarm_k"]));
    assert_eq!(peak, integers(&expected["peak_alarm_k"]));
}

#[test]
fn the_stable_car_runs_as_in_the_reference() {
    check_run("understeer_20_m_per_s");
}

#[test]
fn the_unstable_car_runs_as_in_the_reference() {
    check_run("oversteer_40_m_per_s_unstable");
}

/// w_d = 1 and no noise columns.
const UNWEIGHTED: &str = "disturbance_weight = [1, 1, 1]\nnoise_weight = [0, 0]";

#[test]
fn designs_of_both_cars_agree_with_the_reference() {
    let file = file();
    for name in ["understeer_20_m_per_s", "oversteer_40_m_per_s_unstable"] {
        let vehicle = &file[name];
        let ts = vehicle["Ts"].as_f64().unwrap();
        let design = &vehicle["design"];
        let sampled = plant(&vehicle["plant"]).sample(ts);
        assert_matrix("Ad", &sampled.ad, &design["Ad"], 1e-12);
        assert_matrix("Bdd", &sampled.bdd, &design["Bdd"], 1e-12);
        let filter = HinfFilter::new(&options(vehicle, UNWEIGHTED, "", false), ts).unwrap();
        let report = filter.report();
        assert_matrix("L", &report.gain, &design["L"], 1e-8);
        assert_matrix("V", &report.v, &design["V"], 1e-8);
        let certificate = &report.certificate;
        for (actual, key) in [
            (report.optimum.unwrap(), "gamma_lower_bound"),
            (certificate.disturbance, "hinf_Trd"),
            (certificate.weighted_disturbance, "hinf_V_Trd"),
            (certificate.fault_index, "hminus_V_Trf"),
        ] {
            let expected = design[key].as_f64().unwrap();
            assert!(
                (actual - expected).abs() <= 1e-8 * expected,
                "{key}: {actual} {expected}"
            );
        }
        assert_close(
            "per fault",
            &certificate.fault_indices,
            &numbers(&design["hminus_V_per_fault"]),
            1e-8,
        );
    }
}

#[test]
fn the_unstable_car_is_refused_if_stability_is_required() {
    let file = file();
    let vehicle = &file["oversteer_40_m_per_s_unstable"];
    let error = HinfFilter::new(&options(vehicle, UNWEIGHTED, "", true), 0.02).unwrap_err();
    assert!(matches!(error, HinfFilterError::NotStable { .. }));
    assert!(error.to_string().contains("0.757897"), "{error}");
}

#[test]
fn the_bank_of_the_stable_car_alarms_as_in_the_reference() {
    let file = file();
    let vehicle = &file["understeer_20_m_per_s"];
    let bank = &vehicle["isolation_bank"];
    let bound = |name: &str| bank[name]["fault_bound"].as_f64().unwrap();
    let isolation = format!(
        "[isolation]\nblind_sets = [[\"f1\"], [\"f2\"]]\nblind_weight = 100.0\nfault_bound = [{}, {}]\n",
        bound("blind_to_f1"),
        bound("blind_to_f2")
    );
    for name in ["blind_to_f1", "blind_to_f2"] {
        let mut filter = HinfFilter::new(&options(vehicle, UNWEIGHTED, &isolation, true), 0.02).unwrap();
        let (mut energy, mut peak) = (Vec::new(), Vec::new());
        run(vehicle, &mut filter, |k, filter, record| {
            let alarm = alarms(filter, record, &format!("{name}_"));
            energy.extend(alarm[0].then_some(k));
            peak.extend(alarm[1].then_some(k));
        });
        assert_eq!(energy, integers(&bank[name]["energy_alarm_k"]), "{name}");
        assert_eq!(peak, integers(&bank[name]["peak_alarm_k"]), "{name}");
    }
    let options = options(vehicle, UNWEIGHTED, &isolation, true);
    for blind in options.find_gains(0.02).unwrap().gains.blind {
        let expected = &bank[&format!("blind_to_{}", blind.faults[0])];
        // R of the filter blind to the steering has the condition 7e12: nobody knows its L better than to 1e-6.
        assert_close("L", &blind.l.concat(), &numbers(&expected["L"]), 1e-6);
        assert_close("V", &blind.v.concat(), &numbers(&expected["V"]), 1e-6);
    }
}

#[test]
fn a_record_of_the_car_holds_all_channels_of_bank_and_estimate() {
    let file = file();
    let vehicle = &file["understeer_20_m_per_s"];
    let isolation = "[isolation]\nfault_names = [\"steering\", \"yaw_rate_sensor\"]\nblind_sets = [[\"steering\"]]\n\
                     fault_bound = [0.03, 0.06]\nfault_estimate = true\n";
    let filter = HinfFilter::new(&options(vehicle, UNWEIGHTED, isolation, true), 0.02).unwrap();
    let names: Vec<_> = filter
        .description()
        .channels
        .iter()
        .map(|c| c.name.as_str())
        .collect();
    assert_eq!(
        names,
        [
            "energy",
            "r1",
            "r2",
            "blind_to_steering_energy",
            "blind_to_steering_r1",
            "blind_to_steering_r2",
            "fault_estimate_steering",
            "fault_estimate_yaw_rate_sensor"
        ]
    );
}
