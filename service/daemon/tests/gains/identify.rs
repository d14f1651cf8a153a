//! `residuald identify` through the binary: on simulated recordings, and on a real car and real flights.
//!
//! The recordings of vehicles are no part of the project; without them their tests say so and pass.

use std::fmt::Write as _;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};

use crate::recordings::Recording;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

fn repository(path: &str) -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../..").join(path)
}

fn identify(arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_residuald"))
        .arg("identify")
        .args(arguments)
        .output()
        .unwrap()
}

fn printed(arguments: &[&str]) -> String {
    let output = identify(arguments);
    assert!(
        output.status.success(),
        "{}",
        String::from_utf8_lossy(&output.stderr)
    );
    String::from_utf8(output.stdout).unwrap()
}

/// The refusal, without line breaks and frames.
fn refused(arguments: &[&str]) -> String {
    let output = identify(arguments);
    assert_eq!(
        output.status.code(),
        Some(1),
        "{}",
        String::from_utf8_lossy(&output.stdout)
    );
    let text = String::from_utf8(output.stderr).unwrap();
    let words: Vec<&str> = text
        .split_whitespace()
        .filter(|word| !["│", "×", "╰─▶", "├─▶"].contains(word))
        .collect();
    words.join(" ")
}

/// A first-order plant, x' = 0.8 x + 0.5 u + d, y = x + v, with uniform noise of these half widths.
fn recorded(directory: &Path, runs: usize, rows: usize) -> PathBuf {
    let mut random = ChaCha8Rng::seed_from_u64(1);
    let mut text = String::from("run,t,y,u,twice\n");
    for run in 0..runs {
        let (mut x, mut u): (f64, f64) = (0.0, 0.0);
        for k in 0..rows {
            if k % 4 == 0 {
                u = random.random_range(-1.0..1.0);
            }
            let y = x + random.random_range(-0.1..0.1);
            writeln!(text, "{run},{},{y},{u},{}", 0.1 * k as f64, 2.0 * u).unwrap();
            x = 0.8 * x + 0.5 * u + random.random_range(-0.2..0.2);
        }
    }
    let path = directory.join("recorded.csv");
    fs::write(&path, text).unwrap();
    path
}

/// A configuration of that plant, with the model's section to be filled in.
fn configuration(method: &str, model: &str) -> String {
    format!(
        r#"
[daemon]
instance = "plant"
[[input]]
name = "sensor"
signals = ["y"]
[[input]]
name = "controller"
signals = ["u"]
[[diagnoser]]
name = "plant"
method = "{method}"
sample_time_s = 0.1
measurements = ["sensor.y"]
commands = ["controller.u"]
{model}
[replay]
time_column = "t"
run_column = "run"
[[replay.input]]
input = "sensor"
values = ["y"]
[[replay.input]]
input = "controller"
values = ["u"]
"#
    )
}

const STRUCTURE: &str = r#"
method = "METHOD"
sample_time_s = 0.1
measurements = ["y"]
commands = ["u"]
[recording]
time_column = "t"
run_column = "run"
[model]
A = [[{ start = 0.5 }]]
B = [["free"]]
C = [[1]]
D = [[1]]
initial_state_radius = [3]
"#;

struct Stage {
    directory: tempfile::TempDir,
    recording: PathBuf,
}

impl Stage {
    fn new(runs: usize, rows: usize) -> Self {
        let directory = tempfile::tempdir().unwrap();
        let recording = recorded(directory.path(), runs, rows);
        Self { directory, recording }
    }

    fn file(&self, name: &str, text: &str) -> String {
        let path = self.directory.path().join(name);
        fs::write(&path, text).unwrap();
        path.to_str().unwrap().to_owned()
    }

    fn recording(&self) -> &str {
        self.recording.to_str().unwrap()
    }
}

fn program(arguments: &[&str]) -> String {
    let output = Command::new(env!("CARGO_BIN_EXE_residuald"))
        .args(arguments)
        .output()
        .unwrap();
    assert!(
        output.status.success(),
        "{}",
        String::from_utf8_lossy(&output.stderr)
    );
    String::from_utf8(output.stdout).unwrap()
}

