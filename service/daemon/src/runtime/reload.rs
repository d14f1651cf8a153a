//! Reading the configuration again: everything is loaded, validated and built before the step thread hears of it.

use std::fmt::Write as _;
use std::path::Path;
use std::sync::Arc;
use std::thread;
use std::time::Duration;

use residual_diagnosis::method::Designed;
use residual_shared::bounds_table::{Access, CreateError, PreparedTable};
use residual_shared::control::{Changes, ControlError, ReloadOutcome};
use tracing::warn;

use super::checkpoint::Identity;
use super::command::{Command, Reply};
use super::companion::StepThread;
use super::exchange::{Exchange, ExchangeError, Reported};
use super::running::{Grid, Running};
use super::upkeep::Upkeep;
use crate::assembly::{assemble, descriptions, introduction, table_spec};
use crate::configuration::{Configuration, ConfigurationError};

/// Most mistakes that an answer tells.
const MISTAKES_TOLD: usize = 40;

/// How often the step thread is asked again while the companion is behind.
const ATTEMPTS: u32 = 20;

/// From one attempt to the next.
const RETRY_AFTER: Duration = Duration::from_millis(50);

/// Why the daemon goes on with the configuration that it had.
#[derive(Debug, thiserror::Error)]
pub enum ReloadError {
    /// There is no file to be read again.
    #[error(
        "the configuration came from standard input and cannot be read again; start the daemon with a file, or \
         stop it and start it again"
    )]
    StandardInput,
    /// It has not begun.
    #[error("the daemon is starting; ask again")]
    Starting,
    /// The new configuration is wrong.
    #[error("{}", told(.0))]
    Configuration(#[from] ConfigurationError),
    /// The new configuration differs in something that cannot change.
    #[error("a restart is needed to change {0}; change it back, or stop the daemon and start it again")]
    NeedsRestart(String),
    /// The new bounds table cannot be made.
    #[error(transparent)]
    Table(#[from] CreateError),
    /// The step thread could not exchange the configuration.
    #[error(transparent)]
    Exchange(#[from] ExchangeError),
    /// The step thread did not answer.
    #[error(transparent)]
    Step(#[from] ControlError),
}

/// Reads the configuration again and goes on with it; says what changed.
///
/// # Errors
/// [`ReloadError`]; the daemon goes on as before then.
pub(super) fn reload(upkeep: &Upkeep, step_thread: &StepThread) -> Result<ReloadOutcome, ReloadError> {
    let source = upkeep.source.as_deref().ok_or(ReloadError::StandardInput)?;
    let grid = upkeep.grid().ok_or(ReloadError::Starting)?;
    let running = upkeep.running();
    let (configuration, diagnosers) = load(source, &running.configuration)?;
    let new = Arc::new(Running::new(configuration, &diagnosers));
    let outcome = outcome(&new, &running);
    let mut exchange = Box::new(prepare(&new, &running, diagnosers, grid)?);
    for attempt in 1.. {
        let Reply::Exchanged(returned, result) = step_thread.command(Command::Exchange(exchange))? else {
            return Err(ReloadError::Starting);
        };
        match result {
            Ok(()) => break,
            Err(ExchangeError::CompanionBehind) if attempt < ATTEMPTS => thread::sleep(RETRY_AFTER),
            Err(error) => return Err(error.into()),
        }
        exchange = returned;
    }
    let filter = &new.configuration.daemon.log;
    if *filter != running.configuration.daemon.log
        && let Err(error) = upkeep.log.set(filter)
    {
        warn!(%error, filter, "the log goes on with its filter");
    }
    upkeep.set_running(new);
    Ok(outcome)
}

/// Loads and validates as at a start, gains included, and refuses what cannot change while the daemon runs.
fn load(source: &Path, present: &Configuration) -> Result<(Configuration, Vec<Designed>), ReloadError> {
    let loaded = Configuration::from_file(source)?;
    let unchangeable = unchangeable(present, &loaded.configuration);
    if !unchangeable.is_empty() {
        return Err(ReloadError::NeedsRestart(unchangeable.join(", ")));
    }
    let diagnosers = loaded.build_diagnosers()?;
    for (configured, built) in loaded.configuration.diagnosers.iter().zip(&diagnosers) {
        for warning in &built.warnings {
            warn!(diagnoser = configured.name, "{warning}");
        }
    }
    Ok((loaded.configuration, diagnosers))
}

/// The keys in which the two differ though they cannot change while the daemon runs: names and paths that others
/// have opened, the scheduling of a running thread, and the sizes of queues.
fn unchangeable(present: &Configuration, new: &Configuration) -> Vec<String> {
    let keys = [
        (
            present.daemon.instance != new.daemon.instance,
            "`instance` in [daemon]",
        ),
        (
            present.daemon.runtime_directory != new.daemon.runtime_directory,
            "`runtime_directory` in [daemon]",
        ),
        (
            present.daemon.record_queue != new.daemon.record_queue,
            "`record_queue` in [daemon]",
        ),
        (present.realtime != new.realtime, "[realtime]"),
    ];
    let mut differing: Vec<String> = (keys.into_iter().filter(|(differs, _)| *differs))
        .map(|(_, key)| key.to_owned())
        .collect();
    for input in &new.inputs {
        let Some(before) = present.inputs.iter().find(|before| before.name == input.name) else {
            continue;
        };
        if before.buffer_samples != input.buffer_samples {
            differing.push(format!("`buffer_samples` of the input `{}`", input.name));
        }
        if before.max_publishers != input.max_publishers {
            differing.push(format!("`max_publishers` of the input `{}`", input.name));
        }
    }
    differing
}

/// Builds everything that the step thread will go on with.
fn prepare(
    new: &Arc<Running>,
    present: &Running,
    diagnosers: Vec<Designed>,
    grid: Grid,
) -> Result<Exchange, ReloadError> {
    let configuration = &new.configuration;
    let daemon = &configuration.daemon;
    let introduction = introduction(configuration, &diagnosers);
    let spec = table_spec(
        configuration,
        &descriptions(&diagnosers),
        grid.time,
        grid.epoch_ns,
    );
    let access = Access {
        group: daemon.group,
        mode: daemon.mode,
    };
    let engine = assemble(configuration, diagnosers, grid.epoch_ns, grid.time.speed);
    let number_of = |name: &str| configuration.inputs.iter().position(|input| input.name == name);
    Ok(Exchange {
        running: Arc::clone(new),
        same: new.identities.correspondence(&present.identities),
        input_numbers: (present.configuration.inputs.iter())
            .map(|input| number_of(&input.name))
            .collect(),
        prepared: Some(PreparedTable::create(
            &daemon.instance().bounds_path(),
            &spec,
            &access,
        )?),
        replaced: None,
        introduction: Some(Box::new(introduction)),
        reported: Reported::of(&engine),
        engine,
    })
}

fn outcome(new: &Running, old: &Running) -> ReloadOutcome {
    ReloadOutcome {
        diagnosers: changes(&new.identities.diagnosers, &old.identities.diagnosers),
        inputs: changes(&new.identities.inputs, &old.identities.inputs),
    }
}

fn changes(new: &[Identity], old: &[Identity]) -> Changes {
    let names = |of: &[Identity], chosen: &dyn Fn(&Identity) -> bool| -> Vec<String> {
        let chosen = of.iter().filter(|identity| chosen(identity));
        chosen.map(|identity| identity.name.clone()).collect()
    };
    let has_name = |list: &[Identity], name: &str| list.iter().any(|identity| identity.name == name);
    let mut changes = Changes {
        unchanged: new.iter().filter(|identity| old.contains(identity)).count() as u32,
        changed: names(new, &|identity| {
            has_name(old, &identity.name) && !old.contains(identity)
        }),
        added: names(new, &|identity| !has_name(old, &identity.name)),
        removed: names(old, &|identity| !has_name(new, &identity.name)),
        more: 0,
    };
    for list in [&mut changes.changed, &mut changes.added, &mut changes.removed] {
        changes.more += list.len().saturating_sub(Changes::NAMES) as u32;
        list.truncate(Changes::NAMES);
    }
    changes
}

/// Every mistake with its place, one a line.
fn told(error: &ConfigurationError) -> String {
    let mut text = error.to_string();
    let mistakes = error.mistakes();
    for mistake in mistakes.iter().take(MISTAKES_TOLD) {
        let (line, column, message) = (mistake.line, mistake.column, &mistake.message);
        let help = mistake.help.as_deref().map(|help| format!("; {help}"));
        // Writing to a text cannot fail.
        let _ = write!(text, "\n{line}:{column}: {message}{}", help.unwrap_or_default());
    }
    if mistakes.len() > MISTAKES_TOLD {
        let _ = write!(text, "\nand {} more", mistakes.len() - MISTAKES_TOLD);
    }
    text
}
