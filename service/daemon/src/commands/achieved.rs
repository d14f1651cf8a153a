//! What gains achieve, in words for people.

use comfy_table::Table;
use comfy_table::presets::ASCII_MARKDOWN;
use residual_diagnosis::achieved::{
    Achieved, FalseAlarms, FaultSensitivity, Norm, Poles, Threshold, TimeDomain,
};

/// Significant digits of a number that only informs.
const DIGITS: usize = 4;

/// A discrete-time pole below this modulus is zero but for rounding.
const DEAD_BEAT: f64 = 1e-9;

/// A number with few digits.
pub(super) fn number(value: f64) -> String {
    let magnitude = value.abs();
    if value == 0.0 || !value.is_finite() {
        return value.to_string();
    }
    if !(1e-4..1e6).contains(&magnitude) {
        return format!("{value:.*e}", DIGITS - 1);
    }
    let rounded: f64 = format!("{value:.*e}", DIGITS - 1).parse().unwrap_or(value);
    rounded.to_string()
}

/// A number with its unit, where it has one.
fn with_unit(value: f64, unit: &str) -> String {
    match unit {
        "" => number(value),
        _ => format!("{} {unit}", number(value)),
    }
}

/// A norm and how small it could be.
pub(super) fn norm(norm: &Norm) -> String {
    match norm.lower_bound {
        Some(bound) => format!(
            "{} = {}, no gain achieves less than {}",
            norm.name,
            number(norm.value),
            number(bound)
        ),
        None => format!("{} = {}", norm.name, number(norm.value)),
    }
}

/// Alarms without a fault, and what must be true for that.
pub(super) fn false_alarms(alarms: &FalseAlarms) -> String {
    let mut parts = Vec::new();
    if let Some(probability) = alarms.probability_per_instant {
        parts.push(match probability {
            0.0 => "none at all".to_owned(),
            _ => format!("probability {} at an instant", number(probability)),
        });
    }
    if let Some(expected) = alarms
        .expected_per_hour
        .filter(|&expected| expected > 0.0 || parts.is_empty())
    {
        parts.push(format!("{} expected an hour", number(expected)));
    }
    if parts.is_empty() {
        parts.push("possible".to_owned());
    }
    format!("{}, provided that {}", parts.join(", "), alarms.provided_that)
}

/// The faults that are surely, or likely, seen: of each the smallest size.
pub(super) fn smallest_faults(faults: &[FaultSensitivity]) -> String {
    let describe = |fault: &FaultSensitivity| match fault.detectable {
        Some(size) => format!(
            "{} from {}{}",
            fault.fault,
            with_unit(size, &fault.unit),
            assurance(fault.assurance)
        ),
        None => format!("{} at no size", fault.fault),
    };
    let sizes = faults.iter().map(describe).collect::<Vec<_>>().join(", ");
    match conditions(faults) {
        Some(conditions) => format!("{sizes}, provided that {conditions}"),
        None => sizes,
    }
}

/// What must be true for the sizes beside what excludes false alarms; `None`: nothing.
pub(super) fn conditions(faults: &[FaultSensitivity]) -> Option<String> {
    let mut conditions: Vec<&str> = Vec::new();
    for fault in faults {
        let condition = fault.provided_that.as_str();
        if !condition.is_empty() && !conditions.contains(&condition) {
            conditions.push(condition);
        }
    }
    (!conditions.is_empty()).then(|| conditions.join("; and that "))
}

fn assurance(assurance: f64) -> String {
    if assurance >= 1.0 {
        String::new()
    } else {
        format!(" (with probability {})", number(assurance))
    }
}

/// The condition that is closest to being violated.
pub(super) fn smallest_margin(achieved: &Achieved) -> Option<String> {
    let conditions = &achieved.inequalities;
    let closest = conditions
        .iter()
        .min_by(|left, right| left.margin.total_cmp(&right.margin))?;
    Some(format!(
        "{} hold, smallest margin {}: {}",
        conditions.len(),
        number(closest.margin),
        closest.name
    ))
}

/// The channels that can never alarm, one text for each reason.
pub(super) fn never_firing(thresholds: &[Threshold]) -> Vec<String> {
    let mut reasons: Vec<(&str, Vec<&str>)> = Vec::new();
    for threshold in thresholds {
        let Some(reason) = threshold.never_fires.as_deref() else {
            continue;
        };
        match reasons.iter_mut().find(|(known, _)| *known == reason) {
            Some((_, channels)) => channels.push(&threshold.channel),
            None => reasons.push((reason, vec![&threshold.channel])),
        }
    }
    let describe = |(reason, channels): (&str, Vec<&str>)| format!("{}: {reason}", channels.join(", "));
    reasons.into_iter().map(describe).collect()
}

/// Eigenvalues, in discrete time with the time constant or the duration of an oscillation's decay.
pub(super) fn poles(poles: &Poles, sample_time_s: f64) -> String {
    let describe = |&[real, imaginary]: &[f64; 2]| {
        if poles.time == TimeDomain::Discrete && real.hypot(imaginary) < DEAD_BEAT {
            return "0".to_owned();
        }
        let place = if imaginary == 0.0 {
            number(real)
        } else {
            format!("{} ± {}i", number(real), number(imaginary.abs()))
        };
        let constant_s = match poles.time {
            TimeDomain::Discrete => -sample_time_s / real.hypot(imaginary).ln(),
            TimeDomain::Continuous => -1.0 / real,
        };
        if constant_s > 0.0 && constant_s.is_finite() {
            format!("{place} ({} s)", number(constant_s))
        } else {
            place
        }
    };
    // Of a conjugate pair one is named.
    let named = poles.values.iter().filter(|[_, imaginary]| *imaginary >= 0.0);
    named.map(describe).collect::<Vec<_>>().join(", ")
}

