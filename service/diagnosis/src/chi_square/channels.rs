//! The channels of a record (method sheet 4, "Channels").
//!
//! Only statistics of the decision carry a ratio; everything else is for information and has the ratio 0.

use super::{
    engine::{Detectors, EngineDesign, Outcome, Statistic, deviation},
    error::ChiSquareError,
    glr_modes::FaultMode,
    options::{ChiSquareOptions, StatisticKind},
    thresholds::{Thresholds, threshold},
};
use crate::{
    diagnoser::{Channel, ChannelDescription, StepRecord},
    matrix::Matrix,
};
use residual_shared::record::MAX_CHANNELS;

/// Order and names of the channels.
#[derive(Clone, Debug)]
pub(super) struct ChannelLayout {
    pub descriptions: Vec<ChannelDescription>,
    enabled: Vec<(StatisticKind, bool)>,
    report: Option<StatisticKind>,
    measurements: usize,
    states: usize,
    largest_degrees: usize,
    window_edge: u64,
}

/// What the decision says at an instant.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Tested {
    /// Some statistic of the decision could be evaluated.
    pub evaluated: bool,
    /// One of them is beyond its bound.
    pub alarm: bool,
}

/// In the order of their channels.
const ORDER: [StatisticKind; 6] = [
    StatisticKind::Residual,
    StatisticKind::StatePlain,
    StatisticKind::StateWindow,
    StatisticKind::StateTwoPropagator,
    StatisticKind::Glr,
    StatisticKind::Cusum,
];

/// The state test whose difference is published.
fn report_statistic(options: &ChiSquareOptions) -> Option<StatisticKind> {
    let preferred = [
        StatisticKind::StateWindow,
        StatisticKind::StateTwoPropagator,
        StatisticKind::StatePlain,
    ];
    let enabled = |kind: &StatisticKind| options.statistics.enabled.contains(kind);
    options
        .statistics
        .report_statistic
        .or_else(|| preferred.into_iter().find(enabled))
}

impl ChannelLayout {
    pub fn new(options: &ChiSquareOptions, design: &EngineDesign) -> Result<Self, ChiSquareError> {
        let decision = &options.statistics.decision;
        let enabled: Vec<(StatisticKind, bool)> = ORDER
            .into_iter()
            .filter(|kind| options.statistics.enabled.contains(kind))
            .map(|kind| (kind, decision.contains(&kind)))
            .collect();
        let mut layout = Self {
            descriptions: Vec::new(),
            report: report_statistic(options),
            enabled,
            measurements: design.measurements,
            states: design.states,
            largest_degrees: design.states.max(design.measurements),
            window_edge: design.glr.as_ref().map_or(0, |glr| glr.window_steps - glr.stride),
        };
        layout.describe(options, design);
        let count = layout.descriptions.len();
        if count > MAX_CHANNELS {
            return Err(ChiSquareError::TooManyChannels {
                count,
                limit: MAX_CHANNELS,
            });
        }
        Ok(layout)
    }

    fn describe(&mut self, options: &ChiSquareOptions, design: &EngineDesign) {
        let unit = |units: &Option<Vec<String>>, i: usize| {
            units
                .as_ref()
                .and_then(|units| units.get(i).cloned())
                .unwrap_or_default()
        };
        let mut add = |name: String, unit: String| self.descriptions.push(ChannelDescription { name, unit });
        for i in 0..design.measurements {
            add(
                format!("innovation_{i}"),
                unit(&options.model.measurement_units, i),
            );
        }
        if self.report.is_some() {
            for i in 0..design.states {
                add(
                    format!("state_difference_{i}"),
                    unit(&options.model.state_units, i),
                );
            }
        }
        for (kind, _) in &self.enabled {
            match kind {
                StatisticKind::StateWindow => {
                    for steps in &design.window_steps {
                        add(format!("state_window_{steps}"), String::new());
                    }
                    if design.window_steps.len() > 1 {
                        add("state_window".to_owned(), String::new());
                    }
                }
                StatisticKind::Cusum => {
                    for i in 0..design.measurements {
                        add(format!("cusum_{i}"), String::new());
                    }
                }
                kind => add(kind.name().to_owned(), String::new()),
            }
        }
        for (kind, _) in &self.enabled {
            match kind {
                StatisticKind::Cusum => {}
                StatisticKind::Glr => {
                    add("glr_size".to_owned(), String::new());
                    add("glr_onset_age".to_owned(), "steps".to_owned());
                    add("glr_mode".to_owned(), String::new());
                }
                StatisticKind::StateWindow => {
                    for steps in &design.window_steps {
                        add(format!("state_window_{steps}_degrees"), String::new());
                    }
                }
                kind => add(format!("{}_degrees", kind.name()), String::new()),
            }
        }
    }

