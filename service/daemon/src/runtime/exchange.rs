//! The step thread exchanges its configuration for another one, between two sampling instants.
//!
//! All that takes long has been done before, by [`reload`](super::reload): the new engine and the new bounds table
//! are complete. What is left is to create the subscribers of new inputs, to take over and to publish the table.
//! The old parts go back in the same box, to be dropped elsewhere. A reload without new or removed inputs allocates
//! nothing here; subscribers, which belong to this thread, cost some milliseconds each.

use std::sync::Arc;

use residual_shared::alarm::AlarmTransition;
use residual_shared::bounds_table::{CreateError, PreparedTable, TableWriter};
use residual_shared::clock::monotonic_ns;
use residual_shared::counters::{AlarmStatus, InputCounters, ScheduleCounters};
use residual_shared::transport::{Node, SampleSubscriber, TransportError};

use super::companion::{Introduction, Message};
use super::engine::Engine;
use super::live::{Publication, StepLoop};
use super::running::Running;
use super::take_over::Correspondence;
use crate::configuration::{Configuration, InputConfiguration};

/// The parts of a new configuration on their way to the step thread; the old ones on their way back.
pub struct Exchange {
    /// The configuration.
    pub running: Arc<Running>,
    /// Its engine, which has done no step.
    pub engine: Engine,
    /// What of it is the same in the present one.
    pub same: Correspondence,
    /// For each present input: its number in the new configuration.
    pub input_numbers: Vec<Option<usize>>,
    /// The table to be published.
    pub prepared: Option<PreparedTable>,
    /// The table that was replaced.
    pub replaced: Option<TableWriter>,
    /// What the companion has to know.
    pub introduction: Option<Box<Introduction>>,
    /// Counters as last reported to the log.
    pub reported: Reported,
}

/// Counters as last reported to the log.
#[derive(Clone, Debug)]
pub struct Reported {
    /// Of each input.
    pub inputs: Vec<InputCounters>,
    /// Of each diagnoser.
    pub schedules: Vec<ScheduleCounters>,
}

impl Reported {
    /// All that an engine counted so far is known.
    pub fn of(engine: &Engine) -> Self {
        Self {
            inputs: engine.input_counters().copied().collect(),
            schedules: engine.schedule_counters().copied().collect(),
        }
    }

    /// Goes on with what was reported of the same inputs and diagnosers.
    fn take_over(&mut self, old: &Self, same: &Correspondence) {
        copy(&mut self.inputs, &old.inputs, &same.inputs);
        copy(&mut self.schedules, &old.schedules, &same.kept);
    }
}

fn copy<T: Copy>(to: &mut [T], from: &[T], places: &[Option<usize>]) {
    for (to, place) in to.iter_mut().zip(places) {
        if let Some(from) = place.and_then(|place| from.get(place)) {
            *to = *from;
        }
    }
}

/// Why the step thread goes on with the old configuration.
#[derive(Debug, thiserror::Error)]
pub enum ExchangeError {
    /// The companion is behind and could not be told.
    #[error("the companion thread is behind with its work; try again")]
    CompanionBehind,
    /// A new input cannot be subscribed to.
    #[error("a new input cannot be used: {0}")]
    Input(#[from] TransportError),
    /// The table cannot be published.
    #[error(transparent)]
    Table(#[from] CreateError),
}

/// The subscriber of one input.
pub struct Subscription {
    /// The input's number.
    pub input: usize,
    /// Its subscriber.
    pub subscriber: SampleSubscriber,
    /// Begin of the turn in which it was looked at last, CLOCK_MONOTONIC in nanoseconds.
    pub received_ns: u64,
}

impl Subscription {
    /// Subscribes to the input with this number.
    ///
    /// # Errors
    /// [`TransportError`].
    pub fn create(node: &Node, configuration: &Configuration, input: usize) -> Result<Self, TransportError> {
        let InputConfiguration {
            name,
            buffer_samples,
            max_publishers,
            ..
        } = &configuration.inputs[input];
        let instance = configuration.daemon.instance();
        let subscriber = SampleSubscriber::create(node, &instance, name, *buffer_samples, *max_publishers)?;
        Ok(Self {
            input,
            subscriber,
            received_ns: 0,
        })
    }
}

impl StepLoop<'_> {
    /// Goes on with the configuration in the box, in which the old one lies afterwards.
    ///
    /// # Errors
    /// [`ExchangeError`]; nothing has changed then.
    pub(super) fn exchange(&mut self, exchange: &mut Exchange) -> Result<(), ExchangeError> {
        if self.publication.queue.slots() == 0 {
            return Err(ExchangeError::CompanionBehind);
        }
        let created = self.subscribe_to_new_inputs(exchange)?;
        if let Some(prepared) = exchange.prepared.take() {
            for (slot, place) in exchange.same.named.iter().enumerate() {
                let occurrences = place.and_then(|place| self.engine.occurrences(place));
                let cleared = AlarmStatus {
                    occurrences: occurrences.unwrap_or_default(),
                    ..AlarmStatus::default()
                };
                prepared.show_alarm_status(slot, &cleared);
            }
            let table = prepared.publish()?;
            exchange.replaced = Some(std::mem::replace(&mut self.publication.table, table));
        }
        let now_ns = self.time.now_ns();
        exchange
            .engine
            .take_over(&mut self.engine, &exchange.same, now_ns);
        std::mem::swap(&mut self.engine, &mut exchange.engine);
        std::mem::swap(&mut self.running, &mut exchange.running);
        if let Some(replaced) = &exchange.replaced {
            self.publication.withdraw_alarms(&mut exchange.engine, replaced);
        }
        self.subscriptions.retain_mut(|subscription| {
            let number = exchange.input_numbers.get(subscription.input).copied().flatten();
            number.is_some_and(|number| {
                subscription.input = number;
                true
            })
        });
        self.subscriptions.extend(created);
        self.subscriptions
            .sort_unstable_by_key(|subscription| subscription.input);
        self.publication.go_on(&self.engine, exchange);
        Ok(())
    }

    fn subscribe_to_new_inputs(&self, exchange: &Exchange) -> Result<Vec<Subscription>, TransportError> {
        let configuration = &exchange.running.configuration;
        (0..configuration.inputs.len())
            .filter(|input| !exchange.input_numbers.contains(&Some(*input)))
            .map(|input| Subscription::create(self.node, configuration, input))
            .collect()
    }
}

impl Publication {
    /// Clears the alarms of diagnosers that have changed, which the old engine has kept. Those of diagnosers that the
    /// new table does not have were withdrawn when it was published.
    fn withdraw_alarms(&mut self, old: &mut Engine, replaced: &TableWriter) {
        old.withdraw_alarms(|slot, transition| {
            let identity = replaced.identity(slot).unwrap_or_default();
            if let Some(slot) = self.table.slot_with_identity(identity) {
                self.table.raise(&AlarmTransition {
                    slot: slot as u32,
                    identity,
                    ..transition
                });
            }
        });
    }

    /// Shows in the new table what is known of diagnosers that stayed the same, and introduces all to the companion.
    fn go_on(&mut self, engine: &Engine, exchange: &mut Exchange) {
        exchange.reported.take_over(&self.reported, &exchange.same);
        std::mem::swap(&mut self.reported, &mut exchange.reported);
        for (slot, record) in engine.latest_records() {
            self.table.publish(slot, record);
        }
        if let Some(introduction) = exchange.introduction.take() {
            // There was room before, and this thread alone fills the queue.
            let _ = self.queue.push(Message::Reloaded(introduction));
        }
        self.publish_all_counters(engine);
        self.keep_up(engine, monotonic_ns());
    }
}
