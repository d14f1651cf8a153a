//! The command line: one subcommand, one file in [`crate::commands`].

use crate::commands::check;
use clap::{Parser, Subcommand};
use miette::Report;
use std::path::PathBuf;
use std::process::ExitCode;

/// Fault-diagnosis monitor for vehicle computers.
#[derive(Debug, Parser)]
#[command(name = "residuald", version, propagate_version = true)]
pub struct CommandLine {
    /// What to do.
    #[command(subcommand)]
    pub command: Command,
}

/// The subcommands.
#[derive(Debug, Subcommand)]
pub enum Command {
    /// Check a configuration without starting anything: exit code 0 if the daemon would accept it, otherwise 1.
    Check {
        /// The configuration file (TOML).
        configuration: PathBuf,
    },
}

impl CommandLine {
    /// Executes the command; a failure is reported on standard error and gives the exit code 1.
    pub fn execute(self) -> ExitCode {
        let result = match self.command {
            Command::Check { configuration } => check::execute(&configuration, &mut std::io::stdout().lock()),
        };
        match result {
            Ok(()) => ExitCode::SUCCESS,
            Err(report) => {
                report_failure(&report);
                ExitCode::FAILURE
            }
        }
    }
}

/// Writes a failure with its places and its help to standard error.
fn report_failure(report: &Report) {
    eprintln!("{report:?}");
}
