//! The channels of a record (method sheet 4, "Channels").
//!
//! Only statistics of the decision carry a ratio; everything else is for information and has the ratio 0.

use super::{
    channel_writer::{Tested, Writer, informative},
    engine::{Detectors, EngineDesign, Outcome, Statistic, deviation},
    error::ChiSquareError,
    glr_modes::FaultMode,
    options::{ChiSquareOptions, StatisticKind},
    thresholds::Thresholds,
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
        let mut writer = Writer::new(rest);
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
