//! A table of mistakes: what is changed in the good example, where the refusal points, what it says and advises.

use crate::common::{VTOL, line_of, mistakes_of, vtol_with};

/// One mistake in the example.
struct Case {
    /// The fact.
    name: &'static str,
    /// What is replaced (its first occurrence), and by what.
    edit: (&'static str, &'static str),
    /// Lines from the beginning of the edit to the place that the refusal points at.
    below: isize,
    /// Words of the message.
    message: &'static [&'static str],
    /// Words of the help.
    help: &'static [&'static str],
}

macro_rules! cases {
    ($($name:literal: $good:literal => $bad:literal, $below:literal, [$($message:literal),*], [$($help:literal),*];)*) => {
        &[$(Case {
            name: $name, edit: ($good, $bad), below: $below, message: &[$($message),*], help: &[$($help),*],
        }),*]
    };
}

fn check(cases: &[Case]) {
    for Case {
        name,
        edit: (good, bad),
        below,
        message,
        help,
    } in cases
    {
        let text = vtol_with(good, bad);
        let mistakes = mistakes_of(&text);
        let shown: Vec<_> = mistakes
            .iter()
            .map(|m| (m.line, m.column, &m.message, &m.help))
            .collect();
        assert_eq!(mistakes.len(), 1, "{name}: {shown:?}");
        assert_eq!(
            mistakes[0].line,
            line_of(VTOL, good).saturating_add_signed(*below),
            "{name}: {shown:?}"
        );
        assert!(mistakes[0].column >= 1);
        for words in *message {
            assert!(
                mistakes[0].message.contains(words),
                "{name}: no `{words}` in {shown:?}"
            );
        }
        for words in *help {
            let help = mistakes[0].help.as_deref().unwrap_or("");
            assert!(help.contains(words), "{name}: no `{words}` in {shown:?}");
        }
    }
}

#[test]
fn unknown_keys_are_refused_with_a_suggestion() {
    check(cases![
        "top level": "[realtime]" => "[realtim]", 0, ["unknown key `realtim`"], ["did you mean `realtime`"];
        "daemon": "catch_up_limit = 10" => "catchup_limit = 10", 0, ["`catchup_limit`"], ["`catch_up_limit`?"];
        "input": "buffer_samples = 64" => "buffer = 64", 0, ["`buffer`"], ["buffer_samples"];
        "diagnoser": "priority = 0" => "prority = 0", 0, ["`prority`"], ["`priority`?", "`bank`", "`phase_s`"];
        "model": "disturbance_bound = " => "disturbance_bond = ", 0, ["disturbance_bond"], ["`disturbance_bound`?"];
        "filter": "gain_sweeps = 0" => "gain_sweep = 0", 0, ["`gain_sweep`"], ["did you mean `gain_sweeps`?"];
        "bank": "clear_samples = 50" => "wheels = 50", 0, ["unknown key `wheels`"], ["known keys: ", "`reset`"];
        "parity": "lengths = [1" => "length = [1", 0, ["`length`"], ["`lengths`?"];
        "missing": "fault_bound = [3.0" => "fault_bounds = [3.0", 0, ["fault_bounds"], ["`fault_bound`?"];
        "replay": "time_column = \"t\"" => "time_column = \"t\"\ncolumn = 1", 1, ["`column`"], ["`run_column`"];
    ]);
}

#[test]
fn wrong_types_and_words_are_refused() {
    check(cases![
        "text for a number": "stale_after_periods = 3" => "stale_after_periods = \"3\"", 0,
            ["expected a whole number", "\"3\""], ["write a whole number"];
        "number for a text": "log = \"info\"" => "log = 3", 0, ["expected a string, found 3"], [];
        "fraction for a count": "record_queue = 1024" => "record_queue = 10.5", 0,
            ["expected a whole number, 0 or more, found 10.5"], [];
        "negative count": "buffer_samples = 64" => "buffer_samples = -1", 0, ["0 or more, found -1"], [];
        "text for a switch": "lock_memory = true" => "lock_memory = \"yes\"", 0, ["true or false"], [];
        "text in a matrix": "    [0, 1, 1, 1]," => "    [0, 1, \"1\", 1],", 0, ["expected a number"], [];
        "number for a row": "    [0, 1, 1, 1]," => "    1,", 0, ["expected an array, found 1"], [];
        "date": "phase_s = 0.0" => "phase_s = 2026-01-01", 0, ["date"], [];
        "one bracket": "[replay]" => "[[replay]]", 0, ["expected one table"], ["[replay]"];
        "unknown method": "\"unknown_input_filter\"" => "\"unknown_input_filters\"", 0,
            ["unknown value"], ["did you mean `unknown_input_filter`?"];
        "unknown word": "gain = \"row_wise\"" => "gain = \"rowwise\"", 0, ["\"rowwise\""], ["`row_wise`?"];
        "neither word nor number": "pre_samples = \"auto\"" => "pre_samples = \"some\"", 0,
            ["\"auto\" or a number of samples", "\"some\""], [];
        "number beyond 64 bits": "clear_samples = 50" => "clear_samples = 99999999999999999999", 0, ["64 bits"], [];
    ]);
}