    /// Nothing was tested at this instant.
    pub fn write_nothing(&self, record: &mut StepRecord) {
        record.channel_count = self.descriptions.len() as u32;
        record.channels_mut().fill(Channel::NOT_EVALUATED);
    }

    /// Writes every channel and says what the decision found.
    pub fn write(
        &self,
        outcome: &Outcome,
        detectors: &Detectors,
        thresholds: &Thresholds,
        record: &mut StepRecord,
    ) -> Tested {
        self.write_nothing(record);
        let (innovations, rest) = split(record.channels_mut(), self.measurements);
        for (row, innovation, variance) in outcome.innovations() {
            if let Some(slot) = innovations.get_mut(row) {
                *slot = informative(innovation, thresholds.deviations * variance.sqrt());
            }
        }
        let rest = match self.report {
            Some(kind) => {
                let (differences, rest) = split(rest, self.states);
                if let Some((difference, factor)) = reported(kind, outcome, detectors) {
                    for (i, (slot, value)) in differences.iter_mut().zip(difference).enumerate() {
                        *slot = informative(*value, thresholds.deviations * deviation(factor, i));
                    }
                }
                rest
            }
            None => rest,
        };
        let mut writer = Writer {
            slots: rest.iter_mut(),
            tested: Tested::default(),
        };
        for (kind, decides) in &self.enabled {
            writer.statistic(*kind, *decides, outcome, thresholds, self.measurements);
        }
        for (kind, _) in &self.enabled {
            self.details(*kind, outcome, &mut writer);
        }
        writer.tested
    }

    fn details(&self, kind: StatisticKind, outcome: &Outcome, writer: &mut Writer<'_>) {
        let degrees = |statistic: Statistic| Channel {
            lower: 0.0,
            residual: statistic.degrees as f64,
            upper: self.largest_degrees as f64,
            ratio: 0.0,
        };
        match kind {
            StatisticKind::Residual => writer.put(degrees(outcome.residual)),
            StatisticKind::StatePlain => writer.put(degrees(outcome.plain)),
            StatisticKind::StateTwoPropagator => writer.put(degrees(outcome.pair)),
            StatisticKind::StateWindow => outcome
                .windows()
                .for_each(|(_, window)| writer.put(degrees(window))),
            StatisticKind::Glr => {
                let [size, age, mode] = match outcome.likelihood_ratio() {
                    Some(best) => [
                        Channel::estimate(best.size, best.standard_deviation),
                        Channel {
                            lower: 0.0,
                            residual: best.age as f64,
                            upper: self.window_edge as f64,
                            ratio: 0.0,
                        },
                        Channel::estimate(best.mode as f64, 0.0),
                    ],
                    None => [Channel::NOT_EVALUATED; 3],
                };
                [size, age, mode]
                    .into_iter()
                    .for_each(|channel| writer.put(channel));
            }
            StatisticKind::Cusum => {}
        }
    }
}

/// Puts channels into a record one after the other.
struct Writer<'a> {
    slots: std::slice::IterMut<'a, Channel>,
    tested: Tested,
}

