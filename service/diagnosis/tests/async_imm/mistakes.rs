//! One small mistake in the example at a time: the refusal names the key and the condition.

use crate::configuration::{example, options};
use residual_diagnosis::method::MethodOptions;
use toml::{Table, Value};

/// Sets the entry at a dotted path; numbers index lists.
fn set(table: &mut Table, path: &str, value: &str) {
    let value = format!("value = {value}")
        .parse::<Table>()
        .unwrap()
        .remove("value")
        .unwrap();
    let (first, rest) = path.split_once('.').unwrap_or((path, ""));
    if rest.is_empty() {
        table.insert(first.to_owned(), value);
    } else {
        set_below(table.get_mut(first).unwrap(), rest, value);
    }
}

fn set_below(place: &mut Value, path: &str, value: Value) {
    let (first, rest) = path.split_once('.').unwrap_or((path, ""));
    let below = match place {
        Value::Array(entries) => &mut entries[first.parse::<usize>().unwrap()],
        Value::Table(entries) => entries.entry(first).or_insert(Value::Boolean(false)),
        other => panic!("{path} in {other}"),
    };
    if rest.is_empty() {
        *below = value;
    } else {
        set_below(below, rest, value);
    }
}

/// Changes of the example, the key that the refusal must name, words of its message.
type Case = (
    &'static [(&'static str, &'static str)],
    &'static str,
    &'static str,
);

