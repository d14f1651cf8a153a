//! The JSON schemas of the topics.
//!
//! Every type is a single word: programs for plots refuse lists of types. So numbers that are none (`null`,
//! `"inf"`, `"nan:…"`) are described in words only.

use serde_json::{Value, json};

use crate::header::{Diagnoser, Input};

const NUMBER: &str =
    "null: not a number; \"inf\", \"-inf\": infinite; \"nan:BITS\": not a number, with these bits";

/// Schema of the records of a diagnoser whose channels have these keys.
pub(crate) fn record(diagnoser: &Diagnoser, keys: &[String]) -> Value {
    let channel = |(key, channel): (&String, &crate::header::ChannelOf)| {
        let own = |what: &str| number(&format!("{what}; unit: {}", in_words(&channel.unit)));
        let properties = json!({
            "lower": own("lower bound of the residual"),
            "residual": own("the residual"),
            "upper": own("upper bound of the residual"),
            "ratio": number("normalised distance to alarm, 1 at the bound; null: not evaluated"),
        });
        (key.clone(), object(&properties))
    };
    let channels: serde_json::Map<_, _> = keys.iter().zip(&diagnoser.channels).map(channel).collect();
    object(&json!({
        "sequence": integer("number of the record among those of all diagnosers; a step above 1 is a known loss"),
        "step": integer("number of the sampling instant since the daemon's epoch"),
        "instant_ns": integer("sampling instant, nanoseconds of the daemon's time"),
        "verdict": text("what the diagnoser concludes"),
        "verdict_number": integer("0 starting, 1 nominal, 2 fault, 3 isolated, 4 not evaluated, 5 guarantee lost"),
        "flags": names("what is special about this step"),
        "flag_bits": integer("the flags as bits"),
        "certainly_faulty": names("faults that are certainly present"),
        "certainly_faulty_bits": integer("the same as bits in the order of the diagnoser's faults"),
        "possibly_faulty": names("faults that may be present"),
        "possibly_faulty_bits": integer("the same as bits in the order of the diagnoser's faults"),
        "fault_estimate": number("estimate of the isolated fault"),
        "fault_estimate_half_width": number("half width or standard deviation of the estimate"),
        "inputs_valid_bits": integer("bit i: element i of measurements followed by commands was received"),
        "skipped_instants": integer("instants skipped between the previous record and this one"),
        "channels": object(&Value::Object(channels)),
    }))
}

/// Schema of the alarm transitions.
pub(crate) fn alarm() -> Value {
    object(&json!({
        "number": text("number of the transition, EPOCH.NUMBER"),
        "diagnoser": text("the diagnoser"),
        "slot": integer("the diagnoser's slot; 4294967295 for one that is gone"),
        "identity": text("identity of the diagnoser's configuration, hexadecimal"),
        "written_ns": integer("CLOCK_MONOTONIC when it was written, nanoseconds"),
        "instant_ns": integer("sampling instant that caused it, nanoseconds of the daemon's time"),
        "step": integer("number of that sampling instant"),
        "state": text("the new state"),
        "state_number": integer("0 cleared, 1 pending, 2 raised, 3 isolated"),
        "verdict": text("what the diagnoser concluded"),
        "verdict_number": integer("the verdict as a number"),
        "flags": names("what is special about this transition"),
        "flag_bits": integer("the flags as bits"),
        "occurrence": integer("how often the alarm of this diagnoser has been raised"),
        "certainly_faulty": names("faults that are certainly present"),
        "certainly_faulty_bits": integer("the same as bits in the order of the diagnoser's faults"),
        "possibly_faulty": names("faults that may be present"),
        "possibly_faulty_bits": integer("the same as bits in the order of the diagnoser's faults"),
        "channel": text("the channel with the largest ratio"),
        "channel_number": integer("its number; 4294967295 for none"),
        "ratio": number("its ratio"),
        "fault_estimate": number("estimate of the isolated fault"),
        "fault_estimate_half_width": number("half width or standard deviation of the estimate"),
    }))
}

/// Schema of the samples of an input whose signals have these keys.
pub(crate) fn sample(input: &Input, keys: &[String]) -> Value {
    let signals: serde_json::Map<_, _> = keys
        .iter()
        .zip(&input.signals)
        .map(|(key, signal)| (key.clone(), number(signal)))
        .collect();
    object(&json!({
        "sequence": integer("number of the sample among those of its publisher"),
        "timestamp_ns": integer("when the sample was taken, nanoseconds of the daemon's time"),
        "publisher": text("number of the publisher, hexadecimal"),
        "looked_ns": integer("when the recorder looked the last time before the sample was there"),
        "received_ns": integer("when the recorder had the sample"),
        "signals": object(&Value::Object(signals)),
        "surplus": { "type": "array", "items": { "type": "number" }, "description": "elements beyond the signals" },
    }))
}

fn object(properties: &Value) -> Value {
    json!({ "type": "object", "properties": properties })
}

fn text(what: &str) -> Value {
    json!({ "type": "string", "description": what })
}

fn names(what: &str) -> Value {
    json!({ "type": "array", "items": { "type": "string" }, "description": what })
}

fn integer(what: &str) -> Value {
    json!({ "type": "integer", "description": what })
}

fn number(what: &str) -> Value {
    json!({ "type": "number", "description": format!("{what}; {NUMBER}") })
}

fn in_words(unit: &str) -> &str {
    if unit.is_empty() { "none" } else { unit }
}
