//! One small configuration per mistake: every refusal names its key and says what is wrong.

use residual_diagnosis::{
    method::{MethodOptions, Refusal},
    reduced_order_observer::options::ReducedOrderObserverOptions,
};
use toml::{Table, Value};

const SERVO: &str = r#"
[model]
A = [[0.49, 0.10, 0.06], [-0.32, 0.95, -0.23], [-0.25, -0.06, 0.63]]
B = [[0.4], [0.4], [0.5]]
C = [[1, 0, 0], [0, 1, 0]]
D = [[-0.1], [0.2], [-0.1]]
initial_state_lower = [-1, -1, -1]
initial_state_upper = [1, 1, 1]
disturbance_lower = [-1.0]
disturbance_upper = [1.0]
measurement_noise_bound = [0.01, 0.01]
"#;

/// The servo with these entries replaced.
fn with(changes: &str) -> Result<ReducedOrderObserverOptions, toml::de::Error> {
    let mut table: Table = SERVO.parse().unwrap();
    for (section, entries) in changes.parse::<Table>().unwrap() {
        let target = table.entry(section).or_insert_with(|| Value::Table(Table::new()));
        for (key, value) in entries.as_table().unwrap() {
            target.as_table_mut().unwrap().insert(key.clone(), value.clone());
        }
    }
    table.try_into()
}

fn refusal(changes: &str) -> Refusal {
    let options = with(changes).unwrap();
    options
        .design(0.1)
        .err()
        .unwrap_or_else(|| panic!("{changes} is accepted"))
}

/// The refusal of these changes names the key, contains the words, and says what to do.
fn refused(changes: &str, key: &str, words: &str) {
    let found = refusal(changes);
    assert_eq!(found.key, key, "{found}");
    assert!(found.message.contains(words), "{found}");
    assert!(found.message.contains("; "), "no advice: {found}");
}

/// Refused already without a design.
fn invalid(changes: &str, key: &str, words: &str) {
    refused(changes, key, words);
    assert_eq!(with(changes).unwrap().validate(0.1).unwrap_err().key, key);
}

#[test]
fn the_configuration_without_a_mistake_is_accepted() {
    let options = with("").unwrap();
    options.validate(0.1).unwrap();
    assert_eq!(options.signal_counts(), (2, 1));
    options.design(0.1).unwrap();
}

#[test]
fn shapes_and_entries_of_the_model() {
    invalid("model = { A = [] }", "model.A", "no state");
    invalid("model = { A = [[1, 0, 0], [0, 1, 0]] }", "model.A", "2 x 3");
    invalid(
        "model = { A = [[1, 0, 0], [0, 1], [0, 0, 1]] }",
        "model.A.1",
        "2 entries",
    );
    invalid(
        "model = { A = [[nan, 0, 0], [0, 1, 0], [0, 0, 1]] }",
        "model.A",
        "NaN",
    );
    invalid("model = { B = [[1], [2]] }", "model.B", "2 x 1");
    invalid("model = { B = [] }", "model.B", "0 x 0");
    invalid("model = { C = [[1, 0], [0, 1]] }", "model.C", "2 x 2");
    invalid("model = { D = [[1]] }", "model.D", "1 x 1");
    invalid(
        "model = { initial_state_lower = [0, 0] }",
        "model.initial_state_lower",
        "length 2",
    );
    invalid(
        "model = { disturbance_upper = [1, 1] }",
        "model.disturbance_upper",
        "length 2",
    );
    invalid(
        "model = { measurement_noise_bound = [0.1] }",
        "model.measurement_noise_bound",
        "length 1",
    );
    invalid(
        "model = { measurement_noise_bound = [0.1, -0.1] }",
        "model.measurement_noise_bound",
        "-0.1",
    );
    invalid(
        "model = { output_names = [\"one\"] }",
        "model.output_names",
        "length 1",
    );
    invalid(
        "model = { actuator_units = [] }",
        "model.actuator_units",
        "length 0",
    );
}

