//! `servo_fault_free.json` and `servo_fault.json`: the paper's scenarios (method sheet 8, facts 6, 9, 10, 11).

use crate::fixtures::{channel, design, file, given, servo, step};
use crate::support::{assert_close, numbers, rows};
use residual_diagnosis::{
    diagnoser::{Diagnoser, StepRecord, flags},
    reduced_order_observer::{
        BaselineObserver, ReducedOrderObserver,
        options::{Initialisation, Mode, ReducedOrderObserverOptions, Test},
    },
};
use serde_json::Value;

fn options(file: &Value, mode: Mode, initialisation: Initialisation) -> ReducedOrderObserverOptions {
    let mut options = given(servo(0.0), &rows(&file["K"]), &rows(&file["M"]));
    options.bounds.mode = mode;
    options.bounds.initialisation = Some(initialisation);
    options.bounds.rounding_tolerance = 1e-12;
    options.bounds.tests = vec![Test::Hull];
    options.isolation.enabled = false;
    options
}

struct Run {
    records: Vec<StepRecord>,
    z1: Vec<f64>,
    z2: Vec<f64>,
    /// r of every instant.
    residual: Vec<f64>,
    /// Half widths of both outputs at every instant.
    widths: Vec<f64>,
}

/// Runs a file. The observers' state is that before the step of each instant.
fn run<D: Diagnoser>(mut diagnoser: D, observers: fn(&D) -> (&[f64], &[f64]), file: &Value) -> Run {
    let (y, u) = (rows(&file["y"]), numbers(&file["u"]));
    let mut out = Run {
        records: Vec::new(),
        z1: Vec::new(),
        z2: Vec::new(),
        residual: Vec::new(),
        widths: Vec::new(),
    };
    for (y, u) in y.iter().zip(u) {
        let (z1, z2) = observers(&diagnoser);
        out.z1.extend(z1);
        out.z2.extend(z2);
        let record = step(&mut diagnoser, y, &[u]);
        out.residual
            .push(channel(&diagnoser, &record, "output_excess").residual);
        for name in ["output_0", "output_1"] {
            let channel = channel(&diagnoser, &record, name);
            assert!((channel.upper + channel.lower).abs() < 1e-12);
            out.widths.push(channel.upper);
        }
        out.records.push(record);
    }
    out
}

fn run_joint(file: &Value, initialisation: Initialisation) -> Run {
    let mut options = options(file, Mode::Joint, initialisation);
    options.missing.max_width_ratio = 1e6;
    let diagnoser = ReducedOrderObserver::new(&design(&options)).unwrap();
    run(diagnoser, ReducedOrderObserver::observer_state, file)
}

fn run_baseline(file: &Value, mode: Mode) -> Run {
    let options = options(file, mode, Initialisation::PriorBox);
    let diagnoser = BaselineObserver::new(&design(&options)).unwrap();
    run(diagnoser, BaselineObserver::observer_state, file)
}

/// Indices of the instants at which a test alarms.
fn alarms(run: &Run) -> Vec<usize> {
    let alarming = |record: &StepRecord| record.flags & flags::ALARM_NOW != 0;
    (0..run.records.len())
        .filter(|&k| alarming(&run.records[k]))
        .collect()
}

fn check(name: &str) {
    let file = file(name);
    let centre = &file["start_box_centre"];
    for (mode, key) in [(Mode::Paper, "paper"), (Mode::Tiom, "tiom")] {
        let found = run_baseline(&file, mode);
        assert_close("ẑ1", &found.z1[2..], &numbers(&centre["z1_hat"])[2..], 1e-9);
        assert_close("ẑ2", &found.z2[1..], &numbers(&centre["z2_hat"])[1..], 1e-9);
        let widths = numbers(&centre[format!("{key}_half_width")]);
        assert_close(key, &found.widths[..widths.len()], &widths, 1e-8);
        assert_close(
            key,
            &found.residual,
            &numbers(&centre[format!("{key}_residual")]),
            1e-8,
        );
        check_summary(&found, &file["summary"][key]);
    }
    for (initialisation, start, first) in [
        (Initialisation::PriorBox, "start_box_centre", 0),
        (Initialisation::MeasuredOutput, "start_measured_output", 1),
    ] {
        let found = run_joint(&file, initialisation);
        let expected = &file[start];
        assert_close("ẑ1", &found.z1[2..], &numbers(&expected["z1_hat"])[2..], 1e-9);
        assert_close("ẑ2", &found.z2[1..], &numbers(&expected["z2_hat"])[1..], 1e-9);
        let widths = numbers(&expected["joint_half_width"]);
        let count = widths.len();
        assert_close(start, &found.widths[2 * first..count], &widths[2 * first..], 1e-8);
        let residual = numbers(&expected["joint_residual"]);
        assert_close(start, &found.residual[first..], &residual[first..], 1e-8);
        let summary = if first == 0 {
            "joint_box_centre"
        } else {
            "joint_measured_output"
        };
        check_summary(&found, &file["summary"][summary]);
    }
}

