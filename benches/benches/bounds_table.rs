//! Writing and reading one record of 26 channels in the bounds table, without contention.
#![allow(
    clippy::expect_used,
    missing_docs,
    reason = "a benchmark stops on its first mistake"
)]

use criterion::{Criterion, criterion_group, criterion_main};
use residual_benches::path::tables;
use residual_shared::bounds_table::TableReader;
use residual_shared::record::StepRecord;

const CHANNELS: usize = 26;

fn table(criterion: &mut Criterion) {
    let directory = tempfile::tempdir_in("/dev/shm").expect("a tmpfs");
    let path = directory.path().join("bench.bounds");
    let mut writer = tables::create(&path, 1, CHANNELS).expect("a new table");
    let reader = TableReader::open(&path).expect("the new table");
    let record = tables::record(CHANNELS);
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
