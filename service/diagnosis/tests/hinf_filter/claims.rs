//! Measured facts of method sheet 4.4 and 6, and what the fault estimate promises.

use crate::paper::{PaperPlant, RICCATI, TS, channel, paper_options, paper_plant, step, windowed};
use nalgebra::DVector;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use residual_diagnosis::{
    diagnoser::{Verdict, flags},
    hinf_filter::HinfFilter,
};

const MATCHED: &str = "type = \"matched\"";
const CASES: [&str; 5] = ["none", "1", "1b", "2", "3"];

fn filter(tables: &str) -> HinfFilter {
    HinfFilter::new(&paper_options(tables), TS).unwrap()
}

/// First instants with an energy and a peak alarm.
fn first_alarms(filter: &mut HinfFilter, plant: &mut PaperPlant, steps: usize) -> [Option<usize>; 2] {
    let mut first = [None; 2];
    for k in 0..steps {
        let record = step(filter, &plant.next(), &[1.0]);
        let ratio = |name| channel(filter, &record, name).ratio;
        let alarms = [ratio("energy") > 1.0, ratio("r1") > 1.0 || ratio("r2") > 1.0];
        for (first, alarm) in first.iter_mut().zip(alarms) {
            *first = first.or(alarm.then_some(k));
        }
    }
    first
}

/// Median and worst of the delays after 15 s.
fn median_and_worst(mut delays: Vec<usize>) -> (f64, f64) {
    delays.sort_unstable();
    let time = |k: usize| (k - 1500) as f64 * TS;
    let half = delays.len() / 2;
    (
        (time(delays[half - 1]) + time(delays[half])) / 2.0,
        time(delays[delays.len() - 1]),
    )
}

#[test]
fn delays_over_all_phases_of_the_disturbance() {
    // (design, case, energy median and worst, peak median and worst), s.
    for (synthesis, case, energy, peak) in [
        (MATCHED, "1", (0.10, 0.13), (0.025, 0.04)),
        (MATCHED, "1b", (0.495, 0.64), (0.175, 0.33)),
        (RICCATI, "1", (0.02, 0.03), (0.01, 0.01)),
        (RICCATI, "1b", (0.105, 0.13), (0.01, 0.03)),
    ] {
        let mut found = [Vec::new(), Vec::new()];
        for i in 0..16 {
            let mut plant = PaperPlant::new(case);
            plant.phase = std::f64::consts::TAU * f64::from(i) / 16.0;
            let first = first_alarms(&mut filter(&windowed(synthesis)), &mut plant, 1700);
            for (found, first) in found.iter_mut().zip(first) {
                found.push(first.unwrap());
            }
        }
        for (found, expected) in found.into_iter().zip([energy, peak]) {
            assert!(found.iter().all(|k| *k >= 1500), "no alarm before the fault");
            let actual = median_and_worst(found);
            let close = (actual.0 - expected.0).abs() < 0.0051 && (actual.1 - expected.1).abs() < 0.0051;
            assert!(close, "{synthesis} {case}: {actual:?} instead of {expected:?}");
        }
    }
}

/// Threshold of the energy instant by instant without fault, from x₀ = (0.6, 0.8).
fn thresholds(tables: &str) -> (Vec<f64>, Vec<bool>) {
    let mut filter = filter(tables);
    let plant = paper_plant();
    let sampled = plant.sample(TS);
    let mut x = DVector::from_column_slice(&[0.6, 0.8]);
    let (mut thresholds, mut alarms) = (Vec::new(), Vec::new());
    for k in 0..2000 {
        let d = 0.01 * (k as f64 * TS).sin();
        let y = &plant.c * &x + &plant.d + &plant.dd * d;
        let record = step(&mut filter, y.as_slice(), &[1.0]);
        thresholds.push(channel(&filter, &record, "energy").upper);
        alarms.push(record.flags & flags::ALARM_NOW != 0);
        x = &sampled.ad * x + &sampled.bud + &sampled.bdd * d;
    }
    (thresholds, alarms)
}

/// Instant from which on the threshold stays within 10 % of its end.
fn settling(thresholds: &[f64]) -> f64 {
    let end = thresholds[thresholds.len() - 1];
    let last = thresholds
        .iter()
        .rposition(|value| (value - end).abs() > 0.1 * end)
        .unwrap();
    (last + 1) as f64 * TS
}

#[test]
fn an_initial_error_alarms_without_its_term_and_not_with_it() {
    let given = |bound: &str| {
        let tables = windowed(MATCHED);
        tables.replace(
            "initial_error_bound = [0, 0]",
            &format!("initial_error_bound = {bound}"),
        )
    };
    let (_, alarms) = thresholds(&given("[0, 0]"));
    assert!(alarms[0]);
    let (limits, alarms) = thresholds(&given("[1, 1]"));
    assert!(!alarms.contains(&true));
    assert!((settling(&limits) - 4.75).abs() < 0.021, "{}", settling(&limits));
    let first_output = windowed(MATCHED).replace("initial = \"given\"\ninitial_error_bound = [0, 0]\n", "");
    let (limits, alarms) = thresholds(&first_output);
    assert!(!alarms.contains(&true));
    assert!((settling(&limits) - 1.61).abs() < 0.021, "{}", settling(&limits));
}