#[test]
fn numbers_that_are_not_finite_are_refused_where_they_stand() {
    check(cases![
        "nan in a matrix": "    [0.0, 0.0, 0.0100, 1.0]," => "    [0.0, 0.0, nan, 1.0],", 0, ["nan"], [];
        "infinite bound": "fault_bound = [3.0, 3.0]" => "fault_bound = [3.0, inf]", 0, ["finite"], ["write a finite one"];
        "infinite period": "sample_time_s = 0.01" => "sample_time_s = inf", 0, ["finite"], [];
        "overflow": "max_ahead_s = 1.0" => "max_ahead_s = 1e999", 0, ["1e999", "finite"], [];
    ]);
}

#[test]
fn what_is_missing_is_named_at_its_section() {
    let cases = [
        ("instance = \"vtol\"", "", "[daemon]", "missing key `instance`"),
        (
            "name = \"aircraft_sensors\"",
            "",
            "[[input]]",
            "missing key `name`",
        ),
        (
            "sample_time_s = 0.01",
            "",
            "[[diagnoser]]",
            "missing key `sample_time_s`",
        ),
        (
            "method = \"unknown_input_filter\"",
            "",
            "[[diagnoser]]",
            "missing key `method`",
        ),
        (
            "measurement_noise_bound = ",
            "# ",
            "[diagnoser.model]",
            "missing key `measurement_noise_bound`",
        ),
        ("time_column = \"t\"", "", "[replay]", "missing key `time_column`"),
        (
            "fault_bound = [3.0, 3.0]",
            "",
            "[diagnoser.missing]",
            "`missing.fault_bound` is missing",
        ),
    ];
    for (good, bad, section, message) in cases {
        let text = vtol_with(good, bad);
        let mistakes = mistakes_of(&text);
        assert_eq!(mistakes.len(), 1, "{good}: {mistakes:?}");
        assert_eq!(
            mistakes[0].line,
            line_of(&text, &format!("\n{section}")) + 1,
            "{good}: {mistakes:?}"
        );
        assert!(mistakes[0].message.contains(message), "{}", mistakes[0].message);
        assert!(mistakes[0].help.is_some(), "{good}");
    }
}

#[test]
fn a_configuration_without_inputs_or_diagnosers_is_refused() {
    let text = "[daemon]\ninstance = \"a\"\n";
    let messages: Vec<_> = mistakes_of(text)
        .into_iter()
        .map(|mistake| mistake.message)
        .collect();
    assert_eq!(messages, ["no [[input]]", "no [[diagnoser]]"]);
    let mistakes = mistakes_of("[realtime]\n[input]\nname = \"a\"\n[[diagnoser]]\nname = \"a\"\n");
    assert!(mistakes.iter().any(|m| m.message.contains("[daemon]")));
    assert!(
        mistakes
            .iter()
            .any(|m| m.line == 2 && m.help.as_deref().unwrap_or("").contains("[[input]]"))
    );
}

