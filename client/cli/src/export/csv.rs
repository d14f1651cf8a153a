//! `residual export csv`.

use std::io::{self, Write};
use std::path::{Path, PathBuf};
use std::time::Duration;

use clap::Args;
use csv::Writer;
use residual_client::InstanceName;
use residual_recording::recorder::{self, Received, Stream};
use residual_recording::totals::End;
use residual_recording::{Event, Header, Reader, RecordMessage, columns};

use crate::completeness;
use crate::error::Error;
use crate::plot::refuse_unknown;
use crate::record::LOST;
use crate::until::{self, seconds};
use crate::{instances, new_file};

/// What stands for a running daemon in the place of a recording.
const LIVE: &str = "live";

/// Exit code: with `live`, what was exported is whole, but the daemon has gone on with another table.
const REPLACED: u8 = 8;

/// What to export.
#[derive(Debug, Args)]
pub struct CsvArguments {
    /// The recording, or the word `live` for a running daemon.
    #[arg(value_name = "FILE.mcap|live")]
    source: PathBuf,
    /// Exports the records of this diagnoser only; may be given several times.
    #[arg(long = "diagnoser", value_name = "NAME")]
    diagnosers: Vec<String>,
    /// The file, which must not be there yet; of several diagnosers each gets its own, FILE.DIAGNOSER.csv. Default:
    /// standard output, for a single diagnoser.
    #[arg(long, short, value_name = "FILE.csv")]
    output: Option<PathBuf>,
    /// With `live`: name of the instance; may be left out if there is only one.
    #[arg(long, value_name = "NAME")]
    instance: Option<InstanceName>,
    /// With `live`: ends after so many seconds; default: on SIGINT (Ctrl-C), SIGTERM or SIGHUP, or with the daemon;
    /// also when it reads its configuration again or is started anew (exit code 8).
    #[arg(long, value_name = "S", value_parser = seconds)]
    duration: Option<Duration>,
}

/// Exports; gives the exit code.
pub fn run(arguments: &CsvArguments, runtime_directory: &Path) -> Result<u8, Error> {
    if arguments.source.as_os_str() == LIVE {
        return live(arguments, runtime_directory);
    }
    if arguments.instance.is_some() || arguments.duration.is_some() {
        return Err(Error::Selection(
            "--instance and --duration are for `live` alone; a recording is exported from beginning to end"
                .into(),
        ));
    }
    let mut reader = Reader::open(&arguments.source)?;
    let mut lines = Lines::begin(arguments, reader.header())?;
    while let Some(event) = reader.next_event()? {
        if let Event::Record(message) = event {
            lines.write(&message)?;
        }
    }
    lines.flush()?;
    completeness::tell(&reader);
    Ok(0)
}

fn live(arguments: &CsvArguments, runtime_directory: &Path) -> Result<u8, Error> {
    let stop = until::stop_flag().map_err(Error::Signals)?;
    let instance = instances::choose(arguments.instance.as_ref(), runtime_directory)?;
    let mut stream = Stream::open(&instance, false)?;
    let mut lines = Lines::begin(arguments, stream.header())?;
    let mut failed = None;
    let end = recorder::look(&mut stream, arguments.duration, &stop, |batch| {
        let mut records = batch.iter().filter_map(|received| match received {
            Received::Record { message, .. } => Some(message),
            _ => None,
        });
        let written = records
            .try_for_each(|message| lines.write(message))
            .and_then(|()| lines.flush());
        failed = written.err();
        failed.is_none()
    });
    if let Some(error) = failed {
        return Err(error);
    }
    if end == End::TableReplaced {
        eprintln!(
            "residual: the daemon has read its configuration again or was started anew: its diagnosers may be \
             others; export again"
        );
    }
    match stream.lost_records() {
        0 if end == End::TableReplaced => Ok(REPLACED),
        0 => Ok(0),
        lost => {
            eprintln!("residual: LOST on the way from the daemon: {lost} records");
            Ok(LOST)
        }
    }
}

/// One file a diagnoser.
struct Lines {
    instance: String,
    /// By slot, of the diagnosers that are exported.
    files: Vec<Option<Lined>>,
}

/// The file of one diagnoser.
struct Lined {
    file: Writer<Box<dyn Write>>,
    faults: Vec<String>,
}

impl Lines {
    fn begin(arguments: &CsvArguments, header: &Header) -> Result<Self, Error> {
        let names: Vec<&str> = header
            .diagnosers
            .iter()
            .map(|diagnoser| diagnoser.name.as_str())
            .collect();
        refuse_unknown("diagnoser", &arguments.diagnosers, &names)?;
        let wanted = |name: &String| arguments.diagnosers.is_empty() || arguments.diagnosers.contains(name);
        let count = header
            .diagnosers
            .iter()
            .filter(|diagnoser| wanted(&diagnoser.name))
            .count();
        let own = |path: &Path, name: &str| match count {
            1 => path.to_owned(),
            _ => path.with_extension(format!("{name}.csv")),
        };
        if let Some(path) = &arguments.output {
            for diagnoser in header
                .diagnosers
                .iter()
                .filter(|diagnoser| wanted(&diagnoser.name))
            {
                new_file::refuse_existing(&own(path, &diagnoser.name))?;
            }
        }
        let mut files = Vec::new();
        for diagnoser in &header.diagnosers {
            if !wanted(&diagnoser.name) {
                files.push(None);
                continue;
            }
            let into: Box<dyn Write> = match &arguments.output {
                Some(path) => Box::new(new_file::create(&own(path, &diagnoser.name))?),
                None if count == 1 => Box::new(io::stdout()),
                None => {
                    return Err(Error::Selection(format!(
                        "standard output takes the records of one diagnoser; choose one of {} with --diagnoser, or \
                         give --output",
                        names.join(", ")
                    )));
                }
            };
            let mut file = Writer::from_writer(into);
            let channels = diagnoser.channels.iter().map(|channel| channel.name.as_str());
            file.write_record(columns::names(channels))
                .map_err(output_error)?;
            files.push(Some(Lined {
                file,
                faults: diagnoser.faults.clone(),
            }));
        }
        Ok(Self {
            instance: header.instance.clone(),
            files,
        })
    }

    fn write(&mut self, message: &RecordMessage) -> Result<(), Error> {
        let Some(Some(Lined { file, faults })) = self.files.get_mut(message.slot) else {
            return Ok(());
        };
        let cells = columns::cells(&self.instance, &message.record, faults);
        file.write_record(cells).map_err(output_error)
    }

    fn flush(&mut self) -> Result<(), Error> {
        for lined in self.files.iter_mut().flatten() {
            lined.file.flush()?;
        }
        Ok(())
    }
}

/// The system's error stays as it is, so that a pipe whose reader has seen enough is known as one.
fn output_error(error: csv::Error) -> Error {
    Error::Output(match error.into_kind() {
        csv::ErrorKind::Io(source) => source,
        other => io::Error::other(format!("{other:?}")),
    })
}