#[test]
fn the_identified_section_makes_a_configuration_that_replays_held_out_runs_without_alarm() {
    let stage = Stage::new(12, 80);
    for method in ["unknown_input_filter", "reduced_order_observer", "chi_square"] {
        let structure = stage.file("structure.toml", &STRUCTURE.replace("METHOD", method));
        let section = printed(&[
            "--model",
            &structure,
            stage.recording(),
            "--runs",
            "odd",
            "--margin",
            "0.2",
        ]);
        let table: toml::Table = section.parse().unwrap();
        let model = &table["diagnoser"]["model"];
        let a = model.get("A").or_else(|| model.get("transition")).unwrap()[0][0]
            .as_float()
            .unwrap();
        assert!((a - 0.8).abs() < 0.05, "{section}");
        assert!(
            section.contains("6 runs held out") && !section.contains("OVERFITTED"),
            "{section}"
        );

        let extra = match method {
            "unknown_input_filter" => {
                "[diagnoser.bank]\nallow_untestable_modes = true\n[diagnoser.missing]\nfault_bound = [2]\n"
            }
            "chi_square" => {
                "[diagnoser.statistics]\nenabled = [\"residual\", \"cusum\"]\ndecision = [\"cusum\"]\n"
            }
            _ => "",
        };
        let section = section.replace("[diagnoser.model]", &format!("[diagnoser.model] # {method}"));
        let file = stage.file(
            "plant.toml",
            &configuration(method, &format!("{section}\n{extra}")),
        );
        let report = program(&["replay", &file, stage.recording(), "--runs", "even", "--totals"]);
        assert!(
            report.contains("0 false alarms in 0 runs"),
            "{method}: {report}\n{section}"
        );
        let fault = "offset,column=y,size=3,onset=50%";
        let report = program(&[
            "replay",
            &file,
            stage.recording(),
            "--runs",
            "even",
            "--totals",
            "--fault",
            fault,
        ]);
        assert!(
            report.contains("fault detected in 6 of 6 runs"),
            "{method}: {report}"
        );
    }
}

#[test]
fn a_given_model_gets_the_bounds_or_covariances_of_its_method() {
    let stage = Stage::new(6, 100);
    let observer = "[diagnoser.model]\nA = [[0.8]]\nB = [[0.5]]\nC = [[1]]\nD = [[1]]\ninitial_state_lower = [-3]\n\
                    initial_state_upper = [3]\ndisturbance_lower = [-0.1]\ndisturbance_upper = [0.1]\n\
                    measurement_noise_bound = [0.05]\n";
    let file = stage.file(
        "observer.toml",
        &configuration("reduced_order_observer", observer),
    );
    let found = printed(&[&file, stage.recording(), "--runs", "odd"]);
    let of = |key: &str| -> f64 {
        let line = found
            .lines()
            .find(|line| line.starts_with(key))
            .unwrap_or_else(|| panic!("{key}: {found}"));
        line.split_once('[')
            .unwrap()
            .1
            .trim_end_matches(']')
            .parse()
            .unwrap()
    };
    assert_eq!(of("disturbance_lower"), -of("disturbance_upper"));
    assert!(of("disturbance_upper") > 0.0 && of("measurement_noise_bound") > 0.0);

    let filter = "[diagnoser.model]\ntransition = [[0.8]]\ninput = [[0.5]]\nmeasurement = [[1]]\n\
                  process_noise_covariance = [[1]]\nmeasurement_noise_covariance = [[1]]\ninitial_covariance = [[1]]\n";
    let file = stage.file("filter.toml", &configuration("chi_square", filter));
    let found: toml::Table = printed(&[&file, stage.recording()]).parse().unwrap();
    // Uniform in ±0.2 and ±0.1: variances 0.2²/3 and 0.1²/3.
    let variance = |key: &str| found[key][0][0].as_float().unwrap();
    assert!(
        (variance("process_noise_covariance") / 0.01333 - 1.0).abs() < 0.25,
        "{found}"
    );
    assert!(
        (variance("measurement_noise_covariance") / 0.003333 - 1.0).abs() < 0.5,
        "{found}"
    );
    let single = refused(&[&file, stage.recording(), "--runs", "1"]);
    assert!(single.contains("run 1 is the only training run"), "{single}");
    let parts = printed(&[&file, stage.recording(), "--runs", "1", "--part-length", "2"]);
    assert!(parts.contains("# 5 runs"), "{parts}");
    let short = refused(&[&file, stage.recording(), "--part-length", "0.1"]);
    assert!(short.contains("lengthen --part-length"), "{short}");
}

