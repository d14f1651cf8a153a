//! Gains that were altered by hand, belong to another bank or are no numbers.

use crate::support::{Found, PERIOD_S, aircraft_tables, find, random_tables, read, written};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use residual_diagnosis::gains::file::TOLERANCE;
use residual_diagnosis::method::{MethodOptions, Refusal};
use residual_diagnosis::unknown_input_filter::gains::{UnknownInputFilterGains, Untested, WhyUntested};
use residual_diagnosis::unknown_input_filter::modes::FaultMode;
use residual_diagnosis::unknown_input_filter::tables::UnknownInputFilterTables;

fn refusal(
    tables: &UnknownInputFilterTables,
    found: &Found,
    alter: impl FnOnce(&mut UnknownInputFilterGains),
) -> Refusal {
    let mut gains = found.gains.clone();
    alter(&mut gains);
    tables.with_gains(PERIOD_S, &gains).unwrap_err()
}

fn assert_names(refusal: &Refusal, key: &str, words: &str) {
    assert!(refusal.key.starts_with(key), "{refusal:?}");
    assert!(refusal.message.contains(words), "{refusal:?}");
}

fn mode(actuators: &[usize]) -> FaultMode {
    FaultMode::from_actuators(actuators).unwrap()
}

#[test]
fn a_fixed_gain_that_fails_a_condition_is_refused_with_its_name() {
    let tables = aircraft_tables("[filter]\ngain = \"fixed\"\n[parity]\nlengths = []");
    let found = find(&tables);
    let alter = |entry: usize, change: &dyn Fn(&mut Vec<Vec<f64>>)| {
        refusal(&tables, &found, |gains| {
            change(gains.modes[entry].fixed.as_mut().unwrap())
        })
    };
    let scaled = alter(1, &|gain| {
        gain.iter_mut().flatten().for_each(|value| *value *= 1.01)
    });
    assert_names(&scaled, "gains.mode.1.L_fix", "L_fix C F = F");
    let not_a_number = alter(2, &|gain| gain[1][1] = f64::NAN);
    assert_names(&not_a_number, "gains.mode.2.L_fix", "row 1, column 1");
    let ragged = alter(0, &|gain| {
        gain[2].pop();
    });
    assert_names(&ragged, "gains.mode.0.L_fix", "entries");
    let short = alter(0, &|gain| {
        gain.pop();
    });
    assert_names(&short, "gains.mode.0.L_fix", "3 x 4");
    // The fault-free mode allows any gain: C⁻¹ becomes 3C⁻¹ and the errors move with -2A.
    let unstable = alter(0, &|gain| {
        gain.iter_mut().flatten().for_each(|value| *value *= 3.0)
    });
    assert_names(&unstable, "gains.mode.0.L_fix", "must be below 1");
}

#[test]
fn numbers_for_another_bank_are_refused() {
    let tables = aircraft_tables("[filter]\ngain = \"fixed\"\n[parity]\nlengths = [2]");
    let found = find(&tables);
    let other_mode = refusal(&tables, &found, |gains| gains.modes[1].mode = mode(&[0, 1]));
    assert_names(&other_mode, "gains.mode.1.mode", "[0, 1]");
    let twice = refusal(&tables, &found, |gains| gains.modes[2].mode = mode(&[0]));
    assert_names(&twice, "gains.mode.2.mode", "twice");
    let missing = refusal(&tables, &found, |gains| {
        gains.modes.pop();
    });
    assert_names(&missing, "gains.mode", "L_fix");
    let superfluous = refusal(&tables, &found, |gains| {
        gains.modes[0].n = gains.modes[0].fixed.clone()
    });
    assert_names(&superfluous, "gains.mode.0.N", "no use");
    let foreign_test = refusal(&tables, &found, |gains| gains.certificates[0].mode = mode(&[5]));
    assert_names(&foreign_test, "gains.certificate.0", "[5]");
    let same_test = refusal(&tables, &found, |gains| {
        gains.certificates[1] = gains.certificates[0].clone()
    });
    assert_names(&same_test, "gains.certificate.1", "two certificates");
    let paper = aircraft_tables("[filter]\nform = \"paper\"");
    let from_paper = tables.with_gains(PERIOD_S, &find(&paper).gains).unwrap_err();
    assert_names(&from_paper, "gains.mode", "");
    let from_coupled = paper.with_gains(PERIOD_S, &found.gains).unwrap_err();
    assert_names(&from_coupled, "gains.certificate.0", "no parity tests");
}

#[test]
fn what_a_design_finds_and_the_options_ask_for_must_not_be_missing() {
    let tables = aircraft_tables("[parity]\nlengths = [1, 3]");
    let found = find(&tables);
    let removed = found.gains.certificates[2].clone();
    let no_test = refusal(&tables, &found, |gains| drop(gains.certificates.remove(2)));
    let window = format!(
        "mode {}, fault {} and L = {}",
        removed.mode, removed.fault, removed.length
    );
    assert_names(&no_test, "gains.certificate", &window);
    let no_fixed = refusal(&tables, &found, |gains| gains.modes[1].fixed = None);
    assert_names(&no_fixed, "gains.mode", "L_fix");
    let no_mode = refusal(&tables, &found, |gains| gains.modes.clear());
    assert_names(&no_mode, "gains.mode", "L_fix");
    let untested = Untested {
        mode: removed.mode,
        fault: removed.fault,
        length: removed.length,
        reason: WhyUntested::NotSeparable,
    };
    let both = refusal(&tables, &found, |gains| gains.untested = vec![untested]);
    assert_names(&both, "gains.untested.0", "they have one");
    // Given certificates must all be there; without any list no parity test runs, which is said.
    let mut given = tables.clone();
    given.parity.certificates = Some(found.gains.certificates.clone());
    let not_given = refusal(&given, &find(&given), |gains| gains.certificates.clear());
    assert_names(&not_given, "gains.certificate", "no certificate");
    let without_solver = tables.find_gains(PERIOD_S).unwrap().gains;
    let warnings = tables.with_gains(PERIOD_S, &without_solver).unwrap().warnings;
    assert!(
        warnings.iter().any(|text| text.contains("no parity test runs")),
        "{warnings:?}"
    );
}