#[test]
fn a_ball_of_initial_errors_is_bounded_by_its_norm() {
    let tables = windowed(MATCHED).replace("initial_error_bound = [0, 0]", "initial_error_norm = 1.0");
    let (ball, alarms) = thresholds(&tables);
    assert!(!alarms.contains(&true));
    let (cube, _) = thresholds(&tables.replace("initial_error_norm = 1.0", "initial_error_bound = [1, 1]"));
    assert!(ball.iter().zip(&cube).all(|(ball, cube)| ball <= cube));
}

#[test]
fn lost_samples_widen_the_bounds_and_wear_off() {
    for (lost, factor) in [(1, 1.011), (10, 1.10), (100, 1.61)] {
        let mut filter = filter(&windowed(RICCATI));
        let mut plant = PaperPlant::new("none");
        let (mut before, mut worst, mut back) = (0.0, 0.0_f64, 0);
        for k in 0..2000 {
            let y = plant.next();
            let record = if (1000..1000 + lost).contains(&k) {
                let record = step(&mut filter, &[f64::NAN, y[1]], &[1.0]);
                assert_eq!(record.verdict(), Verdict::NotEvaluated);
                assert_eq!(record.flags & flags::ALARM_NOW, 0);
                record
            } else {
                let record = step(&mut filter, &y, &[1.0]);
                assert_eq!(record.verdict(), Verdict::Nominal, "{k}");
                record
            };
            assert_eq!(record.flags & flags::RESET, 0, "{k}");
            let bound = filter.bound()[0];
            if k == 999 {
                before = bound;
            } else if k > 999 {
                worst = worst.max(bound / before);
                back = if bound > 1.01 * before { k - 1000 } else { back };
            }
        }
        assert!((worst - factor).abs() < 0.006, "{lost}: {worst}");
        assert!(back as f64 * TS <= 2.9 + 1e-9, "{lost}: {back}");
    }
}

#[test]
fn a_gap_beyond_its_limit_starts_the_filter_again() {
    let first_output = windowed(RICCATI).replace(
        "initial = \"given\"\ninitial_error_bound = [0, 0]\n",
        "max_gap = 20\n",
    );
    let mut filter = filter(&first_output);
    let mut plant = PaperPlant::new("none");
    for k in 0..500 {
        let y = plant.next();
        let lost = (100..130).contains(&k) || (300..320).contains(&k);
        let record = step(&mut filter, if lost { &[] } else { &y }, &[1.0]);
        assert_eq!(record.flags & flags::RESET != 0, k == 130, "{k}");
        let expected = if lost {
            Verdict::NotEvaluated
        } else {
            Verdict::Nominal
        };
        assert_eq!(record.verdict(), expected, "{k}");
    }
}

#[test]
fn a_missing_command_costs_the_guarantee_until_the_filter_has_started_again() {
    let from_output = windowed(RICCATI).replace("initial = \"given\"\ninitial_error_bound = [0, 0]\n", "");
    for (tables, after) in [
        (from_output, Verdict::Nominal),
        (windowed(RICCATI), Verdict::GuaranteeLost),
    ] {
        let mut filter = filter(&tables);
        let mut plant = PaperPlant::new("none");
        for k in 0..200 {
            let y = plant.next();
            let record = step(&mut filter, &y, if k == 100 { &[f64::NAN] } else { &[1.0] });
            let reset = record.flags & flags::RESET != 0;
            match (k, after) {
                (0..100, _) => assert_eq!(record.verdict(), Verdict::Nominal),
                (100, Verdict::Nominal) => assert_eq!(record.verdict(), Verdict::NotEvaluated),
                _ => assert_eq!(record.verdict(), after, "{k}"),
            }
            assert_eq!(reset, k == 101 && after == Verdict::Nominal, "{k}");
        }
        residual_diagnosis::diagnoser::Diagnoser::reset(&mut filter);
        let record = step(&mut filter, &PaperPlant::new("none").next(), &[1.0]);
        assert_eq!(record.verdict(), Verdict::Nominal);
    }
}

#[test]
fn jitter_beyond_its_limit_costs_the_guarantee() {
    use residual_diagnosis::diagnoser::{Diagnoser, Packets, StepInput, StepRecord};
    let mut filter = filter(&windowed(RICCATI));
    let mut plant = PaperPlant::new("none");
    let mut record = StepRecord::new(filter.description().channels.len());
    for (k, late_ns) in [0, 900_000, 0, 1_100_000].into_iter().enumerate() {
        let y = plant.next();
        let input = StepInput {
            instant_ns: 1_000_000_000 + 10_000_000 * k as u64 + late_ns,
            measurements: &y,
            commands: &[1.0],
            packets: Packets::default(),
        };
        filter.step(&input, &mut record);
        let expected = if k == 3 {
            Verdict::GuaranteeLost
        } else {
            Verdict::Nominal
        };
        assert_eq!(record.verdict(), expected);
    }
}

