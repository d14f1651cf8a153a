//! A daemon's header, and messages for it.
#![allow(dead_code)] // Not every test file needs every helper.

use residual_recording::header::{ChannelOf, Diagnoser, Header, Input};
use residual_recording::{RecordMessage, SampleMessage};
use residual_shared::alarm::{AlarmNumber, AlarmState, AlarmTransition};
use residual_shared::clock::DaemonTime;
use residual_shared::record::{Channel, StepRecord, Verdict};
use residual_shared::sample::SampleHeader;

/// The diagnosers `front` (two channels) and `rear` (none), and the input `imu`.
pub fn header() -> Header {
    let channel = |name: &str, unit: &str| ChannelOf {
        name: name.into(),
        unit: unit.into(),
    };
    let diagnoser = |name: &str, channels| Diagnoser {
        name: name.into(),
        method: "chi_square".into(),
        period_ns: 10_000_000,
        phase_ns: 3,
        margin_ns: 4,
        channels,
        faults: vec!["pump".into(), "valve \"2\"".into()],
    };
    Header {
        instance: "vtol".into(),
        epoch: 1_764_000_000_000_000_017,
        pid: 99,
        time: DaemonTime {
            origin_ns: 5_000,
            speed: 1.0,
        },
        wall_clock_offset_ns: 1_764_000_000_000_000_000,
        schedule_epoch_ns: 7_000,
        configuration: Some("/etc/residuald/vtol.toml".into()),
        earlier_samples: 3,
        diagnosers: vec![
            diagnoser("front", vec![channel("force", "N"), channel("yaw rate", "rad/s")]),
            diagnoser("rear", vec![]),
        ],
        inputs: vec![Input {
            name: "imu".into(),
            signals: vec!["ax".into(), "ay".into()],
        }],
    }
}

/// A record of the diagnoser in `slot`.
pub fn record(slot: usize, step: u64) -> RecordMessage {
    let mut record = StepRecord::new(2 - 2 * slot);
    record.step = step;
    record.instant_ns = 1_000_000_000 + 10_000_000 * step;
    record.verdict = Verdict::Isolated as u32;
    record.certainly_faulty = 0b10;
    record.possibly_faulty = 0b11;
    if let [force, yaw] = record.channels_mut() {
        *force = Channel::two_sided(0.1 * step as f64, 2.0);
        *yaw = Channel::NOT_EVALUATED;
    }
    RecordMessage {
        sequence: step,
        slot,
        record,
    }
}

/// An alarm transition of the diagnoser `front`.
pub fn alarm(state: AlarmState) -> AlarmTransition {
    AlarmTransition {
        number: AlarmNumber {
            epoch: 1_764_000_000_000_000_017,
            number: 3,
        },
        written_ns: 1_000_000_123,
        instant_ns: 1_000_000_000,
        step: 4,
        slot: 0,
        identity: u64::MAX - 7,
        state,
        flags: 1,
        verdict: Verdict::Isolated as u32,
        occurrence: 2,
        certainly_faulty: 0b10,
        possibly_faulty: 0b11,
        channel: 1,
        ratio: 1.5,
        fault_estimate: 0.1,
        fault_estimate_half_width: f64::INFINITY,
    }
}

/// A sample of the input `imu`.
pub fn sample(sequence: u64, timestamp_ns: u64, elements: &[f64]) -> SampleMessage {
    SampleMessage {
        input: 0,
        publisher: u128::MAX - 3,
        header: SampleHeader {
            sequence,
            timestamp_ns,
        },
        looked_ns: timestamp_ns - 1,
        received_ns: timestamp_ns + 1,
        elements: elements.to_vec(),
    }
}
