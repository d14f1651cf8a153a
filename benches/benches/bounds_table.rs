//! Writing and reading one record of 26 channels in the bounds table, without contention.
#![allow(
    clippy::expect_used,
    missing_docs,
    reason = "a benchmark stops on its first mistake"
)]

use criterion::{Criterion, criterion_group, criterion_main};
use residual_shared::bounds_table::{Access, ChannelSpec, SlotSpec, TableReader, TableSpec, TableWriter};
use residual_shared::clock::DaemonTime;
use residual_shared::record::{Channel, StepRecord};

const CHANNELS: usize = 26;

fn table(criterion: &mut Criterion) {
    let directory = tempfile::tempdir_in("/dev/shm").expect("a tmpfs");
    let path = directory.path().join("bench.bounds");
    let channel = |index| ChannelSpec {
        name: format!("channel_{index}"),
        unit: String::new(),
    };
    let slot = SlotSpec {
        name: "bench".into(),
        method: "none".into(),
        period_ns: 1_000_000,
        phase_ns: 0,
        margin_ns: 0,
        channels: (0..CHANNELS).map(channel).collect(),
        faults: Vec::new(),
    };
    let spec = TableSpec {
        instance: "bench".into(),
        slots: vec![slot],
        inputs: Vec::new(),
        time: DaemonTime::MONOTONIC,
        schedule_epoch_ns: 0,
        stale_after_periods: 3,
        alarm_capacity: 64,
    };
    let access = Access {
        group: None,
        mode: 0o600,
    };
    let mut writer = TableWriter::create(&path, &spec, &access).expect("a new table");
    let reader = TableReader::open(&path).expect("the new table");
    let mut record = StepRecord::new(CHANNELS);
    record.channels_mut().fill(Channel::two_sided(0.5, 1.0));
    writer.publish(0, &record);
    criterion.bench_function("publish a record of 26 channels", |bencher| {
        bencher.iter(|| writer.publish(0, &record));
    });
    let mut copy = StepRecord::new(CHANNELS);
    criterion.bench_function("read a record of 26 channels", |bencher| {
        bencher.iter(|| reader.read(0, &mut copy));
    });
}

criterion_group!(benches, table);
criterion_main!(benches);