#[test]
fn empty_boxes_and_halves_of_boxes() {
    invalid(
        "model = { initial_state_lower = [0, 2, 0] }",
        "model.initial_state_lower",
        "entry 1",
    );
    invalid(
        "model = { disturbance_lower = [3] }",
        "model.disturbance_lower",
        "above 1",
    );
    invalid("model = { input_lower = [-1] }", "model.input_upper", "together");
    invalid(
        "model = { input_lower = [1], input_upper = [-1] }",
        "model.input_lower",
        "above -1",
    );
    invalid(
        "missing = { restart_state_upper = [1, 1, 1] }",
        "missing.restart_state_lower",
        "together",
    );
}

#[test]
fn the_assumptions_of_the_method() {
    invalid(
        "model = { C = [[1, 0, 0], [2, 0, 0]] }",
        "model.C",
        "linearly dependent",
    );
    let two = "disturbance_lower = [-1, -1], disturbance_upper = [1, 1]";
    invalid(
        &format!("model = {{ D = [[1, 2], [1, 2], [0, 0]], {two} }}"),
        "model.D",
        "linearly dependent",
    );
    invalid("model = { D = [[0], [0], [1]] }", "model.D", "tell them apart");
    invalid(
        "model = { D = [[1e-16], [0], [1]] }",
        "model.D",
        "tell them apart",
    );
    // One output, zero 1.2.
    let scalar = "A = [[0.4, 1.0], [0.1, 0.5]], B = [[1], [0]], C = [[1, 0]], measurement_noise_bound = [0], \
                  initial_state_lower = [-1, -1], initial_state_upper = [1, 1]";
    invalid(
        &format!("model = {{ D = [[1], [-0.7]], {scalar} }}"),
        "model.D",
        "invariant zero 1.2",
    );
    invalid(
        &format!("model = {{ D = [[1], [-0.5]], {scalar} }}"),
        "model.D",
        "invariant zero 1",
    );
}

#[test]
fn the_design_options() {
    invalid(
        "design = { spectral_radius_max = 1.0 }",
        "design.spectral_radius_max",
        "between 0 and 1",
    );
    invalid(
        "design = { lmi_decay_rate = 0.0 }",
        "design.lmi_decay_rate",
        "(0, 1]",
    );
    invalid(
        "design = { fault_scale = [1, 1] }",
        "design.fault_scale",
        "length 2",
    );
    invalid("design = { fault_scale = [0] }", "design.fault_scale", "positive");
    invalid("design = { gains = \"closed_form\" }", "design.poles", "missing");
    invalid(
        "design = { gains = \"closed_form\", poles = [0.1, 0.2] }",
        "design.poles",
        "length 2",
    );
    invalid("design = { poles = [1.5] }", "design.poles", "between -1 and 1");
    invalid("design = { gains = \"given\" }", "design.K", "missing");
    invalid("design = { gains = \"given\", K = [[1]] }", "design.K", "1 x 1");
    invalid("design = { observer_M = [[0.5]] }", "design.observer_M", "1 x 1");
}

#[test]
fn gains_that_are_not_accepted() {
    refused(
        "design = { gains = \"closed_form\", poles = [0.95] }",
        "design.poles",
        "0.95",
    );
    refused(
        "design = { gains = \"given\", K = [[100, 0]] }",
        "design.K",
        "|eig F|",
    );
    refused(
        "design = { gains = \"given\", K = [[0, 0.5]], observer_M = [[1.1, 0], [0, 0]] }",
        "design.K",
        "M must be Schur",
    );
    // As many disturbances as outputs: F is that of the plant.
    refused(
        "model = { A = [[0.4, 1.0], [0.1, 0.5]], B = [[1], [0]], C = [[1, 0]], D = [[1], [0.2]], \
         measurement_noise_bound = [0], initial_state_lower = [-1, -1], initial_state_upper = [1, 1] }\n\
         design = { spectral_radius_max = 0.1 }",
        "design.spectral_radius_max",
        "K0",
    );
}

