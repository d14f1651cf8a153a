//! `residuald check` as its user sees it.

use crate::common::{VTOL, line_of, mistakes_of, repository, vtol_with};
use std::path::Path;
use std::process::{Command, Output};

/// Two actuators, two states, both measured.
const SMALL: &str = r#"
[daemon]
instance = "small"
[[input]]
name = "plant"
signals = ["y0", "y1", "u0", "u1"]
[[diagnoser]]
name = "loop"
method = "unknown_input_filter"
sample_time_s = 0.1
measurements = ["plant.y0", "plant.y1"]
commands = ["plant.u0", "plant.u1"]
[diagnoser.model]
A = [[0.9, 0], [0, 0.9]]
B = [[1, 0], [0, 1]]
C = [[1, 0], [0, 1]]
measurement_noise_bound = [0.1, 0.1]
[diagnoser.missing]
fault_bound = [1, 1]
"#;

fn check(path: &Path) -> Output {
    Command::new(env!("CARGO_BIN_EXE_residuald"))
        .arg("check")
        .arg(path)
        .output()
        .unwrap()
}

fn check_text(text: &str) -> Output {
    let file = tempfile::Builder::new().suffix(".toml").tempfile().unwrap();
    // The example's gains belong to the example as it is.
    let text = text.replace("gains_file = ", "# gains_file = ");
    std::fs::write(file.path(), text).unwrap();
    check(file.path())
}

fn text(bytes: &[u8]) -> String {
    String::from_utf8(bytes.to_vec()).unwrap()
}

#[test]
fn a_good_configuration_is_reported_with_exit_code_0() {
    let output = check(&repository("deploy/config/vtol.toml"));
    let report = text(&output.stdout);
    assert_eq!(output.status.code(), Some(0), "{}", text(&output.stderr));
    for words in [
        "instance vtol",
        "/dev/shm/residuald.vtol.bounds, mode 0640",
        "input aircraft_sensors",
        "horizontal_speed [kn]",
        "diagnoser aircraft_actuators",
        "period 10 ms, phase 0 s, margin 5 ms, priority 0",
        "fault-free, collective_pitch, longitudinal_cyclic_pitch",
        "raised by 2 violations in 4 evaluated steps, cleared by 10 evaluated steps in a row with ratios up to 0.9",
        "1 step and the margin, 15 ms, if every step violates; 3 steps and the margin, 35 ms, if only enough do",
        "from the onset",
        "in order",
    ] {
        let plain = report.split_whitespace().collect::<Vec<_>>().join(" ");
        assert!(plain.contains(words), "no `{words}` in\n{report}");
    }
    assert!(report.lines().all(|line| line.chars().count() <= 110), "{report}");
}

#[test]
fn a_refusal_shows_file_line_column_and_help_with_exit_code_1() {
    let bad = vtol_with("gain_sweeps = 0", "gain_sweep = 0");
    let output = check_text(&bad);
    assert_eq!(output.status.code(), Some(1));
    assert!(output.stdout.is_empty());
    let report = text(&output.stderr);
    let place = format!(".toml:{}:1]", line_of(&bad, "gain_sweep = 0"));
    for words in [
        "1 mistake",
        &place,
        "unknown key `gain_sweep`",
        "did you mean `gain_sweeps`?",
    ] {
        assert!(report.contains(words), "no `{words}` in\n{report}");
    }
}

#[test]
fn a_missing_file_gives_exit_code_1_and_its_path() {
    let output = check(Path::new("/nowhere/residuald.toml"));
    assert_eq!(output.status.code(), Some(1));
    assert!(text(&output.stderr).contains("/nowhere/residuald.toml"));
}

#[test]
fn what_is_probably_not_meant_is_a_warning() {
    let spare = SMALL
        .replace("\"u1\"]", "\"u1\", \"spare\"]")
        .replace("sample_time_s = 0.1", "sample_time_s = 0.1\nmargin_s = 0.5");
    let output = check_text(&spare.replace("[[diagnoser]]", "[realtime]\ncpu = 1000\n[[diagnoser]]"));
    assert_eq!(output.status.code(), Some(0), "{}", text(&output.stderr));
    let report = text(&output.stdout)
        .split_whitespace()
        .collect::<Vec<_>>()
        .join(" ");
    for words in [
        "no diagnoser uses the signal `plant.spare`",
        "the margin of the diagnoser `loop` exceeds its period",
        "but not number 1000",
        "`filter.fault_of_interest` is not set",
    ] {
        assert!(report.contains(words), "no `{words}` in\n{report}");
    }
}

/// The report without the line breaks of its columns.
fn flat_report(configuration: &str) -> String {
    let output = check_text(configuration);
    assert_eq!(output.status.code(), Some(0), "{}", text(&output.stderr));
    text(&output.stdout)
        .split_whitespace()
        .collect::<Vec<_>>()
        .join(" ")
}

