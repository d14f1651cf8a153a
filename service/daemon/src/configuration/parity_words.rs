//! What the design of parity tests found, in words: from which size on a fault is seen, and which tests are missing.

use residual_diagnosis::model::LinearModel;
use residual_diagnosis::unknown_input_filter::modes::FaultMode;
use residual_synthesis::bounds::round_up;
use residual_synthesis::certificates::Designed;
use residual_synthesis::floors::FloorQuestion;
use std::collections::BTreeSet;

/// Significant digits of a fault size.
const DIGITS: usize = 3;

/// For each fault duration the smallest constant faults that parity tests certainly detect (one mode without the
/// actuator is falsified) and isolate (every one of the bank's `modes` without it is): name and text.
pub(super) fn sensitivities(
    model: &LinearModel,
    modes: &[FaultMode],
    designed: &Designed,
) -> Vec<(&'static str, String)> {
    let lengths: BTreeSet<usize> = designed
        .floors
        .iter()
        .map(|floor| floor.question.length)
        .collect();
    let sizes = |length: usize, actuator: usize| {
        let floors = designed
            .floors
            .iter()
            .filter(move |floor| (floor.question.length, floor.question.actuator) == (length, actuator));
        floors.map(|floor| floor.floor)
    };
    let detectable = |length, actuator| sizes(length, actuator).reduce(f64::min);
    let isolable = |length, actuator| {
        let foreign = modes.iter().filter(|mode| !mode.contains(actuator)).count();
        let complete = sizes(length, actuator).count() == foreign;
        sizes(length, actuator).reduce(f64::max).filter(|_| complete)
    };
    let list = |smallest: &dyn Fn(usize, usize) -> Option<f64>| {
        let of_length = |&length: &usize| {
            let faults = model.actuators().iter().enumerate().filter_map(|(j, actuator)| {
                let size = round_up(smallest(length, j)?, DIGITS);
                let space = if actuator.unit.is_empty() { "" } else { " " };
                Some(format!("{} from {size}{space}{}", actuator.name, actuator.unit))
            });
            let faults: Vec<String> = faults.collect();
            let samples = if length == 1 { "sample" } else { "samples" };
            (!faults.is_empty()).then(|| format!("within {length} {samples}: {}", faults.join(", ")))
        };
        lengths
            .iter()
            .filter_map(of_length)
            .collect::<Vec<_>>()
            .join("; ")
    };
    let mut notes = vec![("detectable", list(&detectable)), ("isolable", list(&isolable))];
    notes.retain(|(_, text)| !text.is_empty());
    if model.a_plus().amax() > 0.0 {
        for (_, text) in &mut notes {
            *text += " (with the state at `filter.nominal_state_magnitude`)";
        }
    }
    notes
}

/// A warning for every actuator whose fault of the configured size (units of u) no parity test certainly detects,
/// with the state at its nominal magnitude: the thresholds are too wide for it.
pub(super) fn inert_thresholds(
    model: &LinearModel,
    designed: &Designed,
    fault_of_interest: &[f64],
) -> Vec<String> {
    let warning = |(j, &interest): (usize, &f64)| {
        let floors = designed
            .floors
            .iter()
            .filter(|floor| floor.question.actuator == j);
        let smallest = floors.map(|floor| floor.floor).reduce(f64::min)?;
        (smallest > interest).then(|| {
            format!(
                "inert threshold: a fault of \"{}\" is certainly seen only from {} on, not from the \
                 `filter.fault_of_interest` = {interest}; reduce `A_uncertainty` or the bounds, or add longer \
                 `parity.lengths`",
                model.actuators()[j].name,
                round_up(smallest, DIGITS),
            )
        })
    };
    fault_of_interest.iter().enumerate().filter_map(warning).collect()
}

/// A warning for every mode and actuator with windows that have no test.
pub(super) fn not_separable(model: &LinearModel, designed: &Designed) -> Vec<String> {
    let names: Vec<&str> = model
        .actuators()
        .iter()
        .map(|actuator| actuator.name.as_str())
        .collect();
    let mut warnings = Vec::new();
    let mut rest = designed.not_separable.as_slice();
    let pair = |question: &FloorQuestion| (question.mode, question.actuator);
    while let Some(first) = rest.first() {
        let (same, others) = rest.split_at(
            rest.iter()
                .take_while(|question| pair(question) == pair(first))
                .count(),
        );
        let lengths: Vec<_> = same.iter().map(|question| question.length.to_string()).collect();
        warnings.push(format!(
            "no fault of \"{}\" can be told from the mode ({}) by windows of length {}, however large it is: no parity test \
             for it; larger `parity.lengths` or `parity.pre_samples` may help",
            names[first.actuator],
            first.mode.describe(&names),
            lengths.join(", "),
        ));
        rest = others;
    }
    warnings.extend(designed.failures.iter().map(|failure| {
        format!(
            "no parity test for faults of \"{}\" in the mode ({}) by windows of length {}: {}",
            names[failure.question.actuator],
            failure.question.mode.describe(&names),
            failure.question.length,
            failure.reason
        )
    }));
    warnings
}