#[test]
fn a_run_ends_at_its_first_labelled_fault() {
    let stage = Stage::new(4, 80);
    let recorded = fs::read_to_string(&stage.recording).unwrap();
    let mut lines = recorded.lines();
    let (mut labelled, mut ended) = (
        format!("{},fault\n", lines.next().unwrap()),
        String::from("run,t,y,u,twice,fault\n"),
    );
    for line in lines {
        let cells: Vec<&str> = line.split(',').collect();
        if cells[1].parse::<f64>().unwrap() < 4.95 {
            for text in [&mut labelled, &mut ended] {
                writeln!(text, "{line},0").unwrap();
            }
        } else {
            // A sensor that is off by 5; nothing but the first of its rows has a label.
            let y = cells[2].parse::<f64>().unwrap() + 5.0;
            let label = u8::from(cells[1].parse::<f64>().unwrap() < 5.05);
            writeln!(
                labelled,
                "{},{},{y},{},{},{label}",
                cells[0], cells[1], cells[3], cells[4]
            )
            .unwrap();
        }
    }
    let (labelled, ended) = (
        stage.file("labelled.csv", &labelled),
        stage.file("ended.csv", &ended),
    );
    let models = [
        (
            "chi_square",
            "[diagnoser.model]\ntransition = [[0.8]]\ninput = [[0.5]]\nmeasurement = [[1]]\n\
             process_noise_covariance = [[1]]\nmeasurement_noise_covariance = [[1]]\ninitial_covariance = [[1]]\n",
        ),
        (
            "reduced_order_observer",
            "[diagnoser.model]\nA = [[0.8]]\nB = [[0.5]]\nC = [[1]]\nD = [[1]]\ninitial_state_lower = [-3]\n\
             initial_state_upper = [3]\ndisturbance_lower = [-0.1]\ndisturbance_upper = [0.1]\n\
             measurement_noise_bound = [0.05]\n",
        ),
    ];
    for (method, model) in models {
        let ignored = configuration(method, model);
        let honoured = ignored.replace("[replay]\n", "[replay]\nfault_column = \"fault\"\n");
        for rows in ["", "row_period_s = 0.05\n"] {
            let file = stage.file(
                "honoured.toml",
                &honoured.replace("[replay]\n", &format!("[replay]\n{rows}")),
            );
            assert_eq!(
                printed(&[&file, &labelled]),
                printed(&[&file, &ended]),
                "{method}"
            );
        }
        let file = stage.file("ignored.toml", &ignored);
        assert_ne!(
            printed(&[&file, &labelled]),
            printed(&[&file, &ended]),
            "{method}"
        );
    }
}

#[test]
fn a_value_beyond_three_standard_deviations_widens_the_noise_bounds_and_the_section_says_so() {
    let stage = Stage::new(6, 80);
    let recorded = fs::read_to_string(&stage.recording).unwrap();
    let outlier = recorded.lines().enumerate().map(|(i, line)| match i {
        201 => {
            let cells: Vec<&str> = line.split(',').collect();
            let y = cells[2].parse::<f64>().unwrap() + 1.5;
            format!("{},{},{y},{},{}\n", cells[0], cells[1], cells[3], cells[4])
        }
        _ => format!("{line}\n"),
    });
    let outlier = stage.file("outlier.csv", &outlier.collect::<String>());
    let without = STRUCTURE
        .replace("METHOD", "unknown_input_filter")
        .replace("D = [[1]]\n", "");
    let structure = stage.file("structure.toml", &without);
    let words =
        "# No noise bound up to three standard deviations of the innovations explains all training runs";
    let found = printed(&["--model", &structure, &outlier]);
    assert!(found.contains(words), "{found}");
    let disturbed = STRUCTURE.replace("METHOD", "unknown_input_filter");
    let disturbed = stage.file("disturbed.toml", &disturbed);
    let found = printed(&["--model", &disturbed, stage.recording()]);
    assert!(!found.contains("explains all"), "{found}");
    let long = refused(&["--model", &structure, &outlier, "--window", "1000000"]);
    assert!(long.contains("the longest run 79; shorten the window"), "{long}");
}

