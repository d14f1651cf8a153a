//! The configuration of the method sheet is accepted; every misuse names its key.

use super::*;
use crate::model::{LinearModel, ModelOptions};
use crate::unknown_input_filter::options_error::OptionsError;
use serde::Deserialize;

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Table {
    model: ModelOptions,
    bank: BankOptions,
    filter: FilterOptions,
    parity: ParityOptions,
    missing: MissingOptions,
}

const PAPER_CASE: &str = include_str!("../../tests/reference/unknown_input_filter/paper_case.toml");

fn table() -> Table {
    toml::from_str(PAPER_CASE).unwrap()
}

fn options(table: &Table) -> UnknownInputFilterOptions {
    UnknownInputFilterOptions {
        bank: table.bank.clone(),
        filter: table.filter.clone(),
        parity: table.parity.clone(),
        missing: table.missing.clone(),
    }
}

fn refused_key(change: impl FnOnce(&mut UnknownInputFilterOptions)) -> String {
    let table = table();
    let model = LinearModel::new(&table.model, 0.01).unwrap();
    let mut options = options(&table);
    change(&mut options);
    let error = options.validate(&model).unwrap_err();
    assert!(error.to_string().contains(&error.key()), "{error}");
    error.key()
}

#[test]
fn the_configuration_of_the_method_sheet_is_accepted() {
    let table = table();
    let model = LinearModel::new(&table.model, 0.01).unwrap();
    let options = options(&table);
    assert_eq!(options.validate(&model), Ok(()));
    assert_eq!(model.actuators()[1].name, "longitudinal_cyclic_pitch");
    assert_eq!(options.filter.effective_generator_order(), 30);
}

#[test]
fn the_defaults_are_those_of_the_method_sheet() {
    let configured = options(&table());
    let defaults = UnknownInputFilterOptions::default();
    assert_eq!(
        defaults.bank,
        BankOptions {
            max_isolation_window: None,
            ..configured.bank
        }
    );
    assert_eq!(
        defaults.filter,
        FilterOptions {
            generator_order: None,
            reduction: None,
            nominal_state_magnitude: None,
            fault_of_interest: None,
            ..configured.filter.clone()
        }
    );
    assert_eq!(
        Some(defaults.filter.effective_generator_order()),
        configured.filter.generator_order
    );
    assert_eq!(
        Some(defaults.filter.effective_reduction()),
        configured.filter.reduction
    );
    assert_eq!(defaults.parity, configured.parity);
    assert_eq!(defaults.missing.policy, configured.missing.policy);
}

#[test]
fn every_misuse_names_its_key() {
    type Change = fn(&mut UnknownInputFilterOptions);
    let zeros = |rows: usize, columns: usize| vec![vec![0.0; columns]; rows];
    let cases: [(&str, Change); 14] = [
        ("filter.generator_order", |o| o.filter.generator_order = Some(4)),
        ("bank.simultaneous_faults", |o| {
            o.bank.simultaneous_faults = vec![2]
        }),
        ("bank.simultaneous_faults", |o| {
            o.bank.simultaneous_faults = vec![]
        }),
        ("bank.max_isolation_window", |o| {
            o.bank.max_isolation_window = Some(0)
        }),
        ("bank.isolation", |o| o.bank.isolation = Isolation::Instantaneous),
        ("filter.gain_sweeps", |o| o.filter.gain_sweeps = 7),
        ("filter.test", |o| o.filter.test = TestRule::Printed),
        ("filter.residual_norm_threshold", |o| {
            o.filter.residual_norm_threshold = Some(1.0)
        }),
        ("filter.residual_norm_threshold", |o| {
            o.filter.form = Form::Kalman3Sigma
        }),
        ("filter.nominal_state_magnitude", |o| {
            o.filter.nominal_state_magnitude = Some(vec![0.1])
        }),
        ("filter.fault_of_interest", |o| {
            o.filter.fault_of_interest = Some(vec![0.1, f64::NAN])
        }),
        ("missing.fault_bound", |o| o.missing.fault_bound = None),
        ("missing.fault_bound", |o| {
            o.missing.fault_bound = Some(vec![1.0, -1.0])
        }),
        ("parity.lengths", |o| o.parity.lengths = vec![0]),
    ];
    for (key, change) in cases {
        assert_eq!(refused_key(change), key);
    }
    let wrong_shape = |o: &mut UnknownInputFilterOptions| {
        o.filter.form = Form::Paper;
        o.filter.s = Some(zeros(4, 3));
    };
    assert_eq!(refused_key(wrong_shape), "filter.S");
    let kalman = |o: &mut UnknownInputFilterOptions, covariance: Vec<Vec<f64>>| {
        o.filter.form = Form::Kalman3Sigma;
        o.filter.residual_norm_threshold = Some(0.1);
        o.filter.initial_covariance = Some(covariance);
    };
    assert_eq!(
        refused_key(|o| kalman(o, zeros(3, 4))),
        "filter.initial_covariance"
    );
    let indefinite = |i: usize| {
        (0..4)
            .map(|j| if i == j { 1.0 - i as f64 } else { 0.0 })
            .collect()
    };
    assert_eq!(
        refused_key(|o| kalman(o, (0..4).map(indefinite).collect())),
        "filter.initial_covariance"
    );
}

