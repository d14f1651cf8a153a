//! A client's view of one instance, over all lives of its daemon.

use residual_shared::bounds_table::{OpenError, ReadError, TableReader};
use residual_shared::clock::monotonic_ns;
use residual_shared::names::Instance;
use residual_shared::record::StepRecord;

use crate::latest_table::{DaemonState, LatestTable};
use crate::reading::{Freshness, Reading};

/// A client's view of one instance, over all lives of its daemon.
///
/// While the daemon lives, reading makes no system call but for the clock, which needs none on the usual
/// processors. When it does not, reads look for a new one, at most every
/// [`RETRY_PERIOD_NS`](crate::RETRY_PERIOD_NS).
#[derive(Debug)]
pub struct Monitor {
    latest: LatestTable,
    followed: Vec<(String, Option<usize>)>,
}

/// A diagnoser of one monitor, found by its name in every life of the daemon.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Followed(usize);

/// Why a diagnoser could not be read.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum MonitorError {
    /// The daemon has no such diagnoser (any more).
    #[error("the daemon has no diagnoser `{name}`; it has {known}")]
    NoSuchDiagnoser {
        /// The name asked for.
        name: String,
        /// The names there are.
        known: String,
    },
    /// The handle belongs to another monitor.
    #[error("this handle belongs to another monitor; get one from this monitor's `follow`")]
    ForeignHandle,
    /// The daemon writes faster than can be read.
    #[error(transparent)]
    Read(#[from] ReadError),
}

impl Monitor {
    /// Opens the table of an instance.
    ///
    /// # Errors
    /// See [`OpenError`]: above all when no daemon has run yet, or this user may not read its table. A daemon
    /// that has run and ended gives no error, its readings are [`Freshness::Dead`].
    pub fn open(instance: &Instance) -> Result<Self, OpenError> {
        Ok(Self {
            latest: LatestTable::open(instance)?,
            followed: Vec::new(),
        })
    }

    /// A monitor of an instance whose daemon need not have been started: until there is one, every diagnoser
    /// reads as [`Freshness::Dead`].
    pub fn connect(instance: &Instance) -> Self {
        Self {
            latest: LatestTable::unknown(instance),
            followed: Vec::new(),
        }
    }

    /// The table of the latest known life of the daemon: its directory and counters.
    pub fn table(&self) -> Option<&TableReader> {
        self.latest.table.as_ref()
    }

    /// Whether the daemon lives. Looks for a new one if it does not, as a read does.
    pub fn state(&mut self) -> DaemonState<'_> {
        let now_ns = monotonic_ns();
        self.refresh(now_ns);
        self.latest.state(now_ns)
    }

    /// A handle that finds the diagnoser `name` in this and every later life of the daemon, wherever it lies.
    ///
    /// # Errors
    /// [`MonitorError::NoSuchDiagnoser`] if there is a daemon and it has none of this name.
    pub fn follow(&mut self, name: &str) -> Result<Followed, MonitorError> {
        self.refresh(monotonic_ns());
        let slot = match &self.latest.table {
            Some(table) => Some(slot_of(table, name)?),
            None => None,
        };
        self.followed.push((name.into(), slot));
        Ok(Followed(self.followed.len() - 1))
    }

    /// Reads the newest record of the diagnoser `name`.
    ///
    /// # Errors
    /// [`MonitorError::NoSuchDiagnoser`]; [`MonitorError::Read`], after which `record` is of no use.
    pub fn read(&mut self, name: &str, record: &mut StepRecord) -> Result<Reading, MonitorError> {
        let now_ns = monotonic_ns();
        self.refresh(now_ns);
        let Some(table) = &self.latest.table else {
            return Ok(NO_DAEMON);
        };
        Ok(Reading::take(table, slot_of(table, name)?, record, now_ns)?)
    }

    /// Reads the newest record of a followed diagnoser: the fastest way.
    ///
    /// # Errors
    /// As for [`read`](Self::read), and [`MonitorError::ForeignHandle`].
    pub fn read_followed(
        &mut self,
        diagnoser: Followed,
        record: &mut StepRecord,
    ) -> Result<Reading, MonitorError> {
        let now_ns = monotonic_ns();
        self.refresh(now_ns);
        let (name, slot) = self
            .followed
            .get(diagnoser.0)
            .ok_or(MonitorError::ForeignHandle)?;
        let Some(table) = &self.latest.table else {
            return Ok(NO_DAEMON);
        };
        let slot = slot.ok_or_else(|| no_such_diagnoser(table, name))?;
        Ok(Reading::take(table, slot, record, now_ns)?)
    }

    /// Looks for a new life of the daemon, unless the known one lives or it was looked for just now.
    fn refresh(&mut self, now_ns: u64) {
        if let Some(table) = self.latest.find_later(now_ns) {
            for (name, slot) in &mut self.followed {
                *slot = table.directory().slot_of(name);
            }
            self.latest.set(table);
        }
    }
}

const NO_DAEMON: Reading = Reading {
    freshness: Freshness::Dead,
    number: 0,
    epoch: 0,
};

fn slot_of(table: &TableReader, name: &str) -> Result<usize, MonitorError> {
    table
        .directory()
        .slot_of(name)
        .ok_or_else(|| no_such_diagnoser(table, name))
}

fn no_such_diagnoser(table: &TableReader, name: &str) -> MonitorError {
    let names: Vec<_> = table
        .directory()
        .spec
        .slots
        .iter()
        .map(|slot| format!("`{}`", slot.name))
        .collect();
    let known = if names.is_empty() {
        "none at all".into()
    } else {
        names.join(", ")
    };
    MonitorError::NoSuchDiagnoser {
        name: name.into(),
        known,
    }
}