const CASES: &[Case] = &[
    (&[("plant.A", "[[0, 1], [0]]")], "plant.A.1", "same length"),
    (&[("plant.A", "[[0, 1, 0, 0]]")], "plant.A", "1 x 4"),
    (&[("plant.B", "[[0, 0]]")], "plant.B", "1 x 2"),
    (&[("plant.F", "[[0, 0]]")], "plant.F", "states x fault channels"),
    (&[("plant.F.1.0", "nan")], "plant.F", "NaN"),
    (&[("plant.G", "[[1]]")], "plant.G", "states x process noises"),
    (
        &[("plant.process_noise_psd", "[[0.01]]")],
        "plant.process_noise_psd",
        "2 x 2",
    ),
    (
        &[("plant.process_noise_psd", "[[0.01, 0.02], [0.02, 0.01]]")],
        "plant.process_noise_psd",
        "semidefinite",
    ),
    (
        &[("plant.channels", "[\"one\"]")],
        "plant.channels",
        "list of length 2",
    ),
    (
        &[("plant.channels", "[\"a\", \"a\"]")],
        "plant.channels.1",
        "only once",
    ),
    (
        &[("plant.channel_units", "[\"N\"]")],
        "plant.channel_units",
        "list of length 2",
    ),
    (
        &[("input.constant", "[1.0]")],
        "input.constant",
        "list of length 2",
    ),
    (&[("input.constant", "[1.0, inf]")], "input.constant", "finite"),
    (&[("sensor", "[]")], "sensor", "at least one sensor"),
    (
        &[("sensor.1.measurement_matrix", "[]")],
        "sensor.1.measurement_matrix",
        "at least one row",
    ),
    (
        &[("sensor.1.measurement_matrix", "[[1, 0], [0, 1]]")],
        "sensor.1.measurement_matrix",
        "2 x 4",
    ),
    (
        &[("sensor.0.noise_covariance", "[[25]]")],
        "sensor.0.noise_covariance",
        "2 x 2",
    ),
    (
        &[("sensor.0.noise_covariance", "[[25, 0], [0, 0]]")],
        "sensor.0.noise_covariance",
        "positive definite",
    ),
    (
        &[("sensor.0.noise_covariance", "[[25, 1], [2, 25]]")],
        "sensor.0.noise_covariance",
        "symmetric",
    ),
    (
        &[("sensor.2.arrival_probability", "0.8")],
        "sensor.2.arrival_probability",
        "batch_unobserved",
    ),
    (
        &[
            ("form", "\"batch_unobserved\""),
            ("sensor.2.arrival_probability", "0.0"),
        ],
        "sensor.2.arrival_probability",
        "above 0",
    ),
    (
        &[
            ("form", "\"batch_unobserved\""),
            ("sensor.2.initial_held_value", "[1]"),
        ],
        "sensor.2.initial_held_value",
        "list of length 2",
    ),
    (
        &[("sensor.2.initial_held_value", "[1, 2]")],
        "sensor.2.initial_held_value",
        "batch_unobserved",
    ),
    (
        &[("mode", "[]"), ("initial.mode_probability", "[]")],
        "mode",
        "normal mode",
    ),
    (&[("mode.0.direction", "[[1], [1]]")], "mode.0.direction", "zeros"),
    (
        &[("mode.2.direction", "[[1], [0]]")],
        "mode.2.direction",
        "modes 1 and 2",
    ),
    (
        &[("mode.2.direction", "[[1]]")],
        "mode.2.direction",
        "fault channels x slots",
    ),
    (&[("mode.2.name", "\"actuator 1\"")], "mode.2", "only once"),
    (
        &[("amplitude.prior_standard_deviation", "[-1.0]")],
        "amplitude.prior_standard_deviation.0",
        "negative",
    ),
    (
        &[("amplitude.prior_standard_deviation", "[nan]")],
        "amplitude.prior_standard_deviation",
        "finite",
    ),
    (
        &[("amplitude.prior_mean", "[0, 0]")],
        "amplitude.prior_mean",
        "list of length 1",
    ),
    (
        &[("amplitude.random_walk_psd", "[-0.1]")],
        "amplitude.random_walk_psd",
        "not negative",
    ),
    (&[("initial.state", "[0]")], "initial.state", "list of length 4"),
    (
        &[("initial.state_covariance", "[[1]]")],
        "initial.state_covariance",
        "4 x 4",
    ),
    (
        &[("initial.state_covariance.0.0", "-1.0")],
        "initial.state_covariance",
        "semidefinite",
    ),
    (
        &[("initial.mode_probability", "[0.5, 0.5]")],
        "initial.mode_probability",
        "list of length 3",
    ),
    (
        &[("initial.mode_probability", "[0.5, 0.5, 0.5]")],
        "initial.mode_probability",
        "sum to 1",
    ),
    (
        &[("initial.mode_probability", "[1.5, -0.5, 0.0]")],
        "initial.mode_probability",
        "probabilities",
    ),
    (
        &[("transition.stay_probability", "0.3")],
        "transition.stay_probability",
        "1 / modes",
    ),
    (
        &[("transition.stay_probability", "1.1")],
        "transition.stay_probability",
        "at most 1",
    ),
    (
        &[("transition.stay_period_s", "0.0")],
        "transition.stay_period_s",
        "above 0",
    ),
    (
        &[("transition.kind", "\"rate\"")],
        "transition.stay_probability",
        "transition.kind",
    ),
    (
        &[("transition", "{ kind = \"stay\", stay_period_s = 1.0 }")],
        "transition.stay_probability",
        "needs it",
    ),
    (
        &[(
            "transition",
            "{ kind = \"rate\", rate_per_second = [[0, 0], [0, 0]] }",
        )],
        "transition.rate_per_second",
        "3 x 3",
    ),
    (
        &[(
            "transition",
            "{ kind = \"rate\", rate_per_second = [[-1, 1, 0], [1, -1, 0.1], [0, 1, -1]] }",
        )],
        "transition.rate_per_second.1",
        "sum to 0",
    ),
    (
        &[(
            "transition",
            "{ kind = \"rate\", rate_per_second = [[1, -1, 0], [1, -1, 0], [0, 1, -1]] }",
        )],
        "transition.rate_per_second.0",
        "negative rate",
    ),
    (
        &[(
            "transition",
            "{ kind = \"per_step\", matrix = [[1, 0, 0], [0, 1, 0], [0, 0.5, 0.4]] }",
        )],
        "transition.matrix.2",
        "sum to 1",
    ),
    (
        &[(
            "transition",
            "{ kind = \"per_step\", matrix = [[1, 0, 0], [0, 1, 0], [0, 1.5, -0.5]] }",
        )],
        "transition.matrix.2",
        "negative probability",
    ),
    (
        &[("decision.threshold", "1.0")],
        "decision.threshold",
        "between 0 and 1",
    ),
    (
        &[("decision.window_steps", "0")],
        "decision.window_steps",
        "at least 1",
    ),
    (
        &[("decision.amplitude_bound_standard_deviations", "0.0")],
        "decision.amplitude_bound_standard_deviations",
        "above 0",
    ),
    (&[("rollback_steps", "1001")], "rollback_steps", "at most 1000"),
    (
        &[("max_packets_per_step", "0")],
        "max_packets_per_step",
        "at least 1",
    ),
    (
        &[("max_packets_per_step", "100000")],
        "max_packets_per_step",
        "packets would be kept",
    ),
    (&[("max_ahead_ms", "-1.0")], "max_ahead_ms", "not be negative"),
    (&[("max_ahead_ms", "nan")], "max_ahead_ms", "finite"),
    (
        &[
            ("sensor.0.measurement_matrix", "[[0, 1, 0, 0], [0, 0, 0, 1]]"),
            ("sensor.1.measurement_matrix", "[[0, 1, 0, 0], [0, 0, 0, 1]]"),
            ("sensor.2.measurement_matrix", "[[0, 1, 0, 0], [0, 0, 0, 1]]"),
        ],
        "plant.A",
        "does not decay",
    ),
    (
        &[("plant.F", "[[0, 0], [0, 0], [0, 0], [0, 1]]")],
        "mode.1.direction",
        "cannot be estimated",
    ),
    (
        &[
            ("plant.F", "[[0, 0, 0], [-1, 0, -1], [0, 0, 0], [0, 1, 1]]"),
            ("plant.channels", "[\"a\", \"b\", \"c\"]"),
            ("plant.channel_units", "[\"\", \"\", \"\"]"),
            ("amplitude.prior_mean", "[0, 0, 0]"),
            ("amplitude.random_walk_psd", "[0, 0, 0]"),
            ("amplitude.prior_standard_deviation", "[1, 1, 1]"),
            ("mode.0.direction", "[[0, 0, 0], [0, 0, 0], [0, 0, 0]]"),
            ("mode.1.direction", "[[1, 0, 0], [0, 0, 0], [0, 0, 0]]"),
            ("mode.2.direction", "[[1, 0, 0], [0, 1, 0], [0, 0, 1]]"),
        ],
        "mode.2.direction",
        "cannot be estimated",
    ),
    (
        &[("form", "\"batch_unobserved\""), ("rollback_steps", "1")],
        "form",
        "cannot go back",
    ),
    (
        &[
            ("form", "\"batch_unobserved\""),
            ("amplitude.random_walk_psd", "[0.1]"),
        ],
        "form",
        "random walk",
    ),
    (
        &[("form", "\"batch_unobserved\""), ("plant.A.0.0", "-11.0")],
        "form",
        "too fast",
    ),
    (
        &[("form", "\"batch_unobserved\""), ("max_packets_per_step", "1000")],
        "form",
        "too large matrices",
    ),
];

