//! `paper_runs.json`: the paper's evaluation, cumulative left-rectangle energy against a constant threshold.

use crate::paper::{PaperPlant, TS, channel, paper_options, step};
use crate::support::{assert_close, integers, numbers, reference_of, rows};
use residual_diagnosis::hinf_filter::HinfFilter;
use serde_json::Value;

/// Instants after which no case is listed any more.
const STEPS: usize = 3001;

fn run(case: &str, expected: &Value, name: &str, synthesis: &str, realisation: &str) {
    let file = reference_of("hinf_filter", "paper_runs.json");
    let threshold = file["threshold"].as_f64().unwrap();
    let tables = format!(
        "[disturbance]\n[synthesis]\n{synthesis}\n[filter]\nrealisation = \"{realisation}\"\ninitial = \"given\"\n\
         [evaluation]\nwindow = \"cumulative\"\ninclude_current = false\nthreshold = \"constant\"\nconstant_threshold = \
         {threshold}\n"
    );
    let mut filter = HinfFilter::new(&paper_options(&tables), TS).unwrap();
    let mut plant = PaperPlant::new(case);
    let wanted = integers(&expected["k"]);
    let (mut residuals, mut energies, mut outputs, mut alarm) = (Vec::new(), Vec::new(), Vec::new(), None);
    for k in 0..STEPS {
        let y = plant.next();
        let record = step(&mut filter, &y, &[1.0]);
        let energy = channel(&filter, &record, "energy");
        if wanted.contains(&k) {
            residuals.extend_from_slice(filter.residual());
            energies.push(energy.residual);
            outputs.extend(y);
        }
        alarm = alarm.or((energy.ratio > 1.0).then_some(k));
    }
    assert_close("y", &outputs, &rows(&expected["y"]).concat(), 1e-12);
    let residual = rows(&expected[&format!("r_{name}")]).concat();
    assert_close(&format!("{case} r_{name}"), &residuals, &residual, 1e-8);
    let energy = numbers(&expected[&format!("J_cumulative_{name}")]);
    assert_close(&format!("{case} J_{name}"), &energies, &energy, 1e-8);
    let expected = expected[&format!("alarm_s_{name}")].as_f64();
    assert_eq!(
        alarm,
        expected.map(|time| (time / TS).round() as usize),
        "{case} {name}"
    );
}

#[test]
fn cumulative_runs_of_all_three_realisations_agree_with_the_reference() {
    let file = reference_of("hinf_filter", "paper_runs.json");
    let half = "type = \"given\"\nH = [[0.5, 0], [0, 0.5]]";
    for (case, expected) in file["runs"].as_object().unwrap() {
        run(case, expected, "zoh", half, "filter_zoh");
        run(case, expected, "foh", half, "filter_foh");
        let matched = "type = \"matched\"";
        run(
            case,
            expected,
            "discrete_observer_matched",
            matched,
            "discrete_observer",
        );
    }
}

#[test]
fn the_papers_evaluation_alarms_without_a_fault_after_67_s() {
    // The energy of d grows for ever: J = ‖T_rd d‖ passes the threshold in fault-free operation.
    let file = reference_of("hinf_filter", "paper_facts.json");
    let expected = file["horizon"]["false_alarm_time_cumulative_half_identity"]
        .as_f64()
        .unwrap();
    let tables = format!(
        "[disturbance]\n[synthesis]\ntype = \"matched\"\n[filter]\ninitial = \"given\"\n[evaluation]\nwindow = \"cumulative\"\n\
         threshold = \"constant\"\nconstant_threshold = {}\n",
        file["threshold_paper"]
    );
    let mut filter = HinfFilter::new(&paper_options(&tables), TS).unwrap();
    let mut plant = PaperPlant::new("none");
    let alarm = (0..7000).find(|_| {
        let record = step(&mut filter, &plant.next(), &[1.0]);
        channel(&filter, &record, "energy").ratio > 1.0
    });
    let time = alarm.unwrap() as f64 * TS;
    assert!((time - expected).abs() < 0.1, "{time} {expected}");
}
