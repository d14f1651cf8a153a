//! The command line: one subcommand, one file in [`crate::commands`].

use std::io;
use std::path::PathBuf;
use std::process::ExitCode;

use clap::{Parser, Subcommand, ValueEnum};
use miette::{IntoDiagnostic, Report};

#[cfg(feature = "synthesis")]
use crate::commands::identify;
use crate::commands::run::RunOptions;
use crate::commands::{check, design, explain, generate, replay, run};
use crate::configuration::Configuration;
use crate::demo::conductor::DemoArguments;
use crate::demo::publisher::PublisherArguments;
use crate::demo::{Part, client, conductor, publisher};
use crate::logging;

const EXIT_CODES: &str = "\
Exit codes:
  0  done; `check`: the configuration is valid; `demo`: the right fault was isolated and there was no false alarm
  1  it failed, or the configuration or the recording was refused; the message says why and where
  2  wrong usage";

/// Fault-diagnosis monitor for vehicle computers.
#[derive(Debug, Parser)]
#[command(name = "residuald", version, propagate_version = true, after_help = EXIT_CODES)]
pub struct CommandLine {
    /// What to do.
    #[command(subcommand)]
    pub command: Command,
}

/// How the summary of a run is printed.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum SummaryFormat {
    /// For people.
    Text,
    /// One line of JSON.
    Json,
}

/// The subcommands.
#[derive(Debug, Subcommand)]
pub enum Command {
    /// Run the monitor until SIGTERM or SIGINT, then print what it did; SIGHUP lets it read the configuration again.
    Run {
        /// The configuration file (TOML); `-` reads it from standard input.
        configuration: PathBuf,
        /// Speed of the daemon's time, for replays: seconds of it per second of the clock.
        #[arg(long, default_value_t = 1.0)]
        speed: f64,
        /// Form of the summary on standard output.
        #[arg(long, value_enum, default_value = "text")]
        summary: SummaryFormat,
    },
    /// Check a configuration without starting anything: exit code 0 if the daemon would accept it, otherwise 1.
    Check {
        /// The configuration file (TOML).
        configuration: PathBuf,
    },
    /// Demonstrate: publisher, daemon and client in processes of their own, a fault, and its isolation.
    Demo(DemoArguments),
    /// Replay a recording instead of sensors, in this process or through a running daemon.
    Replay(replay::ReplayArguments),
    /// Find the gains of a configuration's diagnosers and write them to a gains file.
    Design(design::DesignArguments),
    /// Print what the gains of a gains file achieve, as it states it.
    Explain {
        /// The gains file.
        gains: PathBuf,
    },
    /// Identify a model, its disturbance and noise bounds, or its covariances from a fault-free recording.
    #[cfg(feature = "synthesis")]
    Identify(identify::IdentifyArguments),
    /// Identify disturbance and noise bounds (not in this program: it was built without the feature `synthesis`).
    #[cfg(not(feature = "synthesis"))]
    #[command(disable_help_flag = true)]
    Identify {
        /// Anything.
        #[arg(trailing_var_arg = true, allow_hyphen_values = true)]
        arguments: Vec<std::ffi::OsString>,
    },
    /// Write shell completions or man pages.
    #[command(subcommand)]
    Generate(generate::Generated),
    /// The publisher of the demonstration.
    #[command(hide = true)]
    DemoPublisher(PublisherArguments),
    /// The client of the demonstration.
    #[command(hide = true)]
    DemoClient(Part),
}

impl CommandLine {
    /// Executes the command; a failure is reported on standard error and gives the exit code 1.
    pub fn execute(self) -> ExitCode {
        let result = match self.command {
            Command::Run {
                configuration,
                speed,
                summary,
            } => execute_run(&configuration, speed, summary),
            Command::Check { configuration } => check::execute(&configuration, &mut io::stdout().lock()),
            Command::Demo(arguments) => conductor::execute(&arguments).into_diagnostic(),
            Command::Replay(arguments) => replay::execute(&arguments).map_err(Report::new),
            Command::Design(arguments) => design::execute(&arguments),
            Command::Explain { gains } => explain::execute(&gains, &mut io::stdout().lock()),
            #[cfg(feature = "synthesis")]
            Command::Identify(arguments) => identify::execute(&arguments),
            #[cfg(not(feature = "synthesis"))]
            Command::Identify { .. } => Err(miette::miette!(
                help = "use a program with the default features, for instance `cargo install --path service/daemon`",
                "this program was built without the feature `synthesis`: it has no solver and cannot identify"
            )),
            Command::Generate(generated) => generate::execute(&generated, &mut io::stdout().lock()),
            Command::DemoPublisher(arguments) => publisher::execute(&arguments).into_diagnostic(),
            Command::DemoClient(arguments) => {
                client::execute(&arguments, &mut io::stdout().lock()).into_diagnostic()
            }
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

fn execute_run(path: &std::path::Path, speed: f64, format: SummaryFormat) -> Result<(), Report> {
    let loaded = if path.as_os_str() == "-" {
        let text = io::read_to_string(io::stdin()).into_diagnostic()?;
        Configuration::from_text("standard input", &text)?
    } else {
        Configuration::from_file(path)?
    };
    let (_log, filter) = logging::start(&loaded.configuration.daemon.log).into_diagnostic()?;
    let diagnosers = loaded.build_diagnosers()?;
    let options = RunOptions {
        source: (path.as_os_str() != "-").then(|| path.to_owned()),
        speed,
        log: filter,
    };
    let summary = run::run(loaded.configuration, diagnosers, options).into_diagnostic()?;
    match format {
        SummaryFormat::Text => println!("{summary}"),
        SummaryFormat::Json => println!("{}", serde_json::to_string(&summary).into_diagnostic()?),
    }
    Ok(())
}

/// Writes a failure with its places and its help to standard error.
fn report_failure(report: &Report) {
    eprintln!("{report:?}");
}
