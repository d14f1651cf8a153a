//! What gains achieve, in words for people.

use comfy_table::Table;
use comfy_table::presets::ASCII_MARKDOWN;
use residual_diagnosis::achieved::{
    Achieved, FalseAlarms, FaultSensitivity, Need, Norm, Poles, Separation, SizeOf, Threshold, TimeDomain,
};

/// Significant digits of a number that only informs.
const DIGITS: usize = 4;

/// A discrete-time pole below this modulus is zero but for rounding.
const DEAD_BEAT: f64 = 1e-9;

/// What the gains achieve, in short: name and value. `residuald explain` says all of it.
pub(super) fn summary(achieved: &Achieved) -> Vec<(&'static str, String)> {
    let entries =
        |name: &'static str, values: Vec<String>| values.into_iter().map(move |value| (name, value));
    let conditions = smallest_margin(achieved).into_iter().collect();
    let detected = smallest_faults(achieved).into_iter().collect();
    let alarms = achieved.false_alarms.iter().map(false_alarms).collect();
    entries("conditions", conditions)
        .chain(entries("detected", detected))
        .chain(entries("smallest faults", not_stated(achieved)))
        .chain(entries("false alarms", alarms))
        .chain(entries("never fire", never_firing(&achieved.thresholds)))
        .chain(entries("insensitive", insensitive(&achieved.thresholds)))
        .collect()
}

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
pub(super) fn with_unit(value: f64, unit: &str) -> String {
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

/// Alarms without a fault, and what must be true for that; or why their rate is unknown.
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
        return format!("unknown: {}", alarms.provided_that);
    }
    format!("{}, provided that {}", parts.join(", "), alarms.provided_that)
}

/// The faults that are surely, or likely, seen: of each the smallest size.
pub(super) fn smallest_faults(achieved: &Achieved) -> Option<String> {
    let stated = |fault: &&FaultSensitivity| !achieved.is_not_stated(SizeOf::Detectable, &fault.fault);
    let describe = |fault: &FaultSensitivity| match fault.detectable {
        Some(size) => format!(
            "{} from {}{}",
            fault.fault,
            with_unit(size, &fault.unit),
            assurance(fault.assurance)
        ),
        None => format!("{} at no size", fault.fault),
    };
    let stated: Vec<String> = achieved.faults.iter().filter(stated).map(describe).collect();
    if stated.is_empty() {
        return None;
    }
    let sizes = stated.join(", ");
    Some(match conditions(&achieved.faults) {
        Some(conditions) => format!("{sizes}, provided that {conditions}"),
        None => sizes,
    })
}

/// What nobody knows of the smallest constant faults, one text for each reason.
pub(super) fn not_stated(achieved: &Achieved) -> Vec<String> {
    let mut reasons: Vec<(&str, &[String], Vec<&str>)> = Vec::new();
    for not in &achieved.not_stated {
        let size = match not.size {
            SizeOf::Detectable => "detected",
            SizeOf::Isolable => "isolated",
        };
        let known = reasons
            .iter_mut()
            .find(|(because, faults, _)| *because == not.because && *faults == not.faults);
        match known {
            Some((.., sizes)) => sizes.push(size),
            None => reasons.push((&not.because, &not.faults, vec![size])),
        }
    }
    let describe = |(because, faults, sizes): (&str, &[String], Vec<&str>)| {
        let of = match faults {
            [] => String::new(),
            _ => format!(" of {}", faults.join(", ")),
        };
        format!(
            "sizes{of} that are {}: not stated, because {because}",
            sizes.join(" or ")
        )
    };
    reasons.into_iter().map(describe).collect()
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
    by_reason(thresholds, |threshold| threshold.never_fires.as_deref())
}

/// The channels whose alarms nobody can rely on, one text for each reason.
pub(super) fn insensitive(thresholds: &[Threshold]) -> Vec<String> {
    by_reason(thresholds, |threshold| threshold.insensitive.as_deref())
}

