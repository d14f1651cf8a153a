//! What the other processes of these measurements do: hidden subcommands.

use std::path::PathBuf;
use std::process::ExitCode;

use anyhow::{Result, ensure};
use clap::Subcommand;
use nix::sys::signal::{Signal, kill};
use nix::unistd::Pid;
use residuald::cli::{Command, CommandLine, SummaryFormat};

use super::{alarm, crowd, latency, write};
use crate::process::wait_until_asked_to_end;

/// Name of the subcommand that holds the roles.
pub const SUBCOMMAND: &str = "path";

/// The roles.
#[derive(Clone, Debug, Subcommand)]
pub enum Role {
    /// The daemon itself.
    Daemon {
        /// Its configuration.
        configuration: PathBuf,
    },
    /// Publishes samples for each sampling instant.
    Publisher(latency::publisher::Options),
    /// Looks for new bounds without pause.
    Client(latency::client::Options),
    /// Sleeps until instants between those of the daemon.
    Timer(latency::timer::Options),
    /// Sleeps until it is woken.
    AlarmConsumer(alarm::consumer::Options),
    /// Reads records, or sleeps until an alarm, while told to.
    Member(crowd::member::Options),
    /// Publishes samples that raise and clear alarms.
    Toggler(write::toggler::Options),
}

/// Plays a role to its end.
///
/// # Errors
/// It fails.
pub fn play(role: &Role) -> Result<()> {
    match role {
        Role::Daemon { configuration } => daemon(configuration.clone()),
        Role::Publisher(options) => latency::publisher::play(options),
        Role::Client(options) => latency::client::play(options),
        Role::Timer(options) => latency::timer::play(options),
        Role::AlarmConsumer(options) => alarm::consumer::play(options),
        Role::Member(options) => crowd::member::play(options),
        Role::Toggler(options) => write::toggler::play(options),
    }
}

/// `residuald run`, until asked to end; its summary is one line of JSON.
fn daemon(configuration: PathBuf) -> Result<()> {
    std::thread::spawn(|| {
        wait_until_asked_to_end();
        // Its own process; the signal is what stops a daemon in good order.
        let _ = kill(Pid::this(), Signal::SIGTERM);
    });
    let command = Command::Run {
        configuration,
        speed: 1.0,
        summary: SummaryFormat::Json,
    };
    let code = CommandLine { command }.execute();
    ensure!(code == ExitCode::SUCCESS, "the daemon failed");
    Ok(())
}
