//! The demonstration from its start to its end.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

mod support;

use std::process::Stdio;
use std::time::{Duration, Instant};

use support::daemon::program;
use support::files_with_prefix;

/// What follows a word at the beginning of a line of the summary.
fn line<'a>(output: &'a str, begin: &str) -> &'a str {
    let found = output.lines().find_map(|line| line.strip_prefix(begin));
    found
        .unwrap_or_else(|| panic!("no line `{begin}` in:\n{output}"))
        .trim()
}

/// The k of a phrase `y(k)`.
fn measurement(text: &str) -> u64 {
    let number = text.split_once("y(").and_then(|(_, rest)| rest.split_once(')'));
    number
        .unwrap_or_else(|| panic!("no measurement in `{text}`"))
        .0
        .parse()
        .unwrap()
}

fn show(case: usize) {
    let begin = Instant::now();
    let child = program()
        .args(["demo", "--case", &case.to_string()])
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
    assert!(taken < Duration::from_secs(15), "{taken:?}");

    assert!(line(&output, "injected").starts_with(&format!("actuator {case},")));
    assert_eq!(line(&output, "false alarms"), "0", "{output}");
    let isolated = line(&output, "isolated");
    let name = ["collective_pitch", "longitudinal_cyclic_pitch"][case - 1];
    assert!(
        isolated.contains(name) && isolated.contains(&format!("(actuator {case})")),
        "{output}"
    );
    // The fault shows in y(102) first; a busy machine may delay a sample past its instant.
    let detected = measurement(line(&output, "detected"));
    assert!((102..=110).contains(&detected), "{output}");
    assert!((102..=110).contains(&measurement(isolated)), "{output}");
    println!(
        "case {case}: detected y({detected}), {isolated}, {:.1} s",
        taken.as_secs_f64()
    );

    for prefix in ["residuald.", "residuald-iox."] {
        let left = files_with_prefix(&format!("{prefix}demo{case}-{pid}."));
        assert!(left.is_empty(), "{left:?}");
    }
}

#[test]
fn the_first_case_isolates_actuator_1_and_leaves_nothing() {
    show(1);
}

#[test]
fn the_second_case_isolates_actuator_2_and_leaves_nothing() {
    show(2);
}
