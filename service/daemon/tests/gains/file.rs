//! Gains files through the program: written, read back, explained, and refused where they do not hold.

use residual_diagnosis::gains::file::GainsFile;
use residuald::configuration::Configuration;
use std::fs;
use std::os::unix::fs::PermissionsExt as _;
use std::path::PathBuf;
use std::process::{Command, Output};
use std::sync::OnceLock;
use tempfile::TempDir;
use toml::{Table, Value};

/// Two actuators, two states, both measured; and a servo.
const SMALL: &str = r#"
[daemon]
instance = "small"
gains_file = "small.gains.toml"
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
[diagnoser.filter]
fault_of_interest = [1, 1]
[diagnoser.parity]
lengths = [1, 2]
[diagnoser.missing]
fault_bound = [1, 1]
[[diagnoser]]
name = "second"
method = "reduced_order_observer"
sample_time_s = 0.2
measurements = ["plant.y0", "plant.y1"]
commands = ["plant.u0"]
[diagnoser.model]
A = [[0.49, 0.10, 0.06], [-0.32, 0.95, -0.23], [-0.25, -0.06, 0.63]]
B = [[0.4], [0.4], [0.5]]
C = [[1, 0, 0], [0, 1, 0]]
D = [[-0.1], [0.2], [-0.1]]
initial_state_lower = [-1, -1, -1]
initial_state_upper = [1, 1, 1]
disturbance_lower = [-1.0]
disturbance_upper = [1.0]
measurement_noise_bound = [0.01, 0.01]
[diagnoser.design]
gains = "closed_form"
poles = [0.5]
[diagnoser.isolation]
poles = [0.5]
fault_bound = [10.0]
"#;

/// A directory with a configuration, and possibly its gains.
struct Place {
    directory: TempDir,
}

impl Place {
    fn new(configuration: &str) -> Self {
        let place = Self {
            directory: tempfile::tempdir().unwrap(),
        };
        fs::write(place.path("small.toml"), configuration).unwrap();
        place
    }

    /// With these gains.
    fn with(configuration: &str, gains: &[u8]) -> Self {
        let place = Self::new(configuration);
        fs::write(place.path("small.gains.toml"), gains).unwrap();
        place
    }

    fn path(&self, name: &str) -> PathBuf {
        self.directory.path().join(name)
    }

    /// Runs the program there.
    fn residuald(&self, arguments: &[&str]) -> Output {
        Command::new(env!("CARGO_BIN_EXE_residuald"))
            .args(arguments)
            .current_dir(self.directory.path())
            .env("NO_COLOR", "1")
            .output()
            .unwrap()
    }

    /// What `check` says against the gains; it must refuse them.
    fn refusal(&self, why: &str) -> String {
        let output = self.residuald(&["check", "small.toml"]);
        let report = flat(&output.stderr);
        assert_eq!(
            output.status.code(),
            Some(1),
            "{why}: accepted\n{}",
            flat(&output.stdout)
        );
        assert!(output.stdout.is_empty(), "{why}: {report}");
        report
    }

    fn files(&self) -> Vec<String> {
        let entries = fs::read_dir(self.directory.path()).unwrap();
        let mut names: Vec<_> = entries
            .map(|entry| entry.unwrap().file_name().into_string().unwrap())
            .collect();
        names.sort();
        names
    }
}

/// Words without line breaks and the drawing around them.
fn flat(bytes: &[u8]) -> String {
    let text = String::from_utf8(bytes.to_vec()).unwrap();
    let words = text
        .split_whitespace()
        .filter(|word| *word != "│" && *word != "|");
    words.collect::<Vec<_>>().join(" ")
}

/// The gains of [`SMALL`] as `design` writes them.
fn good() -> &'static str {
    static GOOD: OnceLock<String> = OnceLock::new();
    GOOD.get_or_init(|| {
        let place = Place::new(SMALL);
        let output = place.residuald(&["design", "small.toml"]);
        assert_eq!(output.status.code(), Some(0), "{}", flat(&output.stderr));
        fs::read_to_string(place.path("small.gains.toml")).unwrap()
    })
}

/// The good file after a change of its table.
fn edited(edit: impl FnOnce(&mut Table)) -> String {
    let mut table: Table = good().parse().unwrap();
    edit(&mut table);
    toml::to_string(&table).unwrap()
}

fn entry(table: &mut Table, index: usize) -> &mut Table {
    table["diagnoser"][index].as_table_mut().unwrap()
}

