//! After construction no step, skip or reset allocates: counted by the global allocator.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic, unsafe_code)]

#[path = "conformance/allocation.rs"]
mod allocation;
mod support;

use allocation::allocations;
use residual_diagnosis::{
    diagnoser::{Diagnoser, StepInput, StepRecord, Verdict, flags},
    model::ModelOptions,
    unknown_input_filter::UnknownInputFilterBank,
};
use support::*;

/// Runs complete, partial, missing and skipped instants, faults, episodes and a reset; returns the verdicts and
/// flags that were seen.
fn exercise(bank: &mut UnknownInputFilterBank, model: &ModelOptions) -> (Vec<Verdict>, u32) {
    let (nx, nu, ny) = (model.a.len(), model.b[0].len(), model.c.len());
    let mut record = StepRecord::new(bank.description().channels.len());
    let mut verdicts = [false; 6];
    let mut seen_flags = 0;
    let (mut x, mut next) = (vec![0.0; nx], vec![0.0; nx]);
    let (mut y, u) = (vec![0.0; ny], vec![0.1; nu]);
    let taken = allocations(|| {
        for round in 0..2 {
            for k in 0..400_usize {
                for (value, row) in y.iter_mut().zip(&model.c) {
                    *value = row.iter().zip(&x).map(|(c, x)| c * x).sum();
                }
                record.flags = 0;
                match k % 50 {
                    20..23 => bank.skip(&mut record),
                    25 => bank.step(&StepInput::new(&y[..1], &u), &mut record),
                    phase => {
                        if phase % 10 == 7 {
                            y[phase % ny] = f64::NAN;
                        }
                        let commands = if phase == 31 { &[][..] } else { &u };
                        bank.step(&StepInput::new(&y, commands), &mut record);
                    }
                }
                verdicts[record.verdict as usize] = true;
                seen_flags |= record.flags;
                for (i, value) in next.iter_mut().enumerate() {
                    let fault = if (100..130).contains(&k) {
                        3.0 * model.b[i][0]
                    } else {
                        0.0
                    };
                    let rest: f64 = (0..nx).map(|l| model.a[i][l] * x[l]).sum();
                    *value = rest + fault + (0..nu).map(|l| model.b[i][l] * u[l]).sum::<f64>();
                }
                x.copy_from_slice(&next);
            }
            if round == 0 {
                bank.reset();
                x.fill(0.0);
            }
        }
    });
    assert_eq!(taken, 0, "the real-time path touched the allocator");
    let seen = (0..6)
        .filter(|i| verdicts[*i as usize])
        .map(|i| Verdict::from_number(i).unwrap())
        .collect();
    (seen, seen_flags)
}

fn check(model: &ModelOptions, text: &str, with_certificates: bool) {
    let mut options = options(text);
    if text.contains("kalman") {
        let nx = model.a.len();
        let row = |i: usize| (0..nx).map(|j| if i == j { 0.01 } else { 0.0 }).collect();
        options.filter.initial_covariance = Some((0..nx).map(row).collect());
    }
    if with_certificates {
        options.parity.certificates = Some(certificates(&reference("vtol_design.json")));
    }
    let (verdicts, seen) = exercise(&mut bank(model, &options), model);
    for expected in [Verdict::Starting, Verdict::Nominal, Verdict::Isolated] {
        assert!(
            verdicts.contains(&expected),
            "{text}: no {expected:?} in {verdicts:?}"
        );
    }
    assert_ne!(seen & flags::ALARM_NOW, 0, "{text}");
    assert_ne!(seen & flags::INPUT_MISSING, 0, "{text}");
}

#[test]
fn the_default_form_never_allocates_with_losses_episodes_and_certificates() {
    let mut boxed = vtol();
    boxed.input_lower = Some(vec![-1.0; 2]);
    boxed.input_upper = Some(vec![1.0; 2]);
    for model in [vtol(), boxed] {
        for policy in [
            "policy = \"bounded_fault\", fault_bound = [3, 3]",
            "policy = \"unbounded_fault\"",
        ] {
            let text = format!("bank = {{ clear_samples = 10 }}\nmissing = {{ {policy} }}");
            check(&model, &text, true);
        }
    }
}

#[test]
fn every_gain_rule_never_allocates() {
    for filter in ["gain = \"fixed\"", "gain = \"frobenius\"", "gain_sweeps = 6"] {
        check(
            &vtol(),
            &format!(
                "bank = {{ clear_samples = 10 }}\nfilter = {{ {filter} }}\n\
                 missing = {{ policy = \"unbounded_fault\" }}"
            ),
            true,
        );
    }
}

#[test]
fn pairs_copies_and_hulls_never_allocate() {
    let mut model = battery();
    model.input_lower = Some(vec![-1.0; 3]);
    model.input_upper = Some(vec![1.0; 3]);
    check(
        &model,
        "bank = { clear_samples = 10, reset = \"copy\", simultaneous_faults = [1, 2] }\n\
         filter = { publish = \"worst\" }\n\
         missing = { policy = \"bounded_fault\", fault_bound = [3, 3, 3] }",
        false,
    );
}

#[test]
fn the_papers_form_and_the_baseline_never_allocate() {
    check(
        &vtol(),
        "bank = { clear_samples = 10 }\nfilter = { form = \"paper\" }",
        false,
    );
    check(
        &vtol(),
        "bank = { clear_samples = 10 }\nfilter = { form = \"kalman_3sigma\", residual_norm_threshold = 0.5 }",
        false,
    );
}
