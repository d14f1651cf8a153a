//! Gains, reductions and orders of the filter against the reference `vtol_variants`.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

mod support;

use serde_json::Value;
use support::*;

const TOLERANCE: f64 = 1e-9;

/// Runs mode \[0\] on the data of case 1 with this `[filter]` table and looks at every record.
fn run_case1(
    filter: &str,
    mut look: impl FnMut(
        usize,
        &residual_diagnosis::unknown_input_filter::UnknownInputFilterBank,
        Vec<f64>,
        Vec<f64>,
    ),
) {
    let design = reference("vtol_design.json");
    let mut options = options(&format!(
        r#"
        bank = {{ fault_free_mode = false, reset = "none" }}
        filter = {filter}
        missing = {{ policy = "unbounded_fault" }}
        "#
    ));
    options.filter.s = Some(rows(&design["model"]["S"]));
    let mut bank = bank(&vtol(), &options);
    for (k, y) in rows(&reference("vtol_case1.json")["y"]).iter().enumerate() {
        let record = step(&mut bank, y, &[0.0, 0.0]);
        if k > 0 {
            let mut names: Vec<String> = (0..4).map(|j| format!("mode_0_output_{j}")).collect();
            if !filter.contains("paper") {
                names.push("mode_0_matched_1".to_owned());
            }
            let (residual, half_width) = names
                .iter()
                .map(|name| residual_and_width(&bank, &record, name))
                .unzip();
            look(k, &bank, residual, half_width);
        }
    }
}

fn check(variant: &Value, k: &[usize], filter: &str) {
    let mut checked = 0;
    run_case1(filter, |instant, bank, residual, half_width| {
        let Some(position) = k.iter().position(|listed| *listed == instant) else {
            return;
        };
        checked += 1;
        let (centre, radius) = bank.state_set(0).unwrap();
        let what = format!("{} at {instant}", variant["name"]);
        assert_close(
            &what,
            &residual,
            &numbers(&variant["residual"][position]),
            TOLERANCE,
        );
        assert_close(
            &what,
            &half_width,
            &numbers(&variant["half_width"][position]),
            TOLERANCE,
        );
        assert_close(&what, &centre, &numbers(&variant["centre"][position]), TOLERANCE);
        assert_close(&what, &radius, &numbers(&variant["radius"][position]), TOLERANCE);
    });
    assert_eq!(checked, k.len());
}

#[test]
fn every_gain_sweep_reduction_and_order_agrees() {
    let file = reference("vtol_variants.json");
    let k = integers(&file["k"]);
    for variant in file["variants"].as_array().unwrap() {
        let common = format!(
            "initialisation = \"prior\", outward_rounding = false, generator_order = {}, reduction = {}",
            variant["generator_order"], variant["reduction"]
        );
        let gain = match variant["gain"].as_str() {
            None => "form = \"paper\", test = \"printed\"".to_owned(),
            Some("frobenius") => "gain = \"frobenius\"".to_owned(),
            Some(_) => format!("gain = \"row_wise\", gain_sweeps = {}", variant["sweeps"]),
        };
        check(variant, &k, &format!("{{ {common}, {gain} }}"));
    }
}

#[test]
fn outward_rounding_costs_next_to_no_width() {
    let file = reference("vtol_variants.json");
    let mut widths = Vec::new();
    for outward in [false, true] {
        let filter = format!(
            "{{ initialisation = \"prior\", generator_order = 20, gain = \"frobenius\", outward_rounding = {outward} }}"
        );
        let mut seen = Vec::new();
        run_case1(&filter, |k, _, _, half_width| {
            if (21..=100).contains(&k) {
                seen.extend(half_width);
            }
        });
        widths.push(seen);
    }
    let growth = widths[1]
        .iter()
        .zip(&widths[0])
        .map(|(outward, plain)| outward / plain - 1.0);
    let limit = file["outward_rounding"]["must_be_below"].as_f64().unwrap();
    for value in growth {
        assert!(value > 0.0 && value < limit, "{value}");
    }
}
