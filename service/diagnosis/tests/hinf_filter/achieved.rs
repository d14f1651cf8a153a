//! What the filter says of itself, against the plant and the reference.

use crate::paper::{PaperPlant, RICCATI, TS, channel, paper_options, step, windowed};
use residual_diagnosis::{
    achieved::{Achieved, TimeDomain},
    diagnoser::Diagnoser,
    hinf_filter::HinfFilter,
    method::MethodOptions,
};

const BANK: &str = "[isolation]\nblind_sets = [[\"f1\"], [\"f2\"]]\nfault_bound = [0.3, 0.3]\nfault_slew = [0.05, \
                    0.05]\nfault_estimate = true\n";

fn filter(synthesis: &str, more: &str) -> HinfFilter {
    HinfFilter::new(&paper_options(&format!("{}{more}", windowed(synthesis))), TS).unwrap()
}

fn achieved(synthesis: &str, more: &str) -> Achieved {
    filter(synthesis, more).report().achieved.clone()
}

fn norm(achieved: &Achieved, name: &str) -> (f64, Option<f64>) {
    let found = achieved.norms.iter().find(|norm| norm.name == name);
    let found = found.unwrap_or_else(|| panic!("no {name}: {:?}", achieved.norms));
    (found.value, found.lower_bound)
}

#[test]
fn norms_and_poles_of_the_papers_plant_are_those_of_the_sheet() {
    let found = achieved("type = \"given\"\nH = [[0.5, 0], [0, 0.5]]", "");
    let direct = 0.0282842712474619;
    let (value, bound) = norm(&found, "largest gain from disturbance to residual (continuous)");
    assert!((value - direct).abs() < 1e-10 && (bound.unwrap() - direct).abs() < 1e-15);
    let (value, bound) = norm(&found, "largest gain from fault to residual (continuous)");
    assert!((value - 1.0).abs() < 1e-9 && bound == Some(1.0));
    let (value, _) = norm(
        &found,
        "smallest gain from fault to filtered residual (continuous)",
    );
    assert!((value - 0.267).abs() < 1e-9);
    let continuous = &found.poles[0];
    assert_eq!(continuous.time, TimeDomain::Continuous);
    for (pole, expected) in continuous.values.iter().zip([-3.2400934172, -3.0259065828]) {
        assert!((pole[0] - expected).abs() < 1e-9 && pole[1] == 0.0);
    }
    assert_eq!(
        (found.poles.len(), found.poles[1].time),
        (2, TimeDomain::Discrete)
    );
    let riccati = achieved(RICCATI, "");
    let (value, bound) = norm(
        &riccati,
        "largest gain from weighted disturbance and noise to residual",
    );
    assert!(
        (value / bound.unwrap() - 1.0).abs() < 1e-8,
        "the Riccati design is optimal"
    );
    // The ratio of the method sheet, item 2.
    let (index, _) = norm(&riccati, "smallest gain from fault to filtered residual");
    assert!((index - 12.7722).abs() < 1e-3, "{index}");
}

#[test]
fn faults_are_seen_from_the_sizes_of_the_sheet_on_if_they_last() {
    for (synthesis, expected) in [
        (RICCATI, [2.468e-4, 5.475e-5]),
        ("type = \"matched\"", [1.062e-3, 4.464e-4]),
    ] {
        let filter = filter(synthesis, "");
        let report = filter.report();
        let lasting = report.detectable.as_ref().unwrap();
        for ((fault, lasting), expected) in report.achieved.faults.iter().zip(lasting).zip(expected) {
            assert!((lasting / expected - 1.0).abs() < 5e-4, "{synthesis}: {lasting}");
            // A short overshoot can be seen of smaller ones.
            let detectable = fault.detectable.unwrap();
            assert!(detectable <= lasting * (1.0 + 2e-6), "{detectable} {lasting}");
            assert_eq!(fault.assurance, 1.0);
            let sizes: Vec<_> = fault.delays.iter().map(|delay| delay.size).collect();
            assert!(sizes.windows(2).all(|pair| pair[1] < pair[0]), "{sizes:?}");
            assert_eq!(sizes.last(), Some(&detectable));
            assert!(sizes.len() <= 16);
        }
    }
}