#[test]
fn windows_without_test_go_through_the_gains_and_are_said_again() {
    // Two equal fault directions: neither fault can be told from the other.
    let mut tables = aircraft_tables("[parity]\nlengths = [1]");
    for row in &mut tables.model.b {
        row[1] = row[0];
    }
    let found = find(&tables);
    assert!(!found.gains.untested.is_empty() && !found.gains.certificates.is_empty());
    let warnings = tables.with_gains(PERIOD_S, &found.gains).unwrap().warnings;
    assert!(
        warnings.iter().any(|text| text.contains("(not_separable)")),
        "{warnings:?}"
    );
    let refused = refusal(&tables, &found, |gains| gains.untested.clear());
    assert_names(&refused, "gains.certificate", "no certificate");
}

#[test]
fn a_decoupling_pair_that_misses_an_equality_is_refused_with_it() {
    let tables = aircraft_tables(
        "[filter]\nform = \"paper\"\n\
         S = [[0.01, 0, 0.01, 0], [0, 0.01, 0, 0.01], [0.01, 0, 0.01, 0], [0, 0.01, 0, 0.01]]",
    );
    let found = find(&tables);
    assert_eq!(found.gains.modes.len(), 3);
    let pair = |entry: &mut UnknownInputFilterGains, which: char| {
        let entry = &mut entry.modes[1];
        let matrix = match which {
            'S' => &mut entry.s,
            'T' => &mut entry.t,
            _ => &mut entry.n,
        };
        matrix.as_mut().unwrap()[2][2] *= 1.01;
    };
    for (which, words) in [('S', "N = L0 + S P"), ('N', "N = L0 + S P"), ('T', "T + N C = I")] {
        let refused = refusal(&tables, &found, |gains| pair(gains, which));
        assert_names(&refused, "gains.mode.1", words);
    }
}

#[test]
fn a_certificate_that_misses_an_equality_or_sees_nothing_is_refused() {
    let tables = aircraft_tables("[parity]\nlengths = [3]");
    let found = find(&tables);
    let not_a_number = refusal(&tables, &found, |gains| {
        gains.certificates[2].mu[1][0] = f64::INFINITY
    });
    assert_names(&not_a_number, "gains.certificate.2", "non-finite");
    let silent = refusal(&tables, &found, |gains| {
        let rows = &mut gains.certificates[1];
        rows.lambda
            .iter_mut()
            .chain(&mut rows.mu)
            .flatten()
            .for_each(|value| *value = 0.0);
    });
    assert_names(&silent, "gains.certificate.1", "not positive");
    let altered = refusal(&tables, &found, |gains| gains.certificates[3].mu[0][1] += 1e-3);
    assert_names(&altered, "gains.certificate.3", "equality");
}

/// Every number that is not negligible beside its neighbours.
fn numbers(gains: &mut UnknownInputFilterGains) -> Vec<&mut f64> {
    let fixed = gains.modes.iter_mut().filter_map(|entry| entry.fixed.as_mut());
    let certificates = gains.certificates.iter_mut().flat_map(|certificate| {
        let limit = 1e-3
            * certificate
                .mu
                .iter()
                .chain(&certificate.lambda)
                .flatten()
                .fold(0.0, |a, b| f64::max(a, b.abs()));
        let rows = certificate.mu.iter_mut().chain(&mut certificate.lambda);
        rows.flatten().filter(move |value| value.abs() > limit)
    });
    let fixed = fixed.flat_map(|gain| {
        let limit = 1e-2 * gain.iter().flatten().fold(0.0, |a, b| f64::max(a, b.abs()));
        gain.iter_mut().flatten().filter(move |value| value.abs() > limit)
    });
    fixed.chain(certificates).collect()
}

#[test]
fn every_single_number_altered_by_one_per_cent_is_found_out() {
    let mut random = ChaCha8Rng::seed_from_u64(3);
    for n in [2, 3] {
        let tables = random_tables(&mut random, n, &[1, 2]);
        let found = find(&tables);
        let designed = tables.with_gains(PERIOD_S, &found.gains).unwrap();
        let entry = read(&written(&tables, &found, &designed));
        let count = numbers(&mut found.gains.clone()).len();
        assert!(count > 40, "{count}");
        for number in 0..count {
            let mut gains = found.gains.clone();
            *numbers(&mut gains)[number] *= 1.01;
            if let Ok(designed) = tables.with_gains(PERIOD_S, &gains) {
                assert!(
                    entry.verify(&designed.achieved, TOLERANCE).is_err(),
                    "number {number} of {count}"
                );
            }
        }
    }
}
