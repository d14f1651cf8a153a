//! `residuald run`: the daemon.

use std::io;
use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

use residual_shared::bounds_table::{Access, CreateError, PreparedTable};
use residual_shared::names::Instance;
use residual_shared::transport::{self, Node, RecordAudience, TransportError};
use rtrb::Producer;
use signal_hook::consts::{SIGHUP, SIGINT, SIGTERM};
use signal_hook::flag;
use tracing::{info, warn};

use crate::assembly::{assemble, descriptions, introduction, table_spec};
use crate::configuration::Configuration;
use crate::logging::LogFilter;
use crate::runtime::command::{self, CommandInbox};
use crate::runtime::companion::{Companion, Control, Message};
use crate::runtime::exchange::{Reported, Subscription};
use crate::runtime::life::Life;
use crate::runtime::live::{Publication, StepLoop, Sweep};
use crate::runtime::lock::{InstanceLock, LockError};
use crate::runtime::real_time;
use crate::runtime::resume::resume_alarms;
use crate::runtime::running::Running;
use crate::runtime::upkeep::Upkeep;
use crate::summary::Summary;
use residual_diagnosis::method::Designed;

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

/// How the daemon runs, beside its configuration.
pub struct RunOptions {
    /// The configuration file, to be read again at a reload; none if it cannot be.
    pub source: Option<PathBuf>,
    /// Seconds of the daemon's time per second of the clock; other than 1 for replays.
    pub speed: f64,
    /// The filter of the log, which control requests may change.
    pub log: LogFilter,
}

/// What signals ask for.
struct Signals {
    /// Stop.
    stop: Arc<AtomicBool>,
    /// Read the configuration again.
    reload: Arc<AtomicBool>,
}

/// Runs the daemon until it is told to stop (SIGTERM, SIGINT); a second such signal ends it at once. SIGHUP lets it
/// read its configuration again.
///
/// # Errors
/// [`RunError`].
pub fn run(
    configuration: Configuration,
    diagnosers: Vec<Designed>,
    options: RunOptions,
) -> Result<Summary, RunError> {
    if !(options.speed > 0.0 && options.speed.is_finite()) {
        return Err(RunError::Speed(options.speed));
    }
    let signals = signals().map_err(RunError::Signals)?;
    let instance = configuration.daemon.instance();
    let _lock = InstanceLock::take(&instance)?;
    transport::remove_leftovers(&instance)?;
    let outcome = monitor(configuration, diagnosers, options, &instance, signals);
    let removed = transport::remove_leftovers(&instance);
    let summary = outcome?;
    removed?;
    Ok(summary)
}

/// Everything between taking the instance and giving it back.
fn monitor(
    configuration: Configuration,
    diagnosers: Vec<Designed>,
    options: RunOptions,
    instance: &Instance,
    signals: Signals,
) -> Result<Summary, RunError> {
    for (configured, built) in configuration.diagnosers.iter().zip(&diagnosers) {
        for warning in &built.warnings {
            warn!(diagnoser = configured.name, "{warning}");
        }
    }
    let node = transport::open_node(instance)?;
    let (sender, receiver) = rtrb::RingBuffer::new(configuration.daemon.record_queue);
    let (commands, inbox) = command::channel();
    let introduction = introduction(&configuration, &diagnosers);
    let running = Arc::new(Running::new(configuration, &diagnosers));
    let RunOptions { source, speed, log } = options;
    let upkeep = Upkeep::new(source, log.clone(), Arc::clone(&running), signals.reload);
    let control = Control {
        commands,
        log,
        work: upkeep.work(),
        due: upkeep.due(),
    };
    let companion = Companion::start(instance.clone(), introduction, receiver, control)?;
    // After the companion, which shall keep the usual scheduling, and before the epoch: locking memory takes
    // longer than a sampling period.
    real_time::apply(&running.configuration.realtime);
    let life = Life::begin(&running.configuration.daemon, speed);
    let mut step_loop = step_loop(
        Arc::clone(&running),
        diagnosers,
        &life,
        &node,
        sender,
        inbox,
        &signals.stop,
    )?;
    step_loop
        .publication
        .record_for(RecordAudience::open(&node, instance)?);
    upkeep.begin(life.grid);
    info!(
        instance = %instance.name,
        table = %instance.bounds_path().display(),
        diagnosers = running.configuration.diagnosers.len(),
        "running"
    );
    let (engine, running) = step_loop.run();
    // It gives up the tasks that wait for the step thread, before the last checkpoint.
    let control = companion.finish();
    upkeep.finish(&engine, &running);
    info!("stopped");
    Ok(Summary::of(&running.configuration, &engine, control))
}

/// The loop of the step thread with its subscribers and its bounds table, ready to run; in a new life the first
/// sampling instant comes 20 ms from its begin.
///
/// Records and changed counters go into `queue` as well; `commands` are obeyed; `stop` ends the loop.
///
/// # Errors
/// [`RunError`].
pub fn step_loop<'a>(
    running: Arc<Running>,
    diagnosers: Vec<Designed>,
    life: &Life,
    node: &'a Node,
    queue: Producer<Message>,
    commands: CommandInbox,
    stop: &'a AtomicBool,
) -> Result<StepLoop<'a>, RunError> {
    let configuration = &running.configuration;
    let subscriptions = (0..configuration.inputs.len())
        .map(|input| Subscription::create(node, configuration, input))
        .collect::<Result<Vec<_>, _>>()?;
    let grid = life.grid;
    let spec = table_spec(
        configuration,
        &descriptions(&diagnosers),
        grid.time,
        grid.epoch_ns,
    );
    let mut engine = assemble(configuration, diagnosers, grid.epoch_ns, grid.time.speed);
    life.resume(&mut engine, &running);
    let access = Access {
        group: configuration.daemon.group,
        mode: configuration.daemon.mode,
    };
    let path = configuration.daemon.instance().bounds_path();
    let prepared = PreparedTable::create(&path, &spec, &access)?;
    let alarms = prepared.alarm_status();
    resume_alarms(&mut engine, &path, &alarms);
    for (slot, known) in alarms.iter().enumerate() {
        if known.is_none()
            && let Some(alarm) = engine.alarm(slot)
        {
            prepared.show_alarm_status(slot, &alarm.status());
        }
    }
    let table = prepared.publish()?;
    let publication = Publication::new(table, queue, Reported::of(&engine));
    publication.publish_all_counters(&engine);
    Ok(StepLoop {
        engine,
        running,
        subscriptions,
        node,
        publication,
        commands,
        time: grid.time,
        stop,
        sweep: Sweep::default(),
    })
}

fn signals() -> Result<Signals, io::Error> {
    let (stop, reload) = (Arc::new(AtomicBool::new(false)), Arc::default());
    // In this order: the first Ctrl-C finds the flag unset and sets it, the second one ends the process. Not so a
    // second SIGTERM: some supervisors send it to the process and then to its group, and mean one stop.
    flag::register_conditional_shutdown(SIGINT, 1, Arc::clone(&stop))?;
    for signal in [SIGTERM, SIGINT] {
        flag::register(signal, Arc::clone(&stop))?;
    }
    flag::register(SIGHUP, Arc::clone(&reload))?;
    Ok(Signals { stop, reload })
}