fn by_reason(thresholds: &[Threshold], reason: impl Fn(&Threshold) -> Option<&str>) -> Vec<String> {
    let mut reasons: Vec<(&str, Vec<&str>)> = Vec::new();
    for threshold in thresholds {
        let Some(reason) = reason(threshold) else {
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
pub(super) fn fault_table(achieved: &Achieved) -> Option<Table> {
    let mut table = table(["fault", "detected from", "isolated from", "assurance"].map(str::to_owned));
    for fault in &achieved.faults {
        let size = |of: SizeOf, size: Option<f64>| match size {
            Some(size) => with_unit(size, &fault.unit),
            None if achieved.is_not_stated(of, &fault.fault) => "not stated".to_owned(),
            None => "never".to_owned(),
        };
        let assurance = match fault.assurance {
            1.0.. => "guaranteed".to_owned(),
            0.0 => "none".to_owned(),
            probability => format!("probability {}", number(probability)),
        };
        table.add_row([
            fault.fault.clone(),
            size(SizeOf::Detectable, fault.detectable),
            size(SizeOf::Isolable, fault.isolable),
            assurance,
        ]);
    }
    (!table.is_empty()).then_some(table)
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
            pair.map_or("-".to_owned(), needed)
        };
        table.add_row(std::iter::once(row.to_owned()).chain(columns.iter().map(cell)));
    }
    (!table.is_empty()).then_some(table)
}

/// What it takes to tell the faults of a pair apart.
fn needed(pair: &Separation) -> String {
    let instants = match pair.instants {
        Some(1) => "1 instant".to_owned(),
        Some(instants) => format!("{instants} instants"),
        None => return "never".to_owned(),
    };
    match pair.need {
        Need::Instants => instants,
        Need::AtLeast => format!("at least {instants}"),
        Need::Transients => "by transients only".to_owned(),
    }
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
    use residual_diagnosis::achieved::NotStated;

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
        let pair = |fault: &str, from: &str, instants, need| Separation {
            fault: fault.to_owned(),
            from: from.to_owned(),
            instants,
            need,
        };
        let achieved = Achieved {
            isolability: vec![
                pair("a", "b", Some(3), Need::Instants),
                pair("a", "c", Some(2), Need::AtLeast),
                pair("b", "a", None, Need::Instants),
                pair("b", "c", Some(2), Need::Transients),
            ],
            ..Achieved::default()
        };
        let text = isolability_matrix(&achieved).unwrap().to_string();
        assert!(
            row(&text, "a").contains("| 3 instants | at least 2 instants |"),
            "{text}"
        );
        assert!(
            row(&text, "b").contains("| - | by transients only |") && row(&text, "b").contains("| never |"),
            "{text}"
        );
        assert!(isolability_matrix(&Achieved::default()).is_none());
    }

    /// The row of a table that begins with this name, with single spaces.
    fn row(table: &str, name: &str) -> String {
        let line = table
            .lines()
            .find(|line| line.trim_start_matches(['|', ' ']).starts_with(name));
        line.unwrap().split_whitespace().collect::<Vec<_>>().join(" ")
    }

    fn fault(name: &str, detectable: Option<f64>) -> FaultSensitivity {
        FaultSensitivity {
            provided_that: String::new(),
            fault: name.to_owned(),
            unit: String::new(),
            assurance: 0.9,
            detectable,
            isolable: None,
            delays: Vec::new(),
        }
    }

    #[test]
    fn what_nobody_knows_is_not_said_to_be_never() {
        let not = |size, faults: &[&str], because: &str| NotStated {
            size,
            faults: faults.iter().map(|name| (*name).to_owned()).collect(),
            because: because.to_owned(),
        };
        let mut achieved = Achieved {
            faults: vec![fault("a", Some(2.0)), fault("b", None), fault("c", None)],
            not_stated: vec![
                not(SizeOf::Detectable, &["c"], "no formula"),
                not(SizeOf::Isolable, &[], "noise"),
            ],
            ..Achieved::default()
        };
        let text = fault_table(&achieved).unwrap().to_string();
        assert!(row(&text, "a").starts_with("| a | 2 | not stated |"), "{text}");
        assert!(
            row(&text, "b").starts_with("| b | never | not stated |"),
            "{text}"
        );
        assert!(
            row(&text, "c").starts_with("| c | not stated | not stated |"),
            "{text}"
        );
        assert_eq!(
            not_stated(&achieved),
            [
                "sizes of c that are detected: not stated, because no formula",
                "sizes that are isolated: not stated, because noise"
            ]
        );
        assert_eq!(
            smallest_faults(&achieved).unwrap(),
            "a from 2 (with probability 0.9), b at no size"
        );
        achieved.not_stated = [SizeOf::Detectable, SizeOf::Isolable]
            .map(|size| not(size, &[], "noise"))
            .to_vec();
        assert_eq!(
            not_stated(&achieved),
            ["sizes that are detected or isolated: not stated, because noise"]
        );
        assert_eq!(smallest_faults(&achieved), None);
    }

    #[test]
    fn a_rate_that_nobody_knows_is_said_to_be_unknown() {
        let mut alarms = FalseAlarms {
            probability_per_instant: None,
            expected_per_hour: None,
            provided_that: "the threshold is fixed".to_owned(),
        };
        assert_eq!(false_alarms(&alarms), "unknown: the threshold is fixed");
        alarms.probability_per_instant = Some(0.0);
        assert_eq!(
            false_alarms(&alarms),
            "none at all, provided that the threshold is fixed"
        );
    }

    #[test]
    fn channels_that_cannot_fire_and_channels_that_may_miss_everything_are_listed_apart() {
        let threshold = |channel: &str, never_fires: Option<&str>, insensitive: Option<&str>| Threshold {
            channel: channel.to_owned(),
            settled: 1.0,
            never_fires: never_fires.map(str::to_owned),
            insensitive: insensitive.map(str::to_owned),
        };
        let thresholds = [
            threshold("a", Some("blind"), None),
            threshold("b", None, Some("inert")),
            threshold("c", None, None),
            threshold("d", None, Some("inert")),
        ];
        assert_eq!(never_firing(&thresholds), ["a: blind"]);
        assert_eq!(insensitive(&thresholds), ["b, d: inert"]);
    }
}
