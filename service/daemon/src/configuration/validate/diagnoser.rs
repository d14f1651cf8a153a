//! `[[diagnoser]]`: schedule and signals; the method checks its own tables.

use super::lifecycle::lifecycle;
use super::quantity::{duration_ns, period_ns};
use super::{check_name, refuse_duplicates};
use crate::configuration::locate::Mistakes;
use crate::configuration::refusal::explain;
use crate::configuration::schema::Diagnoser;
use crate::configuration::suggest::did_you_mean;
use crate::configuration::{
    DiagnoserConfiguration, InputConfiguration, MethodConfiguration, SignalReference,
};

/// Measurements and commands of one diagnoser; a step record has one validity bit for each.
const MAX_SIGNALS: usize = u64::BITS as usize;

/// Longest margin in periods; more would only delay every alarm.
const MAX_MARGIN_PERIODS: f64 = 10.0;

/// Default margin, as a divisor of the period.
const MARGIN_DIVISOR: u64 = 5;

/// Longest delay of the commands, steps.
const MAX_COMMAND_DELAY: usize = 1024;

/// The diagnoser at `path`, e.g. `diagnoser.0`; `method` is `None` where its tables could not be read.
pub(in crate::configuration) fn diagnoser(
    path: &str,
    section: Diagnoser,
    method: Option<MethodConfiguration>,
    inputs: &[InputConfiguration],
    mistakes: &mut Mistakes<'_>,
) -> Option<DiagnoserConfiguration> {
    let at = |key: &str| format!("{path}.{key}");
    check_name(&at("name"), &section.name, "diagnoser", mistakes);
    let period_ns = period_ns(&at("sample_time_s"), section.sample_time_s, mistakes);
    let (phase_ns, margin_ns) = match period_ns {
        Some(period_ns) => schedule(path, &section, period_ns, mistakes),
        None => (None, None),
    };
    if section.command_delay_steps > MAX_COMMAND_DELAY {
        mistakes.at(
            &at("command_delay_steps"),
            format!("a delay of {} steps is not possible", section.command_delay_steps),
            format!("use 0 to {MAX_COMMAND_DELAY} steps"),
        );
    }
    let total = section.measurements.len() + section.commands.len();
    if total > MAX_SIGNALS {
        mistakes.at(
            &at("measurements"),
            format!(
                "the diagnoser `{}` uses {total} measurements and commands",
                section.name
            ),
            format!("at most {MAX_SIGNALS} fit into a step record; split the plant over several diagnosers"),
        );
    }
    let measurements = signals(&at("measurements"), &section.measurements, inputs, mistakes);
    let commands = signals(&at("commands"), &section.commands, inputs, mistakes);
    let lifecycle = lifecycle(&at("lifecycle"), &section.lifecycle, period_ns, inputs, mistakes);
    let mut method = method?;
    let counts_agree = counts_agree(path, &section, &method, mistakes);
    let (measurements, commands) = (measurements?, commands?);
    if counts_agree {
        method.name_signals(&labels(&measurements, inputs), &labels(&commands, inputs));
        if let Some(period_ns) = period_ns
            && let Err(refusal) = method.validate(period_ns as f64 * 1e-9)
        {
            let (message, help) = explain(&refusal);
            mistakes.at(&at(&refusal.key), message, help);
        }
    }
    Some(DiagnoserConfiguration {
        name: section.name,
        period_ns: period_ns?,
        phase_ns: phase_ns?,
        margin_ns: margin_ns?,
        priority: section.priority,
        measurements,
        commands,
        command_delay_steps: section.command_delay_steps,
        lifecycle: lifecycle?,
        method,
    })
}

