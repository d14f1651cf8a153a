//! The lifecycle of an alarm in words, and how long a violation takes until it is raised at worst.

use super::achieved::{number, with_unit};
use super::check::duration;
use super::descriptions::signals;
use crate::configuration::{DiagnoserConfiguration, EnableConfiguration, InputConfiguration};
use residual_diagnosis::achieved::Achieved;

/// What is to say about the alarm of one diagnoser: name and value.
pub(super) fn lifecycle(
    diagnoser: &DiagnoserConfiguration,
    achieved: &Achieved,
    inputs: &[InputConfiguration],
) -> Vec<(&'static str, String)> {
    let mut entries = vec![("alarm", rules(diagnoser))];
    let conditions = diagnoser.lifecycle.enable.iter();
    entries.extend(conditions.map(|condition| ("enabled", enabled(condition, inputs))));
    entries.push(("raised within", delay(diagnoser)));
    let totals = from_onset(diagnoser, achieved).into_iter();
    entries.extend(totals.map(|total| ("from the onset", total)));
    entries
}

fn rules(diagnoser: &DiagnoserConfiguration) -> String {
    let rules = &diagnoser.lifecycle.rules;
    let raised = match (rules.raise_steps, rules.raise_window) {
        (1, _) => "raised by 1 violation".to_owned(),
        (n, m) if n == m => format!("raised by {n} violations in a row"),
        (n, m) => format!("raised by {n} violations in {m} evaluated steps"),
    };
    let mut text = format!(
        "{raised}, cleared by {} evaluated steps in a row with ratios up to {}",
        rules.clear_steps, rules.clear_ratio
    );
    if rules.latch {
        text += " once it is acknowledged";
    }
    if rules.suppressed_instants > 0 {
        text += &format!(
            "; violations in the first {} after the first evaluated step do not count",
            duration(rules.suppressed_instants * diagnoser.period_ns)
        );
    }
    text
}

fn enabled(condition: &EnableConfiguration, inputs: &[InputConfiguration]) -> String {
    let channels = match &condition.channels {
        Some(names) => names.join(", "),
        None => "all channels".to_owned(),
    };
    let [low, high] = condition.range;
    let signal = signals(&[condition.signal], inputs).concat();
    format!(
        "{channels} while {signal} lies from {} to {}",
        number(low),
        number(high)
    )
}

/// From the first violating instant t until the alarm is in the ring: the instant of the last violation that it
/// takes, and the margin that its step waits. The computing time of the step comes on top.
fn delay(diagnoser: &DiagnoserConfiguration) -> String {
    let rules = &diagnoser.lifecycle.rules;
    let one = |steps: u32| {
        let delay_ns = delay_ns(diagnoser, steps);
        let steps = match steps {
            1 => "1 step".to_owned(),
            more => format!("{more} steps"),
        };
        format!("{steps} and the margin, {}", duration(delay_ns))
    };
    let (persistent, intermittent) = (rules.persistent_delay_steps(), rules.intermittent_delay_steps());
    let mut text = one(persistent);
    if intermittent > persistent {
        text += &format!(
            ", if every step violates; {}, if only enough do",
            one(intermittent)
        );
    }
    if rules.suppressed_instants > 0 {
        let suppression = duration(rules.suppressed_instants * diagnoser.period_ns);
        text += &format!("; at start-up up to {suppression} more");
    }
    text + "; each step without an evaluation, for want of samples, adds a period, and their number has no limit"
}

fn delay_ns(diagnoser: &DiagnoserConfiguration, steps: u32) -> u64 {
    u64::from(steps) * diagnoser.period_ns + diagnoser.margin_ns
}

/// Where the method states how soon it detects a fault: how soon the alarm is raised, counted from the onset.
fn from_onset(diagnoser: &DiagnoserConfiguration, achieved: &Achieved) -> Vec<String> {
    let raising_s = delay_ns(diagnoser, diagnoser.lifecycle.rules.persistent_delay_steps()) as f64 * 1e-9;
    let faults = achieved.faults.iter().filter(|fault| !fault.delays.is_empty());
    let of_fault = faults.map(|fault| {
        let delays = fault.delays.iter().map(|delay| {
            let total = number(delay.within_s + raising_s);
            format!("{total} s from {}", with_unit(delay.size, &fault.unit))
        });
        format!("{}: {}", fault.fault, delays.collect::<Vec<_>>().join(", "))
    });
    let mut texts: Vec<String> = of_fault.collect();
    if let Some(last) = texts.last_mut()
        && diagnoser.lifecycle.rules.raise_steps > 1
    {
        *last += "; provided that the verdict lasts from the detection on";
    }
    texts
}