/// Alarms of a filter on the paper's plant with a constant fault from t = 5 s on; instants after the onset.
fn first_peak(synthesis: &str, fault: usize, size: f64, opposite: bool) -> Option<usize> {
    let options = paper_options(&windowed(synthesis).replace("slew = [0.01]\n", ""));
    let mut filter = HinfFilter::new(&options, TS).unwrap();
    let plant = crate::paper::paper_plant();
    let sampled = plant.sample(TS);
    let mut x = nalgebra::DVector::zeros(2);
    let sign = if opposite { -1.0 } else { 1.0 };
    (0..2500_usize).find_map(|k| {
        let mut f = nalgebra::DVector::zeros(2);
        if k >= 500 {
            f[fault] = size * sign;
        }
        // A disturbance that works against the fault all the time.
        let d = nalgebra::dvector![0.01 * if (k / 7) % 2 == 0 { 1.0 } else { -1.0 }];
        let y = &plant.c * &x + &plant.dd * &d + &plant.df * &f;
        x = &sampled.ad * &x + &sampled.bdd * &d + &sampled.bfd * &f;
        let record = step(&mut filter, y.as_slice(), &[0.0]);
        let alarms = ["r1", "r2"].map(|name| channel(&filter, &record, name).ratio > 1.0);
        assert!(k >= 500 || alarms == [false, false], "no alarm without a fault");
        alarms.contains(&true).then(|| k - 500)
    })
}

#[test]
fn a_fault_of_the_stated_size_alarms_within_the_stated_delay() {
    for synthesis in [
        RICCATI,
        "type = \"matched\"",
        "type = \"given\"\nH = [[0.2, 0.1], [0, 0.3]]",
    ] {
        let options = paper_options(&windowed(synthesis).replace("slew = [0.01]\n", ""));
        let found = options.design(TS).unwrap().achieved;
        for (j, fault) in found.faults.iter().enumerate() {
            assert!(!fault.delays.is_empty());
            for delay in &fault.delays {
                for opposite in [false, true] {
                    let allowed = (delay.within_s / TS).round() as usize;
                    let alarm = first_peak(synthesis, j, delay.size * 1.000_001, opposite);
                    assert!(
                        alarm.is_some_and(|alarm| alarm <= allowed),
                        "{synthesis} {j}: {alarm:?} {delay:?}"
                    );
                }
            }
        }
    }
}

#[test]
fn a_bank_tells_both_faults_apart_and_an_isolable_fault_is_isolated() {
    let found = achieved(RICCATI, BANK);
    assert_eq!(found.isolability.len(), 2);
    for separation in &found.isolability {
        assert_eq!(separation.instants, Some(1), "{separation:?}");
    }
    for fault in &found.faults {
        let size = fault.isolable.unwrap();
        assert!(size < 0.3 && size > fault.detectable.unwrap(), "{fault:?}");
    }
    // One filter alone rules out f1 only.
    let half = achieved(RICCATI, &BANK.replace("[[\"f1\"], [\"f2\"]]", "[[\"f1\"]]"));
    let instants: Vec<_> = half
        .isolability
        .iter()
        .map(|pair| (pair.fault.as_str(), pair.instants))
        .collect();
    assert_eq!(instants, [("f1", None), ("f2", Some(1))]);
    assert!(half.faults[0].isolable.is_none() && half.faults[1].isolable.is_some());
    assert!(achieved(RICCATI, "").isolability.is_empty());
}

