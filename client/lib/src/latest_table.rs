//! The table of the latest known life of a daemon, and how a later one is found.

use std::path::PathBuf;
use std::time::Duration;

use residual_shared::bounds_table::{Liveness, OpenError, TableReader};
use residual_shared::names::Instance;

/// How often a client without a living daemon looks for one, nanoseconds: 20 ms.
///
/// Soon enough that a restart costs a client a few steps at most, rare enough that a hundred waiting clients
/// cost nothing (one `stat` each).
pub const RETRY_PERIOD_NS: u64 = 20_000_000;

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

/// The table of the latest known life of a daemon.
#[derive(Debug)]
pub(crate) struct LatestTable {
    path: PathBuf,
    pub(crate) table: Option<TableReader>,
    /// Why the latest attempt to open a table failed.
    error: Option<OpenError>,
    retry_at_ns: u64,
}

impl LatestTable {
    /// Of an instance whose daemon has not been looked for yet.
    pub(crate) fn unknown(instance: &Instance) -> Self {
        Self {
            path: instance.bounds_path(),
            table: None,
            error: None,
            retry_at_ns: 0,
        }
    }

    /// Of an instance that has a table.
    pub(crate) fn open(instance: &Instance) -> Result<Self, OpenError> {
        let table = TableReader::open(&instance.bounds_path())?;
        Ok(Self {
            table: Some(table),
            ..Self::unknown(instance)
        })
    }

    /// Whether the daemon of the known table lives at the moment `now_ns` of CLOCK_MONOTONIC.
    pub(crate) fn is_running(&self, now_ns: u64) -> bool {
        (self.table.as_ref()).is_some_and(|table| table.liveness(now_ns) == Liveness::Running)
    }

    /// The table of a later life, unless the known one lives or it was looked for just now.
    pub(crate) fn find_later(&mut self, now_ns: u64) -> Option<TableReader> {
        if self.is_running(now_ns) || now_ns < self.retry_at_ns {
            return None;
        }
        self.retry_at_ns = now_ns.saturating_add(RETRY_PERIOD_NS);
        if self.table.as_ref().is_some_and(|table| !table.is_replaced()) {
            return None;
        }
        match TableReader::open(&self.path) {
            Ok(table) => Some(table),
            Err(error) => {
                self.error = Some(error);
                None
            }
        }
    }

    /// Makes `table` the latest one.
    pub(crate) fn set(&mut self, table: TableReader) {
        self.table = Some(table);
        self.error = None;
    }

    /// Whether the daemon lives at the moment `now_ns` of CLOCK_MONOTONIC.
    pub(crate) fn state(&self, now_ns: u64) -> DaemonState<'_> {
        let liveness = self.table.as_ref().map(|table| table.liveness(now_ns));
        match (liveness, &self.error) {
            (Some(Liveness::Running), _) => DaemonState::Running,
            (_, Some(error)) => DaemonState::Unreachable(error),
            (Some(Liveness::Hung(age)), None) => DaemonState::Hung(age),
            (Some(Liveness::Closed), None) => DaemonState::Closed,
            (None, None) => DaemonState::Unknown,
        }
    }
}