fn with_estimate(fault_slew: bool) -> HinfFilter {
    let slew = if fault_slew {
        "fault_slew = [0.05, 0.05]\n"
    } else {
        ""
    };
    filter(&format!(
        "{}[isolation]\nblind_sets = [[\"f1\"], [\"f2\"]]\nfault_bound = [0.3, 0.3]\n{slew}fault_estimate = true\n",
        windowed(RICCATI)
    ))
}

#[test]
fn fault_estimates_contain_the_fault_in_every_case() {
    let mut largest = [0.0_f64; 2];
    for case in CASES {
        let mut filter = with_estimate(true);
        let mut plant = PaperPlant::new(case);
        for k in 0..3000 {
            let truth = plant.faults();
            let record = step(&mut filter, &plant.next(), &[1.0]);
            for (j, largest) in largest.iter_mut().enumerate() {
                let estimate = channel(&filter, &record, &format!("fault_estimate_f{}", j + 1));
                assert!(
                    estimate.lower <= truth[j] && truth[j] <= estimate.upper,
                    "{case} {k}: {estimate:?}"
                );
                assert_eq!(estimate.ratio, 0.0);
                *largest = largest.max((estimate.residual - truth[j]).abs());
            }
            if record.verdict() == Verdict::Isolated && record.certainly_faulty.is_power_of_two() {
                let fault = truth[record.certainly_faulty.trailing_zeros() as usize];
                assert!(
                    (record.fault_estimate - fault).abs() <= record.fault_estimate_half_width,
                    "{case} {k}"
                );
            }
        }
    }
    assert!(largest[0] <= 6.5e-4 && largest[1] <= 1.5e-4, "{largest:?}");
    // Without a slew bound of the faults the half widths are those of the sheet.
    let mut filter = with_estimate(false);
    let record = step(&mut filter, &PaperPlant::new("none").next(), &[1.0]);
    for (name, expected) in [("fault_estimate_f1", 9.43e-4), ("fault_estimate_f2", 2.92e-4)] {
        let width = channel(&filter, &record, name).upper - channel(&filter, &record, name).residual;
        assert!((width - expected).abs() < 0.6e-6, "{name}: {width}");
    }
}

#[test]
fn the_bank_isolates_the_right_faults_and_nothing_else() {
    for (case, faults) in [("none", 0), ("1", 0b01), ("1b", 0b01), ("2", 0b10), ("3", 0b11)] {
        let mut filter = with_estimate(true);
        let mut plant = PaperPlant::new(case);
        let mut isolated = 0;
        for k in 0..1900 {
            let record = step(&mut filter, &plant.next(), &[1.0]);
            if record.verdict() == Verdict::Isolated {
                assert!(
                    k >= 1500 && record.certainly_faulty & !faults == 0,
                    "{case} {k}: {record:?}"
                );
                isolated |= record.certainly_faulty;
            }
            assert_eq!(
                record.verdict() == Verdict::Nominal,
                record.flags & flags::ALARM_NOW == 0
            );
        }
        assert_eq!(isolated, faults, "{case}");
    }
}

/// Alarms of one seed of white noise of 1e-3 in the fault-free run, and first alarms of the cases.
fn noisy(seed: u64, case: &str) -> Option<usize> {
    let tables = windowed(MATCHED).replace("slew = [0.01]", "slew = [0.01]\nnoise_std = [0.001, 0.001]");
    let mut filter = filter(&tables);
    let mut plant = PaperPlant::new(case);
    let mut generator = ChaCha8Rng::seed_from_u64(seed);
    let mut normal = || {
        let radius = (-2.0 * (1.0 - generator.random::<f64>()).ln()).sqrt();
        1e-3 * radius * (std::f64::consts::TAU * generator.random::<f64>()).cos()
    };
    (0..1700).find(|_| {
        let y: Vec<f64> = plant.next().iter().map(|y| y + normal()).collect();
        step(&mut filter, &y, &[1.0]).flags & flags::ALARM_NOW != 0
    })
}

fn median_under_noise(runs: u64) {
    for (case, expected) in [
        ("none", None),
        ("1", Some(1534)),
        ("1b", Some(1649)),
        ("2", Some(1500)),
    ] {
        let mut alarms: Vec<_> = (0..runs).map(|seed| noisy(seed, case)).collect();
        alarms.sort_unstable();
        match expected {
            None => assert!(alarms.iter().all(Option::is_none), "{alarms:?}"),
            Some(expected) => {
                assert!(alarms.iter().all(|k| k.unwrap() >= 1500), "{alarms:?}");
                let median = alarms[alarms.len() / 2].unwrap();
                assert!(median.abs_diff(expected) <= 5, "{case}: {median}");
            }
        }
    }
}

#[test]
fn noise_raises_the_threshold_and_causes_no_alarm() {
    median_under_noise(12);
}

#[test]
#[ignore = "40 runs as in the method sheet; cargo test --test hinf_filter -- --ignored"]
fn noise_raises_the_threshold_and_causes_no_alarm_in_40_runs() {
    median_under_noise(40);
}
