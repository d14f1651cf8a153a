//! What the counters of the bounds table count, in a sentence each.

/// Of [`InputCounters`](residual_client::InputCounters).
const INPUTS: [(&str, &str); 11] = [
    ("accepted", "Samples taken into the inbox"),
    (
        "non_finite",
        "Samples rejected because an element is NaN or infinite",
    ),
    (
        "wrong_length",
        "Samples rejected because they have not as many elements as the input has signals",
    ),
    (
        "duplicate",
        "Samples rejected because their sequence number was seen before",
    ),
    (
        "backward",
        "Samples rejected because their time stamp is not later than that of the previous one",
    ),
    (
        "too_far_ahead",
        "Samples rejected because their time stamp lies further ahead than max_ahead_s allows",
    ),
    ("gaps", "Interruptions of the sequence numbers"),
    (
        "lost",
        "Samples missing in the interruptions of the sequence numbers",
    ),
    (
        "late",
        "Samples accepted too late for a sampling instant that had been stepped already",
    ),
    (
        "overwritten",
        "Samples pushed out of a full inbox before any diagnoser was due to see them",
    ),
    ("publisher_changes", "How often another publisher took over"),
];

/// Of [`ScheduleCounters`](residual_client::ScheduleCounters).
const SCHEDULES: [(&str, &str); 7] = [
    ("steps", "Steps done"),
    (
        "overruns",
        "Steps that began later than one period after their instant",
    ),
    (
        "skipped",
        "Sampling instants given up because the catch-up limit was reached",
    ),
    ("input_missing", "Steps with at least one missing input element"),
    (
        "max_lateness_ns",
        "Largest delay of a step behind its due time (instant and margin) since the daemon's start",
    ),
    ("max_step_ns", "Longest step since the daemon's start"),
    (
        "records_dropped",
        "Step records that the recorder queue had no room for",
    ),
];

/// The sentence on a counter of an input, or its name.
pub fn input(name: &'static str) -> &'static str {
    find(&INPUTS, name)
}

/// The sentence on a counter of a diagnoser's schedule, or its name.
pub fn schedule(name: &'static str) -> &'static str {
    find(&SCHEDULES, name)
}

fn find(texts: &[(&str, &'static str)], name: &'static str) -> &'static str {
    let text = texts.iter().find(|(counter, _)| *counter == name);
    text.map_or(name, |(_, text)| text)
}

#[cfg(test)]
mod tests {
    use residual_client::{InputCounters, ScheduleCounters};

    use super::*;

    #[test]
    fn every_counter_has_a_sentence() {
        let names = |texts: &[(&'static str, &str)]| texts.iter().map(|(name, _)| *name).collect::<Vec<_>>();
        assert_eq!(names(&INPUTS), InputCounters::NAMES);
        assert_eq!(names(&SCHEDULES), ScheduleCounters::NAMES);
    }
}
