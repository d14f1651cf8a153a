//! Through a gains file and back: the same gains, the same diagnoser to the last bit, the same achievements.

use crate::support::{PERIOD_S, aircraft_tables, find, random_tables, read, run, written};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use residual_diagnosis::gains::file::TOLERANCE;
use residual_diagnosis::method::MethodOptions;
use residual_diagnosis::unknown_input_filter::gains::UnknownInputFilterGains;
use residual_diagnosis::unknown_input_filter::tables::UnknownInputFilterTables;

/// Returns the size of the file.
fn round_trip(tables: &UnknownInputFilterTables) -> usize {
    let found = find(tables);
    let designed = tables.with_gains(PERIOD_S, &found.gains).unwrap();
    let text = written(tables, &found, &designed);
    let entry = read(&text);
    let gains: UnknownInputFilterGains = toml::Value::Table(entry.gains.clone()).try_into().unwrap();
    assert_eq!(gains, found.gains);
    assert_eq!(entry.solver, found.solver);
    let again = tables.with_gains(PERIOD_S, &gains).unwrap();
    assert_eq!(run(&again), run(&designed));
    entry.verify(&again.achieved, TOLERANCE).unwrap();
    text.len()
}

#[test]
fn a_gains_file_brings_back_the_same_diagnoser_and_what_it_achieves_on_random_plants() {
    let mut random = ChaCha8Rng::seed_from_u64(7);
    for n in 2..=6 {
        for _ in 0..2 {
            round_trip(&random_tables(&mut random, n, &[1, 4]));
        }
    }
}

#[test]
fn every_form_and_gain_goes_through_a_gains_file() {
    let s = "S = [[0.01, 0, 0.01, 0], [0, 0.01, 0, 0.01], [0.01, 0, 0.01, 0], [0, 0.01, 0, 0.01]]";
    for further in [
        "[filter]\ngain = \"fixed\"\n[parity]\nlengths = [2]\n".to_owned(),
        "[filter]\ngain = \"frobenius\"\n[parity]\nlengths = []\n".to_owned(),
        format!("[filter]\nform = \"paper\"\n{s}\n"),
        "[filter]\nform = \"paper\"\n".to_owned(),
        format!(
            "[filter]\nform = \"kalman_3sigma\"\nresidual_norm_threshold = 0.2\n{s}\n\
             initial_covariance = [[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]]\n"
        ),
    ] {
        round_trip(&aircraft_tables(&further));
    }
}

#[test]
fn the_file_of_the_aircraft_stays_readable_by_size() {
    let size = round_trip(&aircraft_tables(""));
    println!("{size} bytes");
    assert!(size < 100_000, "{size} bytes");
}

#[test]
fn one_entry_speaks_for_all_linear_programs_and_none_where_there_was_none() {
    let found = find(&aircraft_tables("[parity]\nlengths = [1, 3]"));
    assert_eq!(found.solver.len(), 1);
    let run = &found.solver[0];
    assert!(
        run.problem.starts_with("8 linear programs") && run.status == "Solved",
        "{run:?}"
    );
    assert!((run.objective - run.dual_objective).abs() < 1e-8 && run.iterations >= 8);
    assert!(find(&aircraft_tables("[parity]\nlengths = []")).solver.is_empty());
}

#[test]
fn certificates_given_by_hand_need_no_solver_and_run_unchanged() {
    let mut tables = aircraft_tables("[parity]\nlengths = [1, 3]");
    assert_eq!(tables.needs_solver().unwrap().key, "parity.lengths");
    let designed = find(&tables).gains;
    tables.parity.certificates = Some(designed.certificates.clone());
    assert_eq!(tables.needs_solver(), None);
    let given = tables.find_gains(PERIOD_S).unwrap();
    assert_eq!(given.gains, designed);
    assert!(find(&tables).solver.is_empty());
    for off in ["[parity]\nlengths = []", "[filter]\nform = \"paper\""] {
        assert_eq!(aircraft_tables(off).needs_solver(), None);
    }
    tables.parity.certificates = Some(Vec::new());
    assert!(tables.find_gains(PERIOD_S).unwrap().warnings[0].contains("`parity.certificates` is empty"));
}
