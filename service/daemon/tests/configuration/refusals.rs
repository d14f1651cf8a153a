//! Every mistake in a configuration is refused at its place, with what to do about it.

use crate::common::{VTOL, line_of, mistakes_of, vtol_with};
use residual_diagnosis::unknown_input_filter::tables::UnknownInputFilterTables;
use residuald::configuration::{Configuration, ConfigurationError, MethodConfiguration, SignalReference};
use std::path::Path;

/// The tables of a bank of unknown-input filters.
fn bank(method: &MethodConfiguration) -> &UnknownInputFilterTables {
    match method {
        MethodConfiguration::UnknownInputFilter(tables) => tables,
        other => panic!("{} is another method", other.name()),
    }
}

#[test]
fn the_example_is_read_as_it_is_written() {
    let configuration = Configuration::from_text("vtol.toml", VTOL).unwrap().configuration;
    assert_eq!(configuration.daemon.instance.to_string(), "vtol");
    assert_eq!(
        (configuration.daemon.mode, configuration.daemon.group),
        (0o640, None)
    );
    assert!(configuration.realtime.lock_memory);
    assert_eq!(configuration.inputs[0].signals[2], "pitch_rate");
    assert_eq!(configuration.inputs[1].max_ahead_ns, 1_000_000_000);
    let diagnoser = &configuration.diagnosers[0];
    assert_eq!(
        (diagnoser.period_ns, diagnoser.phase_ns, diagnoser.margin_ns),
        (10_000_000, 0, 5_000_000)
    );
    assert_eq!(
        diagnoser.measurements[3],
        SignalReference { input: 0, element: 3 }
    );
    assert_eq!(diagnoser.commands[1], SignalReference { input: 1, element: 1 });
    let tables = bank(&diagnoser.method);
    assert_eq!(tables.model.b[1], [0.0198, -0.0759]);
    assert_eq!(tables.parity.lengths, [1, 3, 10, 30]);
    assert_eq!(
        configuration.replay.unwrap().inputs[0].values[3],
        "v_z + q + theta"
    );
}

#[test]
fn names_and_units_of_the_signals_serve_where_the_model_states_none() {
    let configuration = Configuration::from_text("vtol.toml", VTOL).unwrap().configuration;
    let tables = bank(&configuration.diagnosers[0].method);
    assert_eq!(
        tables.model.actuator_names.as_deref().unwrap(),
        ["collective_pitch", "longitudinal_cyclic_pitch"]
    );
    assert_eq!(
        tables.model.output_units.as_deref().unwrap(),
        ["kn", "kn", "deg/s", ""]
    );
    let named = vtol_with(
        "# actuator_names = [\"collective_pitch\"",
        "actuator_names = [\"lift\"",
    );
    let configuration = Configuration::from_text("vtol.toml", &named)
        .unwrap()
        .configuration;
    let tables = bank(&configuration.diagnosers[0].method);
    assert_eq!(tables.model.actuator_names.as_deref().unwrap()[0], "lift");
}

#[test]
fn what_is_left_out_has_its_documented_default() {
    let text = VTOL
        .replace("margin_s = 0.005 ", "#")
        .replace("lock_memory = true", "#")
        .replace("mode = \"0640\"", "#")
        .replace("record_queue = 1024", "#");
    let configuration = Configuration::from_text("vtol.toml", &text)
        .unwrap()
        .configuration;
    assert_eq!(configuration.diagnosers[0].margin_ns, 2_000_000);
    assert_eq!(
        (configuration.daemon.mode, configuration.daemon.record_queue),
        (0o640, 1024)
    );
    assert!(configuration.realtime.lock_memory);
    assert_eq!(configuration.inputs[1].buffer_samples, 64);
}

#[test]
fn one_run_shows_the_mistakes_of_all_sections_in_their_order() {
    let text = VTOL
        .replace("mode = \"0640\"", "mode = \"0666\"")
        .replace("cpu = 1 ", "cpus = 1 ")
        .replace("# cpus", "cpus")
        .replace("max_publishers = 2", "max_publishers = 0")
        .replace("phase_s = 0.0", "phase_s = \"none\"")
        .replace(
            "\"aircraft_sensors.pitch_rate\"",
            "\"aircraft_sensors.pitchrate\"",
        )
        .replace("gain_sweeps = 0", "gain_sweeps = nan")
        .replace("policy = \"bounded_fault\"", "policy = \"bounded\"")
        .replace("\"v_x\"", "\"v_x +\"");
    let lines: Vec<usize> = mistakes_of(&text).iter().map(|mistake| mistake.line).collect();
    let expected = [
        "mode = \"0666\"",
        "cpus = 1",
        "max_publishers = 0",
        "phase_s = \"none\"",
        "aircraft_sensors.pitchrate",
        "gain_sweeps = nan",
        "policy = \"bounded\"",
        "v_x +",
    ];
    assert_eq!(lines, expected.map(|words| line_of(&text, words)));
}

#[test]
fn a_missing_file_is_named() {
    let error = Configuration::from_file(Path::new("/nowhere/residuald.toml")).unwrap_err();
    assert!(matches!(error, ConfigurationError::Unreadable { .. }));
    assert!(error.to_string().contains("/nowhere/residuald.toml"), "{error}");
}

#[test]
fn a_file_that_is_not_utf8_is_refused_with_the_line() {
    let file = tempfile::NamedTempFile::new().unwrap();
    std::fs::write(file.path(), b"[daemon]\ninstance = \"v\xe4hicle\"\n").unwrap();
    let error = Configuration::from_file(file.path()).unwrap_err();
    assert!(
        matches!(
            error,
            ConfigurationError::NotUtf8 {
                line: 2,
                offset: 22,
                ..
            }
        ),
        "{error:?}"
    );
}

#[test]
fn an_empty_file_is_refused_as_empty() {
    for text in ["", "# nothing but a comment\n"] {
        let mistakes = mistakes_of(text);
        assert_eq!(mistakes.len(), 1);
        assert!(mistakes[0].message.contains("empty") && mistakes[0].help.is_some());
    }
}

#[test]
fn a_syntax_mistake_is_found_at_its_line_and_column() {
    let text = vtol_with("mode = \"0640\"", "mode = \"0640");
    let mistakes = mistakes_of(&text);
    assert_eq!(mistakes[0].line, line_of(&text, "mode = \"0640"));
    let text = vtol_with("instance = \"vtol\"", "instance = \"vtol\"\ninstance = \"again\"");
    let mistakes = mistakes_of(&text);
    assert_eq!(
        (mistakes[0].line, mistakes[0].column),
        (line_of(&text, "\"again\""), 1)
    );
    assert!(
        mistakes[0].message.contains("duplicate"),
        "{}",
        mistakes[0].message
    );
}