#[test]
fn a_daemon_section_that_cannot_work_is_refused() {
    check(cases![
        "instance with a slash": "\"vtol\"" => "\"a/b\"", 0, ["`a/b` holds `/`"], ["use only a-z"];
        "instance too long": "\"vtol\"" => "\"abcdefghijklmnopqrstuvwxyz\"", 0, ["26 characters"], ["1 to 24"];
        "relative directory": "\"/dev/shm\"" => "\"shm\"", 0, ["absolute"], ["/dev/shm"];
        "long directory": "\"/dev/shm\"" => "\"/run/a/rather/long/path/for/a/runtime/directory\"", 0,
            ["too long"], ["60 bytes"];
        "unknown group": "# group = \"residual\"" => "group = \"no_such_group\"", 0,
            ["no group `no_such_group`"], ["groupadd"];
        "negative group": "# group = \"residual\"" => "group = -5", 0, ["name or the number of a group"], [];
        "world-writable": "mode = \"0640\"" => "mode = \"0646\"", 0, ["everybody write"], ["0640"];
        "group-writable": "mode = \"0640\"" => "mode = \"0660\"", 0, ["the group write"], ["0640"];
        "not octal": "mode = \"0640\"" => "mode = \"0680\"", 0, ["not a permission"], ["octal"];
        "owner without rights": "mode = \"0640\"" => "mode = \"0440\"", 0, ["0440"], ["0600"];
        "stale at once": "stale_after_periods = 3" => "stale_after_periods = 0", 0, ["stale at once"], ["1 or more"];
        "no queue": "record_queue = 1024" => "record_queue = 0", 0, ["0 is no possible"], ["1 to 65536"];
        "checkpoints without a file": "# checkpoint_period_s = 10.0" => "checkpoint_period_s = 10.0", 0,
            ["a period for checkpoints but no file"], ["`checkpoint_file`"];
        "checkpoints all the time":
            "# checkpoint_file = \"vtol.state\"" => "checkpoint_file = \"vtol.state\"\ncheckpoint_period_s = 0.01 #", 1,
            ["every 0.01 s is not possible"], ["0.1"];
        "log filter": "log = \"info\"" => "log = \"residuald=loud\"", 0, ["not a log filter"], ["debug"];
        "priority 0": "# fifo_priority = 50" => "fifo_priority = 0", 0, ["SCHED_FIFO"], ["1 to 99"];
        "priority 100": "# fifo_priority = 50" => "fifo_priority = 100", 0, ["100"], ["1 to 99"];
        "processor": "# cpu = 1" => "cpu = 5000", 0, ["5000"], ["0 to 1023"];
    ]);
}

#[test]
fn inputs_that_cannot_work_are_refused() {
    check(cases![
        "units": "units = [\"kn\", \"kn\"" => "units = [\"kn\"", 0, ["4 signals but 3 units"], ["one unit per signal"];
        "no buffer": "buffer_samples = 64" => "buffer_samples = 0", 0, ["0 is no possible"], ["1 to 65536"];
        "no publisher": "max_publishers = 2" => "max_publishers = 0", 0, ["0 is no possible"], ["1 to 64"];
        "past only": "max_ahead_s = 1.0" => "max_ahead_s = -1.0", 0, ["-1 s"], ["0 to 86400"];
    ]);
    let repeated = vtol_with(
        "\"pitch_rate\", \"attitude_mix\"]",
        "\"pitch_rate\", \"pitch_rate\"]",
    );
    let mistakes = mistakes_of(&repeated);
    assert!(
        mistakes
            .iter()
            .any(|m| m.message.contains("`pitch_rate` appears twice"))
    );
    let line = line_of(VTOL, "signals = [");
    assert!(
        mistakes
            .iter()
            .any(|m| m.help.as_deref().unwrap_or("").contains(&format!("line {line}")))
    );
    let twins = vtol_with("name = \"aircraft_commands\"", "name = \"aircraft_sensors\"");
    let mistakes = mistakes_of(&twins);
    assert!(
        mistakes[0]
            .message
            .contains("the input `aircraft_sensors` appears twice"),
        "{mistakes:?}"
    );
    for bad in ["", "a b", "a.b", &"x".repeat(49)] {
        let text = VTOL.replace("aircraft_commands", bad);
        assert_eq!(
            mistakes_of(&text)[0].line,
            line_of(VTOL, "name = \"aircraft_commands\""),
            "{bad}"
        );
    }
}

