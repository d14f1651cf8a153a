//! The demonstration from its start to its end.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

mod support;

use std::process::Stdio;
use std::time::{Duration, Instant};

use support::daemon::program;
use support::files_with_prefix;

/// Runs the demonstration with these arguments; its output after a check that it went as it should and left nothing.
fn show(arguments: &[&str], limit: Duration) -> String {
    let begin = Instant::now();
    let child = program()
        .arg("demo")
        .args(arguments)
        .stdin(Stdio::null())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    let pid = child.id();
    let finished = child.wait_with_output().unwrap();
    let taken = begin.elapsed();
    let output = String::from_utf8(finished.stdout).unwrap();
    let messages = String::from_utf8_lossy(&finished.stderr);
    assert_eq!(finished.status.code(), Some(0), "{output}\n{messages}");
    assert!(taken < limit, "{taken:?}");
    for prefix in ["residuald.", "rsd."] {
        for name in ["demo", "demo-all"] {
            let left = files_with_prefix(&format!("{prefix}{name}-{pid}."));
            assert!(left.is_empty(), "{left:?}");
        }
    }
    println!("{arguments:?}: {:.1} s", taken.as_secs_f64());
    output
}

/// The cells of a diagnoser's row in the summary.
fn row(output: &str, diagnoser: &str) -> Vec<String> {
    let cells = |line: &str| {
        line.split('|')
            .map(|cell| cell.trim().to_owned())
            .collect::<Vec<_>>()
    };
    let mut rows = output
        .lines()
        .map(cells)
        .filter(|cells| cells.len() > 10 && cells[2] == diagnoser);
    rows.next()
        .unwrap_or_else(|| panic!("no row of {diagnoser} in\n{output}"))
}

#[test]
fn the_first_case_of_the_aircraft_isolates_actuator_1_and_leaves_nothing() {
    let output = show(&["--scenario", "aircraft-1"], Duration::from_secs(20));
    assert!(
        row(&output, "aircraft_actuators")[8].starts_with("collective_pitch +"),
        "{output}"
    );
}

#[test]
fn the_second_case_of_the_aircraft_isolates_actuator_2_and_leaves_nothing() {
    let output = show(&["--scenario", "aircraft-2"], Duration::from_secs(20));
    let isolated = &row(&output, "aircraft_actuators")[8];
    assert!(isolated.starts_with("longitudinal_cyclic_pitch +"), "{output}");
}

#[test]
fn all_methods_together_find_their_faults_in_one_daemon() {
    let output = show(&["--all"], Duration::from_secs(60));
    assert!(output.contains("result            as it should be"), "{output}");
}