#[test]
fn methods_that_are_not_served_are_refused_by_name() {
    let stage = Stage::new(2, 20);
    for (method, example) in [
        ("async_imm", "turning_target.toml"),
        ("hinf_filter", "two_state.toml"),
    ] {
        let structure = stage.file("structure.toml", &STRUCTURE.replace("METHOD", method));
        let message = refused(&["--model", &structure, stage.recording()]);
        assert!(
            message.contains(&format!("`{method}` needs")) && message.contains("served are"),
            "{message}"
        );
        assert!(repository("deploy/config").join(example).exists());
    }
}

#[test]
fn mistakes_of_a_structure_file_are_named() {
    let stage = Stage::new(3, 60);
    let good = STRUCTURE.replace("METHOD", "chi_square");
    let equation = "method = \"chi_square\"\nsample_time_s = 0.1\n[recording]\ntime_column = \"t\"\nrun_column = \"run\"\n\
                    [[equation]]\noutput = \"y\"\nterms = [{ value = \"y\", lag = 1 }, { value = \"u\", lag = 1 }]\n";
    let message = |text: &str| {
        let file = stage.file("structure.toml", text);
        refused(&["--model", &file, stage.recording()])
    };
    let cases = [
        (good.replace("chi_square", "kalman"), "unknown variant `kalman`"),
        (good.replace("[model]\n", "[model]\nE = 1\n"), "unknown field `E`"),
        (
            good.replace("\"free\"", "\"gian\""),
            "there is no parameter `gian`",
        ),
        (
            good.replace("C = [[1]]", "C = [[1, 0]]"),
            "`C` is 1 x 2, but 1 x 1 is needed",
        ),
        (good.replace("[\"y\"]", "[\"why\"]"), "uses the column `why`"),
        (
            good.replace("[\"y\"]", "[\"0 * y\"]"),
            "measurement 0 has the same value",
        ),
        (
            good.replace("[\"u\"]", "[\"0 * u + 3\"]"),
            "command 0 has the same value at every instant of the training runs (3)",
        ),
        (
            good.replace("= 0.1", "= 0.07"),
            "no multiple of the sampling period of 0.07 s",
        ),
        (good.replace("= 0.1", "= 0"), "`sample_time_s` is 0"),
        (
            good.replace("run_column", "every_rows = 0\nrun_column"),
            "`every_rows` is 0",
        ),
        (
            good.replace("run_column = \"run\"", "run_column = \"flight\""),
            "no column `flight`",
        ),
        (
            good.replace("measurements = [\"y\"]", ""),
            "[model] needs `measurements`",
        ),
        (
            equation.replace("[[equation]]\n", "[[equation]]\nouput = \"y\"\n"),
            "unknown field `ouput`",
        ),
        (
            equation.replace(
                "{ value = \"u\", lag = 1 }",
                "{ value = \"u\" }, { value = \"twice\" }",
            ),
            "the regressors u, twice of `y` are linearly dependent",
        ),
        (
            equation.replace("{ value = \"y\", lag = 1 }", "{ value = \"y\" }"),
            "uses its own output",
        ),
        (
            equation.replace("{ value = \"y\", lag = 1 }", "{ value = \"t - t\" }"),
            "`t - t` has the same value (0)",
        ),
        (
            equation.split("[[equation]]").next().unwrap().to_owned(),
            "needs either a [model]",
        ),
        (
            equation
                .replace("chi_square", "unknown_input_filter")
                .replace("\"y\", lag = 1", "\"y\", lag = 2"),
            "every term needs the lag 1",
        ),
    ];
    for (text, words) in cases {
        let message = message(&text);
        assert!(message.contains(words), "no `{words}`: {message}\n{text}");
    }
    let file = stage.file("structure.toml", &good);
    let message = refused(&["--model", &file, stage.recording(), "--runs", "7"]);
    assert!(message.contains("no run `7`"), "{message}");
}