#[test]
fn schedules_that_cannot_work_are_refused() {
    check(cases![
        "zero period": "sample_time_s = 0.01" => "sample_time_s = 0", 0, ["period of 0 s"], ["10 µs"];
        "negative period": "sample_time_s = 0.01" => "sample_time_s = -0.01", 0, ["-0.01"], ["10 µs"];
        "too short": "sample_time_s = 0.01" => "sample_time_s = 9e-6", 0, ["0.000009"], ["10 µs"];
        "too long": "sample_time_s = 0.01" => "sample_time_s = 3601", 0, ["3601"], ["1 h"];
        "no whole nanoseconds": "sample_time_s = 0.01" => "sample_time_s = 0.0166666666666", 0,
            ["whole number of nanoseconds"], ["0.016666667"];
        "phase of a period": "phase_s = 0.0" => "phase_s = 0.01", 0, ["whole period"], ["below the period of 0.01 s"];
        "phase beyond": "phase_s = 0.0" => "phase_s = 0.02", 0, ["0.02 s"], ["below the period"];
        "negative phase": "phase_s = 0.0" => "phase_s = -0.001", 0, ["-0.001"], ["from 0"];
        "negative margin": "margin_s = 0.005" => "margin_s = -0.002", 0, ["-0.002"], ["0 to 10 periods"];
        "margin of 11 periods": "margin_s = 0.005" => "margin_s = 0.11", 0, ["0.11"], ["0 to 10 periods"];
        "delay": "command_delay_steps = 0" => "command_delay_steps = 5000", 0, ["5000"], ["1024"];
    ]);
}

#[test]
fn signals_that_are_not_there_are_refused_with_the_known_ones() {
    check(cases![
        "unknown signal": "\"aircraft_sensors.pitch_rate\"" => "\"aircraft_sensors.pitch_rat\"", 0,
            ["`aircraft_sensors` has no signal `pitch_rat`"], ["did you mean `pitch_rate`?", "`vertical_speed`"];
        "unknown input": "\"aircraft_sensors.pitch_rate\"" => "\"aircraft_sensor.pitch_rate\"", 0,
            ["no input `aircraft_sensor`"], ["did you mean `aircraft_sensors`?", "`aircraft_commands`"];
        "input left out": "\"aircraft_sensors.pitch_rate\"" => "\"pitch_rate\"", 0,
            ["input.signal"], ["write \"aircraft_sensors.pitch_rate\""];
        "used twice": "\"aircraft_sensors.pitch_rate\"" => "\"aircraft_sensors.vertical_speed\"", 0,
            ["`aircraft_sensors.vertical_speed` appears twice"], ["rename or remove"];
    ]);
    let text = vtol_with("    \"aircraft_sensors.attitude_mix\",\n", "");
    let mistakes = mistakes_of(&text);
    assert_eq!(mistakes[0].line, line_of(VTOL, "measurements = ["));
    assert!(
        mistakes[0]
            .message
            .contains("3 measurements, but its model has 4 measured outputs"),
        "{mistakes:?}"
    );
    assert!(
        mistakes[0]
            .help
            .as_deref()
            .unwrap()
            .contains("list one signal for each"),
        "{mistakes:?}"
    );
    let text = vtol_with("    \"aircraft_commands.longitudinal_cyclic_pitch\",\n", "");
    let mistakes = mistakes_of(&text);
    assert_eq!(mistakes[0].line, line_of(VTOL, "commands = ["));
    assert!(
        mistakes[0]
            .message
            .contains("1 commands, but its model has 2 known inputs"),
        "{mistakes:?}"
    );
}