#[test]
fn settled_thresholds_are_those_of_the_channels() {
    let mut filter = filter(RICCATI, BANK);
    let mut plant = PaperPlant::new("none");
    let mut record = step(&mut filter, &plant.next(), &[1.0]);
    for _ in 0..1499 {
        record = step(&mut filter, &plant.next(), &[1.0]);
    }
    let names: Vec<_> = filter
        .description()
        .channels
        .iter()
        .map(|c| c.name.clone())
        .collect();
    let thresholds = &filter.report().achieved.thresholds;
    let stated: Vec<_> = thresholds
        .iter()
        .map(|threshold| threshold.channel.clone())
        .collect();
    assert_eq!(stated, names);
    for threshold in thresholds {
        let found = channel(&filter, &record, &threshold.channel);
        let half = match threshold.channel.ends_with("energy") {
            true => found.upper,
            false => (found.upper - found.lower) / 2.0,
        };
        assert!(
            (half / threshold.settled - 1.0).abs() < 1e-6,
            "{threshold:?} {half}"
        );
    }
}

#[test]
fn channels_that_are_sure_of_nothing_are_named() {
    let reason = |achieved: &Achieved, channel: &str| {
        let found = achieved
            .thresholds
            .iter()
            .find(|threshold| threshold.channel == channel);
        let found = found.unwrap();
        assert_eq!(found.never_fires, None, "{found:?}");
        found.insensitive.clone()
    };
    // [1, -1] sees no disturbance; the second fault acts on the first state alone.
    let found = achieved(RICCATI, "");
    assert_eq!(reason(&found, "r1"), None);
    let declared = |bound: &str| {
        achieved(
            RICCATI,
            &BANK
                .replace("[0.3, 0.3]", bound)
                .replace("fault_estimate = true", ""),
        )
    };
    assert_eq!(reason(&declared("[0.3, 0.3]"), "r1"), None);
    let tiny = declared("[1e-6, 1e-6]");
    assert!(reason(&tiny, "r1").unwrap().contains("within its declared bound"));
    let tables = windowed(RICCATI) + "[evaluation]\nwindow = \"cumulative\"\n";
    let cumulative = HinfFilter::new(&paper_options(&tables), TS).unwrap();
    let report = cumulative.report();
    assert!(
        report
            .achieved
            .thresholds
            .iter()
            .all(|threshold| threshold.channel != "energy")
    );
    assert!(
        report
            .warnings
            .iter()
            .any(|warning| warning.contains("grows with time")),
        "{:?}",
        report.warnings
    );
    let tables = windowed(RICCATI) + "[evaluation]\nwindow = 0.01\n";
    let single = HinfFilter::new(&paper_options(&tables), TS).unwrap();
    assert!(
        reason(&single.report().achieved, "energy")
            .unwrap()
            .contains("alarms first")
    );
}

#[test]
fn false_alarms_are_excluded_or_stated_with_their_probability() {
    let complete = achieved(RICCATI, "").false_alarms.unwrap();
    assert_eq!(
        (complete.probability_per_instant, complete.expected_per_hour),
        (Some(0.0), Some(0.0))
    );
    assert!(
        complete.provided_that.contains("slew"),
        "{}",
        complete.provided_that
    );
    let tables = windowed(RICCATI).replace("slew", "noise_std = [1e-3, 1e-3]\nslew");
    let noisy = HinfFilter::new(&paper_options(&tables), TS)
        .unwrap()
        .report()
        .achieved
        .clone();
    let alarms = noisy.false_alarms.unwrap();
    let probability = alarms.probability_per_instant.unwrap();
    // Two residuals beyond 6 deviations, and the energy beyond 5.
    assert!(
        (probability - (2.0 * 1.973e-9 + 2.867e-7)).abs() < 1e-9,
        "{probability}"
    );
    assert!((alarms.expected_per_hour.unwrap() - probability * 3.6e5).abs() < 1e-9);
    assert!(
        noisy
            .faults
            .iter()
            .all(|fault| fault.assurance < 1.0 && fault.assurance > 0.999_999)
    );
}
