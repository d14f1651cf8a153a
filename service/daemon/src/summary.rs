//! What a monitor has done, in numbers: printed when it stops.

use std::fmt;

use hdrhistogram::Histogram;
use residual_shared::control::ControlCounters;
use residual_shared::counters::{InputCounters, ScheduleCounters};
use serde::{Deserialize, Serialize};

use crate::configuration::Configuration;
use crate::runtime::engine::Engine;

/// Counters of a whole run.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Summary {
    /// One entry a diagnoser.
    pub diagnosers: Vec<DiagnoserSummary>,
    /// One entry an input.
    pub inputs: Vec<InputSummary>,
    /// What became of the control requests.
    pub control: ControlCounters,
    /// Durations of all steps.
    pub step_times: StepTimes,
    /// Delays of all steps behind their due times.
    pub lateness: StepTimes,
}

/// How a diagnoser was scheduled.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct DiagnoserSummary {
    /// The diagnoser.
    pub name: String,
    /// Counter names and values.
    pub counters: Vec<(String, u64)>,
}

/// What happened at the door of an input.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct InputSummary {
    /// The input.
    pub name: String,
    /// Counter names and values.
    pub counters: Vec<(String, u64)>,
}

/// Percentiles of a time of every step, nanoseconds.
#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
pub struct StepTimes {
    /// Number of steps.
    pub count: u64,
    /// Median.
    pub p50_ns: u64,
    /// 90th percentile.
    pub p90_ns: u64,
    /// 99th percentile.
    pub p99_ns: u64,
    /// 99.9th percentile.
    pub p999_ns: u64,
    /// Longest.
    pub max_ns: u64,
}

impl StepTimes {
    /// The percentiles of a histogram.
    pub fn of(histogram: &Histogram<u64>) -> Self {
        Self {
            count: histogram.len(),
            p50_ns: histogram.value_at_quantile(0.5),
            p90_ns: histogram.value_at_quantile(0.9),
            p99_ns: histogram.value_at_quantile(0.99),
            p999_ns: histogram.value_at_quantile(0.999),
            max_ns: histogram.max(),
        }
    }
}

impl fmt::Display for StepTimes {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        let microseconds = |nanoseconds: u64| nanoseconds as f64 / 1e3;
        write!(
            formatter,
            "p50 {:.1} µs, p99 {:.1} µs, p99.9 {:.1} µs, max {:.1} µs over {} steps",
            microseconds(self.p50_ns),
            microseconds(self.p99_ns),
            microseconds(self.p999_ns),
            microseconds(self.max_ns),
            self.count
        )
    }
}

impl Summary {
    /// The summary of an engine that has stopped.
    pub fn of(configuration: &Configuration, engine: &Engine, control: ControlCounters) -> Self {
        let named = |names: &[&'static str], words: &[u64]| {
            names
                .iter()
                .map(|&name| name.into())
                .zip(words.iter().copied())
                .collect()
        };
        Self {
            diagnosers: configuration
                .diagnosers
                .iter()
                .zip(engine.schedule_counters())
                .map(|(diagnoser, counters)| DiagnoserSummary {
                    name: diagnoser.name.clone(),
                    counters: named(ScheduleCounters::NAMES, &counters.to_words()),
                })
                .collect(),
            inputs: configuration
                .inputs
                .iter()
                .zip(engine.input_counters())
                .map(|(input, counters)| InputSummary {
                    name: input.name.clone(),
                    counters: named(InputCounters::NAMES, &counters.to_words()),
                })
                .collect(),
            control,
            step_times: StepTimes::of(engine.step_times_ns()),
            lateness: StepTimes::of(engine.lateness_ns()),
        }
    }

    /// A counter of the first diagnoser that has it under this name, summed over all diagnosers.
    pub fn schedule_total(&self, counter: &str) -> u64 {
        let of = |diagnoser: &DiagnoserSummary| {
            diagnoser
                .counters
                .iter()
                .filter(|(name, _)| name == counter)
                .map(|(_, value)| value)
                .sum::<u64>()
        };
        self.diagnosers.iter().map(of).sum()
    }
}

impl fmt::Display for Summary {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        let counters = |counters: &[(String, u64)]| {
            let nonzero = counters.iter().filter(|(_, value)| *value > 0);
            nonzero
                .map(|(name, value)| format!("{name} {value}"))
                .collect::<Vec<_>>()
                .join(", ")
        };
        for diagnoser in &self.diagnosers {
            writeln!(
                formatter,
                "diagnoser {}: {}",
                diagnoser.name,
                counters(&diagnoser.counters)
            )?;
        }
        for input in &self.inputs {
            writeln!(formatter, "input {}: {}", input.name, counters(&input.counters))?;
        }
        let ControlCounters {
            answered,
            rejected,
            timed_out,
        } = self.control;
        writeln!(
            formatter,
            "control requests: answered {answered}, rejected {rejected}, timed out {timed_out}"
        )?;
        writeln!(formatter, "step time: {}", self.step_times)?;
        write!(formatter, "lateness: {}", self.lateness)
    }
}
