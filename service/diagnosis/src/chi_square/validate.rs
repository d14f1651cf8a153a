//! Whether the settings make sense, alone and together (method sheet 7).

use super::{
    error::ChiSquareError,
    options::{AlarmOptions, ChiSquareOptions, OnIsolation, Signature, StatisticKind},
};
use std::collections::HashSet;
use std::hash::Hash;

/// Longest window, steps.
const LONGEST_WINDOW: usize = 100_000;
/// Fewest simulated runs: the 5 % quantile of fewer means little.
const FEWEST_RUNS: usize = 200;
/// Most sensors of which any set can be excluded: every set is examined at construction.
pub(super) const MOST_EXCLUDABLE: usize = 8;

/// Checks every setting beside the model.
pub(super) fn check_settings(options: &ChiSquareOptions) -> Result<(), ChiSquareError> {
    check_statistics(options)?;
    check_glr(options)?;
    check_thresholds(options)?;
    check_alarm(&options.alarm)?;
    let numerics = &options.numerics;
    in_range("numerics.rank_tolerance", numerics.rank_tolerance, 0.0, 1e-2)?;
    in_range(
        "numerics.steady_state_tolerance",
        numerics.steady_state_tolerance,
        0.0,
        1e-3,
    )
}

fn check_statistics(options: &ChiSquareOptions) -> Result<(), ChiSquareError> {
    let statistics = &options.statistics;
    distinct("statistics.enabled", &statistics.enabled)?;
    distinct("statistics.decision", &statistics.decision)?;
    let enabled = |kind: &StatisticKind| statistics.enabled.contains(kind);
    if let Some(kind) = statistics.decision.iter().find(|kind| !enabled(kind)) {
        return Err(ChiSquareError::setting(
            "statistics.decision",
            format!("a list with \"{}\"", kind.name()),
            "list enabled statistics only, or add it to `statistics.enabled`",
        ));
    }
    if let Some(kind) = statistics.report_statistic {
        let state_test = matches!(
            kind,
            StatisticKind::StatePlain | StatisticKind::StateWindow | StatisticKind::StateTwoPropagator
        );
        if !state_test || !enabled(&kind) {
            return Err(ChiSquareError::setting(
                "statistics.report_statistic",
                format!("\"{}\"", kind.name()),
                "name a state test of `statistics.enabled`, or leave it out",
            ));
        }
    }
    if enabled(&StatisticKind::StateWindow) {
        distinct("statistics.window_steps", &statistics.window_steps)?;
        for steps in &statistics.window_steps {
            count_in_range("statistics.window_steps", *steps, LONGEST_WINDOW)?;
        }
    }
    count_in_range(
        "statistics.two_propagator_reset_steps",
        statistics.two_propagator_reset_steps,
        LONGEST_WINDOW,
    )?;
    if options.alarm.on_isolation != OnIsolation::Continue && !enabled(&StatisticKind::Glr) {
        return Err(ChiSquareError::setting(
            "alarm.on_isolation",
            format!("\"{}\"", options.alarm.on_isolation.name()),
            "only \"glr\" isolates; add it to `statistics.enabled`, or use \"continue\"",
        ));
    }
    in_range("cusum.reference", options.cusum.reference, 0.0, 100.0)
}

fn check_glr(options: &ChiSquareOptions) -> Result<(), ChiSquareError> {
    let glr = &options.glr;
    count_in_range("glr.window_steps", glr.window_steps, LONGEST_WINDOW)?;
    count_in_range("glr.onset_stride_steps", glr.onset_stride_steps, glr.window_steps)?;
    distinct("glr.signatures", &glr.signatures)?;
    in_range("glr.isolation_margin", glr.isolation_margin, 0.0, 1e6)?;
    let process = [Signature::ProcessStep, Signature::ProcessRamp];
    let named = process
        .iter()
        .find(|signature| glr.signatures.contains(signature));
    match (named, glr.process_fault_input.is_empty()) {
        (Some(_), true) => Err(ChiSquareError::Missing {
            key: "glr.process_fault_input".to_owned(),
            need: "give the matrix through which the process faults enter the state, n x faults",
        }),
        (None, false) => Err(ChiSquareError::setting(
            "glr.process_fault_input",
            "given",
            "add \"process_step\" or \"process_ramp\" to `glr.signatures`, or remove it",
        )),
        _ => Ok(()),
    }
}