/// Phase and margin, nanoseconds.
fn schedule(
    path: &str,
    section: &Diagnoser,
    period_ns: u64,
    mistakes: &mut Mistakes<'_>,
) -> (Option<u64>, Option<u64>) {
    let phase_path = format!("{path}.phase_s");
    let limit = format!(
        "the phase lies from 0 to below the period of {} s",
        section.sample_time_s
    );
    let phase_ns = duration_ns(
        &phase_path,
        section.phase_s,
        section.sample_time_s,
        &limit,
        mistakes,
    );
    if phase_ns.is_some_and(|phase_ns| phase_ns >= period_ns) {
        mistakes.at(
            &phase_path,
            format!("a phase of {} s is a whole period", section.phase_s),
            limit,
        );
    }
    let margin_ns = match section.margin_s {
        None => Some(period_ns / MARGIN_DIVISOR),
        Some(margin_s) => {
            let limit_s = MAX_MARGIN_PERIODS * section.sample_time_s;
            let limit = format!("use 0 to {MAX_MARGIN_PERIODS} periods; every alarm waits for the margin");
            duration_ns(&format!("{path}.margin_s"), margin_s, limit_s, &limit, mistakes)
        }
    };
    (phase_ns, margin_ns)
}

/// Finds the signals of a list; `None` if one is missing.
fn signals(
    path: &str,
    list: &[String],
    inputs: &[InputConfiguration],
    mistakes: &mut Mistakes<'_>,
) -> Option<Vec<SignalReference>> {
    let path_of = |index: usize| format!("{path}.{index}");
    refuse_duplicates(list.iter().map(String::as_str), path_of, "signal", mistakes);
    let mut found = Vec::with_capacity(list.len());
    for (index, reference) in list.iter().enumerate() {
        match signal(reference, inputs) {
            Ok(signal) => found.push(signal),
            Err((message, help)) => mistakes.at(&path_of(index), message, help),
        }
    }
    (found.len() == list.len()).then_some(found)
}

/// Finds the signal that is written as "input.signal"; otherwise what is wrong and what to do.
pub(super) fn signal(
    reference: &str,
    inputs: &[InputConfiguration],
) -> Result<SignalReference, (String, String)> {
    let Some((input_name, signal_name)) = reference.split_once('.') else {
        let written = |input: &InputConfiguration| {
            input
                .signals
                .iter()
                .map(|signal| format!("{}.{signal}", input.name))
                .collect::<Vec<_>>()
        };
        let known: Vec<_> = inputs.iter().flat_map(written).collect();
        let full = known.iter().find(|full| full.ends_with(&format!(".{reference}")));
        let help = match full {
            Some(full) => format!("write \"{full}\""),
            None => did_you_mean(reference, &known, "signals"),
        };
        return Err((
            format!("`{reference}` does not name a signal as \"input.signal\""),
            help,
        ));
    };
    let Some(input) = inputs.iter().position(|input| input.name == input_name) else {
        let known: Vec<_> = inputs.iter().map(|input| &input.name).collect();
        return Err((
            format!("there is no input `{input_name}`"),
            did_you_mean(input_name, &known, "inputs"),
        ));
    };
    let known = &inputs[input].signals;
    match known.iter().position(|signal| signal == signal_name) {
        Some(element) => Ok(SignalReference { input, element }),
        None => Err((
            format!("the input `{input_name}` has no signal `{signal_name}`"),
            did_you_mean(signal_name, known, "signals"),
        )),
    }
}

/// Name and unit of each signal.
fn labels(references: &[SignalReference], inputs: &[InputConfiguration]) -> Vec<(String, String)> {
    let label = |reference: &SignalReference| {
        let input = &inputs[reference.input];
        let unit = input.units.get(reference.element).cloned().unwrap_or_default();
        (input.signals[reference.element].clone(), unit)
    };
    references.iter().map(label).collect()
}

/// Whether there are as many measurements and commands as the method's tables speak of.
fn counts_agree(
    path: &str,
    section: &Diagnoser,
    method: &MethodConfiguration,
    mistakes: &mut Mistakes<'_>,
) -> bool {
    let (measurements, commands) = method.signal_counts();
    let mut agree = true;
    let lists = [
        (
            "measurements",
            section.measurements.len(),
            measurements,
            "measured outputs",
        ),
        ("commands", section.commands.len(), commands, "known inputs"),
    ];
    for (key, found, expected, what) in lists {
        if found != expected {
            agree = false;
            mistakes.at(
                &format!("{path}.{key}"),
                format!(
                    "the diagnoser `{}` has {found} {key}, but its model has {expected} {what}",
                    section.name
                ),
                "list one signal for each, in the order of the model, or correct the model's matrices"
                    .to_owned(),
            );
        }
    }
    agree
}