#[test]
fn the_options_of_bounds_isolation_and_gaps() {
    invalid(
        "bounds = { generator_order = 2 }",
        "bounds.generator_order",
        "3 rows",
    );
    invalid(
        "bounds = { mode = \"paper\", generator_order = 1 }",
        "bounds.generator_order",
        "2 rows",
    );
    invalid(
        "bounds = { generator_order = 5000 }",
        "bounds.generator_order",
        "1000",
    );
    invalid(
        "bounds = { mode = \"paper\", initialisation = \"measured_output\" }",
        "bounds.initialisation",
        "prior_box",
    );
    invalid("bounds = { tests = [\"set\"] }", "bounds.tests", "hull");
    invalid(
        "bounds = { max_directions = 1 }",
        "bounds.max_directions",
        "direction",
    );
    invalid(
        "bounds = { rounding_tolerance = -1e-9 }",
        "bounds.rounding_tolerance",
        "negative",
    );
    invalid(
        "bounds = { alarm_samples = 0 }",
        "bounds.alarm_samples",
        "at least 1",
    );
    invalid(
        "isolation = { poles = [0.1, 0.2] }",
        "isolation.poles",
        "length 2",
    );
    invalid(
        "isolation = { poles = [-1.0] }",
        "isolation.poles",
        "between -1 and 1",
    );
    invalid(
        "isolation = { fault_bound = [1, 1] }",
        "isolation.fault_bound",
        "length 2",
    );
    invalid(
        "isolation = { fault_bound = [-1] }",
        "isolation.fault_bound",
        "-1",
    );
    invalid(
        "isolation = { fault_estimate_radius_max = [-1] }",
        "isolation.fault_estimate_radius_max",
        "-1",
    );
    invalid(
        "missing = { max_width_ratio = 1.0 }",
        "missing.max_width_ratio",
        "larger than 1",
    );
}

#[test]
fn more_rows_than_a_record_holds() {
    // Two hidden states with slow complex modes have many facets.
    let text = "model = { A = [[0.1, 0.2, 1, 0.5], [0, 0.3, -0.4, 1], [0.2, 0, 0.6, -0.6], [0, 0.1, 0.6, 0.6]], \
                B = [[1], [0], [0], [1]], C = [[1, 0, 0, 0], [0, 1, 0, 0]], D = [[], [], [], []], \
                disturbance_lower = [], disturbance_upper = [], \
                initial_state_lower = [-1, -1, -1, -1], initial_state_upper = [1, 1, 1, 1] }\n\
                bounds = { max_directions = 200 }";
    refused(text, "bounds.max_directions", "a record holds 64");
}

#[test]
fn unknown_keys_and_words() {
    for (changes, word) in [
        ("model = { E = [[1]] }", "E"),
        ("design = { gain = \"auto\" }", "gain"),
        ("bounds = { mode = \"exact\" }", "exact"),
        ("design = { observer_M = \"zeros\" }", "observer_M"),
        ("extra = { a = 1 }", "extra"),
    ] {
        let error = with(changes).unwrap_err().to_string();
        assert!(error.contains(word), "{error}");
    }
}

#[test]
fn designs_that_need_a_solver_fall_back_with_a_warning() {
    for (changes, word) in [
        ("design = { gains = \"h2\" }", "h2"),
        ("design = { gains = \"lmi\", lmi_decay_rate = 0.9 }", "lmi"),
        ("design = { observer_M = \"lmi\" }", "observer_M"),
    ] {
        let designed = with(changes).unwrap().design(0.1).unwrap();
        assert!(
            designed.warnings.iter().any(|warning| warning.contains(word)),
            "{:?}",
            designed.warnings
        );
    }
}

#[test]
fn options_survive_their_text_form() {
    let options =
        with("design = { observer_M = [[0, 0.1], [0, 0]], K = [[1, 1]] }\nisolation = { fault_bound = [2] }");
    let options = options.unwrap();
    let text = toml::to_string(&options).unwrap();
    assert_eq!(
        toml::from_str::<ReducedOrderObserverOptions>(&text).unwrap(),
        options
    );
}
