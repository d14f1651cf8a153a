//! `residual record`: everything that a daemon says, in an MCAP file.

use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};
use std::{fs, io};

use clap::Args;
use residual_client::InstanceName;
use residual_recording::Totals;
use residual_recording::recorder::{self, Stream};
use residual_recording::totals::End;
use time::OffsetDateTime;

use crate::error::Error;
use crate::until::{self, seconds};
use crate::{instances, new_file};

/// Exit code: the recording is whole, but something was lost on the way to it.
pub const LOST: u8 = 7;

/// What to record.
#[derive(Debug, Args)]
pub struct RecordArguments {
    /// Name of the instance; may be left out if there is only one.
    #[arg(long, value_name = "NAME")]
    instance: Option<InstanceName>,
    /// The file, which must not be there yet; default: INSTANCE-DATE.mcap in this directory. When the daemon reads
    /// its configuration again, or is started anew at once, the recording goes on in FILE.2.mcap, and so on.
    #[arg(long, short, value_name = "FILE.mcap")]
    output: Option<PathBuf>,
    /// Records the samples of all inputs as well, so that `residuald replay` can replay the recording. Its records
    /// come out again to the last bit if the recording began before the first sample.
    #[arg(long)]
    samples: bool,
    /// Ends after so many seconds; default: on SIGINT (Ctrl-C), SIGTERM or SIGHUP, or when the daemon ends.
    #[arg(long, value_name = "S", value_parser = seconds)]
    duration: Option<Duration>,
    /// Records this diagnoser only; may be given several times.
    #[arg(long = "diagnoser", value_name = "NAME")]
    diagnosers: Vec<String>,
    /// Names the daemon's configuration file, which must be there, in the recording.
    #[arg(long, value_name = "FILE.toml", value_parser = existing_file)]
    configuration: Option<PathBuf>,
}

/// Records until told to end; gives the exit code.
pub fn run(arguments: &RecordArguments, runtime_directory: &Path) -> Result<u8, Error> {
    let stop = until::stop_flag().map_err(Error::Signals)?;
    let instance = instances::choose(arguments.instance.as_ref(), runtime_directory)?;
    let mut stream = Stream::open(&instance, arguments.samples)?;
    let mut slots = stream.slots(&arguments.diagnosers)?;
    if let Some(path) = &arguments.configuration {
        stream.set_configuration(&std::path::absolute(path)?);
    }
    let path = arguments
        .output
        .clone()
        .unwrap_or_else(|| default_name(&instance.name).into());
    let begin = Instant::now();
    let mut is_complete = true;
    for number in 1.. {
        let path = numbered(&path, number);
        new_file::check(&path)?;
        eprintln!("recording to {}", path.display());
        let left = arguments
            .duration
            .map(|limit| limit.saturating_sub(begin.elapsed()));
        let totals = recorder::record(&mut stream, &path, &slots, left, &stop)?;
        report(&totals, &mut io::stdout().lock())?;
        is_complete &= totals.is_complete();
        if totals.end != Some(End::TableReplaced) {
            break;
        }
        stream = stream.next()?;
        slots = remaining(&stream, &arguments.diagnosers)?;
    }
    Ok(if is_complete { 0 } else { LOST })
}

/// The file for the recording with this number, of those that begin with `path`.
fn numbered(path: &Path, number: u32) -> PathBuf {
    match number {
        1 => path.to_owned(),
        _ => path.with_extension(format!("{number}.mcap")),
    }
}

/// The slots of those of the named diagnosers that there still are; says which are gone.
fn remaining(stream: &Stream, names: &[String]) -> Result<Vec<usize>, Error> {
    let mut there = Vec::new();
    for name in names {
        match stream.slots(std::slice::from_ref(name)) {
            Ok(_) => there.push(name.clone()),
            Err(error) => eprintln!("residual: {error}"),
        }
    }
    // Without any of them the error says so.
    let sought = if there.is_empty() { names } else { &there };
    Ok(stream.slots(sought)?)
}

fn report(totals: &Totals, out: &mut impl io::Write) -> io::Result<()> {
    for (topic, totals) in &totals.topics {
        write!(out, "{topic}: {} messages", totals.messages)?;
        match totals.missing {
            0 => writeln!(out)?,
            missing => writeln!(out, ", {missing} missing")?,
        }
    }
    match totals.end {
        Some(End::DaemonEnded) => writeln!(out, "the daemon has ended")?,
        Some(End::TableReplaced) => writeln!(
            out,
            "the daemon has read its configuration again or was started anew; the recording goes on in the next file"
        )?,
        Some(End::Asked) | None => {}
    }
    match (totals.lost_records, totals.lost_samples, totals.lost_alarms) {
        (0, 0, 0) => writeln!(out, "nothing was lost on the way from the daemon"),
        (records, samples, alarms) => writeln!(
            out,
            "LOST on the way from the daemon: {records} records, {samples} samples, {alarms} alarm transitions"
        ),
    }
}

fn existing_file(path: &str) -> Result<PathBuf, String> {
    match fs::metadata(path) {
        Ok(found) if found.is_file() => Ok(path.into()),
        Ok(_) => Err("it is no file".into()),
        Err(error) => Err(error.to_string()),
    }
}

fn default_name(instance: &InstanceName) -> String {
    let now = OffsetDateTime::now_utc();
    let (year, month, day) = now.to_calendar_date();
    let (hour, minute, second) = now.to_hms();
    let month = u8::from(month);
    format!("{instance}-{year:04}{month:02}{day:02}T{hour:02}{minute:02}{second:02}Z.mcap")
}
