//! `residual-bench instructions`: instructions and floating-point operations of a step.

pub mod callgrind;
pub mod formulas;
pub mod operations;
pub mod peak;
mod report;
pub mod table;

use anyhow::Result;
use clap::Args;
use serde::{Deserialize, Serialize};

use super::case_named;
use super::stepper::Stepper;
pub use report::{Options, run};

/// Periods of the recording that are stepped through before anything is counted: sets are full by then, windows too.
pub const WARM_UP_PERIODS: usize = 4;

/// Arguments of `step-case`, the child whose instructions are counted.
#[derive(Args)]
pub struct ChildOptions {
    /// Name of the case.
    pub case: String,
    /// Steps before those that count.
    pub warm_up: usize,
    /// Steps that count.
    pub steps: usize,
}

/// What the child says of itself: counts depend on it.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Child {
    /// Whether it was compiled with the checks of the profile `dev`.
    pub has_debug_assertions: bool,
    /// Features of the processor as it sees them, for which code may choose another path.
    pub features: String,
}

/// In the child: steps the case.
///
/// # Errors
/// There is no such case, or it cannot be designed.
pub fn run_child(options: &ChildOptions) -> Result<()> {
    let mut stepper = Stepper::new(&case_named(&options.case)?)?;
    stepper.steps(options.warm_up);
    for _ in 0..options.steps {
        stepper.prepare();
        counted_step(&mut stepper);
    }
    let child = Child {
        has_debug_assertions: cfg!(debug_assertions),
        features: features(),
    };
    println!("{}", serde_json::to_string(&child)?);
    Ok(())
}

/// The step that callgrind counts, which finds it by its name.
#[inline(never)]
pub fn counted_step(stepper: &mut Stepper) {
    stepper.step();
}

#[cfg(target_arch = "x86_64")]
fn features() -> String {
    let all = [
        ("avx", is_x86_feature_detected!("avx")),
        ("avx2", is_x86_feature_detected!("avx2")),
        ("fma", is_x86_feature_detected!("fma")),
        ("avx512f", is_x86_feature_detected!("avx512f")),
    ];
    let present: Vec<&str> = all
        .iter()
        .filter(|(_, present)| *present)
        .map(|(name, _)| *name)
        .collect();
    format!("x86-64 {}", present.join(" "))
}

#[cfg(not(target_arch = "x86_64"))]
fn features() -> String {
    std::env::consts::ARCH.to_owned()
}