impl Writer<'_> {
    fn put(&mut self, channel: Channel) {
        if let Some(slot) = self.slots.next() {
            *slot = channel;
        }
    }

    /// A channel of the decision, or one for information.
    fn judged(&mut self, channel: Channel, decides: bool) {
        let channel = if decides || !channel.is_evaluated() {
            channel
        } else {
            Channel {
                ratio: 0.0,
                ..channel
            }
        };
        if decides && channel.is_evaluated() {
            self.tested.evaluated = true;
            self.tested.alarm |= channel.ratio > 1.0;
        }
        self.put(channel);
    }

    fn statistic(
        &mut self,
        kind: StatisticKind,
        decides: bool,
        outcome: &Outcome,
        thresholds: &Thresholds,
        measurements: usize,
    ) {
        let test =
            |statistic: Statistic, list: &[f64]| one_sided(statistic.value, threshold(list, &statistic));
        match kind {
            StatisticKind::Residual => self.judged(test(outcome.residual, &thresholds.residual), decides),
            StatisticKind::StatePlain => self.judged(test(outcome.plain, &thresholds.plain), decides),
            StatisticKind::StateTwoPropagator => self.judged(test(outcome.pair, &thresholds.pair), decides),
            StatisticKind::StateWindow => {
                let mut largest = f64::NEG_INFINITY;
                for (_, window) in outcome.windows() {
                    self.judged(test(window, &thresholds.window), decides);
                    if window.degrees > 0 {
                        largest = largest.max(window.value / threshold(&thresholds.bank_reference, &window));
                    }
                }
                if outcome.windows().count() > 1 {
                    let bank = if largest >= 0.0 {
                        one_sided(largest, thresholds.bank)
                    } else {
                        Channel::NOT_EVALUATED
                    };
                    self.judged(bank, decides);
                }
            }
            StatisticKind::Glr => {
                let best = outcome.likelihood_ratio();
                let channel = best.map_or(Channel::NOT_EVALUATED, |best| {
                    one_sided(best.value, thresholds.glr)
                });
                self.judged(channel, decides);
            }
            StatisticKind::Cusum => {
                for row in 0..measurements {
                    let arrived = outcome.innovations().any(|(available, ..)| available == row);
                    let channel = match outcome.cusum.get(row) {
                        Some(value) if arrived => Channel::two_sided(*value, thresholds.cusum),
                        _ => Channel::NOT_EVALUATED,
                    };
                    self.judged(channel, decides);
                }
            }
        }
    }
}

/// (0, value, threshold); not evaluated without a finite threshold, infinite for a value that is not a number.
fn one_sided(value: f64, threshold: f64) -> Channel {
    if !threshold.is_finite() {
        return Channel::NOT_EVALUATED;
    }
    let value = if value.is_nan() { f64::INFINITY } else { value };
    Channel {
        lower: 0.0,
        residual: value,
        upper: threshold,
        ratio: value / threshold,
    }
}

/// A value with its half width that never alarms.
fn informative(value: f64, half_width: f64) -> Channel {
    Channel {
        lower: -half_width,
        residual: value,
        upper: half_width,
        ratio: 0.0,
    }
}

fn split(channels: &mut [Channel], count: usize) -> (&mut [Channel], &mut [Channel]) {
    channels.split_at_mut(count.min(channels.len()))
}

/// The difference β and the factor of its covariance that are published.
pub(super) fn reported<'a>(
    kind: StatisticKind,
    outcome: &'a Outcome,
    detectors: &'a Detectors,
) -> Option<(&'a [f64], &'a Matrix)> {
    let of_propagator = match kind {
        StatisticKind::StatePlain => detectors.plain.as_ref(),
        StatisticKind::StateTwoPropagator => detectors.pair.as_ref().map(|pair| pair.in_use()),
        _ => {
            let (longest, _) = outcome.windows().last()?;
            return outcome.window_difference(longest);
        }
    };
    of_propagator.map(|propagator| (propagator.difference.as_slice(), &propagator.factor))
}

/// Names of the components: measurements, then process faults.
pub(super) fn component_names(options: &ChiSquareOptions, design: &EngineDesign) -> Vec<String> {
    let name = |names: &Option<Vec<String>>, i: usize, default: &str| {
        let given = names.as_ref().and_then(|names| names.get(i).cloned());
        given.unwrap_or_else(|| format!("{default}_{i}"))
    };
    let faults = design.glr.as_ref().map_or(0, |glr| glr.entry.columns());
    let sensors = (0..design.measurements).map(|i| name(&options.model.measurement_names, i, "measurement"));
    let process = (0..faults).map(|i| name(&options.glr.process_fault_names, i, "process_fault"));
    sensors.chain(process).collect()
}

/// A mode for people: "step of wheel_speed".
pub(super) fn describe_mode(mode: &FaultMode, components: &[String]) -> String {
    let profile = match mode.profile {
        super::options::FaultProfile::Step => "step",
        super::options::FaultProfile::Ramp => "ramp",
    };
    let component = components.get(mode.component).map_or("", String::as_str);
    format!("{profile} of {component}")
}
