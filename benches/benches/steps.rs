//! One step of every method in every mode, on random plants with 2, 4, 6 and 12 states (module `steps`).
#![allow(
    clippy::expect_used,
    missing_docs,
    reason = "a benchmark stops on its first mistake"
)]

use std::time::Duration;

use criterion::{Criterion, criterion_group, criterion_main};
use residual_benches::steps::cases;
use residual_benches::steps::instructions::WARM_UP_PERIODS;
use residual_benches::steps::stepper::Stepper;

fn steps(criterion: &mut Criterion) {
    for of_method in cases().chunk_by(|a, b| a.method == b.method) {
        let mut group = criterion.benchmark_group(of_method[0].method);
        group.warm_up_time(Duration::from_millis(100));
        group.measurement_time(Duration::from_millis(500));
        for case in of_method {
            // Designed only if this case is chosen.
            let mut stepper = None;
            let name = case.name();
            group.bench_function(name.trim_start_matches(case.method).trim_start(), |bencher| {
                let stepper = stepper.get_or_insert_with(|| {
                    let mut stepper = Stepper::new(case).expect("a good case");
                    stepper.steps(WARM_UP_PERIODS * stepper.period());
                    stepper
                });
                bencher.iter(|| stepper.steps(1));
            });
        }
        group.finish();
    }
}

criterion_group!(benches, steps);
criterion_main!(benches);
