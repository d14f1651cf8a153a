//! An alarm transition as a message: `/INSTANCE/alarms`.

use residual_shared::alarm::{AlarmState, AlarmTransition, alarm_flags};
use residual_shared::record::{Verdict, fault_names};
use serde::{Deserialize, Serialize};

use super::MessageError;
use crate::header::Diagnoser;
use crate::number::Number;

#[derive(Serialize)]
struct Written<'a> {
    number: String,
    diagnoser: &'a str,
    slot: u32,
    identity: String,
    written_ns: u64,
    instant_ns: u64,
    step: u64,
    state: &'static str,
    state_number: u32,
    verdict: &'static str,
    verdict_number: u32,
    flags: Vec<&'static str>,
    flag_bits: u32,
    occurrence: u64,
    certainly_faulty: Vec<&'a str>,
    certainly_faulty_bits: u64,
    possibly_faulty: Vec<&'a str>,
    possibly_faulty_bits: u64,
    channel: &'a str,
    channel_number: u32,
    ratio: Number,
    fault_estimate: Number,
    fault_estimate_half_width: Number,
}

#[derive(Deserialize)]
struct Read {
    number: String,
    slot: u32,
    identity: String,
    written_ns: u64,
    instant_ns: u64,
    step: u64,
    state_number: u32,
    verdict_number: u32,
    flag_bits: u32,
    occurrence: u64,
    certainly_faulty_bits: u64,
    possibly_faulty_bits: u64,
    channel_number: u32,
    ratio: Number,
    fault_estimate: Number,
    fault_estimate_half_width: Number,
}

/// Appends the transition as JSON, with the names of one of `diagnosers`.
pub(crate) fn write(
    transition: &AlarmTransition,
    diagnosers: &[Diagnoser],
    into: &mut Vec<u8>,
) -> serde_json::Result<()> {
    let index = |number: u32| usize::try_from(number).unwrap_or(usize::MAX);
    let diagnoser = diagnosers.get(index(transition.slot));
    let faults = diagnoser.map_or(&[][..], |diagnoser| &diagnoser.faults);
    let channel = diagnoser.and_then(|diagnoser| diagnoser.channels.get(index(transition.channel)));
    let verdict = Verdict::from_number(transition.verdict);
    let written = Written {
        number: transition.number.to_string(),
        diagnoser: diagnoser.map_or("", |diagnoser| &diagnoser.name),
        slot: transition.slot,
        identity: format!("{:x}", transition.identity),
        written_ns: transition.written_ns,
        instant_ns: transition.instant_ns,
        step: transition.step,
        state: transition.state.name(),
        state_number: transition.state as u32,
        verdict: verdict.unwrap_or(Verdict::NotEvaluated).name(),
        verdict_number: transition.verdict,
        flags: alarm_flags::names(transition.flags).collect(),
        flag_bits: transition.flags,
        occurrence: transition.occurrence,
        certainly_faulty: fault_names(faults, transition.certainly_faulty).collect(),
        certainly_faulty_bits: transition.certainly_faulty,
        possibly_faulty: fault_names(faults, transition.possibly_faulty).collect(),
        possibly_faulty_bits: transition.possibly_faulty,
        channel: channel.map_or("", |channel| &channel.name),
        channel_number: transition.channel,
        ratio: Number(transition.ratio),
        fault_estimate: Number(transition.fault_estimate),
        fault_estimate_half_width: Number(transition.fault_estimate_half_width),
    };
    serde_json::to_writer(into, &written)
}

/// The transition in `json`.
pub(crate) fn read(json: &[u8]) -> Result<AlarmTransition, MessageError> {
    let read: Read = serde_json::from_slice(json)?;
    let identity = u64::from_str_radix(&read.identity, 16);
    Ok(AlarmTransition {
        number: read.number.parse()?,
        written_ns: read.written_ns,
        instant_ns: read.instant_ns,
        step: read.step,
        slot: read.slot,
        identity: identity.map_err(|_| MessageError::NotHexadecimal(read.identity))?,
        state: AlarmState::from_number(read.state_number).ok_or(MessageError::State(read.state_number))?,
        flags: read.flag_bits,
        verdict: read.verdict_number,
        occurrence: read.occurrence,
        certainly_faulty: read.certainly_faulty_bits,
        possibly_faulty: read.possibly_faulty_bits,
        channel: read.channel_number,
        ratio: read.ratio.0,
        fault_estimate: read.fault_estimate.0,
        fault_estimate_half_width: read.fault_estimate_half_width.0,
    })
}
