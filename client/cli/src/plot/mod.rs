//! `residual plot`: the channels of a recording as pictures.

mod history;

use std::fs;
use std::io::Write as _;
use std::path::{Path, PathBuf};

use clap::Args;
use residual_chart::Chart;
use residual_recording::Reader;

use crate::completeness;
use crate::error::Error;
use crate::new_file;
use history::History;

/// What to draw, and where to.
#[derive(Debug, Args)]
pub struct PlotArguments {
    /// The recording.
    #[arg(value_name = "FILE.mcap")]
    recording: PathBuf,
    /// Draws the channels of this diagnoser only; may be given several times.
    #[arg(long = "diagnoser", value_name = "NAME")]
    diagnosers: Vec<String>,
    /// Draws the channels of this name only; may be given several times.
    #[arg(long = "channel", value_name = "NAME")]
    channels: Vec<String>,
    /// A directory for one file a channel, DIAGNOSER.CHANNEL.svg; or, for a single channel, a file that ends with .svg
    /// or .png. A new directory with a dot in its name must end with `/`. No file may be there yet. Default: the recording's name with the extension `plots`.
    #[arg(long, short, value_name = "DIRECTORY|FILE")]
    output: Option<PathBuf>,
    /// Draws PNG files instead of SVG files.
    #[arg(long)]
    png: bool,
}

/// Draws; prints the names of the files.
pub fn run(arguments: &PlotArguments) -> Result<u8, Error> {
    let output = arguments.output();
    let form = Form::of(&output, arguments)?;
    let mut reader = Reader::open(&arguments.recording)?;
    check_names(arguments, &reader)?;
    let histories = History::read(&mut reader, &arguments.diagnosers)?;
    completeness::tell(&reader);
    let mut charts = Vec::new();
    for history in &histories {
        charts.extend(history.charts(&arguments.channels));
    }
    match (form, charts.as_slice()) {
        (_, []) => Err(Error::Selection(
            "nothing to draw: no chosen channel was evaluated at two instants".into(),
        )),
        (Form::File { png }, [(_, chart)]) => {
            write(&output, chart, png)?;
            Ok(0)
        }
        (Form::File { .. }, several) => Err(Error::Selection(format!(
            "{} channels do not fit into one file; choose one with --diagnoser and --channel, or give a directory",
            several.len()
        ))),
        (Form::Directory, charts) => {
            fs::create_dir_all(&output).map_err(|source| Error::File {
                path: output.clone(),
                source,
            })?;
            let extension = if arguments.png { "png" } else { "svg" };
            let path = |name: &str| output.join(format!("{name}.{extension}"));
            for (name, _) in charts {
                new_file::refuse_existing(&path(name))?;
            }
            for (name, chart) in charts {
                write(&path(name), chart, arguments.png)?;
            }
            Ok(0)
        }
    }
}

impl PlotArguments {
    fn output(&self) -> PathBuf {
        let default = || self.recording.with_extension("plots");
        self.output.clone().unwrap_or_else(default)
    }
}

/// What is written.
enum Form {
    Directory,
    File { png: bool },
}

impl Form {
    /// What the name of the output says.
    fn of(output: &Path, arguments: &PlotArguments) -> Result<Self, Error> {
        let is_directory = output.as_os_str().as_encoded_bytes().ends_with(b"/") || output.is_dir();
        match output.extension().map(|extension| extension.to_string_lossy()) {
            _ if is_directory || arguments.output.is_none() => Ok(Self::Directory),
            None => Ok(Self::Directory),
            Some(extension) if extension == "png" => Ok(Self::File { png: true }),
            Some(extension) if extension == "svg" && !arguments.png => Ok(Self::File { png: false }),
            Some(extension) if extension == "svg" => Err(Error::Selection(format!(
                "`{}` ends with .svg, but --png asks for PNG; leave one of them out",
                output.display()
            ))),
            Some(extension) => Err(Error::Selection(format!(
                "pictures are SVG or PNG files: `{}` ends with .{extension}; end it with .svg or .png, or with / for a \
                 directory",
                output.display()
            ))),
        }
    }
}

fn write(path: &Path, chart: &Chart, png: bool) -> Result<(), Error> {
    let bytes = if png {
        chart.png()?
    } else {
        chart.svg()?.into_bytes()
    };
    new_file::create(path)?
        .write_all(&bytes)
        .map_err(|source| Error::File {
            path: path.into(),
            source,
        })?;
    println!("{}", path.display());
    Ok(())
}

fn check_names(arguments: &PlotArguments, reader: &Reader) -> Result<(), Error> {
    let diagnosers = &reader.header().diagnosers;
    let known: Vec<&str> = diagnosers
        .iter()
        .map(|diagnoser| diagnoser.name.as_str())
        .collect();
    refuse_unknown("diagnoser", &arguments.diagnosers, &known)?;
    let channels = diagnosers.iter().flat_map(|diagnoser| &diagnoser.channels);
    let known: Vec<&str> = channels.map(|channel| channel.name.as_str()).collect();
    refuse_unknown("channel", &arguments.channels, &known)
}

/// Refuses a name that is not among the known ones.
pub fn refuse_unknown(kind: &str, names: &[String], known: &[&str]) -> Result<(), Error> {
    match names.iter().find(|name| !known.contains(&name.as_str())) {
        Some(name) => Err(Error::Selection(format!(
            "the recording has no {kind} `{name}`; it has {}",
            known.join(", ")
        ))),
        None => Ok(()),
    }
}
