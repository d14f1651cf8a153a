//! The program `residuald`.

use clap::Parser;
use residuald::cli::CommandLine;
use std::process::ExitCode;

fn main() -> ExitCode {
    CommandLine::parse().execute()
}
