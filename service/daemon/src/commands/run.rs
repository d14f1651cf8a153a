//! `residuald run`: the daemon.

use std::io;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

use residual_shared::bounds_table::{Access, CreateError, TableWriter};
use residual_shared::clock::{DaemonTime, monotonic_ns};
use residual_shared::control::ControlError;
use residual_shared::names::Instance;
use residual_shared::transport::{self, Node, SampleSubscriber, TransportError};
use rtrb::Producer;
use signal_hook::consts::{SIGHUP, SIGINT, SIGTERM};
use signal_hook::flag;
use tracing::{info, warn};

use super::descriptions;
use crate::assembly::{assemble, descriptions, log_names, table_spec};
use crate::configuration::Configuration;
use crate::logging::LogFilter;
use crate::runtime::command::{self, CommandInbox};
use crate::runtime::companion::{Companion, Control, Identity, Message, Work};
use crate::runtime::live::{Publication, StepLoop};
use crate::runtime::lock::{InstanceLock, LockError};
use crate::runtime::real_time;
use crate::summary::Summary;
use residual_diagnosis::method::Designed;

/// From start-up to the epoch of the schedule: lets everything settle before the first step.
const HEAD_START_NS: u64 = 20_000_000;

/// Why the daemon could not run.
#[derive(Debug, thiserror::Error)]
pub enum RunError {
    /// Another daemon has the instance, or its lock is not to be had.
    #[error(transparent)]
    Lock(#[from] LockError),
    /// iceoryx2 refused.
    #[error(transparent)]
    Transport(#[from] TransportError),
    /// The bounds table could not be created.
    #[error(transparent)]
    Table(#[from] CreateError),
    /// Signal handlers could not be installed.
    #[error("cannot install signal handlers: {0}")]
    Signals(io::Error),
    /// The speed is not a positive number.
    #[error("the speed {0} is not possible; use a number above 0, for example 1 or 4")]
    Speed(f64),
}

/// Runs the daemon until it is told to stop (SIGTERM, SIGINT, SIGHUP); a second signal ends it at once.
///
/// Control requests may change the filter of the `log`.
///
/// With a `speed` other than 1 the daemon's time runs faster or slower than the clock, for replays.
pub fn run(
    configuration: &Configuration,
    diagnosers: Vec<Designed>,
    speed: f64,
    log: LogFilter,
) -> Result<Summary, RunError> {
    if !(speed > 0.0 && speed.is_finite()) {
        return Err(RunError::Speed(speed));
    }
    let stop = stop_flag().map_err(RunError::Signals)?;
    let instance = configuration.daemon.instance();
    let _lock = InstanceLock::take(&instance)?;
    transport::remove_leftovers(&instance)?;
    let outcome = monitor(configuration, diagnosers, speed, log, &instance, &stop);
    let removed = transport::remove_leftovers(&instance);
    let summary = outcome?;
    removed?;
    Ok(summary)
}

/// Everything between taking the instance and giving it back.
fn monitor(
    configuration: &Configuration,
    diagnosers: Vec<Designed>,
    speed: f64,
    log: LogFilter,
    instance: &Instance,
    stop: &AtomicBool,
) -> Result<Summary, RunError> {
    for (configured, built) in configuration.diagnosers.iter().zip(&diagnosers) {
        for warning in &built.warnings {
            warn!(diagnoser = configured.name, "{warning}");
        }
    }
    let node = transport::open_node(instance)?;
    let (sender, receiver) = rtrb::RingBuffer::new(configuration.daemon.record_queue);
    let names = log_names(configuration, &descriptions(&diagnosers));
    let (commands, inbox) = command::channel();
    let control = Control {
        identity: Identity {
            program: env!("CARGO_PKG_VERSION").into(),
            diagnosers: descriptions::descriptions(configuration, &diagnosers),
        },
        commands,
        log,
        work: work(),
    };
    let companion = Companion::start(instance.clone(), names, receiver, control)?;
    // After the companion, which shall keep the usual scheduling, and before the epoch: locking memory takes
    // longer than a sampling period.
    real_time::apply(&configuration.realtime);
    let step_loop = step_loop(configuration, diagnosers, speed, &node, sender, inbox, stop)?;
    info!(
        instance = %instance.name,
        table = %instance.bounds_path().display(),
        diagnosers = configuration.diagnosers.len(),
        "running"
    );
    let engine = step_loop.run();
    let control = companion.finish();
    info!("stopped");
    Ok(Summary::of(configuration, &engine, control))
}

/// The loop of the step thread with its subscribers and its bounds table, ready to run: the first sampling
/// instant comes 20 ms from now.
///
/// Records and changed counters go into `queue` as well; `commands` are obeyed; `stop` ends the loop.
pub fn step_loop<'a>(
    configuration: &Configuration,
    diagnosers: Vec<Designed>,
    speed: f64,
    node: &Node,
    queue: Producer<Message>,
    commands: CommandInbox,
    stop: &'a AtomicBool,
) -> Result<StepLoop<'a>, RunError> {
    let instance = configuration.daemon.instance();
    let subscribers = configuration
        .inputs
        .iter()
        .map(|input| {
            SampleSubscriber::create(
                node,
                &instance,
                &input.name,
                input.buffer_samples,
                input.max_publishers,
            )
        })
        .collect::<Result<Vec<_>, _>>()?;

    let time = DaemonTime {
        origin_ns: monotonic_ns(),
        speed,
    };
    let epoch_ns = time.from_monotonic(time.origin_ns + HEAD_START_NS);
    let spec = table_spec(configuration, &descriptions(&diagnosers), time, epoch_ns);
    let engine = assemble(configuration, diagnosers, epoch_ns, speed);
    let access = Access {
        group: configuration.daemon.group,
        mode: configuration.daemon.mode,
    };
    let table = TableWriter::create(&instance.bounds_path(), &spec, &access)?;
    let publication = Publication::new(
        table,
        queue,
        configuration.inputs.len(),
        configuration.diagnosers.len(),
    );
    Ok(StepLoop {
        engine,
        subscribers,
        publication,
        commands,
        time,
        stop,
    })
}

/// What control requests that take long come to.
fn work() -> Work {
    Arc::new(|task, _| {
        Err(ControlError::Unsupported {
            reason: format!("it was built without {}; stop it and start it again", task.name()),
        })
    })
}

fn stop_flag() -> Result<Arc<AtomicBool>, io::Error> {
    let stop = Arc::new(AtomicBool::new(false));
    for signal in [SIGTERM, SIGINT, SIGHUP] {
        // In this order: the first signal finds the flag unset and sets it, the second one ends the process.
        flag::register_conditional_shutdown(signal, 1, Arc::clone(&stop))?;
        flag::register(signal, Arc::clone(&stop))?;
    }
    Ok(stop)
}
