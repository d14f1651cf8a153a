//! Step records in C.

use std::time::Duration;

use residual::{Channel, Freshness, MAX_CHANNELS, Reading, StepRecord, Verdict, flags};

/// Channels for which a record has room.
pub const RESIDUAL_MAX_CHANNELS: usize = 64;

const _: () = assert!(RESIDUAL_MAX_CHANNELS == MAX_CHANNELS);

/// Instants were skipped between the record before and this one.
pub const RESIDUAL_FLAG_INSTANTS_SKIPPED: u32 = 1;
/// The step began later than one period after its sampling instant.
pub const RESIDUAL_FLAG_OVERRUN: u32 = 2;
/// At least one sample that the step should have used was missing.
pub const RESIDUAL_FLAG_INPUT_MISSING: u32 = 4;
/// A sample for an earlier instant arrived after that instant had been stepped.
pub const RESIDUAL_FLAG_LATE_SAMPLE: u32 = 8;
/// A test alarmed at this very instant.
pub const RESIDUAL_FLAG_ALARM_NOW: u32 = 16;
/// The diagnoser was reset, wholly or in part, at this instant.
pub const RESIDUAL_FLAG_RESET: u32 = 32;
/// A fault of the configured size could not be detected with the present thresholds.
pub const RESIDUAL_FLAG_THRESHOLD_INERT: u32 = 64;

const _: () = assert!(
    RESIDUAL_FLAG_INSTANTS_SKIPPED == flags::INSTANTS_SKIPPED
        && RESIDUAL_FLAG_OVERRUN == flags::OVERRUN
        && RESIDUAL_FLAG_INPUT_MISSING == flags::INPUT_MISSING
        && RESIDUAL_FLAG_LATE_SAMPLE == flags::LATE_SAMPLE
        && RESIDUAL_FLAG_ALARM_NOW == flags::ALARM_NOW
        && RESIDUAL_FLAG_RESET == flags::RESET
        && RESIDUAL_FLAG_THRESHOLD_INERT == flags::THRESHOLD_INERT
);

/// A residual between its bounds, in the channel's unit.
#[repr(C)]
#[derive(Clone, Copy)]
pub struct residual_channel {
    /// Lower bound.
    pub lower: f64,
    /// The residual.
    pub residual: f64,
    /// Upper bound.
    pub upper: f64,
    /// Distance to alarm: 1 at the bound, above 1 (or infinite) beyond it. NaN: not evaluated at this instant.
    pub ratio: f64,
}

/// What a diagnoser concludes.
#[repr(C)]
#[derive(Clone, Copy)]
pub enum residual_verdict {
    /// No complete input has arrived yet.
    Starting = 0,
    /// Evaluated, no fault.
    Nominal = 1,
    /// A fault is detected but not isolated.
    Fault = 2,
    /// The faulty component is known.
    Isolated = 3,
    /// Nothing could be tested at this instant.
    NotEvaluated = 4,
    /// The method can guarantee nothing until it has been reset.
    GuaranteeLost = 5,
}

const _: () = assert!(
    residual_verdict::Starting as u32 == Verdict::Starting as u32
        && residual_verdict::Nominal as u32 == Verdict::Nominal as u32
        && residual_verdict::Fault as u32 == Verdict::Fault as u32
        && residual_verdict::Isolated as u32 == Verdict::Isolated as u32
        && residual_verdict::NotEvaluated as u32 == Verdict::NotEvaluated as u32
        && residual_verdict::GuaranteeLost as u32 == Verdict::GuaranteeLost as u32
);

/// What a diagnoser says at one sampling instant. Bit j of a fault set is fault j of the diagnoser.
#[repr(C)]
#[derive(Clone, Copy)]
pub struct residual_record {
    /// Number of the sampling instant since the daemon's epoch.
    pub step: u64,
    /// The sampling instant, nanoseconds of the daemon's time.
    pub instant_ns: u64,
    /// Faults that are certainly present.
    pub certainly_faulty: u64,
    /// Faults that may be present.
    pub possibly_faulty: u64,
    /// Bit i: element i of measurements followed by commands was received for this instant.
    pub inputs_valid: u64,
    /// Estimate of the isolated fault; NaN for none.
    pub fault_estimate: f64,
    /// Half width or standard deviation of the estimate; NaN for none.
    pub fault_estimate_half_width: f64,
    /// A residual_verdict; a number that is none means not evaluated.
    pub verdict: u32,
    /// Bits RESIDUAL_FLAG_….
    pub flags: u32,
    /// Instants skipped between the record before and this one.
    pub skipped_instants: u32,
    /// How many of `channels` are used.
    pub channel_count: u32,
    /// The channels.
    pub channels: [residual_channel; RESIDUAL_MAX_CHANNELS],
}

/// How much a record is worth at the moment it is read.
#[repr(C)]
#[derive(Clone, Copy)]
pub enum residual_freshness {
    /// Evaluated at one of the latest sampling instants: the only one that says something about the plant now.
    Fresh = 0,
    /// The daemon lives, but the diagnoser has written nothing newer for too long.
    Stale = 1,
    /// The latest instant could not be evaluated, for want of a valid input.
    NotEvaluated = 2,
    /// The diagnoser has not had a complete input yet.
    Starting = 3,
    /// The daemon has ended, hangs, or was never there.
    Dead = 4,
}

/// What a read gave.
#[repr(C)]
#[derive(Clone, Copy)]
pub struct residual_reading {
    /// How much the record is worth.
    pub freshness: residual_freshness,
    /// Age of a stale record, nanoseconds; otherwise 0.
    pub age_ns: u64,
    /// Number of the record, from 1 in this life of the daemon: a larger one is a newer record. 0: there is none.
    pub number: u64,
    /// Number of the daemon's life; larger after a restart. 0: there has not been a daemon.
    pub epoch: u64,
}

impl From<Channel> for residual_channel {
    fn from(channel: Channel) -> Self {
        let Channel {
            lower,
            residual,
            upper,
            ratio,
        } = channel;
        Self {
            lower,
            residual,
            upper,
            ratio,
        }
    }
}

impl From<&StepRecord> for residual_record {
    fn from(record: &StepRecord) -> Self {
        Self {
            step: record.step,
            instant_ns: record.instant_ns,
            certainly_faulty: record.certainly_faulty,
            possibly_faulty: record.possibly_faulty,
            inputs_valid: record.inputs_valid,
            fault_estimate: record.fault_estimate,
            fault_estimate_half_width: record.fault_estimate_half_width,
            verdict: record.verdict,
            flags: record.flags,
            skipped_instants: record.skipped_instants,
            channel_count: record.channel_count,
            channels: record.channels.map(residual_channel::from),
        }
    }
}

impl From<Reading> for residual_reading {
    fn from(reading: Reading) -> Self {
        let (freshness, age) = match reading.freshness {
            Freshness::Fresh => (residual_freshness::Fresh, Duration::ZERO),
            Freshness::Stale { age } => (residual_freshness::Stale, age),
            Freshness::NotEvaluated => (residual_freshness::NotEvaluated, Duration::ZERO),
            Freshness::Starting => (residual_freshness::Starting, Duration::ZERO),
            Freshness::Dead => (residual_freshness::Dead, Duration::ZERO),
        };
        Self {
            freshness,
            age_ns: u64::try_from(age.as_nanos()).unwrap_or(u64::MAX),
            number: reading.number,
            epoch: reading.epoch,
        }
    }
}
