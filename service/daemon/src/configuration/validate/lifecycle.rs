//! `[diagnoser.lifecycle]`.

use super::check_range;
use super::diagnoser::signal;
use super::quantity::duration_ns;
use crate::configuration::locate::Mistakes;
use crate::configuration::schema::{Enable, Lifecycle};
use crate::configuration::{EnableConfiguration, InputConfiguration, LifecycleConfiguration};
use crate::lifecycle::{MAX_WINDOW, Rules};

/// Most steps of hysteresis: a day at 10 Hz.
const MAX_CLEAR_STEPS: u32 = 1_000_000;

/// Longest start-up suppression, one day.
const MAX_SUPPRESSION_S: f64 = 86_400.0;

pub(super) fn lifecycle(
    path: &str,
    section: &Lifecycle,
    period_ns: Option<u64>,
    inputs: &[InputConfiguration],
    mistakes: &mut Mistakes<'_>,
) -> Option<LifecycleConfiguration> {
    let at = |key: &str| format!("{path}.{key}");
    let default = Rules::default();
    let raise_steps = section.raise_steps.unwrap_or(default.raise_steps);
    let raise_window = section.raise_window.unwrap_or(raise_steps);
    let window = u64::from(MAX_WINDOW);
    let before = mistakes.len();
    let what = "number of violations";
    check_range(&at("raise_steps"), raise_steps.into(), 1, window, what, mistakes);
    if section.raise_window.is_some() {
        let what = "length of the window in steps";
        check_range(
            &at("raise_window"),
            raise_window.into(),
            1,
            window,
            what,
            mistakes,
        );
    }
    if mistakes.len() == before && raise_steps > raise_window {
        mistakes.at(
            &at("raise_window"),
            format!("{raise_steps} violations never come together in {raise_window} steps: no alarm would be raised"),
            format!("use a window of {raise_steps} to {MAX_WINDOW} steps, or fewer `raise_steps`"),
        );
    }
    let clear_steps = section.clear_steps.unwrap_or(default.clear_steps);
    check_range(
        &at("clear_steps"),
        clear_steps.into(),
        1,
        MAX_CLEAR_STEPS.into(),
        "number of quiet steps",
        mistakes,
    );
    let clear_ratio = section.clear_ratio.unwrap_or(default.clear_ratio);
    if !(clear_ratio > 0.0 && clear_ratio <= 1.0) {
        mistakes.at(
            &at("clear_ratio"),
            format!("no step is quiet below the ratio {clear_ratio}, or some are that violate"),
            "use a number above 0 and up to 1, the ratio at the bound",
        );
    }
    let suppression_ns = duration_ns(
        &at("startup_suppression_s"),
        section.startup_suppression_s,
        MAX_SUPPRESSION_S,
        "use 0 to 86400 s (one day)",
        mistakes,
    );
    let conditions = section.enable.iter().enumerate();
    let enable: Vec<_> = conditions
        .map(|(index, condition)| enable(&format!("{path}.enable.{index}"), condition, inputs, mistakes))
        .collect();
    Some(LifecycleConfiguration {
        rules: Rules {
            raise_steps,
            raise_window,
            clear_steps,
            clear_ratio,
            latch: section.latch,
            suppressed_instants: Rules::suppressed_instants(suppression_ns?, period_ns?),
        },
        enable: enable.into_iter().collect::<Option<_>>()?,
    })
}

fn enable(
    path: &str,
    section: &Enable,
    inputs: &[InputConfiguration],
    mistakes: &mut Mistakes<'_>,
) -> Option<EnableConfiguration> {
    let [low, high] = section.range;
    if low > high {
        mistakes.at(
            &format!("{path}.range"),
            format!("no value lies between {low} and {high}: the channels would never count"),
            "write the lower end first",
        );
    }
    if section.channels.as_ref().is_some_and(Vec::is_empty) {
        mistakes.at(
            &format!("{path}.channels"),
            "the condition concerns no channel",
            "name channels (`residuald check` lists them), or leave `channels` out for all of them",
        );
    }
    match signal(&section.signal, inputs) {
        Ok(signal) => Some(EnableConfiguration {
            channels: section.channels.clone(),
            signal,
            range: section.range,
        }),
        Err((message, help)) => {
            mistakes.at(&format!("{path}.signal"), message, help);
            None
        }
    }
}
