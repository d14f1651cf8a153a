//! How much a record is worth at the moment it is read.

use std::time::Duration;

use residual_shared::bounds_table::{SlotSpec, TableSpec};
use residual_shared::record::{StepRecord, Verdict};

/// How much a record is worth at the moment it is read.
///
/// Only a [`Fresh`](Self::Fresh) record says something about the plant now. Its verdict may still be
/// `GuaranteeLost`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Freshness {
    /// Evaluated at one of the latest sampling instants.
    Fresh,
    /// The daemon lives, but the diagnoser has written nothing newer for too long.
    Stale {
        /// Time since the record's sampling instant, in the daemon's time.
        age: Duration,
    },
    /// The latest instant could not be evaluated, for want of a valid input.
    NotEvaluated,
    /// The diagnoser has not had a complete input yet.
    Starting,
    /// The daemon has ended, hangs, or was never there; [`Monitor::state`](crate::Monitor::state) tells which.
    Dead,
}

/// What a read gave.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Reading {
    /// How much the record is worth.
    pub freshness: Freshness,
    /// Number of the record, counted from 1 in this life of the daemon: a larger one is a newer record.
    /// 0: there is no record, and the caller's is as it was.
    pub number: u64,
    /// Number of the daemon's life; a larger one after a restart, and `number` then begins again. 0: there has
    /// not been a daemon.
    pub epoch: u64,
}

impl Freshness {
    /// The freshness of a record of a living daemon at `now_ns` of the daemon's time.
    ///
    /// Record k appears at its instant plus the margin, and is the newest one for a period. It is stale when
    /// older than `stale_after_periods` periods and the margin.
    pub(crate) fn of_record(table: &TableSpec, slot: &SlotSpec, record: &StepRecord, now_ns: u64) -> Self {
        let age_ns = now_ns.saturating_sub(record.instant_ns);
        let limit_ns = u64::from(table.stale_after_periods)
            .saturating_mul(slot.period_ns)
            .saturating_add(slot.margin_ns);
        if age_ns > limit_ns {
            return Self::Stale {
                age: Duration::from_nanos(age_ns),
            };
        }
        match record.verdict() {
            Verdict::Starting => Self::Starting,
            Verdict::NotEvaluated => Self::NotEvaluated,
            Verdict::Nominal | Verdict::Fault | Verdict::Isolated | Verdict::GuaranteeLost => Self::Fresh,
        }
    }

    /// The name shown to people and written to files.
    pub fn name(&self) -> &'static str {
        match self {
            Self::Fresh => "fresh",
            Self::Stale { .. } => "stale",
            Self::NotEvaluated => "not evaluated",
            Self::Starting => "starting",
            Self::Dead => "dead",
        }
    }
}