fn check_summary(run: &Run, summary: &Value) {
    let found: Vec<usize> = alarms(run).into_iter().filter(|&k| k >= 1).collect();
    assert_eq!(found.len() as u64, summary["alarms_total"].as_u64().unwrap());
    assert_eq!(found.first().map(|&k| k as u64), summary["first_alarm"].as_u64());
    assert_eq!(found.last().map(|&k| k as u64), summary["last_alarm"].as_u64());
    if let Some(expected) = summary["alarms_in_window"].as_u64() {
        let inside = found.iter().filter(|k| (50..=150).contains(*k)).count();
        assert_eq!(inside as u64, expected);
        let peak = run.residual[50..=150].iter().copied().fold(f64::MIN, f64::max);
        assert!((peak - summary["peak"].as_f64().unwrap()).abs() < 1e-8);
    }
}

#[test]
fn the_fault_free_run_agrees_in_every_mode_and_start() {
    check("servo_fault_free.json");
}

#[test]
fn the_run_with_fault_agrees_in_every_mode_and_start() {
    check("servo_fault.json");
}

#[test]
fn the_paper_alarms_from_51_on_but_also_at_the_fault_free_sample_1() {
    let file = file("servo_fault.json");
    let paper = alarms(&run_baseline(&file, Mode::Paper));
    assert_eq!(&paper[..2], [1, 51]);
    let joint = alarms(&run_joint(&file, Initialisation::MeasuredOutput));
    assert_eq!((joint[0], *joint.last().unwrap()), (51, 153));
    assert_eq!(joint[..], paper[1..]);
}

#[test]
fn the_printed_sign_of_the_residual_would_alarm_at_every_fault_free_sample() {
    let file = file("servo_fault_free.json");
    let run = run_baseline(&file, Mode::Paper);
    let printed: Vec<f64> = run
        .records
        .iter()
        .map(|record| {
            let excess = |channel: &residual_diagnosis::diagnoser::Channel| {
                (channel.residual - channel.upper).max(channel.residual - channel.lower)
            };
            record.channels()[..2].iter().map(excess).fold(f64::MIN, f64::max)
        })
        .collect();
    let expected = numbers(&file["start_box_centre"]["paper_residual_printed_sign"]);
    assert_close("printed", &printed, &expected, 1e-8);
    assert!(printed.iter().all(|r| *r > 0.0));
    let least = printed.iter().copied().fold(f64::MAX, f64::min);
    assert!((least - 0.1318224).abs() < 1e-6, "{least}");
    assert!((run.residual[1] - 0.385590).abs() < 1e-5);
    assert_eq!(alarms(&run), [1]);
}

#[test]
fn the_error_of_the_third_state_shrinks_by_f_at_every_sample() {
    let file = file("servo_fault_free.json");
    let mut options = options(&file, Mode::Paper, Initialisation::PriorBox);
    options.bounds.generator_order = Some(20);
    let mut diagnoser = BaselineObserver::new(&design(&options)).unwrap();
    let k = numbers(&file["K"]);
    let (y, u, x3) = (rows(&file["y"]), numbers(&file["u"]), numbers(&file["x3"]));
    let mut errors = Vec::new();
    for t in 0..20 {
        let z2 = diagnoser.observer_state().1[0];
        errors.push(x3[t] - (z2 - k[0] * y[t][0] - k[1] * y[t][1]));
        step(&mut diagnoser, &y[t], &[u[t]]);
    }
    assert!((errors[0] - 2.603824).abs() < 1e-6);
    for pair in errors[..5].windows(2) {
        assert!((pair[1] / pair[0] - 0.0559656).abs() < 1e-6);
    }
    assert!(errors[10].abs() < 1e-11);
}

#[test]
fn the_papers_bound_is_violated_in_the_transient_where_the_joint_one_is_attained() {
    // Fact 11: x0 = (1, 1, 1), observers at 0, η(0) = -1.
    let mut file = file("servo_fault_free.json");
    file["K"] = serde_json::json!([[8.3461, 4.67305]]);
    let plant = servo(0.0).model;
    let x1 = |row: usize| plant.a[row].iter().sum::<f64>() - plant.d[row][0];
    let samples = [[1.0, 1.0], [x1(0), x1(1)]];
    let last = |diagnoser: &mut dyn Diagnoser| {
        let records: Vec<StepRecord> = samples.iter().map(|y| step(diagnoser, y, &[0.0])).collect();
        (
            channel(diagnoser, &records[1], "output_0"),
            channel(diagnoser, &records[1], "output_1"),
        )
    };
    let paper = options(&file, Mode::Paper, Initialisation::PriorBox);
    let (_, second) = last(&mut BaselineObserver::new(&design(&paper)).unwrap());
    assert!((second.residual + 3.4409045).abs() < 1e-9, "{}", second.residual);
    assert!((second.upper - 0.2165).abs() < 1e-9, "{}", second.upper);
    assert!(second.ratio > 1.0);
    let joint = options(&file, Mode::Joint, Initialisation::PriorBox);
    let (first, second) = last(&mut ReducedOrderObserver::new(&design(&joint)).unwrap());
    assert!((first.upper - 1.015849).abs() < 1e-9, "{}", first.upper);
    assert!((second.upper - 3.4409045).abs() < 1e-9, "{}", second.upper);
    assert!((second.residual + second.upper).abs() < 1e-9 && second.ratio <= 1.0);
}
