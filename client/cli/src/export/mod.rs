//! `residual export`: records for other programs.

mod csv;
mod prometheus;

use std::path::Path;

use clap::Subcommand;

use crate::error::Error;

/// Where records go.
#[derive(Debug, Subcommand)]
pub enum ExportTarget {
    /// Writes one line a record, with the columns that `residuald replay --records` writes as well.
    Csv(csv::CsvArguments),
    /// Answers Prometheus on a loopback port, until SIGINT (Ctrl-C), SIGTERM or SIGHUP.
    Prometheus(prometheus::PrometheusArguments),
}

/// Exports; gives the exit code.
pub fn run(target: &ExportTarget, runtime_directory: &Path) -> Result<u8, Error> {
    match target {
        ExportTarget::Csv(arguments) => csv::run(arguments, runtime_directory),
        ExportTarget::Prometheus(arguments) => prometheus::run(arguments, runtime_directory),
    }
}
