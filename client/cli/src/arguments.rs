//! The command line.

use std::path::PathBuf;

use clap::{Parser, Subcommand};
use residual_client::{DEFAULT_RUNTIME_DIRECTORY, InstanceName, RUNTIME_DIRECTORY_VARIABLE};

use crate::alarms::AlarmOptions;
use crate::ctl::ControlArguments;
use crate::export::ExportTarget;
use crate::generate::Generated;
use crate::plot::PlotArguments;
use crate::record::RecordArguments;
use crate::watch::WatchOptions;

/// What the program's end tells.
pub const EXIT_CODES: &str = "\
Exit codes:
  0  all is well; `status`: every diagnoser has judged its latest instant and neither a record nor an alarm
     reports a fault
  1  an error, such as a table that may not be read; `ctl`: the daemon refused
  2  wrong usage
  3  there is no living daemon (the last state and the alarms it left are shown all the same)
  4  `status`: a diagnoser reports a fault, or its alarm is raised, isolated or latched
  5  `status`: no fault is reported, but a diagnoser does not judge: stale, starting, not evaluated, or
     guarantee lost
  6  `ctl`: the daemon did not answer in time
  7  `record`: the recording is whole, but something was lost on the way to it; it says how much";

/// Looks at the diagnosers of a residuald daemon, and controls it.
#[derive(Debug, Parser)]
#[command(name = "residual", version, after_help = EXIT_CODES)]
pub struct Arguments {
    /// Directory of the instance's files.
    #[arg(long, global = true, value_name = "DIRECTORY", env = RUNTIME_DIRECTORY_VARIABLE,
          default_value = DEFAULT_RUNTIME_DIRECTORY)]
    pub runtime_directory: PathBuf,
    /// What to do.
    #[command(subcommand)]
    pub command: Command,
}

/// What to do.
#[derive(Debug, Subcommand)]
pub enum Command {
    /// Shows all diagnosers and inputs once.
    #[command(after_help = EXIT_CODES)]
    Status {
        /// Name of the instance; may be left out if there is only one.
        #[arg(long, value_name = "NAME")]
        instance: Option<InstanceName>,
        /// Writes JSON, with every channel. A number that is not one (NaN) is null; infinite numbers are the
        /// strings "inf" and "-inf".
        #[arg(long)]
        json: bool,
    },
    /// Controls the daemon; only for the user who runs it.
    #[command(after_help = EXIT_CODES)]
    Ctl(ControlArguments),
    /// Shows every channel between its bounds, again and again.
    ///
    /// On a terminal: a list of the diagnosers, and of each its channels with a live plot; the last line shows the
    /// keys, q ends it. Otherwise: one line for each new record and each change of an alarm; records that came and went
    /// between two looks are counted as missed.
    #[command(after_help = EXIT_CODES)]
    Watch {
        /// Name of the instance; may be left out if there is only one.
        #[arg(long, value_name = "NAME")]
        instance: Option<InstanceName>,
        /// What to watch.
        #[command(flatten)]
        options: WatchOptions,
    },
    /// Records every step record and alarm of the diagnosers, and if asked for the samples of the inputs, to an MCAP file.
    #[command(after_help = EXIT_CODES)]
    Record(RecordArguments),
    /// Draws the channels of a recording: residuals between their bounds, alarms and faults.
    #[command(after_help = EXIT_CODES)]
    Plot(PlotArguments),
    /// Hands records on to other programs: as CSV, or to Prometheus.
    #[command(after_help = EXIT_CODES)]
    Export {
        /// Where to.
        #[command(subcommand)]
        target: ExportTarget,
    },
    /// Shows the alarm transitions, each once and in order; what is lost is shown as a gap.
    #[command(after_help = EXIT_CODES)]
    Alarms(AlarmOptions),
    /// Writes shell completions or man pages.
    #[command(subcommand)]
    Generate(Generated),
}
