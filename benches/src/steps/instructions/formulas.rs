//! Floating-point operations of a step by the formulas of the methods' sources, to compare with what is executed.
//!
//! | symbol | meaning |
//! |---|---|
//! | n, m, p | states, commands, outputs of the case |
//! | s | generator order |
//! | q | columns of a set after the new blocks: s + 2 n |
//! | z | test directions of a filter: outputs less one unknown input |
//!
//! A multiply-add is two operations. Where a formula leaves a part open ("new blocks", "small"), that part is missing
//! here as well, so that a ratio above 1 is no waste by itself.

use super::super::{Case, Watched};

/// Operations by the formula of the case; `None` where its source states none.
pub fn operations(case: &Case, watched: &Watched) -> Option<f64> {
    let sample = watched.recording.instants.first()?;
    let (n, m, p) = (
        case.states as f64,
        sample.commands.len() as f64,
        sample.measurements.len() as f64,
    );
    match case.method {
        "unknown_input_filter" => filter(case.mode, n, p, case.generators? as f64),
        "reduced_order_observer" => observer(case.mode, n, m, p),
        "chi_square" => chi_square(case.mode, n, p),
        "hinf_filter" => hinf(case.mode, n, m, p),
        _ => None,
    }
}

/// Method sheet 9 of the unknown-input filter.
fn filter(mode: &str, n: f64, p: f64, s: f64) -> Option<f64> {
    let (q, z) = (s + 2.0 * n, p - 1.0);
    let fixed = n * n * s + z * n * s + 3.0 * n * q;
    let row_wise = n * n * s
        + n * p * q
        + q * p * p / 2.0
        + 2.0 * n * p * q
        + z * p * q
        + 3.0 * n * z * (q + p)
        + z * p * q
        + 3.0 * n * q;
    let sweep = n * (z * z / 2.0 + 2.0 * z) * (q + p);
    match mode {
        "fixed" | "fixed inward" => Some(2.0 * fixed),
        "row_wise" | "row_wise inward" => Some(2.0 * row_wise),
        "row_wise 2 sweeps" => Some(2.0 * (row_wise + 2.0 * sweep)),
        "paper" if n == 4.0 => Some(155.0 * s + 2600.0),
        _ => None,
    }
}

/// Method sheet 9 of the reduced-order observer, with a test of every output alone.
fn observer(mode: &str, n: f64, m: f64, p: f64) -> Option<f64> {
    let one = 2.0 * (n * n + n * m + p * p + n * n);
    mode.starts_with("joint").then_some(match mode {
        "joint with bank" => one * (1.0 + 2.0 * m),
        _ => one,
    })
}

/// Method sheet 9 of the chi-square tests: cached while the model is constant, the full recursion otherwise.
fn chi_square(mode: &str, n: f64, p: f64) -> Option<f64> {
    let filter = 2.0 * n * n + 4.0 * n * p + p * p;
    let hypotheses = 2.0 * p;
    let ratio = |window: f64| window * 2.0 * p * hypotheses;
    let sums = 6.0 * p;
    let (test, windows) = (2.0 * n * n, 1.0 + 3.0 + 9.0 + 27.0);
    let bank = 4.0 * test + 2.0 * n * n * windows;
    let full_filter =
        n.powi(3) + 4.0 * n.powi(3) - 2.0 / 3.0 * n.powi(3) + p * n * n + 4.0 / 3.0 * (n + p).powi(3);
    let full_ratio = |window: f64| window * hypotheses * (2.0 * n * n + 4.0 * n * p + p * p + 4.0 * p);
    Some(match mode {
        "all" => filter + 2.0 * p * p + bank + ratio(120.0) + sums,
        "likelihood ratio M=40" => filter + ratio(40.0) + sums,
        "window bank" => filter + bank,
        "residual" => filter + 2.0 * p * p,
        "likelihood ratio M=40, changing models" => full_filter + full_ratio(40.0) + sums,
        _ => return None,
    })
}

/// Method sheet 9 of the H∞ filter: every output has a residual; the initial error is forgotten.
fn hinf(mode: &str, n: f64, m: f64, p: f64) -> Option<f64> {
    let main = 2.0 * (n * n + n * m + 2.0 * n * p + p * m + p * p);
    Some(match mode {
        "bank of 3" => 3.0 * main,
        "2 listed models" => main + 2.0 * 2.0 * (4.0 * n * n + 2.0 * n * m + 2.0 * n * p),
        _ => main,
    })
}
