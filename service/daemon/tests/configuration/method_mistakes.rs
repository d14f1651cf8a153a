//! What a method refuses is shown at its line of the configuration, with the condition that fails and a way out.

use crate::common::{line_of, mistakes_of, repository};

/// In an example `good` is replaced by `bad`: the only mistake is shown at the line of `place` and says `condition`.
fn refuses(example: &str, good: &str, bad: &str, place: &str, condition: &str) {
    let text = std::fs::read_to_string(repository("deploy/config").join(example)).unwrap();
    assert!(text.contains(good), "{example} does not contain {good}");
    let spoilt = text.replacen(good, bad, 1);
    let mistakes = mistakes_of(&spoilt);
    let [mistake] = mistakes.as_slice() else {
        panic!("{example}, {bad}: {} mistakes: {mistakes:#?}", mistakes.len());
    };
    let help = mistake.help.as_deref().unwrap_or_default();
    assert!(
        mistake.message.contains(condition) || help.contains(condition),
        "{example}, {bad}: {mistake:#?}"
    );
    assert_eq!(
        mistake.line,
        line_of(&spoilt, place),
        "{example}, {bad}: {mistake:#?}"
    );
    assert!(
        mistake.help.as_ref().is_some_and(|help| !help.is_empty()),
        "{mistake:#?}"
    );
}

#[test]
fn the_reduced_order_observer_refuses_what_it_cannot_do() {
    refuses(
        "servo.toml",
        "C = [[1, 0, 0], [0, 1, 0]]",
        "C = [[1, 0, 0], [1, 0, 0]]",
        "C = [[1, 0, 0]",
        "linearly dependent",
    );
    refuses(
        "servo.toml",
        "disturbance_lower = [-1.0]",
        "disturbance_lower = [2.0]",
        "disturbance_lower",
        "above 1",
    );
    refuses(
        "servo.toml",
        "generator_order = 24",
        "generator_order = 2",
        "generator_order",
        "at least 3",
    );
}

#[test]
fn asynchronous_fusion_refuses_what_it_cannot_do() {
    let file = "turning_target.toml";
    refuses(
        file,
        "stay_probability = 0.999",
        "stay_probability = 1.5",
        "stay_probability",
        "1 / modes",
    );
    refuses(
        file,
        "noise_covariance = [[25, 0], [0, 25]] ",
        "noise_covariance = [[25, 26], [26, 25]] ",
        "[[25, 26]",
        "positive definite",
    );
    refuses(
        file,
        "mode_probability = [0.9, 0.05, 0.05]",
        "mode_probability = [0.9, 0.05, 0.15]",
        "mode_probability",
        "sum",
    );
}

#[test]
fn the_chi_square_tests_refuse_what_they_cannot_do() {
    let file = "scalar.toml";
    refuses(
        file,
        "measurement_noise_covariance = [[0.01]]",
        "measurement_noise_covariance = [[0.0]]",
        "[[0.0]]",
        "positive definite",
    );
    refuses(
        file,
        "process_noise_covariance = [[0.01]]",
        "process_noise_covariance = [[-0.01]]",
        "[[-0.01]]",
        "negative",
    );
    refuses(
        file,
        "run_false_alarm_probability = 0.001",
        "run_false_alarm_probability = 1.5",
        "run_false_alarm_probability = 1.5",
        "at most 0.5",
    );
}

#[test]
fn the_fault_detection_filter_refuses_what_it_cannot_do() {
    let file = "two_state.toml";
    refuses(
        file,
        "A = [[-3.370, 1.636]",
        "A = [[+3.370, 1.636]",
        "A = [[+3.370",
        "does not decay",
    );
    refuses(
        file,
        "window = 1.0",
        "window = 1.0037",
        "window = 1.0037",
        "period",
    );
    refuses(
        file,
        "type = \"riccati_dt\"",
        "type = \"lmi_best\"",
        "lmi_best",
        "possible values",
    );
    // The paper's own gain does not keep the bound that its theorem claims.
    refuses(
        file,
        "type = \"riccati_dt\"",
        "recovery = \"as_printed\"\ntype = \"lmi_paper\"",
        "type = \"lmi_paper\"",
        "theorem1_bound_violated",
    );
}
