//! How much a record is worth at the moment it is read.

use std::time::Duration;

use residual_shared::bounds_table::{Liveness, ReadError, ReadOutcome, SlotSpec, TableReader, TableSpec};
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

impl Reading {
    /// Reads the newest record of the slot with the index `slot` from a table, at the moment `now_ns` of
    /// CLOCK_MONOTONIC. For clients that read all diagnosers of one life of the daemon at one moment; others
    /// use a [`Monitor`](crate::Monitor).
    ///
    /// # Errors
    /// See [`ReadError`]; after `Contended`, `record` is of no use.
    pub fn take(
        table: &TableReader,
        slot: usize,
        record: &mut StepRecord,
        now_ns: u64,
    ) -> Result<Self, ReadError> {
        let number = match table.read(slot, record)? {
            ReadOutcome::NeverWritten => 0,
            ReadOutcome::Record { number } => number,
        };
        let directory = table.directory();
        let spec = &directory.spec;
        let freshness = if table.liveness(now_ns) != Liveness::Running {
            Freshness::Dead
        } else if number == 0 {
            Freshness::Starting
        } else {
            Freshness::of_record(spec, &spec.slots[slot], record, spec.time.from_monotonic(now_ns))
        };
        Ok(Self {
            freshness,
            number,
            epoch: directory.epoch,
        })
    }
}

impl Freshness {
    /// The freshness of a record of a living daemon at `now_ns` of the daemon's time.
    ///
    /// Record k appears at its instant plus the margin, and is the newest one for a period. It is stale when
    /// older than `stale_after_periods` periods and the margin.
    fn of_record(table: &TableSpec, slot: &SlotSpec, record: &StepRecord, now_ns: u64) -> Self {
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