/// The configuration of a vehicle with another section in place of its model.
fn with_model(configuration: &str, section: &str) -> String {
    let (before, after) = configuration.split_once("[diagnoser.model]\n").unwrap();
    let after = after.split_once("\n[diagnoser.").unwrap().1;
    format!("{before}{section}\n[diagnoser.{after}")
}

#[test]
fn the_model_of_a_real_car_gives_no_false_alarm_on_held_out_runs() {
    let Some(recording) = Recording::find("f1tenth.csv", "f1tenth.toml") else {
        return;
    };
    let data = recording.path().to_str().unwrap().to_owned();
    let structure = repository("deploy/identify/f1tenth.toml");
    let section = printed(&[
        "--model",
        structure.to_str().unwrap(),
        &data,
        "--runs",
        "odd",
        "--window",
        "60",
    ]);
    println!("{section}");
    let table: toml::Table = section.parse().unwrap();
    let model = &table["diagnoser"]["model"];
    let entry = |key: &str, i: usize, j: usize| model[key][i][j].as_float().unwrap();
    // ../config/f1tenth.toml: 0.869, 0.131; 0.915, 0.082.
    assert!((entry("A", 0, 0) - 0.869).abs() < 0.06, "{section}");
    assert!(
        (entry("A", 2, 2) - 0.915).abs() < 0.03 && (entry("B", 2, 1) - 0.082).abs() < 0.03,
        "{section}"
    );
    assert!(
        section.contains("# 21 runs") && section.contains("20 runs held out"),
        "{section}"
    );
    assert!(!section.contains("OVERFITTED"), "{section}");

    let directory = tempfile::tempdir().unwrap();
    let file = directory.path().join("identified.toml");
    let configured = fs::read_to_string(repository("deploy/config/f1tenth.toml")).unwrap();
    // The example's gains do not belong to the identified model.
    let configured = configured.replace("gains_file = ", "# gains_file = ");
    fs::write(&file, with_model(&configured, &section)).unwrap();
    let report = program(&[
        "replay",
        file.to_str().unwrap(),
        &data,
        "--runs",
        "even",
        "--totals",
    ]);
    assert!(report.contains("0 false alarms in 0 runs"), "{report}");
}

#[test]
fn the_regression_of_real_flights_is_the_configured_one() {
    let Some(recording) = Recording::find("alfa_rates.csv", "alfa.toml") else {
        return;
    };
    let structure = repository("deploy/identify/alfa_roll.toml");
    let data = recording.path().to_str().unwrap();
    let section = printed(&["--model", structure.to_str().unwrap(), data, "--runs", "odd"]);
    println!("{section}");
    let table: toml::Table = section.parse().unwrap();
    let model = &table["diagnoser"]["model"];
    let entry = |key: &str, i: usize, j: usize| model[key][i][j].as_float().unwrap();
    // ../config/alfa.toml: p(k) = -0.0784 p(k-1) + 0.0370 p(k-2) + ... + 1.0756 e0(k) + 0.2038 e1(k) - 0.2769 e2(k).
    for (lag, configured) in [-0.0784, 0.0370, 0.0319, 0.0318].into_iter().enumerate() {
        assert!((entry("input", lag, 0) - configured).abs() < 0.01, "{section}");
    }
    for (column, configured) in [(1, 1.0756), (2, 0.2038), (3, -0.2769)] {
        assert!(
            (entry("feedthrough", 0, column) - configured).abs() < 0.01,
            "{section}"
        );
    }
    assert!(
        (entry("measurement_noise_covariance", 0, 0) - 0.0126).abs() < 0.0005,
        "{section}"
    );
}