/// All numbers below a value, changed one at a time by `change`; the results.
fn each_number(value: &Value, change: &dyn Fn(f64) -> f64) -> Vec<Value> {
    match value {
        Value::Float(number) => vec![Value::Float(change(*number))],
        Value::Array(entries) => {
            let mut results = Vec::new();
            for (index, part) in entries.iter().enumerate() {
                for changed in each_number(part, change) {
                    let mut whole = entries.clone();
                    whole[index] = changed;
                    results.push(Value::Array(whole));
                }
            }
            results
        }
        Value::Table(entries) => {
            let mut results = Vec::new();
            for (key, part) in entries {
                for changed in each_number(part, change) {
                    let mut whole = entries.clone();
                    whole.insert(key.clone(), changed);
                    results.push(Value::Table(whole));
                }
            }
            results
        }
        _ => Vec::new(),
    }
}

/// The good file with one number of a part of an entry after another changed; with the diagnoser's name.
fn spoilt(part: &str, change: &dyn Fn(f64) -> f64) -> Vec<(&'static str, String)> {
    let table: Table = good().parse().unwrap();
    let mut files = Vec::new();
    for (index, name) in ["loop", "second"].into_iter().enumerate() {
        for value in each_number(&table["diagnoser"][index][part], change) {
            let file = edited(|table| {
                entry(table, index).insert(part.to_owned(), value);
            });
            files.push((name, file));
        }
    }
    files
}

/// A clear change of any number.
fn other(number: f64) -> f64 {
    number * 1.01 + 0.001
}

/// Why the gains are refused, without a process; `None` if they are accepted.
fn refused(gains: &str) -> Option<String> {
    let loaded = Configuration::from_text("small.toml", SMALL).unwrap();
    let error = loaded.on_gains("small.gains.toml", gains).err()?;
    let mistakes = error.mistakes();
    assert!(!mistakes.is_empty(), "{error}");
    let describe = |mistake: &residuald::configuration::Mistake| {
        format!("{} {}", mistake.message, mistake.help.as_deref().unwrap_or(""))
    };
    Some(mistakes.iter().map(describe).collect::<Vec<_>>().join(" "))
}

#[test]
fn what_design_writes_is_for_people_and_what_check_and_explain_read() {
    let place = Place::with(SMALL, good().as_bytes());
    assert!(good().starts_with("# Gains of residuald: "), "{}", good());
    assert!(
        good().contains("# Made by: residuald design small.toml"),
        "{}",
        good()
    );
    let file = GainsFile::parse(good()).unwrap();
    assert_eq!(file.diagnoser.len(), 2);
    assert!(file.date.ends_with('Z') && file.date.len() == 20, "{}", file.date);

    let checked = place.residuald(&["check", "small.toml"]);
    assert_eq!(checked.status.code(), Some(0), "{}", flat(&checked.stderr));
    let report = flat(&checked.stdout);
    assert!(
        report.contains("gains from small.gains.toml, verified"),
        "{report}"
    );

    let explained = place.residuald(&["explain", "small.gains.toml"]);
    assert_eq!(explained.status.code(), Some(0), "{}", flat(&explained.stderr));
    let report = flat(&explained.stdout);
    for words in [
        "diagnoser loop",
        "diagnoser second",
        "as the file states them",
        "`residuald check CONFIG`",
    ] {
        assert!(report.contains(words), "no `{words}` in {report}");
    }
}

#[test]
fn without_a_gains_file_the_gains_are_found_at_the_start() {
    let place = Place::new(&SMALL.replace("gains_file", "# gains_file"));
    let output = place.residuald(&["check", "small.toml"]);
    assert_eq!(output.status.code(), Some(0), "{}", flat(&output.stderr));
    assert!(
        flat(&output.stdout).contains("gains designed now"),
        "{}",
        flat(&output.stdout)
    );
}

#[test]
fn design_goes_to_the_place_that_is_asked_for_and_nowhere_else() {
    let unnamed = SMALL.replace("gains_file", "# gains_file");
    let place = Place::new(&unnamed);
    assert_eq!(place.residuald(&["design", "small.toml"]).status.code(), Some(0));
    assert_eq!(place.files(), ["small.gains.toml", "small.toml"]);
    let again = place.residuald(&["design", "small.toml", "-o", "other.toml"]);
    assert_eq!(again.status.code(), Some(0), "{}", flat(&again.stderr));
    assert!(
        flat(&again.stderr).contains("loop: "),
        "progress: {}",
        flat(&again.stderr)
    );
    assert_eq!(place.files(), ["other.toml", "small.gains.toml", "small.toml"]);
    let printed = place.residuald(&["design", "small.toml", "-o", "-"]);
    let text = String::from_utf8(printed.stdout).unwrap();
    assert_eq!(
        GainsFile::parse(&text).unwrap().diagnoser,
        GainsFile::parse(good()).unwrap().diagnoser
    );
    let mode = fs::metadata(place.path("other.toml"))
        .unwrap()
        .permissions()
        .mode();
    assert_eq!(mode & 0o400, 0o400, "{mode:o}");
}