#[test]
fn parity_tests_are_designed_and_their_floors_reported() {
    // Without disturbance the settled filters know the state: |r| <= 0.1, so that every fault above 0.2 is seen.
    let report = flat_report(SMALL);
    for words in [
        "parity tests 16, designed",
        "detectable within 1 sample: u0 from 0.2, u1 from 0.2; within 3 samples: u0 from",
        "isolable within 1 sample: u0 from 0.2, u1 from 0.2;",
        "mode_fault_free_parity_0_1,",
        "mode_1_parity_0_30,",
    ] {
        assert!(report.contains(words), "no `{words}` in\n{report}");
    }
    let off = SMALL.replace(
        "[diagnoser.missing]",
        "[diagnoser.parity]\nlengths = []\n[diagnoser.missing]",
    );
    let report = flat_report(&off);
    assert!(
        report.contains("parity tests off") && !report.contains("_parity_"),
        "{report}"
    );
    let none = SMALL.replace(
        "[diagnoser.missing]",
        "[diagnoser.parity]\ncertificates = []\n[diagnoser.missing]",
    );
    let report = flat_report(&none);
    assert!(
        report.contains("`parity.certificates` is empty") && !report.contains("_parity_"),
        "{report}"
    );
}

#[test]
fn a_fault_of_interest_below_every_floor_is_warned_of_as_inert() {
    let report = flat_report(&vtol_with(
        "fault_of_interest = [2.0, 1.0]",
        "fault_of_interest = [2.0, 0.1]",
    ));
    assert!(
        report.contains("inert threshold: a fault of \"longitudinal_cyclic_pitch\""),
        "{report}"
    );
    assert!(
        !report.contains("a fault of \"collective_pitch\" is certainly seen"),
        "{report}"
    );
    assert!(!flat_report(VTOL).contains("inert threshold"));
}

#[test]
fn windows_that_cannot_tell_a_fault_from_a_mode_are_warned_of() {
    // Actuator u1 acts like u0 and, one sample later, on the second output.
    let delayed = SMALL
        .replace(
            "A = [[0.9, 0], [0, 0.9]]",
            "A = [[0.9, 0, 0], [0, 0.9, 0.1], [0, 0, 0]]",
        )
        .replace("B = [[1, 0], [0, 1]]", "B = [[1, 1], [0, 0], [0, 1]]")
        .replace(
            "C = [[1, 0], [0, 1]]",
            "C = [[1, 0, 0], [0, 1, 0]]\ninitial_state_radius = [1, 1, 1]",
        )
        .replace(
            "[diagnoser.missing]",
            "[diagnoser.parity]\nlengths = [1, 10]\n[diagnoser.missing]",
        );
    let report = flat_report(&delayed);
    for words in [
        "parity tests 6, designed",
        "no fault of \"u1\" can be told from the mode (u0) by windows of length 1,",
        "no fault of \"u0\" can be told from the mode (u1) by windows of length 1,",
        "isolable within 10 samples",
    ] {
        assert!(report.contains(words), "no `{words}` in\n{report}");
    }
    assert!(!report.contains("isolable within 1 sample:"), "{report}");
}

#[test]
fn more_parity_tests_than_a_record_holds_are_refused_with_a_way_out() {
    let lengths =
        "[diagnoser.parity]\nlengths = [1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13]\n[diagnoser.missing]";
    let many = SMALL.replace("[diagnoser.missing]", lengths);
    let mistakes = mistakes_of(&many);
    assert_eq!(mistakes.len(), 1, "{mistakes:?}");
    let words = mistakes[0].message.clone() + mistakes[0].help.as_deref().unwrap();
    assert!(
        words.contains("a record holds 64") && words.contains("fewer `parity.lengths`"),
        "{words}"
    );
    let compact = many.replace(
        "[diagnoser.parity]",
        "[diagnoser.filter]\npublish = \"worst\"\n[diagnoser.parity]",
    );
    assert!(mistakes_of(&compact).is_empty(), "{:?}", mistakes_of(&compact));
}

#[test]
fn counts_beyond_reason_are_refused_at_their_line() {
    for (good, bad) in [
        ("generator_order = 30", "generator_order = 2000000000"),
        ("lengths = [1, 3, 10, 30]", "lengths = [1, 3, 2000000000]"),
        ("clear_samples = 50", "clear_samples = 4000000000"),
        ("pre_samples = \"auto\"", "pre_samples = 2000000000"),
    ] {
        let text = vtol_with(good, bad);
        let mistakes = mistakes_of(&text);
        assert_eq!(mistakes.len(), 1, "{mistakes:?}");
        assert_eq!(mistakes[0].line, line_of(&text, bad), "{mistakes:?}");
        assert!(
            mistakes[0].message.contains("000000000") && mistakes[0].help.is_some(),
            "{mistakes:?}"
        );
    }
}

