//! The channels of a record (method sheet 4.12).
//!
//! For every mode i: `mode_i_output_j`, `mode_i_matched_j`, `mode_i_parity_j_L`, `mode_i_fault_estimate_a`, or
//! only `mode_i_worst`; then `detectable_fault_j` and `isolable_fault_j`. i is the list of the mode's actuators
//! joined by `_`, or `fault_free`.

use residual_shared::record::MAX_CHANNELS;

use super::{
    bank::Mode,
    decision::Conclusion,
    error::ConstructionError,
    floors::Floors,
    options::{Form, Publish, UnknownInputFilterOptions},
    outcome::{Outcome, TestRow},
};
use crate::{
    diagnoser::{Channel, ChannelDescription, StepRecord},
    model::LinearModel,
};

/// Order and names of the channels of a bank.
#[derive(Clone, Debug)]
pub(super) struct ChannelLayout {
    publish: Publish,
    descriptions: Vec<ChannelDescription>,
    floors: Floors,
}

impl ChannelLayout {
    pub fn new(
        model: &LinearModel,
        modes: &[Mode],
        outcomes: &[Outcome],
        options: &UnknownInputFilterOptions,
    ) -> Result<Self, ConstructionError> {
        let publish = options.filter.publish;
        let mut descriptions = Vec::new();
        let mut add = |name: String, unit: &str| {
            descriptions.push(ChannelDescription {
                name,
                unit: unit.to_owned(),
            })
        };
        for (mode, outcome) in modes
            .iter()
            .zip(outcomes)
            .filter(|(mode, _)| mode.filter.is_some())
        {
            let prefix = format!("mode_{}", mode.mode.label());
            if publish == Publish::Worst {
                add(format!("{prefix}_worst"), "");
                continue;
            }
            for (j, output) in model.outputs().iter().enumerate() {
                add(format!("{prefix}_output_{j}"), &output.unit);
            }
            for (j, _) in mode
                .mode
                .other_actuators(model.actuator_count())
                .zip(&outcome.matched)
            {
                add(format!("{prefix}_matched_{j}"), "");
            }
            if outcome.norm.is_some() {
                add(format!("{prefix}_norm"), "");
            }
            for test in &mode.parity {
                add(format!("{prefix}_parity_{}_{}", test.fault(), test.length()), "");
            }
            for (a, _) in mode.mode.actuators().zip(&outcome.estimates) {
                add(format!("{prefix}_fault_estimate_{a}"), &model.actuators()[a].unit);
            }
        }
        let guaranteed = options.filter.form != Form::Kalman3Sigma;
        for kind in ["detectable", "isolable"].iter().filter(|_| guaranteed) {
            for (j, actuator) in model.actuators().iter().enumerate() {
                add(format!("{kind}_fault_{j}"), &actuator.unit);
            }
        }
        if descriptions.len() > MAX_CHANNELS {
            return Err(ConstructionError::TooManyChannels {
                count: descriptions.len(),
                limit: MAX_CHANNELS,
            });
        }
        let floors = Floors::new(
            if guaranteed { model.actuator_count() } else { 0 },
            options.filter.fault_of_interest.clone(),
        );
        Ok(Self {
            publish,
            descriptions,
            floors,
        })
    }

    pub fn descriptions(&self) -> &[ChannelDescription] {
        &self.descriptions
    }

    /// Writes channels, fault estimate and the flag `THRESHOLD_INERT`.
    pub fn write(
        &mut self,
        outcomes: &[Outcome],
        parity: &[Vec<TestRow>],
        modes: &[Mode],
        conclusion: &Conclusion,
        record: &mut StepRecord,
    ) {
        record.channel_count = self.descriptions.len() as u32;
        let mut next = 0;
        let mut put = |channel: Channel| {
            if let Some(slot) = record.channels.get_mut(next) {
                *slot = channel;
            }
            next += 1;
        };
        self.floors.clear();
        for (i, mode) in modes.iter().enumerate().filter(|(_, mode)| mode.filter.is_some()) {
            self.floors.note(mode.mode, &outcomes[i]);
            let rows = outcomes[i].rows().chain(&parity[i]).map(channel);
            match self.publish {
                Publish::All => {
                    rows.for_each(&mut put);
                    outcomes[i].estimates.iter().for_each(|estimate| {
                        put(estimate
                            .map_or(Channel::NOT_EVALUATED, |e| Channel::estimate(e.centre, e.radius)));
                    });
                }
                Publish::Worst => {
                    put(rows.fold(Channel::NOT_EVALUATED, |worst, row| {
                        if row.ratio > worst.ratio || !worst.is_evaluated() {
                            row
                        } else {
                            worst
                        }
                    }));
                }
            }
        }
        self.floors.channels().for_each(&mut put);
        if self.floors.inert() {
            record.flags |= crate::diagnoser::flags::THRESHOLD_INERT;
        }
        let isolated = modes
            .iter()
            .position(|mode| conclusion.isolated == Some(mode.mode) && mode.mode.len() == 1);
        let estimate = isolated.and_then(|i| outcomes[i].estimates.first().copied().flatten());
        record.fault_estimate = estimate.map_or(f64::NAN, |estimate| estimate.centre);
        record.fault_estimate_half_width = estimate.map_or(f64::NAN, |estimate| estimate.radius);
    }
}

fn channel(row: &TestRow) -> Channel {
    if row.evaluated {
        Channel::two_sided(row.residual, row.half_width)
    } else {
        Channel::NOT_EVALUATED
    }
}