#[test]
fn every_mistake_is_refused_with_key_and_condition() {
    for (changes, key, words) in CASES {
        let mut table = example();
        for (path, value) in *changes {
            set(&mut table, path, value);
        }
        let tables = options(table);
        for refusal in [tables.validate(1.0).err(), tables.design(1.0).err()] {
            let refusal = refusal.unwrap_or_else(|| panic!("{changes:?} is accepted"));
            assert_eq!(refusal.key, *key, "{changes:?}: {refusal}");
            assert!(refusal.message.contains(words), "{changes:?}: {refusal}");
            assert!(refusal.message.contains("; "), "no advice: {refusal}");
        }
    }
}

#[test]
fn a_period_below_a_microsecond_is_refused() {
    let refusal = options(example()).validate(1e-7).unwrap_err();
    assert_eq!(refusal.key, "sample_time_s");
}

#[test]
fn more_modes_than_channels_of_a_record_are_refused() {
    let mut tables = options(example());
    let count = 70;
    tables.plant.f.iter_mut().for_each(|row| row.resize(count, 0.0));
    for j in 2..count {
        tables.plant.f[1][j] = 1.0 + j as f64;
    }
    tables.plant.channels = None;
    tables.plant.channel_units = None;
    let mode = |m: usize| residual_diagnosis::async_imm::options::ModeOptions {
        name: format!("mode {m}"),
        direction: (0..count)
            .map(|i| vec![if i + 1 == m { 1.0 } else { 0.0 }])
            .collect(),
    };
    tables.mode = (0..=count).map(mode).collect();
    tables.initial.mode_probability = vec![0.0; count + 1];
    tables.initial.mode_probability[0] = 1.0;
    let refusal = tables.validate(1.0).unwrap_err();
    assert_eq!(refusal.key, "mode");
    assert!(
        refusal.message.contains("142 channels") || refusal.message.contains("141 channels"),
        "{refusal}"
    );
}

#[test]
fn unknown_keys_are_refused() {
    for path in [
        "plnt",
        "plant.C",
        "sensor.0.service",
        "mode.0.direction_",
        "decision.latch",
    ] {
        let mut table = example();
        set(&mut table, path, "1");
        let read: Result<residual_diagnosis::async_imm::options::AsyncImmTables, _> = table.try_into();
        assert!(read.is_err(), "{path}");
    }
}
