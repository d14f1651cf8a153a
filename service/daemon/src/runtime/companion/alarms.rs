//! The companion's view of the alarms: it sleeps until there is one, writes it to the log, and wakes those who
//! wait through iceoryx2.
//!
//! It reads the ring of the bounds table as every client does: nothing is copied to it, and no queue can be full.

use std::time::Duration;

use residual_shared::alarm::{AlarmTransition, alarm_flags};
use residual_shared::bounds_table::{AlarmRead, Liveness, TableReader};
use residual_shared::clock::monotonic_ns;
use residual_shared::names::Instance;
use residual_shared::record::{Verdict, fault_names};
use residual_shared::transport::AlarmNotifier;
use tracing::{info, warn};

/// Follows the alarm ring of the daemon it lives in, over every table that the daemon makes.
pub(super) struct AlarmWatch {
    instance: Instance,
    notifier: AlarmNotifier,
    table: Option<TableReader>,
    /// Epoch of the first table: older transitions are not this process's.
    first_epoch: Option<u64>,
    /// Number of the transition that was looked at last.
    seen: u64,
    /// Whether all that comes after it is of this process: what an earlier life lost is not lost here.
    is_own: bool,
    refused: bool,
}

impl AlarmWatch {
    /// A watch that finds the table once it is there.
    pub(super) fn new(instance: Instance, notifier: AlarmNotifier) -> Self {
        Self {
            instance,
            notifier,
            table: None,
            first_epoch: None,
            seen: 0,
            is_own: false,
            refused: false,
        }
    }

    /// Sleeps until there is an alarm that was not looked at, at most `timeout`.
    pub(super) fn wait(&self, timeout: Duration) {
        match &self.table {
            Some(table) => table.wait_for_alarm(self.seen, timeout),
            None => std::thread::sleep(timeout),
        }
    }

    /// Tells every alarm that has come since the last time.
    pub(super) fn look(&mut self) {
        self.tell();
        let open = |table: &TableReader| table.liveness(monotonic_ns()) != Liveness::Closed;
        if !self.table.as_ref().is_some_and(open) && self.find() {
            self.tell();
        }
    }

    /// Opens the newest table of this process; false if that is the one at hand or not there yet.
    fn find(&mut self) -> bool {
        let Ok(table) = TableReader::open(&self.instance.bounds_path()) else {
            return false;
        };
        let (epoch, pid) = (table.directory().epoch, table.directory().pid);
        let known = self.table.as_ref().map(|table| table.directory().epoch);
        if pid != std::process::id() || known == Some(epoch) {
            return false;
        }
        self.first_epoch.get_or_insert(epoch);
        self.table = Some(table);
        true
    }

    fn tell(&mut self) {
        let (Some(table), Some(first_epoch)) = (&self.table, self.first_epoch) else {
            return;
        };
        let newest = table.newest_alarm();
        let oldest = newest.saturating_sub(u64::from(table.directory().spec.alarm_capacity)) + 1;
        let mut lost = 0;
        if self.is_own {
            lost = oldest.saturating_sub(self.seen + 1);
        }
        for number in oldest.max(self.seen + 1)..=newest {
            match table.read_alarm(number) {
                AlarmRead::Transition(transition) if transition.number.epoch >= first_epoch => {
                    self.is_own = true;
                    log(table, &transition);
                    if let Err(error) = self.notifier.notify(transition.state)
                        && !self.refused
                    {
                        self.refused = true;
                        warn!(%error, "cannot wake those who wait for alarms through iceoryx2");
                    }
                }
                AlarmRead::Transition(_) | AlarmRead::Waiting => {}
                AlarmRead::Lost => lost += u64::from(self.is_own),
            }
        }
        if lost > 0 {
            warn!(transitions = lost, "alarms came too fast for the log");
        }
        self.seen = newest;
        self.is_own = true;
    }
}

/// One line of the log for one transition.
fn log(table: &TableReader, transition: &AlarmTransition) {
    let slot = table.directory().spec.slots.get(transition.slot as usize);
    let diagnoser = slot.map_or("(removed)", |slot| slot.name.as_str());
    let faults: &[String] = slot.map_or(&[], |slot| &slot.faults);
    let faulty: Vec<&str> = fault_names(faults, transition.certainly_faulty).collect();
    let possibly: Vec<&str> = fault_names(faults, transition.possibly_faulty).collect();
    let channel = slot.and_then(|slot| slot.channels.get(transition.channel as usize));
    let channel = channel.map_or("", |channel| channel.name.as_str());
    let verdict = Verdict::from_number(transition.verdict).map_or("?", Verdict::name);
    let alarm = state_and_flags(transition);
    let (number, step) = (transition.number.number, transition.step);
    let (occurrence, ratio) = (transition.occurrence, transition.ratio);
    if transition.state.is_active() {
        warn!(
            diagnoser,
            alarm,
            number,
            occurrence,
            step,
            verdict,
            ?faulty,
            ?possibly,
            channel,
            ratio
        );
    } else {
        info!(diagnoser, alarm, number, occurrence, step, verdict);
    }
}

fn state_and_flags(transition: &AlarmTransition) -> String {
    let state = std::iter::once(transition.state.name());
    state
        .chain(alarm_flags::names(transition.flags))
        .collect::<Vec<_>>()
        .join(", ")
}