#[test]
fn certificates_are_used_and_refused_where_they_do_not_fit() {
    // λ = (1, 0), μ_0 = -A'λ, μ_1 = λ: the second output never enters, the model holds exactly.
    let certificate = "[[diagnoser.parity.certificates]]\nmode = []\nfault = 0\nL = 1\n\
                       mu = [[-0.9, 0], [1, 0]]\nlambda = [[1, 0]]\n[diagnoser.missing]";
    let good = SMALL.replace("[diagnoser.missing]", certificate);
    let report = check_text(&good).stdout;
    assert!(
        text(&report).contains("1, as configured") && text(&report).contains("mode_fault_free_parity_0_1"),
        "{}",
        text(&report)
    );
    let altered = good.replace("-0.9", "-0.8");
    let without_mode = good.replace(
        "[diagnoser.missing]",
        "[diagnoser.bank]\nfault_free_mode = false\n[diagnoser.missing]",
    );
    for (bad, words) in [(altered, "equality"), (without_mode, "mode []")] {
        let mistakes = mistakes_of(&bad);
        assert_eq!(mistakes.len(), 1, "{mistakes:?}");
        assert_eq!(
            mistakes[0].line,
            line_of(&bad, "[[diagnoser.parity.certificates]]"),
            "{mistakes:?}"
        );
        assert!(mistakes[0].message.contains(words), "{mistakes:?}");
    }
}

#[test]
fn conditions_of_the_method_are_refused_at_their_place() {
    assert!(mistakes_of(SMALL).is_empty(), "{:?}", mistakes_of(SMALL));
    let invisible = SMALL.replace("B = [[1, 0], [0, 1]]", "B = [[1, 0], [0, 0]]");
    let cases = [
        (
            invisible.as_str(),
            "C = [[1, 0]",
            "no output shows a fault of \"u1\"",
            "add a sensor",
        ),
        (
            &SMALL.replace(
                "[diagnoser.missing]",
                "[diagnoser.bank]\nsimultaneous_faults = [1, 2]\n[diagnoser.missing]",
            ),
            "simultaneous_faults",
            "(u0 + u1) has as many unknown faults as there are outputs",
            "leave `2` out",
        ),
        (
            &SMALL.replace(
                "[diagnoser.missing]",
                "[diagnoser.filter]\ninitialisation = \"prior\"\n[diagnoser.missing]",
            ),
            "[diagnoser.model]",
            "`model.initial_state_radius` is missing",
            "give its radius",
        ),
    ];
    for (text, place, message, help) in cases {
        let mistakes = mistakes_of(text);
        assert_eq!(mistakes.len(), 1, "{mistakes:?}");
        assert_eq!(mistakes[0].line, line_of(text, place), "{mistakes:?}");
        assert!(mistakes[0].message.contains(message), "{mistakes:?}");
        assert!(
            mistakes[0].help.as_deref().unwrap().contains(help),
            "{mistakes:?}"
        );
    }
}

#[test]
fn more_channels_than_a_record_holds_are_refused_with_the_way_out() {
    let count = 8;
    let row = |i: usize, value: f64| {
        let entry = |j: usize| if i == j { value.to_string() } else { "0".to_owned() };
        format!("[{}]", (0..count).map(entry).collect::<Vec<_>>().join(", "))
    };
    let matrix = |value: f64| {
        format!(
            "[{}]",
            (0..count).map(|i| row(i, value)).collect::<Vec<_>>().join(", ")
        )
    };
    let names = |prefix: &str| {
        let names: Vec<_> = (0..count).map(|i| format!("\"{prefix}{i}\"")).collect();
        format!("[{}]", names.join(", "))
    };
    let bounds = format!("[{}]", vec!["0.1"; count].join(", "));
    let (a, b) = (matrix(0.9), matrix(1.0));
    let text = format!(
        "[daemon]\ninstance = \"wide\"\n[[input]]\nname = \"y\"\nsignals = {}\n[[input]]\nname = \"u\"\n\
         signals = {}\n[[diagnoser]]\nname = \"wide\"\nmethod = \"unknown_input_filter\"\nsample_time_s = 0.1\n\
         measurements = {}\ncommands = {}\n[diagnoser.model]\nA = {a}\nB = {b}\nC = {b}\n\
         measurement_noise_bound = {bounds}\n[diagnoser.filter]\ngain = \"row_wise\"\npublish = \"all\"\n\
         [diagnoser.missing]\nfault_bound = {bounds}\n",
        names("y"),
        names("u"),
        names("y.y"),
        names("u.u"),
    );
    let mistakes = mistakes_of(&text);
    assert_eq!(mistakes.len(), 1, "{mistakes:?}");
    assert_eq!(mistakes[0].line, line_of(&text, "publish = \"all\""));
    assert!(mistakes[0].message.contains("a record holds 64"), "{mistakes:?}");
    assert!(
        mistakes[0]
            .help
            .as_deref()
            .unwrap()
            .contains("`filter.publish` = \"worst\""),
        "{mistakes:?}"
    );
    let worst = text.replace("publish = \"all\"", "publish = \"worst\"");
    assert!(mistakes_of(&worst).is_empty(), "{:?}", mistakes_of(&worst));
}