#[test]
fn design_replaces_a_damaged_gains_file_but_nothing_else() {
    let half = &good()[..good().len() / 2];
    for replaceable in [half, "", good()] {
        let place = Place::with(SMALL, replaceable.as_bytes());
        assert_eq!(place.residuald(&["design", "small.toml"]).status.code(), Some(0));
        let written = fs::read_to_string(place.path("small.gains.toml")).unwrap();
        assert_eq!(written.lines().count(), good().lines().count());
    }
    let place = Place::with(SMALL, b"name = \"not gains\"\n");
    for output in ["small.gains.toml", "small.toml", "."] {
        let refused = place.residuald(&["design", "small.toml", "-o", output]);
        assert_eq!(refused.status.code(), Some(1), "{output}");
        let words = flat(&refused.stderr);
        assert!(words.contains("is not a gains file"), "{words}");
    }
    assert_eq!(fs::read_to_string(place.path("small.toml")).unwrap(), SMALL);
    let nowhere = place.residuald(&["design", "small.toml", "-o", "no/such/directory.toml"]);
    assert!(
        flat(&nowhere.stderr).contains("cannot write no/such/directory.toml"),
        "{}",
        flat(&nowhere.stderr)
    );
    assert_eq!(place.files(), ["small.gains.toml", "small.toml"]);
}

#[test]
fn design_writes_nothing_when_a_condition_does_not_hold() {
    let place = Place::new(&SMALL.replacen("B = [[1, 0], [0, 1]]", "B = [[1, 0], [0, 0]]", 1));
    let output = place.residuald(&["design", "small.toml"]);
    assert_eq!(output.status.code(), Some(1));
    assert!(
        flat(&output.stderr).contains("no output shows a fault of"),
        "{}",
        flat(&output.stderr)
    );
    assert_eq!(place.files(), ["small.toml"]);
}

#[test]
fn no_altered_gain_is_accepted() {
    let altered = spoilt("gains", &other);
    for diagnoser in ["loop", "second"] {
        assert!(
            altered.iter().any(|(name, _)| *name == diagnoser),
            "{diagnoser} has no gains"
        );
    }
    for (name, gains) in &altered {
        let words = refused(gains).unwrap_or_else(|| panic!("accepted:\n{gains}"));
        assert!(words.contains(&format!("the gains of `{name}`")), "{words}");
    }
}

#[test]
fn no_altered_figure_is_accepted_and_each_is_named_with_both_values() {
    let altered = spoilt("achieved", &other);
    for diagnoser in ["loop", "second"] {
        assert!(
            altered.iter().any(|(name, _)| *name == diagnoser),
            "{diagnoser} states nothing"
        );
    }
    for (name, gains) in &altered {
        let words = refused(gains).unwrap_or_else(|| panic!("accepted:\n{gains}"));
        let begin = format!("the gains of `{name}` do not achieve what the file states");
        for part in [begin.as_str(), "is stated as", "the gains give"] {
            assert!(words.contains(part), "{words}");
        }
    }
}

#[test]
fn numbers_that_are_none_are_refused_wherever_they_stand() {
    for part in ["gains", "achieved"] {
        for bad in [f64::NAN, f64::INFINITY] {
            for (_, gains) in spoilt(part, &|_| bad) {
                let words = refused(&gains).unwrap_or_else(|| panic!("accepted:\n{gains}"));
                assert!(
                    words.contains(&format!("{bad}")) && words.contains("diagnoser."),
                    "{words}"
                );
            }
        }
    }
}

#[test]
fn a_file_cut_off_at_any_line_is_refused() {
    let whole = GainsFile::parse(good()).unwrap();
    let mut end = 0;
    let mut refusals = 0;
    for line in good().split_inclusive('\n') {
        let cut = &good()[..end];
        end += line.len();
        match refused(cut) {
            Some(_) => refusals += 1,
            None => assert_eq!(GainsFile::parse(cut).unwrap(), whole, "accepted:\n{cut}"),
        }
    }
    assert!(refusals > 20, "{refusals}");
}