#[test]
fn lifecycles_that_cannot_work_are_refused() {
    check(cases![
        "unknown key": "raise_steps = 2" => "raise_step = 2", 0, ["unknown key `raise_step`"], ["did you mean `raise_steps`?"];
        "no violation": "raise_steps = 2" => "raise_steps = 0", 0, ["0 is no possible number of violations"], ["1 to 64"];
        "too long a window": "raise_window = 4" => "raise_window = 65", 0, ["65 is no possible"], ["1 to 64"];
        "three of two": "raise_window = 4" => "raise_window = 1", 0,
            ["2 violations never come together in 1 steps"], ["a window of 2 to 64 steps"];
        "too long a row": "raise_steps = 2                    # so many violations raise it ...\nraise_window = 4 " =>
            "raise_steps = 70\n", 0, ["70 is no possible"], ["1 to 64"];
        "never cleared": "clear_steps = 10" => "clear_steps = 0", 0, ["0 is no possible number of quiet steps"], ["1 to"];
        "never quiet": "clear_ratio = 0.9" => "clear_ratio = 0", 0, ["ratio 0"], ["above 0 and up to 1"];
        "quiet beyond the bound": "clear_ratio = 0.9" => "clear_ratio = 1.1", 0, ["1.1"], ["up to 1"];
        "switch": "latch = false" => "latch = \"no\"", 0, ["true or false"], [];
        "suppression": "startup_suppression_s = 0.0" => "startup_suppression_s = -1.0", 0, ["-1 s"], ["one day"];
    ]);
    let condition = |keys: &str| {
        let enable = "[[diagnoser.lifecycle.enable]]\n";
        vtol_with("[diagnoser.model]", &format!("{enable}{keys}\n[diagnoser.model]"))
    };
    let cases = [
        (
            "signal = \"aircraft_sensors.pich_rate\"\nrange = [0, 1]",
            "signal = \"aircraft_sensors.pich_rate\"",
            "no signal `pich_rate`",
            "did you mean `pitch_rate`?",
        ),
        (
            "signal = \"aircraft_sensors.pitch_rate\"\nrange = [1, 0]",
            "range = [1, 0]",
            "no value lies between 1 and 0",
            "lower end first",
        ),
        (
            "signal = \"aircraft_sensors.pitch_rate\"\nchannels = []\nrange = [0, 1]",
            "channels = []",
            "concerns no channel",
            "leave `channels` out",
        ),
        (
            "signal = \"aircraft_sensors.pitch_rate\"\nchannels = [\"fault_free\"]\nrange = [0, 1]",
            "channels = [\"fault_free\"]",
            "it has no channel `fault_free`",
            "channels: ",
        ),
        (
            "range = [0, 1]",
            "[[diagnoser.lifecycle.enable]]\nrange",
            "missing key `signal`",
            "add `signal = ...`",
        ),
    ];
    for (keys, place, message, help) in cases {
        let text = condition(keys);
        let mistakes = mistakes_of(&text);
        assert_eq!(mistakes.len(), 1, "{keys}: {mistakes:?}");
        assert_eq!(mistakes[0].line, line_of(&text, place), "{keys}: {mistakes:?}");
        assert!(mistakes[0].message.contains(message), "{keys}: {mistakes:?}");
        assert!(
            mistakes[0].help.as_deref().unwrap_or("").contains(help),
            "{keys}: {mistakes:?}"
        );
    }
}

#[test]
fn two_diagnosers_of_the_same_name_are_refused() {
    let start = VTOL.find("[[diagnoser]]").unwrap();
    let end = VTOL.find("[replay]").unwrap();
    let text = format!("{}{}{}", &VTOL[..end], &VTOL[start..end], &VTOL[end..]);
    let mistakes = mistakes_of(&text);
    assert_eq!(mistakes.len(), 1);
    assert!(
        mistakes[0]
            .message
            .contains("the diagnoser `aircraft_actuators` appears twice")
    );
    assert!(mistakes[0].line > line_of(VTOL, "[replay]"));
}

#[test]
fn matrices_and_bounds_that_do_not_fit_are_refused_at_their_place() {
    check(cases![
        "ragged A": "    [0.0005, 0.9899, 0.0, -0.0402]," => "    [0.0005, 0.9899, 0.0],", 0,
            ["row 1 of `model.A` has 3 entries"], ["same length"];
        "rows of B": "    [-0.0552, 0.0449],\n" => "\n", -3, ["`model.B` is 3 x 2"], ["correct"];
        "rows of D": "    [0, 0, 0, 1],\n]" => "]", -4, ["`model.D` is 3 x 4"], ["correct"];
        "uncertainty": "    [0, 0, 0, 0],\n]" => "]", -4, ["`model.A_uncertainty`"], ["correct"];
        "disturbance bound": "disturbance_bound = [0.01, " => "disturbance_bound = [", 0, ["disturbance_bound"], [];
        "noise bound": "measurement_noise_bound = [0.01, " => "measurement_noise_bound = [", 0, ["noise_bound"], [];
        "negative bound": "measurement_noise_bound = [0.01" => "measurement_noise_bound = [-0.01", 0,
            ["-0.01"], ["never negative"];
        "initial radius": "initial_state_radius = [1, " => "initial_state_radius = [", 0, ["initial_state_radius"], [];
        "state names": "state_names = [\"horizontal_speed\", " => "state_names = [", 0, ["state_names"], [];
        "fault bound": "fault_bound = [3.0, 3.0]" => "fault_bound = [3.0]", 0, ["missing.fault_bound"], [];
        "negative fault bound": "fault_bound = [3.0, 3.0]" => "fault_bound = [3.0, -3.0]", 0, ["-3"], [];
        "discretisation": "# discretisation" => "discretisation", 0, ["model.discretisation"], ["remove it"];
        "half a box": "input_lower = [-10, -10]" => "#", 1, ["input_lower"], ["both"];
    ]);
}

