//! The guarantee of the method on random plants (method sheet 8b): a true mode is never falsified, the state is
//! in the reported hull, the fault in its estimate, whatever noise, uncertainty, commands, own faults and losses
//! do within their bounds.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]
// `!(a <= b)` also holds for a value that is not a number.
#![allow(clippy::neg_cmp_op_on_partial_ord)]

mod case;
mod certificate;
mod check;
mod plant;
mod relations;

use check::Counts;
use proptest::test_runner::{Config, RngSeed, TestCaseError, TestError, TestRunner};
use std::cell::Cell;

/// Runs `cases` random cases from a fixed seed and fails with the smallest case that violates the guarantee.
fn check_guarantee(cases: u32, seed: u64) -> Counts {
    let config = Config {
        cases,
        rng_seed: RngSeed::Fixed(seed),
        failure_persistence: None,
        ..Config::default()
    };
    let total = Cell::new(Counts::default());
    let outcome = TestRunner::new(config).run(&case::cases(), |case| {
        let counts = check::run(&case).map_err(TestCaseError::fail)?;
        let mut sum = total.get();
        sum.add(&counts);
        total.set(sum);
        Ok(())
    });
    match outcome {
        Ok(()) => total.get(),
        Err(TestError::Fail(reason, case)) => panic!("{reason}\n{case:#?}"),
        Err(TestError::Abort(reason)) => panic!("{reason}"),
    }
}

#[test]
fn no_true_mode_alarms_and_truth_stays_inside_on_random_plants() {
    let counts = check_guarantee(600, 1);
    println!("{counts:?}");
    assert!(counts.tested_steps >= 100_000, "{counts:?}");
    assert!(
        counts.hulls >= 100_000 && counts.estimates >= 10_000 && counts.windows >= 10_000,
        "{counts:?}"
    );
    assert!(counts.episodes >= 20 && counts.detections >= 50, "{counts:?}");
    assert!(
        counts.largest_ratio > 0.9,
        "the noise never came close to a bound: {counts:?}"
    );
}

#[test]
#[ignore = "ten million filter steps: minutes in release"]
fn no_true_mode_alarms_in_ten_million_filter_steps() {
    let mut total = Counts::default();
    for seed in 2.. {
        total.add(&check_guarantee(2_000, seed));
        println!("{total:?}");
        if total.tested_steps >= 10_000_000 {
            break;
        }
    }
}
