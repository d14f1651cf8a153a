//! `[[input]]`.

use super::quantity::duration_ns;
use super::{check_name, check_range, refuse_duplicates};
use crate::configuration::InputConfiguration;
use crate::configuration::locate::Mistakes;
use crate::configuration::schema::Input;

/// Most signals of one input.
const MAX_SIGNALS: usize = 1024;

/// Most samples that an input keeps.
const MAX_BUFFER_SAMPLES: u64 = 65_536;

/// Most publishers of one input.
const MAX_PUBLISHERS: u64 = 64;

/// Longest allowance for stamps in the future, one day.
const MAX_AHEAD_S: f64 = 86_400.0;

pub(in crate::configuration) fn input(
    path: &str,
    section: Input,
    mistakes: &mut Mistakes<'_>,
) -> InputConfiguration {
    let at = |key: &str| format!("{path}.{key}");
    check_name(&at("name"), &section.name, "input", mistakes);
    let count = section.signals.len();
    if count == 0 || count > MAX_SIGNALS {
        mistakes.at(
            &at("signals"),
            format!("the input `{}` has {count} signals", section.name),
            format!("name 1 to {MAX_SIGNALS} signals, one per element of a sample"),
        );
    }
    let signal = |index: usize| format!("{path}.signals.{index}");
    for (index, name) in section.signals.iter().enumerate() {
        check_name(&signal(index), name, "signal", mistakes);
    }
    refuse_duplicates(section.signals.iter().map(String::as_str), signal, "signal", mistakes);
    let units = section.units.unwrap_or_else(|| vec![String::new(); count]);
    if units.len() != count {
        mistakes.at(
            &at("units"),
            format!("the input `{}` has {count} signals but {} units", section.name, units.len()),
            "give one unit per signal (\"\" for none), or leave `units` out",
        );
    }
    check_range(
        &at("buffer_samples"),
        section.buffer_samples as u64,
        1,
        MAX_BUFFER_SAMPLES,
        "number of kept samples",
        mistakes,
    );
    check_range(
        &at("max_publishers"),
        section.max_publishers as u64,
        1,
        MAX_PUBLISHERS,
        "number of publishers",
        mistakes,
    );
    let limit = "use 0 to 86400 s (one day)";
    let max_ahead_ns = duration_ns(&at("max_ahead_s"), section.max_ahead_s, MAX_AHEAD_S, limit, mistakes);
    InputConfiguration {
        name: section.name,
        signals: section.signals,
        units,
        buffer_samples: section.buffer_samples,
        max_ahead_ns: max_ahead_ns.unwrap_or_default(),
        max_publishers: section.max_publishers,
    }
}