#[test]
fn options_of_the_method_that_do_not_fit_are_refused_at_their_place() {
    check(cases![
        "generator order": "generator_order = 30" => "generator_order = 4", 0, ["4 states"], [];
        "orders": "simultaneous_faults = [1]" => "simultaneous_faults = [2]", 0, ["[2]"], ["[1, 2]"];
        "sweeps": "gain_sweeps = 0" => "gain_sweeps = 7", 0, ["7"], ["0 to 6"];
        "window": "lengths = [1, 3" => "lengths = [0, 3", 0, ["parity.lengths"], [];
        "isolation rule": "isolation = \"latched\"" => "isolation = \"instantaneous\"", 0, ["paper"], ["change the form"];
        "printed test": "test = \"tight\"" => "test = \"printed\"", 0, ["paper"], ["change the form"];
    ]);
}

#[test]
fn replay_values_that_are_no_expressions_are_refused() {
    check(cases![
        "operator without operand": "\"v_z + q + theta\"" => "\"v_z + q +\"", 0, ["not an expression"], ["+ - * /"];
        "parenthesis": "\"collective\"" => "\"(collective\"", 0, ["not an expression"], ["columns"];
        "too few": "values = [\"v_x\", " => "values = [", 0, ["3 values for the 4 signals"], ["attitude_mix"];
        "unknown input": "input = \"aircraft_sensors\"" => "input = \"aircraft_sensor\"", 0,
            ["no input `aircraft_sensor`"], ["did you mean `aircraft_sensors`?"];
        "same input twice": "input = \"aircraft_commands\"\nvalues = [\"collective\", \"cyclic\"]" =>
            "input = \"aircraft_sensors\"\nvalues = [\"1\", \"2\", \"3\", \"4\"]", 0, ["appears twice"], ["line"];
    ]);
}

#[test]
fn rows_that_cannot_be_chosen_or_replayed_are_refused() {
    check(cases![
        "no row at all": "every_rows = 1 " => "every_rows = 0 ", 0, ["`every_rows` = 0"], ["1 for every row"];
        "first row beyond": "first_row = 0 " => "first_row = 1 ", 0, ["beyond the first 1 rows"], ["below `every_rows`"];
        "row period of zero": "# row_period_s = 0.01" => "row_period_s = 0", 0, ["period of 0 s"], ["10 µs"];
        "number for a column": "# fault_column = \"fault\"" => "fault_column = 3", 0, ["expected a string"], [];
    ]);
}

/// Every second line left out, and every value of these lines replaced by something else: a refusal always has its
/// place, and whatever is accepted can be built.
fn spoil_every_second_line(first: usize) {
    let lines: Vec<&str> = VTOL.lines().collect();
    let (mut accepted, mut refused) = (0, 0);
    for index in (first..lines.len()).step_by(2) {
        let key = lines[index]
            .split_once(" = ")
            .map(|(key, _)| key.trim_start_matches("# "));
        let values = [
            "{}",
            "[]",
            "[[]]",
            "\"\"",
            "-1",
            "0",
            "nan",
            "1e300",
            "true",
            "\"ä.ö\"",
            "[\"a\", 1]",
        ];
        let replaced = values
            .iter()
            .filter_map(|value| key.map(|key| format!("{key} = {value}")));
        // A comment that is left out or repeated changes nothing.
        let comment = lines[index].is_empty() || lines[index].starts_with('#');
        let whole = (!comment).then(|| [String::new(), lines[index].repeat(2)]);
        for spoiled in replaced
            .chain(whole.into_iter().flatten())
            .chain(["[[[".to_owned()])
        {
            let mut text = lines.clone();
            text[index] = &spoiled;
            let mistakes = mistakes_of(&text.join("\n"));
            for mistake in &mistakes {
                assert!(
                    (1..=lines.len() + 1).contains(&mistake.line),
                    "{spoiled}: {mistake:?}"
                );
                assert!(!mistake.message.is_empty());
            }
            if mistakes.is_empty() {
                accepted += 1
            } else {
                refused += 1
            }
        }
    }
    assert!(
        refused > 250 && accepted > 50,
        "{refused} refused, {accepted} accepted"
    );
}

#[test]
fn no_spoiled_odd_line_makes_the_check_panic_or_lose_the_place() {
    spoil_every_second_line(0);
}

#[test]
fn no_spoiled_even_line_makes_the_check_panic_or_lose_the_place() {
    spoil_every_second_line(1);
}
