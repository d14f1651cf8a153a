//! Compares what the client saw with what the scenarios must show.

use comfy_table::Table;
use comfy_table::presets::ASCII_MARKDOWN;

use super::client::Seen;
use super::scenario::{Expectation, Scenario};
use crate::summary::Summary;

/// What is wrong with what one diagnoser said; `None` if nothing.
fn objection(expectation: &Expectation, seen: &Seen) -> Option<&'static str> {
    let latest_ns = (expectation.onset_s + expectation.detect_within_s) * 1e9;
    let isolated_right = match (expectation.isolates, &seen.isolated) {
        (Some(name), Some((_, names))) => names.len() == 1 && names[0] == name,
        (Some(_), None) => false,
        (None, _) => true,
    };
    match &seen.detected {
        _ if seen.false_alarms > 0 => Some("false alarms"),
        None => Some("not detected"),
        Some((time_ns, _)) if *time_ns as f64 > latest_ns + 1.0 => Some("detected too late"),
        Some(_) if !isolated_right => Some("not isolated"),
        Some(_) => None,
    }
}

/// Prints the table of all diagnosers and what the daemon did; true if everything was as it should be.
pub fn judge(scenarios: &[&Scenario], seen: &[Seen], summary: &Summary) -> bool {
    let mut table = Table::new();
    table.load_style(ASCII_MARKDOWN);
    table.set_header([
        "method",
        "diagnoser",
        "period",
        "fault",
        "onset",
        "detected",
        "first by",
        "isolated",
        "estimate",
        "false alarms",
        "result",
    ]);
    let mut all_good = true;
    for scenario in scenarios {
        for expectation in scenario.expectations {
            let Some(seen) = seen.iter().find(|seen| seen.diagnoser == expectation.diagnoser) else {
                all_good = false;
                continue;
            };
            let objection = objection(expectation, seen);
            all_good &= objection.is_none();
            table.add_row(row(scenario, expectation, seen, objection));
        }
    }
    println!("\n{table}");
    let (records, missed) = seen.iter().fold((0, 0), |(records, missed), seen| {
        (records + seen.records, missed + seen.missed)
    });
    println!("records polled    {records} ({missed} overwritten before they were read)");
    println!(
        "steps             {}, instants skipped {}, overruns {}",
        summary.schedule_total("steps"),
        summary.schedule_total("skipped"),
        summary.schedule_total("overruns")
    );
    println!("step time         {}", summary.step_times);
    println!(
        "result            {}",
        if all_good { "as it should be" } else { "WRONG" }
    );
    all_good
}

fn row(
    scenario: &Scenario,
    expectation: &Expectation,
    seen: &Seen,
    objection: Option<&'static str>,
) -> [String; 11] {
    let onset_ns = expectation.onset_s * 1e9;
    let after = |time_ns: u64| format!("+{:.2} s", (time_ns as f64 - onset_ns) * 1e-9);
    [
        scenario.method.to_owned(),
        seen.diagnoser.clone(),
        format!("{} ms", seen.period_ns as f64 * 1e-6),
        expectation.fault.to_owned(),
        format!("{:.2} s", expectation.onset_s),
        seen.detected
            .as_ref()
            .map_or("no".to_owned(), |(time_ns, _)| after(*time_ns)),
        seen.detected
            .as_ref()
            .and_then(|(_, channels)| channels.first().cloned())
            .unwrap_or_default(),
        match (&seen.isolated, expectation.isolates) {
            (Some((time_ns, names)), _) => format!("{} {}", names.join("+"), after(*time_ns)),
            (None, Some(_)) => "no".to_owned(),
            (None, None) => "-".to_owned(),
        },
        seen.estimate.map_or("-".to_owned(), |(value, width)| {
            format!("{value:+.3} ± {width:.3}")
        }),
        seen.false_alarms.to_string(),
        objection.unwrap_or("good").to_owned(),
    ]
}

#[cfg(test)]
mod tests {
    use super::*;

    const EXPECTATION: Expectation = Expectation {
        diagnoser: "d",
        fault: "f",
        onset_s: 1.0,
        detect_within_s: 0.5,
        isolates: Some("pump"),
    };

    fn seen(detected_ns: Option<u64>, isolated: Option<&str>, false_alarms: u64) -> Seen {
        Seen {
            detected: detected_ns.map(|time_ns| (time_ns, vec![])),
            isolated: isolated.map(|name| (1_200_000_000, vec![name.to_owned()])),
            false_alarms,
            ..Seen::default()
        }
    }

    #[test]
    fn only_the_right_fault_in_time_without_false_alarms_is_good() {
        let at = 1_100_000_000;
        assert_eq!(objection(&EXPECTATION, &seen(Some(at), Some("pump"), 0)), None);
        assert_eq!(
            objection(&EXPECTATION, &seen(Some(at), Some("pump"), 1)),
            Some("false alarms")
        );
        assert_eq!(
            objection(&EXPECTATION, &seen(None, None, 0)),
            Some("not detected")
        );
        assert_eq!(
            objection(&EXPECTATION, &seen(Some(1_600_000_000), Some("pump"), 0)),
            Some("detected too late")
        );
        assert_eq!(
            objection(&EXPECTATION, &seen(Some(at), Some("valve"), 0)),
            Some("not isolated")
        );
        assert_eq!(
            objection(&EXPECTATION, &seen(Some(at), None, 0)),
            Some("not isolated")
        );
    }
}