#[test]
fn counts_that_would_take_all_memory_or_time_are_refused_and_the_largest_allowed_ones_are_not() {
    type Set = fn(&mut UnknownInputFilterOptions, usize);
    let counts: [(&str, usize, Set); 7] = [
        ("filter.generator_order", 1000, |o, n| {
            o.filter.generator_order = Some(n)
        }),
        ("filter.gain_sweeps", 6, |o, n| o.filter.gain_sweeps = n),
        ("bank.max_isolation_window", 10_000, |o, n| {
            o.bank.max_isolation_window = Some(n)
        }),
        ("bank.clear_samples", 1_000_000_000, |o, n| {
            o.bank.clear_samples = n as u32
        }),
        ("parity.lengths", 1000, |o, n| o.parity.lengths = vec![1, n]),
        ("parity.lengths", 16, |o, n| o.parity.lengths = (1..=n).collect()),
        ("parity.pre_samples", 1000, |o, n| {
            o.parity.pre_samples = PreSamples::Count(n)
        }),
    ];
    let table = table();
    let model = LinearModel::new(&table.model, 0.01).unwrap();
    for (key, largest, set) in counts {
        let mut allowed = options(&table);
        set(&mut allowed, largest);
        assert_eq!(allowed.validate(&model), Ok(()), "{key}");
        for count in [largest + 1, 2_000_000_000]
            .into_iter()
            .filter(|&n| largest != 16 || n == 17)
        {
            assert_eq!(refused_key(|o| set(o, count)), key);
        }
    }
}

#[test]
fn certificates_are_checked_against_the_model_and_the_bank() {
    let table = table();
    let mut options = options(&table);
    let design = include_str!("../../tests/reference/unknown_input_filter/vtol_design.json");
    let reference: serde_json::Value = serde_json::from_str(design).unwrap();
    let mut first = reference["certificates"][0].as_object().unwrap().clone();
    first.retain(|key, _| ["mode", "fault", "L", "mu", "lambda"].contains(&key.as_str()));
    let certificate: ParityCertificate = serde_json::from_value(first.into()).unwrap();
    let model = LinearModel::new(&table.model, 0.01).unwrap();
    options.parity.certificates = Some(vec![certificate]);
    assert_eq!(options.validate(&model), Ok(()));
    let round_trip: UnknownInputFilterOptions = toml::from_str(&toml::to_string(&options).unwrap()).unwrap();
    assert_eq!(round_trip, options);

    options.filter.form = Form::Paper;
    assert_eq!(options.validate(&model).unwrap_err().key(), "parity.certificates");
    options.filter.form = Form::Coupled;
    let mut pair_only = options.clone();
    pair_only.parity.certificates.as_mut().unwrap()[0].mode = FaultMode::FAULT_FREE;
    assert_eq!(pair_only.validate(&model), Ok(()));
    pair_only.bank.fault_free_mode = false;
    assert!(matches!(
        pair_only.validate(&model),
        Err(OptionsError::CertificateOfUnlistedMode { index: 0, .. })
    ));
    options.parity.certificates.as_mut().unwrap()[0].lambda[0][1] *= 1.001;
    let error = options.validate(&model).unwrap_err();
    assert!(
        matches!(error, OptionsError::Certificate { index: 0, .. }),
        "{error}"
    );
    assert_eq!(error.key(), "parity.certificates");
}

#[test]
fn a_strip_is_only_offered_when_one_measurement_determines_the_state() {
    let mut table = table();
    table.model.c.truncate(3);
    table.model.measurement_noise_bound.truncate(3);
    let key = |table: &Table, options: &UnknownInputFilterOptions| {
        let model = LinearModel::new(&table.model, 0.01).unwrap();
        options.validate(&model).map_err(|error| error.key())
    };
    let mut options = options(&table);
    assert_eq!(key(&table, &options), Ok(()));
    options.bank.reset = ResetRule::Strip;
    assert_eq!(key(&table, &options), Err("bank.reset".to_owned()));
    options.bank.reset = ResetRule::Auto;
    options.filter.initialisation = Initialisation::Strip;
    assert_eq!(key(&table, &options), Err("filter.initialisation".to_owned()));
    options.filter.initialisation = Initialisation::Auto;
    table.model.initial_state_center = None;
    table.model.initial_state_radius = None;
    assert_eq!(
        key(&table, &options),
        Err("model.initial_state_radius".to_owned())
    );
}

#[test]
fn unknown_keys_are_refused_and_pre_samples_take_a_word_or_a_number() {
    assert!(toml::from_str::<UnknownInputFilterOptions>("[bank]\nlatched = true\n").is_err());
    let parity = |text: &str| toml::from_str::<ParityOptions>(text);
    assert_eq!(
        parity("pre_samples = 12").unwrap().pre_samples,
        PreSamples::Count(12)
    );
    assert_eq!(
        parity("pre_samples = \"auto\"").unwrap().pre_samples.count(false),
        30
    );
    assert!(parity("pre_samples = -1").is_err() && parity("pre_samples = \"some\"").is_err());
}
