//! A record of 26 channels on its way to a reader: through the bounds table, and as string diagnostics.

use std::hint::black_box;
use std::time::{Duration, Instant};

use anyhow::{Context, Result, ensure};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use residual_shared::bounds_table::{
    Access, ChannelSpec, ReadOutcome, SlotSpec, TableReader, TableSpec, TableWriter,
};
use residual_shared::clock::DaemonTime;
use residual_shared::record::{Channel, StepRecord};

use super::diagnostics::Diagnostic;
use super::timing::{Times, processor_time};
use crate::percentiles::{duration, significant};
use crate::results::{Finding, Results, Table};

const CHANNELS: usize = 26;
/// Records of a round.
const RECORDS: usize = 256;
const NAME: &str = "aircraft_actuators";

/// A way of a record to a reader.
type Way<'a> = &'a mut dyn FnMut(&StepRecord, &mut StepRecord) -> bool;

/// Compares both ways; takes `budget`.
///
/// # Errors
/// There is no tmpfs, or a record does not arrive as it was sent.
pub fn compare(budget: Duration, results: &mut Results) -> Result<()> {
    let names: Vec<String> = (0..CHANNELS)
        .map(|i| format!("mode_{}_output_{}", i / 6, i % 6))
        .collect();
    let directory = tempfile::Builder::new().prefix("rb").tempdir_in("/dev/shm")?;
    let path = directory.path().join("peers.bounds");
    let access = Access {
        group: None,
        mode: 0o600,
    };
    let mut writer = TableWriter::create(&path, &spec(&names), &access)?;
    let reader = TableReader::open(&path)?;
    let mut through_table = |record: &StepRecord, read: &mut StepRecord| {
        writer.publish(0, record);
        matches!(reader.read(0, read), Ok(ReadOutcome::Record { .. }))
    };
    let (mut bytes, mut length) = (Vec::new(), 0);
    let mut as_text = |record: &StepRecord, read: &mut StepRecord| {
        Diagnostic::of(record, NAME, &names).serialise(&mut bytes);
        length = bytes.len();
        Diagnostic::deserialise(&bytes).is_some_and(|message| message.read(&names, read))
    };
    let records = records();
    let times = {
        let mut ways: [Way<'_>; 2] = [&mut through_table, &mut as_text];
        for way in &mut ways {
            check(&records, way)?;
        }
        rounds(&records, &mut ways, budget)?
    };
    let [table_times, text_times] = &times;

    let mut table = Table::new(
        format!("Writing and reading a record of {CHANNELS} channels within one process"),
        &["way", "rounds x records", "median", "best", "median / ours"],
    );
    let ratio = text_times.median() / table_times.median();
    for (name, times) in [
        ("bounds table: publish, read".to_owned(), table_times),
        (
            format!("string diagnostics: format, serialise ({length} bytes), deserialise, parse"),
            text_times,
        ),
    ] {
        table.row([
            name,
            format!("{} x {RECORDS}", times.rounds()),
            duration(times.median()),
            duration(times.best()),
            significant(times.median() / table_times.median()),
        ]);
    }
    results.tables.push(table);
    results.findings.push(Finding::at_least(
        "record of 26 channels: string diagnostics / bounds table",
        ratio,
        1.0,
        "",
    ));
    results.notes.push(
        "String diagnostics as a ROS 2 node publishes them: one DiagnosticStatus with a key and a value of text for each \
         number, serialised as CDR, deserialised by the reader and parsed back into numbers. Both ways give every number \
         back to the last bit, which is checked before. The strings stay within one process and pay for no transport; \
         the bounds table is the real one in shared memory."
            .to_owned(),
    );
    Ok(())
}

fn rounds(records: &[StepRecord], ways: &mut [Way<'_>; 2], budget: Duration) -> Result<[Times; 2]> {
    let mut times = [Times::default(), Times::default()];
    let mut read = StepRecord::new(CHANNELS);
    let begin = Instant::now();
    while begin.elapsed() < budget {
        for (way, times) in ways.iter_mut().zip(&mut times) {
            // The first pass brings back what the other way has driven from the caches.
            for counts in [false, true] {
                let begin = processor_time()?;
                for record in records {
                    black_box(way(record, &mut read));
                    black_box(&read);
                }
                if counts {
                    times.add(processor_time()?.saturating_sub(begin), records.len());
                }
            }
        }
    }
    Ok(times)
}

/// Every number arrives as it was sent.
fn check(records: &[StepRecord], way: &mut dyn FnMut(&StepRecord, &mut StepRecord) -> bool) -> Result<()> {
    for record in records {
        let mut read = StepRecord::new(CHANNELS);
        ensure!(way(record, &mut read), "a record does not arrive");
        let equal = record.channels() == read.channels();
        ensure!(
            equal && record.step == read.step,
            "record {} arrives with other numbers",
            record.step
        );
    }
    records.first().context("no records").map(drop)
}

/// Records as a bank of filters makes them.
fn records() -> Vec<StepRecord> {
    let mut generator = ChaCha8Rng::seed_from_u64(3);
    let one = |step: usize| {
        let mut record = StepRecord::new(CHANNELS);
        record.step = step as u64;
        record.instant_ns = 10_000_000 * record.step;
        for channel in record.channels_mut() {
            let half_width = generator.random_range(0.01..0.2_f64);
            *channel = Channel::two_sided(half_width * generator.random_range(-1.0..1.0_f64), half_width);
        }
        record
    };
    (1..=RECORDS).map(one).collect()
}

fn spec(names: &[String]) -> TableSpec {
    let channel = |name: &String| ChannelSpec {
        name: name.clone(),
        unit: String::new(),
    };
    TableSpec {
        instance: "peers".to_owned(),
        slots: vec![SlotSpec {
            name: NAME.to_owned(),
            method: "none".to_owned(),
            period_ns: 10_000_000,
            phase_ns: 0,
            margin_ns: 0,
            channels: names.iter().map(channel).collect(),
            faults: Vec::new(),
        }],
        inputs: Vec::new(),
        time: DaemonTime::MONOTONIC,
        schedule_epoch_ns: 0,
        stale_after_periods: 3,
        alarm_capacity: 64,
    }
}
