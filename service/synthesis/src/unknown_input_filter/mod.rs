//! Gains of a bank of unknown-input filters: parity certificates by linear programs, all else in closed form (method
//! sheet 3.3, 3.4).

pub mod certificates;
pub mod floors;
mod window_equalities;

use certificates::{CertificateOptions, Designed, design};
use floors::FloorQuestion;
use nalgebra::DVector;
use residual_diagnosis::gains::{FoundGains, SolverRun};
use residual_diagnosis::method::{MethodOptions, Refusal};
use residual_diagnosis::model::LinearModel;
use residual_diagnosis::unknown_input_filter::checks::check_modes;
use residual_diagnosis::unknown_input_filter::gains::{UnknownInputFilterGains, Untested, WhyUntested};
use residual_diagnosis::unknown_input_filter::modes::FaultMode;
use residual_diagnosis::unknown_input_filter::tables::UnknownInputFilterTables;

/// Finds the gains of a bank; with the certificates that `parity.lengths` asks for unless the options bring their own.
/// `progress` hears of each longer piece of work before it begins.
///
/// # Errors
/// [`Refusal`]: the first condition that does not hold. A window without certificate is a warning.
pub fn find_gains(
    options: &UnknownInputFilterTables,
    sample_time_s: f64,
    progress: &mut dyn FnMut(&str),
) -> Result<FoundGains<UnknownInputFilterGains>, Refusal> {
    progress("fixed gains and decoupling pairs");
    let mut found = options.find_gains(sample_time_s)?;
    if options.needs_solver().is_none() {
        return Ok(found);
    }
    let model = LinearModel::new(&options.model, sample_time_s)?;
    let all = options.options();
    let modes = all.bank.modes(model.actuator_count());
    // Modes without filter are never falsified.
    let report = check_modes(&model, &all, &modes)?;
    let with_filter = modes
        .iter()
        .zip(&report.testable)
        .filter(|(_, testable)| **testable);
    let with_filter: Vec<FaultMode> = with_filter.map(|(mode, _)| *mode).collect();
    let request = CertificateOptions {
        lengths: all.parity.lengths.clone(),
        pre_samples: all.parity.pre_samples.count(model.strip_gain().is_some()),
        nominal_state: match &all.filter.nominal_state_magnitude {
            Some(magnitude) => DVector::from_column_slice(magnitude),
            None => DVector::zeros(model.state_count()),
        },
    };
    let designed =
        design(&model, &with_filter, &request, progress).map_err(|error| Refusal::new("parity", &error))?;
    found.warnings.extend(windows_without_test(&model, &designed));
    found.solver.extend(summary(&designed.runs));
    found.gains.untested = untested(&designed);
    found.gains.certificates = designed.certificates;
    Ok(found)
}

/// The windows without certificate, for the gains.
fn untested(designed: &Designed) -> Vec<Untested> {
    let entry = |question: &FloorQuestion, reason| Untested {
        mode: question.mode,
        fault: question.actuator,
        length: question.length,
        reason,
    };
    let not_separable = designed.not_separable.iter();
    let not_separable = not_separable.map(|question| entry(question, WhyUntested::NotSeparable));
    let failures = designed.failures.iter();
    let failures = failures.map(|failure| entry(&failure.question, WhyUntested::NotComputed));
    not_separable.chain(failures).collect()
}

/// One entry for all programs: the worst status, the iterations of all, the objectives that agree least.
fn summary(runs: &[SolverRun]) -> Option<SolverRun> {
    let gap = |run: &SolverRun| (run.objective - run.dual_objective).abs();
    let loosest = runs.iter().max_by(|a, b| gap(a).total_cmp(&gap(b)))?;
    let worst = runs.iter().find(|run| run.status != "Solved").unwrap_or(loosest);
    Some(SolverRun {
        problem: format!(
            "{} linear programs for parity certificates; least agreement of the objectives",
            runs.len()
        ),
        status: worst.status.clone(),
        iterations: runs.iter().map(|run| run.iterations).sum(),
        ..loosest.clone()
    })
}

/// A warning for every mode and actuator with windows that have no test.
fn windows_without_test(model: &LinearModel, designed: &Designed) -> Vec<String> {
    let names: Vec<&str> = model
        .actuators()
        .iter()
        .map(|actuator| actuator.name.as_str())
        .collect();
    let pairs = designed
        .not_separable
        .chunk_by(|a, b| (a.mode, a.actuator) == (b.mode, b.actuator));
    let not_separable = pairs.filter_map(|same| {
        let first = same.first()?;
        let lengths: Vec<String> = same.iter().map(|question| question.length.to_string()).collect();
        Some(format!(
            "no fault of \"{}\" can be told from the mode ({}) by windows of length {}, however large it is: no parity \
             test for it; larger `parity.lengths` or `parity.pre_samples` may help",
            names[first.actuator],
            first.mode.describe(&names),
            lengths.join(", "),
        ))
    });
    let failures = designed.failures.iter().map(|failure| {
        format!(
            "no parity test for faults of \"{}\" in the mode ({}) by windows of length {}: {}",
            names[failure.question.actuator],
            failure.question.mode.describe(&names),
            failure.question.length,
            failure.reason
        )
    });
    not_separable.chain(failures).collect()
}
