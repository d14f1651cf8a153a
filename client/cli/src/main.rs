//! `residual`: what the diagnosers of a residuald daemon say, on the command line.

mod alarms;
mod arguments;
mod completeness;
mod ctl;
mod entry;
mod error;
mod export;
mod generate;
mod instances;
mod new_file;
mod number;
mod plot;
mod record;
mod snapshot;
mod status;
mod until;
mod watch;

use std::process::ExitCode;

use arguments::{Arguments, Command};
use clap::Parser;
use error::Error;
use residual_client::Monitor;

fn main() -> ExitCode {
    let arguments = Arguments::parse();
    match run(&arguments) {
        Ok(code) => ExitCode::from(code),
        // The reader of a pipe has seen enough: `residual watch | head`.
        Err(Error::Output(error)) if error.kind() == std::io::ErrorKind::BrokenPipe => ExitCode::SUCCESS,
        Err(error) => {
            let hint = if error.is_missing_instance() {
                instances::hint(&arguments.runtime_directory)
            } else {
                String::new()
            };
            eprintln!("residual: {error}{hint}");
            ExitCode::from(error.exit_code())
        }
    }
}

fn run(arguments: &Arguments) -> Result<u8, Error> {
    let choose = |name: &Option<_>| instances::choose(name.as_ref(), &arguments.runtime_directory);
    let open = |name: &Option<_>| -> Result<Monitor, Error> { Ok(Monitor::open(&choose(name)?)?) };
    match &arguments.command {
        Command::Status { instance, json } => status::run(&mut open(instance)?, *json),
        Command::Plot(options) => plot::run(options),
        Command::Export { target } => export::run(target, &arguments.runtime_directory),
        Command::Record(options) => record::run(options, &arguments.runtime_directory),
        Command::Ctl(control) => ctl::run(control, &arguments.runtime_directory),
        Command::Watch { instance, options } => watch::run(&choose(instance)?, options),
        Command::Alarms(options) => alarms::run(&choose(&options.instance)?, options),
        Command::Generate(generated) => generate::run(generated, &mut std::io::stdout().lock()),
    }
}