#[test]
fn every_bad_file_is_refused_by_its_condition() {
    type Edit = fn(&mut Table);
    let table_edits: [(&str, Edit, &[&str]); 9] = [
        (
            "version",
            |table| {
                table.insert("version".into(), Value::Integer(2));
            },
            &["has version 2, this program reads version 1"],
        ),
        (
            "tolerance",
            |table| {
                table.insert("tolerance".into(), Value::Float(0.5));
            },
            &["the tolerance 0.5 of the gains file"],
        ),
        (
            "negative tolerance",
            |table| {
                table.insert("tolerance".into(), Value::Float(-1e-6));
            },
            &["the tolerance -0.000001 of the gains file"],
        ),
        (
            "missing entry",
            |table| {
                table["diagnoser"].as_array_mut().unwrap().remove(1);
            },
            &["no gains for the diagnoser `second`"],
        ),
        (
            "entry twice",
            |table| {
                let entries = table["diagnoser"].as_array_mut().unwrap();
                entries.push(entries[0].clone());
            },
            &["several entries for the diagnoser `loop`"],
        ),
        (
            "entry of nobody",
            |table| {
                entry(table, 1).insert("name".into(), "third".into());
            },
            &[
                "gains for `third`, which is no diagnoser",
                "no gains for the diagnoser `second`",
            ],
        ),
        (
            "other method",
            |table| {
                entry(table, 0).insert("method".into(), "chi_square".into());
            },
            &["for the method `chi_square`, but it runs `unknown_input_filter`"],
        ),
        (
            "other period",
            |table| {
                entry(table, 0).insert("sample_time_s".into(), Value::Float(0.3));
            },
            &["for a period of 0.3 s, not 0.1 s"],
        ),
        (
            "unknown key",
            |table| {
                entry(table, 0).insert("remark".into(), "mine".into());
            },
            &["cannot be read: unknown field `remark`"],
        ),
    ];
    for (why, edit, expected) in table_edits {
        let report = Place::with(SMALL, edited(edit).as_bytes()).refusal(why);
        for words in expected {
            assert!(report.contains(words), "{why}: {report}");
        }
        assert!(report.contains("residuald design"), "{why}: {report}");
        assert!(report.contains("small.gains.toml"), "{why}: {report}");
    }
    let other_plant = SMALL.replacen("0.9", "0.91", 1);
    let other_option = SMALL.replacen("lengths = [1, 2]", "lengths = [1, 3]", 1);
    let other_period = SMALL.replacen("sample_time_s = 0.1", "sample_time_s = 0.05", 1);
    for (configuration, words) in [
        (other_plant, "another model or other options"),
        (other_option, "another model or other options"),
        (other_period, "for a period of 0.1 s, not 0.05 s"),
    ] {
        let report = Place::with(&configuration, good().as_bytes()).refusal(words);
        assert!(report.contains(words) && report.contains("`loop`"), "{report}");
        assert!(!report.contains("`second`"), "{report}");
    }
}

#[test]
fn what_is_no_gains_file_at_all_is_refused() {
    let place = Place::new(SMALL);
    let report = place.refusal("no file");
    for words in [
        "small.gains.toml cannot be read",
        "No such file",
        "residuald design small.toml",
    ] {
        assert!(report.contains(words), "{report}");
    }
    fs::create_dir(place.path("small.gains.toml")).unwrap();
    assert!(place.refusal("directory").contains("it is not a file"));
    for (bytes, words) in [
        (&b""[..], "missing field"),
        (b"\x7fELF\x02\x01\xff\xfe", "not UTF-8 text (byte 6)"),
        (b"version = \x01 one", "the gains file cannot be read"),
        (b"version = 1\n", "missing field"),
    ] {
        let report = Place::with(SMALL, bytes).refusal(words);
        assert!(report.contains(words), "{report}");
    }
    let below_a_file = Place::new(&SMALL.replace("small.gains.toml", "small.toml/gains.toml"));
    let report = below_a_file.refusal("below a file");
    assert!(report.contains("Not a directory"), "{report}");
    let explained = place.residuald(&["explain", "nothing.toml"]);
    assert_eq!(explained.status.code(), Some(1));
    assert!(flat(&explained.stderr).contains("cannot read the gains file nothing.toml"));
}

#[test]
fn run_refuses_as_check_does_and_leaves_nothing_behind() {
    let shared = tempfile::Builder::new()
        .prefix("rt-")
        .tempdir_in("/dev/shm")
        .unwrap();
    let directory = format!("[daemon]\nruntime_directory = \"{}\"", shared.path().display());
    let configuration = SMALL.replace("[daemon]", &directory);
    let place = Place::with(
        &configuration,
        edited(|table| {
            entry(table, 0).insert("inputs".into(), "xxh3:0".into());
        })
        .as_bytes(),
    );
    let output = place.residuald(&["run", "small.toml"]);
    assert_eq!(output.status.code(), Some(1));
    assert!(
        flat(&output.stderr).contains("another model or other options"),
        "{}",
        flat(&output.stderr)
    );
    assert_eq!(fs::read_dir(shared.path()).unwrap().count(), 0);
    assert_eq!(place.files(), ["small.gains.toml", "small.toml"]);
}
