//! The long tasks of a running daemon, checkpoint and reload, each on a thread of its own, one at a time.

use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, OnceLock, PoisonError};
use std::time::{Duration, Instant};

use residual_shared::control::{Answer, CheckpointOutcome, ControlError, Response};
use tracing::{info, warn};

use super::checkpoint::{Checkpoint, CheckpointError};
use super::command::{Command, Reply};
use super::companion::{Due, StepThread, Task, Work};
use super::engine::Engine;
use super::reload;
use super::running::{Grid, Running};
use super::snapshot::{Progress, Snapshot};
use crate::logging::LogFilter;

/// What the tasks work on.
pub struct Upkeep {
    /// The configuration file; none if the configuration came from standard input.
    pub(super) source: Option<PathBuf>,
    /// The filter of the log.
    pub(super) log: LogFilter,
    /// Set as soon as the schedule stands.
    grid: OnceLock<Grid>,
    running: Mutex<Arc<Running>>,
    snapshot: Mutex<SnapshotRoom>,
    /// Set by a signal: reload.
    reload: Arc<AtomicBool>,
}

/// Where states are written to.
#[derive(Default)]
struct SnapshotRoom {
    /// Its room is kept from one checkpoint to the next; a checkpoint that ended in the middle has taken it away.
    snapshot: Box<Snapshot>,
    /// Whether the last checkpoint has been made.
    finished: bool,
}

/// Why there is no new checkpoint.
#[derive(Debug, thiserror::Error)]
enum NoCheckpoint {
    #[error("no checkpoint file is configured; name one with `checkpoint_file` in [daemon] and reload")]
    NoFile,
    #[error("the daemon is starting; ask again")]
    Starting,
    #[error(transparent)]
    File(#[from] CheckpointError),
    #[error(transparent)]
    Step(#[from] ControlError),
    #[error("another configuration came in between; ask again")]
    Exchanged,
}

impl Upkeep {
    /// Upkeep of a daemon with this configuration, from the file `source`; `reload` asks for a reload.
    pub fn new(
        source: Option<PathBuf>,
        log: LogFilter,
        running: Arc<Running>,
        reload: Arc<AtomicBool>,
    ) -> Arc<Self> {
        Arc::new(Self {
            source,
            log,
            grid: OnceLock::new(),
            running: Mutex::new(running),
            snapshot: Mutex::default(),
            reload,
        })
    }

    /// The schedule stands.
    pub fn begin(&self, grid: Grid) {
        // A daemon has one schedule.
        let _ = self.grid.set(grid);
    }

    /// Does a task when it is asked for.
    pub fn work(self: &Arc<Self>) -> Work {
        let upkeep = Arc::clone(self);
        Arc::new(move |task, step_thread| upkeep.execute(task, step_thread))
    }

    /// Says when a task is due: a reload after its signal, a checkpoint after each period.
    pub fn due(self: &Arc<Self>) -> Due {
        let upkeep = Arc::clone(self);
        let mut last = Instant::now();
        Box::new(move || {
            if upkeep.grid.get().is_some() && upkeep.reload.swap(false, Ordering::Relaxed) {
                info!("reload: asked for by a signal");
                return Some(Task::Reload);
            }
            let period_ns = upkeep.running().configuration.daemon.checkpoint_period_ns?;
            if last.elapsed() < Duration::from_nanos(period_ns) {
                return None;
            }
            last = Instant::now();
            Some(Task::Checkpoint)
        })
    }

    /// The configuration in force.
    pub(super) fn running(&self) -> Arc<Running> {
        Arc::clone(&locked(&self.running))
    }

    /// The schedule, once it stands.
    pub(super) fn grid(&self) -> Option<Grid> {
        self.grid.get().copied()
    }

    /// Another configuration is in force.
    pub(super) fn set_running(&self, running: Arc<Running>) {
        *locked(&self.running) = running;
    }

    fn execute(&self, task: Task, step_thread: &StepThread) -> Answer {
        match task {
            Task::Checkpoint => match self.checkpoint(step_thread) {
                Ok(outcome) => Ok(Response::Checkpoint(outcome)),
                Err(NoCheckpoint::Step(error)) => Err(error),
                Err(error) => Err(refused(&error)),
            },
            Task::Reload => match reload::reload(self, step_thread) {
                Ok(outcome) => Ok(Response::Reload(outcome)),
                Err(error) => Err(refused(&error)),
            },
        }
    }

    /// Lets the step thread write all states, a few at a time, and puts them into the file.
    fn checkpoint(&self, step_thread: &StepThread) -> Result<CheckpointOutcome, NoCheckpoint> {
        let running = self.running();
        let file = running.configuration.daemon.checkpoint_file.as_deref();
        let file = file.ok_or(NoCheckpoint::NoFile)?;
        let grid = self.grid().ok_or(NoCheckpoint::Starting)?;
        let mut room = locked(&self.snapshot);
        if room.finished {
            return Err(ControlError::Stopping.into());
        }
        let mut snapshot = std::mem::take(&mut room.snapshot);
        snapshot.clear();
        loop {
            let Reply::Saved(written, progress) = step_thread.command(Command::Save(snapshot))? else {
                return Err(NoCheckpoint::Exchanged);
            };
            snapshot = written;
            match progress {
                Progress::Whole => break,
                Progress::NoRoom => snapshot.grow(),
                Progress::Unfinished => {}
            }
        }
        let outcome = write(file, &running, grid, &snapshot);
        room.snapshot = snapshot;
        outcome
    }

    /// The last checkpoint, of an engine that has stopped.
    pub fn finish(&self, engine: &Engine, running: &Running) {
        let Some(file) = &running.configuration.daemon.checkpoint_file else {
            return;
        };
        // A checkpoint that is being written is waited for; there is no later one.
        let mut room = locked(&self.snapshot);
        room.finished = true;
        let snapshot = &mut room.snapshot;
        snapshot.clear();
        while engine.save(snapshot, || true) != Progress::Whole {
            snapshot.grow();
        }
        let written = self.grid().map(|grid| write(file, running, grid, snapshot));
        match written {
            Some(Ok(outcome)) => info!(path = outcome.path, bytes = outcome.bytes, "checkpoint"),
            Some(Err(error)) => warn!("{error}"),
            None => {}
        }
    }
}

/// Writes the checkpoint file.
fn write(
    file: &Path,
    running: &Running,
    grid: Grid,
    snapshot: &Snapshot,
) -> Result<CheckpointOutcome, NoCheckpoint> {
    let bytes = Checkpoint::of(running, grid, snapshot.bytes().to_vec()).write(file)?;
    Ok(CheckpointOutcome {
        path: file.display().to_string(),
        diagnosers: running.identities.diagnosers.len() as u32,
        bytes,
    })
}

fn refused(error: &dyn std::error::Error) -> ControlError {
    ControlError::Refused {
        reason: error.to_string(),
    }
}

/// What a task that failed in the middle has left is whole: it is replaced as a whole.
fn locked<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}