fn check_thresholds(options: &ChiSquareOptions) -> Result<(), ChiSquareError> {
    let threshold = &options.threshold;
    in_range(
        "threshold.false_alarm_probability",
        threshold.false_alarm_probability,
        0.0,
        0.5,
    )?;
    in_range(
        "threshold.run_false_alarm_probability",
        threshold.run_false_alarm_probability,
        0.0,
        0.5,
    )?;
    count_in_range("threshold.run_steps", threshold.run_steps, 1_000_000)?;
    if threshold.calibration_runs < FEWEST_RUNS || threshold.calibration_runs > 10_000_000 {
        return Err(ChiSquareError::setting(
            "threshold.calibration_runs",
            threshold.calibration_runs,
            format!("use {FEWEST_RUNS} to 10000000"),
        ));
    }
    for (key, value) in [
        ("threshold.glr", threshold.glr),
        ("threshold.cusum", threshold.cusum),
        ("threshold.bank", threshold.bank),
    ] {
        if !(value >= 0.0 && value.is_finite()) {
            return Err(ChiSquareError::setting(
                key,
                value,
                "use a threshold above 0, or 0 to calibrate",
            ));
        }
    }
    Ok(())
}

fn check_alarm(alarm: &AlarmOptions) -> Result<(), ChiSquareError> {
    for (key, value) in [
        ("alarm.confirm_steps", alarm.confirm_steps),
        ("alarm.clear_steps", alarm.clear_steps),
        ("alarm.max_gap_steps", alarm.max_gap_steps),
    ] {
        if value == 0 {
            return Err(ChiSquareError::setting(key, value, "use at least 1"));
        }
    }
    Ok(())
}

/// `low` < value <= `high`.
fn in_range(key: &str, value: f64, low: f64, high: f64) -> Result<(), ChiSquareError> {
    if value > low && value <= high {
        Ok(())
    } else {
        Err(ChiSquareError::setting(
            key,
            value,
            format!("use a number above {low}, at most {high}"),
        ))
    }
}

/// 1 <= value <= `most`.
fn count_in_range(key: &str, value: usize, most: usize) -> Result<(), ChiSquareError> {
    if (1..=most).contains(&value) {
        Ok(())
    } else {
        Err(ChiSquareError::setting(key, value, format!("use 1 to {most}")))
    }
}

/// Neither empty nor with an entry twice.
fn distinct<T: Eq + Hash + std::fmt::Debug>(key: &str, list: &[T]) -> Result<(), ChiSquareError> {
    let set: HashSet<&T> = list.iter().collect();
    if !list.is_empty() && set.len() == list.len() {
        Ok(())
    } else {
        Err(ChiSquareError::setting(
            key,
            format!("{list:?}"),
            "list at least one entry, none twice",
        ))
    }
}

/// Names that are given: as many as needed, none empty, none twice.
pub(super) fn check_names(
    key: &str,
    names: Option<&Vec<String>>,
    count: usize,
) -> Result<(), ChiSquareError> {
    let Some(names) = names else { return Ok(()) };
    let set: HashSet<&String> = names.iter().collect();
    if names.len() == count && set.len() == count && names.iter().all(|name| !name.trim().is_empty()) {
        Ok(())
    } else {
        Err(ChiSquareError::setting(
            key,
            format!("{names:?}"),
            format!("give {count} different names, none empty"),
        ))
    }
}

/// Units that are given: as many as needed.
pub(super) fn check_units(
    key: &str,
    units: Option<&Vec<String>>,
    count: usize,
) -> Result<(), ChiSquareError> {
    match units {
        Some(units) if units.len() != count => Err(ChiSquareError::setting(
            key,
            format!("a list of length {}", units.len()),
            format!("give {count} units, \"\" for none"),
        )),
        _ => Ok(()),
    }
}