/// Fault by fault: the smallest sizes and how sure they are.
pub(super) fn fault_table(faults: &[FaultSensitivity]) -> Table {
    let mut table = table(["fault", "detected from", "isolated from", "assurance"].map(str::to_owned));
    let size = |size: Option<f64>, unit: &str| size.map_or("never".to_owned(), |size| with_unit(size, unit));
    for fault in faults {
        let assurance = match fault.assurance {
            1.0.. => "guaranteed".to_owned(),
            probability => format!("probability {}", number(probability)),
        };
        table.add_row([
            fault.fault.clone(),
            size(fault.detectable, &fault.unit),
            size(fault.isolable, &fault.unit),
            assurance,
        ]);
    }
    table
}

/// Fault by fault: how long the detection takes at worst, by the size of the fault.
pub(super) fn delay_table(faults: &[FaultSensitivity]) -> Option<Table> {
    let mut table = table(["fault", "of at least", "is detected within"].map(str::to_owned));
    for fault in faults {
        for delay in &fault.delays {
            table.add_row([
                fault.fault.clone(),
                with_unit(delay.size, &fault.unit),
                format!("{} s", number(delay.within_s)),
            ]);
        }
    }
    (!table.is_empty()).then_some(table)
}

/// A row for each fault that is there, a column for each that is to be excluded.
pub(super) fn isolability_matrix(achieved: &Achieved) -> Option<Table> {
    let pairs = &achieved.isolability;
    let mut names: Vec<&str> = Vec::new();
    for name in pairs
        .iter()
        .flat_map(|pair| [pair.fault.as_str(), pair.from.as_str()])
    {
        if !names.contains(&name) {
            names.push(name);
        }
    }
    let is_column = |name: &&str| pairs.iter().any(|pair| pair.from == *name);
    let is_row = |name: &&str| pairs.iter().any(|pair| pair.fault == *name);
    let columns: Vec<&str> = names.iter().copied().filter(is_column).collect();
    let heading = std::iter::once("there \\ excluded").chain(columns.iter().copied());
    let mut table = table(heading.map(str::to_owned));
    for row in names.iter().copied().filter(is_row) {
        let cell = |column: &&str| {
            let pair = pairs
                .iter()
                .find(|pair| pair.fault == row && pair.from == *column);
            pair.map_or("-".to_owned(), |pair| match pair.instants {
                Some(1) => "1 instant".to_owned(),
                Some(instants) => format!("{instants} instants"),
                None => "never".to_owned(),
            })
        };
        table.add_row(std::iter::once(row.to_owned()).chain(columns.iter().map(cell)));
    }
    (!table.is_empty()).then_some(table)
}

fn table(heading: impl IntoIterator<Item = String>) -> Table {
    let mut table = Table::new();
    table
        .load_style(ASCII_MARKDOWN)
        .set_header(heading.into_iter().collect::<Vec<_>>());
    table
}

#[cfg(test)]
mod tests {
    use super::*;
    use residual_diagnosis::achieved::Separation;

    #[test]
    fn numbers_have_few_digits_and_their_magnitude() {
        let written = [0.0, 0.028_200_001, 1234.56, 1e-9, -3.0e12].map(number);
        assert_eq!(written, ["0", "0.0282", "1235", "1.000e-9", "-3.000e12"]);
    }

    #[test]
    fn poles_are_said_with_their_time_constants_and_pairs_once() {
        let discrete = Poles {
            name: String::new(),
            time: TimeDomain::Discrete,
            values: vec![[(-0.5_f64).exp(), 0.0], [0.3, 0.4], [0.3, -0.4], [0.0, 0.0]],
        };
        assert_eq!(poles(&discrete, 0.1), "0.6065 (0.2 s), 0.3 ± 0.4i (0.1443 s), 0");
        let continuous = Poles {
            time: TimeDomain::Continuous,
            values: vec![[-4.0, 0.0]],
            ..discrete
        };
        assert_eq!(poles(&continuous, 0.1), "-4 (0.25 s)");
    }

    #[test]
    fn the_matrix_says_what_is_never_told_apart() {
        let pair = |fault: &str, from: &str, instants| Separation {
            fault: fault.to_owned(),
            from: from.to_owned(),
            instants,
        };
        let achieved = Achieved {
            isolability: vec![pair("a", "b", Some(3)), pair("b", "a", None)],
            ..Achieved::default()
        };
        let text = isolability_matrix(&achieved).unwrap().to_string();
        let row = |name: &str| {
            let line = text
                .lines()
                .find(|line| line.trim_start_matches(['|', ' ']).starts_with(name));
            line.unwrap().split_whitespace().collect::<Vec<_>>().join(" ")
        };
        assert!(row("a").contains("| - | 3 instants |"), "{text}");
        assert!(row("b").contains("| never | - |"), "{text}");
        assert!(isolability_matrix(&Achieved::default()).is_none());
    }
}
