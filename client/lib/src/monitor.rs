//! A client's view of one instance, over all lives of its daemon.

use std::path::PathBuf;
use std::time::Duration;

use residual_shared::bounds_table::{Liveness, OpenError, ReadError, TableReader};
use residual_shared::clock::monotonic_ns;
use residual_shared::names::Instance;
use residual_shared::record::StepRecord;

use crate::reading::{Freshness, Reading};

/// How often a monitor without a living daemon looks for one, nanoseconds: 20 ms.
///
/// Soon enough that a restart costs a client a few steps at most, rare enough that a hundred waiting clients
/// cost nothing (one `stat` each).
pub const RETRY_PERIOD_NS: u64 = 20_000_000;

/// A client's view of one instance, over all lives of its daemon.
///
/// While the daemon lives, reading makes no system call but for the clock, which needs none on the usual
/// processors. When it does not, reads look for a new one, at most every [`RETRY_PERIOD_NS`].
#[derive(Debug)]
pub struct Monitor {
    path: PathBuf,
    table: Option<TableReader>,
    /// Why the latest attempt to open a table failed.
    error: Option<OpenError>,
    retry_at_ns: u64,
    followed: Vec<(String, Option<usize>)>,
}

/// A diagnoser of one monitor, found by its name in every life of the daemon.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Followed(usize);

/// Whether there is a daemon, and if not, why.
#[derive(Clone, Copy, Debug)]
pub enum DaemonState<'a> {
    /// It lives.
    Running,
    /// It has given no sign of life for this long: stopped, killed, or kept from running.
    Hung(Duration),
    /// It has ended in good order, or before the machine's last boot.
    Closed,
    /// Its table cannot be opened.
    Unreachable(&'a OpenError),
    /// Nothing has been looked for yet.
    Unknown,
}

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
        let table = TableReader::open(&instance.bounds_path())?;
        Ok(Self {
            table: Some(table),
            ..Self::connect(instance)
        })
    }

    /// A monitor of an instance whose daemon need not have been started: until there is one, every diagnoser
    /// reads as [`Freshness::Dead`].
    pub fn connect(instance: &Instance) -> Self {
        Self {
            path: instance.bounds_path(),
            table: None,
            error: None,
            retry_at_ns: 0,
            followed: Vec::new(),
        }
    }

    /// The table of the latest known life of the daemon: its directory and counters.
    pub fn table(&self) -> Option<&TableReader> {
        self.table.as_ref()
    }

    /// Whether the daemon lives. Looks for a new one if it does not, as a read does.
    pub fn state(&mut self) -> DaemonState<'_> {
        let now_ns = monotonic_ns();
        self.refresh(now_ns);
        let liveness = self.table.as_ref().map(|table| table.liveness(now_ns));
        match (liveness, &self.error) {
            (Some(Liveness::Running), _) => DaemonState::Running,
            (_, Some(error)) => DaemonState::Unreachable(error),
            (Some(Liveness::Hung(age)), None) => DaemonState::Hung(age),
            (Some(Liveness::Closed), None) => DaemonState::Closed,
            (None, None) => DaemonState::Unknown,
        }
    }

    /// A handle that finds the diagnoser `name` in this and every later life of the daemon, wherever it lies.
    ///
    /// # Errors
    /// [`MonitorError::NoSuchDiagnoser`] if there is a daemon and it has none of this name.
    pub fn follow(&mut self, name: &str) -> Result<Followed, MonitorError> {
        self.refresh(monotonic_ns());
        let slot = match &self.table {
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
        let Some(table) = &self.table else {
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
        let Some(table) = &self.table else {
            return Ok(NO_DAEMON);
        };
        let slot = slot.ok_or_else(|| no_such_diagnoser(table, name))?;
        Ok(Reading::take(table, slot, record, now_ns)?)
    }

    /// Looks for a new life of the daemon, unless the known one lives or it was looked for just now.
    fn refresh(&mut self, now_ns: u64) {
        let is_running = |table: &TableReader| table.liveness(now_ns) == Liveness::Running;
        if self.table.as_ref().is_some_and(is_running) || now_ns < self.retry_at_ns {
            return;
        }
        self.retry_at_ns = now_ns.saturating_add(RETRY_PERIOD_NS);
        if self.table.as_ref().is_some_and(|table| !table.is_replaced()) {
            return;
        }
        match TableReader::open(&self.path) {
            Ok(table) => {
                for (name, slot) in &mut self.followed {
                    *slot = table.directory().slot_of(name);
                }
                self.table = Some(table);
                self.error = None;
            }
            Err(error) => self.error = Some(error),
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
